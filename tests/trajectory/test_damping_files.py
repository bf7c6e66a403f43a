"""Damping in files: dampers of robots, commands of trajectories, what is refused and where."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from samples.command_line import REPOSITORY, edited

from vsacli.cli.console import Exit

MOTION = (REPOSITORY / "trajectories" / "rest_to_rest.yaml").read_text().replace("rate: 1000", "rate: 100")
LINES = len(MOTION.splitlines())


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    damper = "    damper: {location: link, range: [1, 5]}\n    actuator:"
    path = tmp_path / "damped.yaml"
    path.write_text((REPOSITORY / "robots" / "vsa_3r.yaml").read_text().replace("    actuator:", damper, 2))
    return path


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        (("[1, 5]", "[-1, 5]"), "range: must be [lower, upper] with 0 <= lower, such as [0, 5]"),
        (
            ("[1, 5]", "-5"),
            "range: the lower limit 0 N m s/rad exceeds the upper limit -5 N m s/rad; swap them",
        ),
        (
            ("[1, 5]", "[6, 5]"),
            "range: the lower limit 6 N m s/rad exceeds the upper limit 5 N m s/rad; swap them",
        ),
        (("location: link", "location: tip"), "location: unknown word 'tip'; valid: link"),
    ],
)
def test_dampers_that_cannot_be(
    robot: Path, replaced: tuple[str, str], message: str, vsacli: Callable[..., Any]
) -> None:
    robot.write_text(robot.read_text().replace(*replaced, 1))
    done = vsacli("validate", robot)
    assert done.code == Exit.USAGE
    assert message in done.out + done.err


def test_a_rigid_joint_has_no_damper(tmp_path: Path, vsacli: Callable[..., Any]) -> None:
    path = tmp_path / "rigid.yaml"
    damper = "    damper: {location: link, range: [1, 5]}\n    actuator:"
    edited(REPOSITORY / "robots" / "mixed_3r.yaml", path, ("    actuator:", damper))
    done = vsacli("validate", path)
    assert done.code == Exit.USAGE
    assert "damper: a joint with a rigid actuator has no springs to calm; leave it out" in done.out + done.err


@pytest.mark.parametrize(
    ("damping", "message"),
    [
        (
            "{type: constant, value: {base: 2, shoulder: 2, elbow: 2}}",
            f"m.yaml:{LINES + 1}: value: expected no value for elbow, found '2': it has no damper",
        ),
        ("{type: constant, value: [2, 2, 2]}", "it has no damper"),
        ("{type: constant, value: {base: 2}}", "value: no value for shoulder; each joint needs one"),
        (
            "{type: polynomial, degree: 4, start: 1, end: 2}",
            "degree: must be odd, from 3 to 15 (its rate must vanish at both ends), not 4",
        ),
    ],
)
def test_commands_that_cannot_be(
    robot: Path, damping: str, message: str, tmp_path: Path, vsacli: Callable[..., Any]
) -> None:
    (tmp_path / "m.yaml").write_text(f"{MOTION}damping: {damping}\n")
    done = vsacli("invdyn", robot, "m.yaml")
    assert done.code == Exit.USAGE
    assert message in done.err


def test_a_robot_without_dampers_takes_no_damping(tmp_path: Path, vsacli: Callable[..., Any]) -> None:
    (tmp_path / "m.yaml").write_text(MOTION + "damping: {type: constant, value: 2}\n")
    done = vsacli("invdyn", REPOSITORY / "robots" / "vsa_3r.yaml", "m.yaml")
    assert done.code == Exit.USAGE
    assert done.err == f"m.yaml:{LINES + 1}: damping: no joint of the robot has a damper; leave it out\n"


@pytest.mark.slow
def test_a_table_may_have_it(robot: Path, tmp_path: Path, vsacli: Callable[..., Any]) -> None:
    (tmp_path / "m.yaml").write_text(MOTION + "damping: {type: polynomial, degree: 3, start: 2, end: 4}\n")
    names = "q,dq,ddq,d3q,d4q,stiffness,dstiffness,ddstiffness"
    assert vsacli("invdyn", robot, "m.yaml", "-o", "r.h5").code == Exit.OK
    for variables, damping in ((names, 1.0), (f"{names},damping,ddamping,dddamping", None)):
        assert (
            vsacli("export", "r.h5", "--variables", variables, "-o", "t.csv", "--overwrite").code == Exit.OK
        )
        done = vsacli("invdyn", robot, "t.csv", "-o", "again.h5", "--overwrite")
        assert done.code == Exit.OK
        assert ("dampers stand at the least" in done.out) == (damping is not None)
        with h5py.File(tmp_path / "r.h5") as file, h5py.File(tmp_path / "again.h5") as again:
            wanted = file["damping"][:, :2] if damping is None else np.ones((401, 2))
            np.testing.assert_allclose(again["damping"][:, :2], wanted, rtol=1e-15)
            assert np.isnan(again["damping"][:, 2]).all()


def test_columns_of_joints_without_damper_are_passed_over(
    tmp_path: Path, robot: Path, vsacli: Callable[..., Any]
) -> None:
    (tmp_path / "m.yaml").write_text(MOTION + "damping: {type: constant, value: 2}\n")
    assert vsacli("invdyn", robot, "m.yaml", "-o", "r.h5").code == Exit.OK
    assert vsacli("export", "r.h5", "--variables", "q,stiffness,damping", "-o", "t.csv").code == Exit.OK
    done = vsacli("check-feasibility", REPOSITORY / "robots" / "vsa_3r.yaml", "t.csv")
    note = "t.csv: not used: base.damping, shoulder.damping; only joints with a damper take a damping"
    assert note in done.out


def test_files_say_which_joints_have_one(robot: Path, vsacli: Callable[..., Any]) -> None:
    motion = REPOSITORY / "trajectories" / "rest_to_rest.yaml"
    assert vsacli("invdyn", robot, motion, "-o", "r.h5").code == Exit.OK
    done = vsacli("export", "r.h5", "--variables", "damping,tau_damper", "--rate", "1")
    assert done.out.startswith("time,base.damping,shoulder.damping,base.tau_damper,shoulder.tau_damper\n")
    plain = REPOSITORY / "robots" / "vsa_3r.yaml"
    done = vsacli(
        "invdyn", plain, REPOSITORY / "trajectories" / "rest_to_rest.yaml", "--variables", "damping"
    )
    assert done.code == Exit.USAGE
    assert "there is no damping: no joint of vsa-3r has a damper" in done.err


def test_a_trajectory_without_its_robot_is_described(tmp_path: Path, vsacli: Callable[..., Any]) -> None:
    motion = MOTION.partition("position:")[0]
    position = "position: {type: constant, value: [0.1, 0.2, 0.3]}\n"
    damping = "damping: {type: constant, value: [2, null, 3]}\n"
    (tmp_path / "m.yaml").write_text(motion + position + damping)
    done = vsacli("info", "m.yaml")
    assert done.code == Exit.OK
    assert "damping N m s/rad" in done.out
    new = vsacli("new", "trajectory", "--robot", REPOSITORY / "robots" / "vsa_3r.yaml").out
    assert "# damping:" in new


def test_a_new_trajectory_commands_it(robot: Path, tmp_path: Path, vsacli: Callable[..., Any]) -> None:
    assert vsacli("new", "trajectory", "--robot", robot, "-o", "n.yaml").code == Exit.OK
    assert "value: {base: 3, shoulder: 3}" in (tmp_path / "n.yaml").read_text()
    assert vsacli("check-feasibility", robot, "n.yaml").code == Exit.OK
