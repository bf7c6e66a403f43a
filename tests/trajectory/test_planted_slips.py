"""A slip of the unit of all values of a kind has one warning, of its cause, with the unit that was meant."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from samples.slips.of_fingers import FINGER, FLEXION, PLANTED, Planted

from vsacli import load_robot, load_trajectory


@pytest.mark.parametrize("planted", PLANTED, ids=lambda planted: planted.what)
def test_the_cause_is_named_once_with_its_unit(planted: Planted, tmp_path: Path) -> None:
    arm, motion = tmp_path / "finger.yaml", tmp_path / "flexion.yaml"
    arm.write_text(planted.of(FINGER))
    motion.write_text(planted.of(FLEXION))
    robot = load_robot(arm)
    warnings = [*robot.located_warnings, *load_trajectory(motion, robot).located_warnings]
    assert len(warnings) == len(planted.warnings), warnings
    for warning, (field, unit) in zip(warnings, planted.warnings, strict=True):
        assert re.match(rf"\S*{re.escape(field)} ", warning.message), warning
        assert unit in warning.message
        line = Path(warning.file).read_text().splitlines()[warning.line - 1]
        assert (
            f"{field.removesuffix(' (x)').removesuffix('.0').rpartition('.')[2]}:" in line or "type" in line
        )


def test_all_values_of_the_same_unit_are_listed_with_their_lines(tmp_path: Path) -> None:
    (slip,) = (planted for planted in PLANTED if planted.what == "centers of mass in mm")
    arm = tmp_path / "finger.yaml"
    arm.write_text(slip.of(FINGER))
    (warning,) = load_robot(arm).warnings
    assert warning.endswith(
        "? Also joints.middle.link.com.0 (x) (line 19), joints.tip.link.com.0 (x) (line 29)"
    )


@pytest.mark.parametrize(
    ("lengths", "masses", "unit"),
    [
        ("45,28,22", "0.018,0.01,0.007", "45 mm"),
        ("4.5,2.8,2.2", "0.018,0.01,0.007", "4.5 cm"),
        ("0.045,0.028,0.022", "18,10,7", "18 g"),
        ("0.045,0.028,0.022", "0.018,0.01,0.007", ""),
    ],
)
def test_a_new_robot_is_written_with_a_warning_of_its_cause(lengths, masses, unit, vsacli) -> None:
    new = ("new", "robot", "--joints", "RRR", "--length", lengths, "--mass", masses, "-o", "finger.yaml")
    done = vsacli(*new)
    assert done.code == 0
    assert done.err.count("warning: finger.yaml:") == bool(unit)
    assert not unit or f"did you mean {unit}, which is" in done.err
