"""Parameters of which torques determine only a sum: it is found and named, and the file gets parts of it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import Outcome
from samples.excited import Excitation, Recorded, excited
from samples.shipped import shipped_robot

from vsacli import InputError, Robot, identify, load_robot

Command = Callable[..., Outcome]

ARM = """\
format: vsacli-robot/1
name: arm
gravity: [0, -9.81, 0]
joints:
  - name: lower
    type: revolute
    dh: {a: 0.5, alpha: 0}
    damping: 0.5
    link: {mass: 4, com: [-0.25, 0, 0], inertia: {xx: 0.02, yy: 0.1, zz: 0.1}}
    actuator: {type: rigid, motor: {inertia: 0.8, damping: 1, friction: {coulomb: 1, width: 0.05}}}
  - name: upper
    type: revolute
    dh: {a: 0.4, alpha: 0}
    damping: 0
    link: {mass: 2, com: [-0.2, 0, 0], inertia: {xx: 0.01, yy: 0.04, zz: 0.04}}
    actuator: {type: rigid, motor: {inertia: 0.4, damping: 0.4}}
"""

MOTION = Excitation(position=[0, 0], reach=[0.6, 0.6], stiffness=None, duration=12, rate=100)

OFF: Mapping[str, Any] = {
    "joints.lower.damping": 0.3,
    "joints.lower.actuator.motor.damping": 1.6,
    "joints.lower.actuator.motor.inertia": 1.3,
    "joints.lower.actuator.motor.friction.coulomb": 1.5,
    "joints.*.link.mass": 3,
}


@pytest.fixture(name="arm")
def _arm(tmp_path: Path) -> Robot:
    path = tmp_path / "arm.yaml"
    path.write_text(ARM)
    return load_robot(path)


@pytest.fixture(name="moved")
def _moved(arm: Robot) -> Recorded:
    return excited(arm, MOTION)


@pytest.fixture(name="record")
def _record(arm: Robot, moved: Recorded, tmp_path: Path) -> Path:
    return moved.noisy(seed=1, torque=0.05).write(tmp_path / "record.csv", arm)


@pytest.mark.slow
def test_dampings_of_a_rigid_joint_are_found_as_their_sum(
    vsacli: Command, record: Path, moved: Recorded
) -> None:
    text = ARM.replace("damping: 0.5", "damping: 0.3").replace("damping: 1,", "damping: 1.6,")
    Path("file.yaml").write_text(text.replace("inertia: 0.8", "inertia: 1.3").replace("mass: 4", "mass: 3"))
    found = vsacli("identify", "file.yaml", record, "-o", "fitted.yaml", "--json")
    assert found.code == 0
    report = json.loads(found.out)
    numbers = {number["path"]: number for system in report["systems"] for number in system["numbers"]}
    damping, inertia = numbers["joints.lower.damping*"], numbers["lower.Izz*"]
    assert damping["sum"] == "joints.lower.damping + joints.lower.actuator.motor.damping"
    assert damping["unit"] == "N m s/rad"
    assert abs(damping["value"] - 1.5) < 4 * damping["standard_error"] < 0.1
    assert "+ joints.lower.actuator.motor.inertia" in inertia["sum"]
    assert all(system["condition"] < 100 for system in report["systems"])
    fitted = load_robot("fitted.yaml")
    lower = fitted.joints[0]
    total = lower.damping + lower.actuator.motors[0].damping
    assert abs(total - damping["value"]) < damping["standard_error"]
    assert min(lower.damping, lower.actuator.motors[0].damping) > 0
    error = np.abs(excited(fitted, MOTION).tau_motor - moved.tau_motor)[..., 0].max(axis=0)
    stated = np.array([each["deviation"] for each in report["deviations"]])
    assert np.all(error < 4 * stated)
    assert np.all(stated < 0.01 * np.array([each["torque"] for each in report["deviations"]]))


@pytest.mark.parametrize(
    ("word", "paths"),
    [
        ("friction", ["lower.actuator.motor.friction.coulomb", "lower.actuator.motor.friction.offset"]),
        ("motors", ["lower.actuator.motor.inertia", "lower.actuator.motor.damping"]),
    ],
)
def test_groups_are_those_of_rigid_joints_as_well(
    word: str, paths: list[str], arm: Robot, record: Path
) -> None:
    off = {"joints.lower.actuator.motor.friction.coulomb": 1.5, "joints.lower.actuator.motor.damping": 1.4}
    start = arm.replace({path: value for path, value in off.items() if path.removeprefix("joints.") in paths})
    found = identify(start, record, fit=[word])
    assert found.verdict == "ok"
    of_lower = [number for number in found.numbers if number.path.startswith("joints.lower")]
    assert [number.path for number in of_lower] == [f"joints.{path}" for path in paths]
    truth = dict.fromkeys(paths, 0.0) | dict(
        zip(paths, (1, 0) if word == "friction" else (0.8, 1), strict=True)
    )
    for number in of_lower:
        assert abs(number.value - truth[number.path.removeprefix("joints.")]) < 4 * number.standard_error
    assert "links of the file, which are assumed to be exact" in " ".join(found.notes)


def test_joints_without_the_parameters_are_said_to_have_others(record: Path, tmp_path: Path) -> None:
    path = tmp_path / "smooth.yaml"
    path.write_text(ARM.replace(", friction: {coulomb: 1, width: 0.05}", ""))
    smooth = load_robot(path)
    had = "links: damping; motors: actuator.motor.inertia, actuator.motor.damping"
    with pytest.raises(
        InputError, match=rf"none of the parameters to identify \(friction\); they have {had}"
    ):
        identify(smooth, record, fit=["friction"])


def test_missing_positions_are_the_reason_why_rigid_joints_are_not_identified(
    arm: Robot, record: Path, tmp_path: Path
) -> None:
    header, *_ = record.read_text().splitlines()
    columns = header.split(",")
    chosen = [columns.index(name) for name in ("time", "lower.q", "lower.tau_motor_1")]
    path, rows = tmp_path / "part.csv", np.loadtxt(record, delimiter=",", skiprows=1)
    np.savetxt(path, rows[:, chosen], delimiter=",", header="time,lower.q,lower.tau_motor_1", comments="")
    reason = (
        r"nothing can be identified .*rigid joints are not identified, since the positions of upper were not"
    )
    with pytest.raises(InputError, match=reason):
        identify(arm, path, fit=["motors"])


@pytest.mark.slow
def test_damping_that_is_zero_stays_zero_unless_its_path_is_given(arm: Robot, record: Path) -> None:
    start = arm.replace("joints.upper.actuator.motor.damping", 0)
    paths = {number.path for number in identify(arm, record).numbers}
    assert "joints.upper.damping" not in paths
    assert "joints.upper.actuator.motor.damping" in paths
    left = {number.path for number in identify(start, record).numbers}
    assert not any(path.startswith("joints.upper") and "damping" in path for path in left)
    found = identify(start, record, fit=["links", "motors", "friction", "joints.upper.damping"])
    (number,) = (each for each in found.numbers if each.path == "joints.upper.damping")
    assert abs(number.value - 0.4) < 4 * number.standard_error


@pytest.mark.slow
def test_friction_of_two_directions_and_its_offset_are_sums(tmp_path: Path) -> None:
    """Of three, any motion determines two: the offset adds to one direction and takes from the other."""
    arm = shipped_robot("vsa_3r")
    joint = dataclasses.replace(arm, joints=arm.joints[:1]).replace(
        "joints.base.actuator.motor.friction", {"coulomb": [2.0, 3.0], "offset": 0.5}
    )
    motion = Excitation(position=[0], reach=[0.4], stiffness=[1400], swing=[300], duration=12, rate=100)
    path = excited(joint, motion).noisy(seed=2).write(tmp_path / "record.csv", joint)
    start = joint.replace("joints.base.actuator.motor.friction.coulomb", [1.5, 3.5])
    found = identify(start, path, fit=["motors", "friction"])
    assert found.verdict == "ok"
    sums = [number for number in found.numbers if number.sum]
    assert [number.path.rpartition(".")[2] for number in sums] == ["0*", "1*"]
    friction = found.fitted.joints[0].actuator.motors[0].friction
    assert friction is not None
    assert friction.offset == 0.5
    assert friction.coulomb == pytest.approx((2, 3), abs=4 * max(each.standard_error for each in sums))


def test_columns_that_the_fit_does_not_use_are_not_judged(
    arm: Robot, moved: Recorded, tmp_path: Path
) -> None:
    """Motor positions of a rigid joint, here cut off as a commanded one may be."""
    noisy = moved.noisy(seed=1, torque=0.05)
    clipped = noisy.theta.copy()
    clipped[:, :, 0] = np.clip(noisy.q, -0.1, 0.1)
    path = noisy._replace(theta=clipped).write(tmp_path / "clipped.csv", arm)
    found = identify(arm, path, fit=["friction"])
    assert found.verdict == "ok"
    assert set(found.records[0].unused) == {"lower.theta_1", "upper.theta_1"}


@pytest.mark.slow
def test_springs_at_one_stiffness_have_the_combination_found(tmp_path: Path) -> None:
    """`k` and `k_c` are not distinguished, but the file that contradicts their combination does not stay."""
    arm = shipped_robot("vsa_3r")
    joint = dataclasses.replace(arm, joints=arm.joints[:1])
    motion = Excitation(position=[0], reach=[0.4], stiffness=[1400], swing=[0], duration=12, rate=100)
    path = excited(joint, motion).noisy(seed=3).write(tmp_path / "record.csv", joint)
    found = identify(joint.replace("joints.base.actuator.spring.k", 350), path, fit=["springs", "motors"])
    assert found.verdict == "unidentifiable"
    spring, truth = (each.joints[0].actuator.spring[0] for each in (found.fitted, joint))
    deflection = 0.2236  # at 1400 N m/rad of both springs
    torques = [each.k * deflection + each.k_c * deflection**3 for each in (spring, truth)]
    assert torques[0] == pytest.approx(torques[1], rel=0.01)  # of the file, 10 % less
