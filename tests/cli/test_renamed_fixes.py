"""Old names of verdicts, fixes and branches are refused, and the error names the new ones."""

from __future__ import annotations

import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, edited

import vsacli as package
from vsacli.analysis import report
from vsacli.base.renamed import RENAMINGS
from vsacli.cli.console import COLORS, EXIT_OF_VERDICT
from vsacli.control.simulation import simulation_report
from vsacli.results.pages.document import FAIR
from vsacli.studies import search
from vsacli.studies.identification import identification_report


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (("--suggest",), "--suggest is now --fixes"),
        (("--remedy", 2), "--remedy is now --write-fix"),
        (("--write-fixed", "fixed.yaml"), "--write-fixed is now"),
    ],
)
def test_old_options(vsacli, own_folder, old, new):
    outcome = vsacli("check-feasibility", ROBOT, REST_TO_REST, *old)
    assert (outcome.code, outcome.out) == (2, "")
    assert new in outcome.err
    assert not list(own_folder.iterdir())


@pytest.mark.parametrize(
    ("robot", "type_"), [("vsa_3r", "type: antagonistic"), ("shifted_cams_1r", "type: shifted_cams")]
)
def test_an_old_key_of_a_robot(vsacli, tmp_path, robot, type_):
    source = REPOSITORY / "robots" / f"{robot}.yaml"
    indent = " " * (8 if robot == "shifted_cams_1r" else 6)
    old = edited(source, tmp_path / "old.yaml", (type_, f"preload: positive\n{indent}{type_}"))
    outcome = vsacli("validate", old)
    assert outcome.code == 2
    assert "unknown key 'preload'; it is now 'branch'" in outcome.out
    assert vsacli("validate", edited(old, tmp_path / "new.yaml", ("preload:", "branch:"))).code == 0


def test_old_paths(vsacli):
    robot = vsacli("info", ROBOT, "--field", "joints.0.actuator.preload")
    assert (robot.code, robot.err) == (
        2,
        "--field: joints.0.actuator has no 'preload'; it is now 'branch'\n",
    )
    change = ("--set", "joints.elbow.actuator.preload=negative")
    outcome = vsacli("check-feasibility", ROBOT, REST_TO_REST, *change)
    assert outcome.code == 2
    assert "has no 'preload'; it is now 'branch'" in outcome.err


def test_an_old_key_of_a_report(vsacli):
    assert vsacli("invdyn", ROBOT, REST_TO_REST, "-o", "r.h5").code == 0
    outcome = vsacli("info", "r.h5", "--field", "report.joints.0.other_preload")
    assert outcome.code == 2
    assert "has no 'other_preload'; it is now 'other_branch'" in outcome.err
    assert vsacli("info", "r.h5", "--field", "report.joints.0.other_branch").out == "false\n"


def test_old_python_names():
    with pytest.raises(AttributeError, match="module 'vsacli' has no attribute 'suggest'; it is now 'fixes'"):
        _ = package.suggest
    for old, new in (("Suggestions", "Fixes"), ("Remedy", "Fix")):
        with pytest.raises(AttributeError, match=f"has no attribute '{old}'; it is now '{new}'"):
            getattr(search, old)


def test_no_verdict_has_an_old_name():
    renamed = {each.old: each.new for each in RENAMINGS if each.kind == "verdict"}
    assert renamed.keys() == {"doubtful", "strayed", "untold", "misfit"}
    judged = {
        *report.VERDICTS,
        *simulation_report.VERDICTS,
        *(identification_report.UNIDENTIFIABLE, identification_report.POOR_FIT),
    }
    assert set(renamed.values()) <= judged
    assert not renamed.keys() & {*judged, *COLORS, *EXIT_OF_VERDICT, *FAIR}
