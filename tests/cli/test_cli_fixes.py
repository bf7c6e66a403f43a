"""`vsacli check-feasibility` with --fixes, --write-fix and --min-margin."""

from __future__ import annotations

import json
import re

import pytest
from samples.command_line import ROBOT, contents, edited, without_hint

from vsacli.base.flags import MIN_MARGIN
from vsacli.cli.check_feasibility import check_feasibility

WRITE = ("--write-fix", 1, "-o", "fixed.yaml")


@pytest.mark.slow
def test_fixes_follow_the_report(vsacli, too_soft):
    plain = vsacli("check-feasibility", ROBOT, too_soft)
    done = vsacli("check-feasibility", ROBOT, too_soft, "--fixes")
    assert (done.code, done.err) == (3, "")
    report = without_hint(plain.out)
    assert done.out.startswith(report)
    blank, *causes, heading, profile, gentle, offset, rough, springs = done.out[len(report) :].splitlines()
    assert blank == ""
    assert (
        heading
        == "fixes; with any of them every sample has a margin of at least 1 % and is within all limits:"
    )
    assert [cause.partition(":")[0] for cause in causes] == ["base", "shoulder", "elbow"]
    assert causes[0].startswith(
        "base: stiffness is 790 N m/rad at t = 4.000 s, even at rest, below the 808.1 N m/rad needed for a "
        "margin of 1 % (minimum 800): no slower motion helps, an increase of 18.0"
    )
    assert offset.startswith("2. raise the stiffness of base by 18.0")
    assert profile.startswith("1. reshape the stiffness of base by up to +18.")
    torques = re.compile(
        r"   peak motor torque [\d.]+ N m \(shoulder\), initial torque discontinuity [\d.]+ N m \(\w+\)"
    )
    assert all(map(torques.fullmatch, (gentle, rough)))
    assert springs.startswith("to keep the commanded stiffness, change the springs: vsacli sensitivity ")


@pytest.mark.slow
def test_json_has_them_under_one_key(vsacli, too_soft):
    plain = json.loads(vsacli("check-feasibility", ROBOT, too_soft, "--json").out)
    report = json.loads(vsacli("check-feasibility", ROBOT, too_soft, "--json", "--fixes").out)
    found = report.pop("fixes")
    assert report == plain
    assert found["min_margin"] == MIN_MARGIN
    assert found["slow_down"]["possible"] is False
    offsets = found["stiffness_offset"]["offsets"]
    assert offsets.keys() == {"base", "shoulder", "elbow"}
    # the base carries nothing at the end, where 2K/(1-m) is needed: 800/0.99 - 790, up to the grid of 0.01
    assert 800 / 0.99 - 790 <= offsets["base"] <= 800 / 0.99 - 790 + 0.02
    changes = found["stiffness_profile"]["changes"]
    assert changes.keys() == offsets.keys()
    assert changes["base"]["largest"] == pytest.approx(offsets["base"], abs=0.05)


@pytest.mark.slow
def test_slow_down_with_its_durations(vsacli, tmp_path, motion):
    fast = edited(
        motion, tmp_path / "fast.yaml", ("duration: 4.0", "duration: 0.4"), ("rate: 100 ", "rate: 1000 ")
    )
    report = json.loads(vsacli("check-feasibility", ROBOT, fast, "--json", "--fixes").out)
    found = report["fixes"]["slow_down"]
    assert found["duration"] == pytest.approx(0.4 * found["factor"])
    factor = f"slow down by a factor {found['factor']:.4g}"
    assert found["text"] == f"{factor} (0.4 s -> {found['duration']:.10g} s)"
    slower = edited(fast, tmp_path / "slower.yaml", ("duration: 0.4", f"duration: {found['duration']}"))
    again = vsacli("check-feasibility", ROBOT, slower, "--fixes")
    assert again.code == 0
    assert again.out.endswith(
        "nothing to change: every sample has a margin of at least 1 % and is within all limits\n"
    )


def test_nothing_needs_to_change(vsacli, motion):
    report = json.loads(vsacli("check-feasibility", ROBOT, motion, "--json", "--fixes").out)
    assert report["fixes"] == {
        "min_margin": 0.01,
        "slow_down": None,
        "stiffness_offset": None,
        "stiffness_profile": None,
        "transition": None,
        "causes": [],
        "fixes": [],
    }


@pytest.mark.slow
def test_fixed_trajectory_runs_clean(vsacli, tmp_path, too_soft):
    done = vsacli("check-feasibility", ROBOT, too_soft, *WRITE)
    assert (done.code, done.err) == (
        0,
        "fix 1 goes to fixed.yaml\nwrote fixed.yaml\nwrote fixed.csv\n",
    )
    assert "fixes; with any of them" in done.out
    assert contents(tmp_path).keys() == {"soft.yaml", "fixed.yaml", "fixed.csv"}
    run = vsacli("invdyn", ROBOT, "fixed.yaml")
    assert run.code == 0
    assert "near-singular" not in run.out


@pytest.mark.slow
def test_recorded_trajectory_is_fixed(vsacli, too_soft):
    vsacli("invdyn", ROBOT, too_soft, "-o", "soft.h5")
    vsacli(
        "export",
        "soft.h5",
        "--variables",
        "q,dq,ddq,d3q,d4q,stiffness,dstiffness,ddstiffness",
        "-o",
        "soft.csv",
    )
    assert vsacli("check-feasibility", ROBOT, "soft.csv", *WRITE).code == 0
    assert vsacli("check-feasibility", ROBOT, "fixed.yaml").code == 0


def test_nothing_is_written_if_nothing_needs_to_change(vsacli, tmp_path, motion):
    done = vsacli("check-feasibility", ROBOT, motion, *WRITE)
    assert (done.code, done.err) == (0, "fixed.yaml is not written: nothing needs to change\n")
    assert contents(tmp_path).keys() == {"move.yaml"}


@pytest.mark.slow
def test_nothing_is_written_if_nothing_helps(vsacli, tmp_path, too_soft):
    robot = edited(
        ROBOT,
        tmp_path / "robot.yaml",
        ("motor: {inertia:", "motor: {max_torque: 1, inertia:"),
    )
    edited(too_soft, too_soft, ("rate: 100 ", "rate: 20 "))
    done = vsacli("check-feasibility", robot, too_soft, *WRITE)
    assert (done.code, done.err) == (3, "fixed.yaml is not written: nothing that was tried fixes the task\n")
    assert contents(tmp_path).keys() == {"robot.yaml", "soft.yaml"}


@pytest.mark.slow
def test_another_fix_is_written_by_its_number(vsacli, tmp_path, too_soft):
    done = vsacli("check-feasibility", ROBOT, too_soft, "--write-fix", 2, "-o", "fixed.yaml")
    assert (done.code, done.err) == (0, "fix 2 goes to fixed.yaml\nwrote fixed.yaml\n")
    assert "INFEASIBLE" not in done.out  # the report was read before
    assert re.search(r"^fixes; with any of them [^:]*:\n1\. .*\n   peak .*\n2\. ", done.out, re.MULTILINE)
    assert contents(tmp_path).keys() == {"soft.yaml", "fixed.yaml"}
    again = vsacli("check-feasibility", ROBOT, "fixed.yaml")
    assert again.code == 0
    assert "motors move" not in again.out


@pytest.mark.slow
def test_number_of_no_fix(vsacli, tmp_path, too_soft):
    done = vsacli("check-feasibility", ROBOT, too_soft, "--write-fix", 9, "-o", "fixed.yaml")
    assert (done.code, done.err) == (
        3,
        "fixed.yaml is not written: there are 2 fixes, no fix 9; give --write-fix 1 or 2\n",
    )
    assert contents(tmp_path).keys() == {"soft.yaml"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--write-fix", 2), "--write-fix 2 needs -o FILE, the trajectory file to write"),
        (("-o", "f.yaml"), "-o FILE needs --write-fix N, the number of a fix as --fixes lists it"),
        (("--fixes", "--output", "f.yaml"), "-o FILE needs --write-fix N"),
    ],
)
def test_number_of_a_fix_and_its_file_need_each_other(vsacli, tmp_path, too_soft, options, message):
    done = vsacli("check-feasibility", ROBOT, too_soft, *options)
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert contents(tmp_path).keys() == {"soft.yaml"}


@pytest.mark.slow
def test_files_that_exist_are_kept(vsacli, tmp_path, too_soft):
    (tmp_path / "fixed.csv").write_text("mine")
    done = vsacli("check-feasibility", ROBOT, too_soft, *WRITE)
    assert (done.code, done.out) == (4, "")
    assert done.err.startswith("fixed.csv: exists already")
    assert vsacli("check-feasibility", ROBOT, too_soft, *WRITE, "--overwrite").code == 0
    assert (tmp_path / "fixed.csv").read_text().startswith("time,base.stiffness,")


def test_inputs_are_never_overwritten(vsacli, too_soft):
    before = too_soft.read_text()
    done = vsacli("check-feasibility", ROBOT, too_soft, "--write-fix", 1, "-o", too_soft, "--overwrite")
    assert done.code == 2
    assert "soft.yaml: is an input" in done.err
    assert too_soft.read_text() == before


@pytest.mark.parametrize("margin", ["0", "-0.1", "1e-09", "1", "2", "nan"])
def test_margins_out_of_range_are_refused(vsacli, motion, margin):
    done = vsacli("check-feasibility", ROBOT, motion, "--min-margin", margin)
    assert (done.code, done.out) == (2, "")
    if 0 <= float(margin) <= 1:
        reason = f"--min-margin: the minimum margin must lie between 1e-09 and 1, e.g. 0.01, not {margin}"
    else:
        reason = f"'--min-margin': '{margin}': expected a share from 0 % to 100 %, e.g. 2% or 0.02"
    assert done.err.endswith(f"{reason}\n")


def test_margin_decides_which_steps_are_near_singular(vsacli, motion):
    def near_singular(*options):
        report = json.loads(vsacli("check-feasibility", ROBOT, motion, "--json", *options).out)
        return sum(joint["samples"]["near_singular"] for joint in report["joints"]), report["verdict"]

    assert near_singular() == near_singular("--min-margin", "0.01") == (0, "ok")
    steps, verdict = near_singular("--min-margin", "0.1")
    assert steps > 0
    assert verdict == "ok"


@pytest.mark.slow
def test_fixes_keep_the_margin_that_is_asked_for(vsacli, motion):
    done = vsacli("check-feasibility", ROBOT, motion, "--min-margin", "0.1", *WRITE)
    assert "a margin of at least 10 %" in done.out
    again = vsacli("check-feasibility", ROBOT, "fixed.yaml", "--min-margin", "0.1", "--fixes")
    assert (again.code, again.out.splitlines()[-1]) == (
        0,
        "nothing to change: every sample has a margin of at least 10 % and is within all limits",
    )


def test_help_names_the_default_margin():
    (option,) = [each for each in check_feasibility.params if each.name == "min_margin"]
    assert option.show_default == f"{100 * MIN_MARGIN:g}%"
