"""Rigid and elastic joints in robot files, and which joints a trajectory gives a stiffness."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vsacli import (
    Antagonistic,
    Elastic,
    InputError,
    Motor,
    Rigid,
    Robot,
    Trajectory,
    inverse_dynamics,
    load_robot,
    load_trajectory,
)

pytestmark = pytest.mark.usefixtures("own_folder")

ROOT = Path(__file__).parents[2]
ROBOT = ROOT / "robots" / "mixed_3r.yaml"
TRAJECTORY = ROOT / "trajectories" / "mixed_3r.yaml"

HEAD = "format: vsacli-robot/1\nname: rig\njoints:\n"
JOINT = """\
  - name: {name}
    type: revolute
    dh: {{a: 0.2, alpha: 90 deg}}
    link: {{mass: 2, com: [0.1, 0, 0], inertia: {{xx: 0.1, yy: 0.2, zz: 0.2}}}}
    actuator: {actuator}
"""
RIGID = "{type: rigid, motor: {inertia: 2}}"
ELASTIC = "{type: elastic, motor: {inertia: 3, max_torque: 50}, stiffness: 1e3}"
ANTAGONISTIC = "{type: antagonistic, motor: {inertia: 3}, spring: {type: cubic, k: 400, k_c: 2000}}"
POSITION = "position: {type: polynomial, degree: 7, start: 0, end: 0.4}\n"
FEW = "on so few knots, derivatives are unreliable far into the record from both ends"


def robot(*actuators: str) -> Robot:
    """Joints a, b, c, ... with these actuators."""
    joints = (JOINT.format(name=name, actuator=each) for name, each in zip("abcd", actuators, strict=False))
    Path("rig.yaml").write_text(HEAD + "".join(joints))
    return load_robot("rig.yaml")


def trajectory(of: Robot, stiffness: str, position: str = POSITION) -> Trajectory:
    head = "format: vsacli-trajectory/1\nname: move\nduration: 1\nrate: 20\n"
    Path("move.yaml").write_text(head + position + stiffness)
    return load_trajectory("move.yaml", of)


def commanded(of: Robot, stiffness: str) -> list[float | None]:
    """The stiffness in the middle, None where there is none."""
    found = trajectory(of, stiffness).at(np.array([0.5])).commanded["stiffness"][0]
    return [None if np.isnan(value) else value for value in found.tolist()]


def problems(function: object, *arguments: object) -> list[str]:
    with pytest.raises(InputError) as caught:
        function(*arguments)
    return str(caught.value).splitlines()


# Robot files


def test_actuators_of_all_kinds_are_read() -> None:
    kinds = [joint.actuator for joint in robot(RIGID, ELASTIC, ANTAGONISTIC).joints]
    assert kinds[0] == Rigid(motor=Motor(inertia=2.0))
    assert kinds[1] == Elastic(motor=Motor(inertia=3.0, max_torque=50.0), stiffness=1000.0)
    assert isinstance(kinds[2], Antagonistic)


@pytest.mark.parametrize(
    ("actuator", "expected"),
    [
        ("{type: elastic, motor: {inertia: 3}}", "actuator: missing key 'stiffness'"),
        ("{type: elastic, motor: {inertia: 3}, stiffness: 0}", "stiffness: must be positive, not 0"),
        ("{type: elastic, motor: [{inertia: 3}, {inertia: 3}], stiffness: 9}", "motor: expected a mapping"),
        ("{type: rigid, motor: {inertia: 3}, stiffness: 9}", "unknown key 'stiffness'"),
        ("{type: rigid, motor: {inertia: 3}, spring: {type: cubic}}", "unknown key 'spring'"),
        ("{type: rigid}", "actuator: missing key 'motor'"),
        ("{type: ridgid, motor: {inertia: 3}}", "did you mean 'rigid'?"),
    ],
)
def test_mistaken_actuators_are_refused_with_their_line(actuator: str, expected: str) -> None:
    [problem] = problems(robot, RIGID, actuator)
    assert problem.startswith("rig.yaml:13: ")
    assert expected in problem


def test_a_rigid_joint_has_no_stiffness_to_limit() -> None:
    limits = RIGID + "\n    limits: {velocity: 3,\n      stiffness: 900}"
    expected = "limits.stiffness: a joint with a rigid actuator has no stiffness to limit; leave it out"
    assert problems(robot, limits) == [f"rig.yaml:10: joints: {expected}"]


# Trajectory files


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("900", [None, None, 900.0, 900.0]),
        ("[null, ~, 900, 950]", [None, None, 900.0, 950.0]),
        ("{d: 950, c: 900}", [None, None, 900.0, 950.0]),
        ("{a: null, c: 900, d: 950}", [None, None, 900.0, 950.0]),
    ],
)
def test_only_antagonistic_joints_take_a_stiffness(value: str, expected: list[float | None]) -> None:
    of = robot(RIGID, ELASTIC, ANTAGONISTIC, ANTAGONISTIC)
    assert commanded(of, f"stiffness: {{type: constant, value: {value}}}") == expected
    assert (
        commanded(of, f"stiffness: {{type: polynomial, degree: 3, start: {value}, end: {value}}}") == expected
    )


AN_ELASTIC = "its actuator is elastic, with the spring that the robot file says"
A_RIGID = "its actuator is rigid and has no stiffness"


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("[null, 1000, 900]", [f"value: expected no value for b, found '1000': {AN_ELASTIC}"]),
        ("{a: 5, c: 900}", [f"value: expected no value for a, found '5': {A_RIGID}"]),
        (
            "{a: 5, b: 1000, c: 900}",
            [
                f"value: expected no value for a, found '5': {A_RIGID}",
                f"value: expected no value for b, found '1000': {AN_ELASTIC}",
            ],
        ),
        ("[null, null, null]", ["value: expected a number in N m/rad, found nothing"]),
        ("{b: null}", ["value: no value for c; each joint needs one"]),
        (
            "[900]",
            [
                "value: expected 3 values, one for each joint (a, b, c), found 1; "
                "is the file for another robot?"
            ],
        ),
        ("[null, null, -900]", ["value of joint c: must be positive, not -900 N m/rad"]),
    ],
)
def test_other_joints_take_none(value: str, expected: list[str]) -> None:
    of = robot(RIGID, ELASTIC, ANTAGONISTIC)
    found = problems(trajectory, of, f"stiffness: {{type: constant, value: {value}}}")
    assert found == [f"move.yaml:6: {line}" for line in expected]


def test_the_position_is_for_all_joints() -> None:
    position = "position: {type: constant, value: [0, null, 0]}\n"
    [problem] = problems(
        trajectory, robot(RIGID, ELASTIC, ANTAGONISTIC), "stiffness: {type: constant, value: 900}", position
    )
    assert problem == "move.yaml:5: value: expected a number in rad, found nothing"


def test_the_stiffness_may_be_absent_if_no_joint_takes_one() -> None:
    assert commanded(robot(RIGID, ELASTIC), "") == [None, None]
    [problem] = problems(trajectory, robot(RIGID, ANTAGONISTIC), "")
    assert problem.startswith("move.yaml:1: missing key 'stiffness'")


@pytest.mark.parametrize("degree", [3, 5])
def test_low_degrees_suffice_if_all_joints_are_rigid(degree: int) -> None:
    position = f"position: {{type: polynomial, degree: {degree}, start: 0, end: 0.4}}\n"
    report = inverse_dynamics(of := robot(RIGID, RIGID), trajectory(of, "", position)).report
    assert report.verdict == "ok"
    for others in ([RIGID, ELASTIC], [ELASTIC, ELASTIC]):
        [problem] = problems(trajectory, robot(*others), "", position)
        assert re.match(
            r"move\.yaml:5: degree: must be odd, from 7 to 15 \(derivatives up to the third must vanish",
            problem,
        )


def test_a_rigid_robot_needs_a_velocity_that_vanishes_at_the_ends() -> None:
    position = "position: {type: polynomial, degree: 1, start: 0, end: 0.4}\n"
    [problem] = problems(trajectory, robot(RIGID), "", position)
    assert problem.startswith("move.yaml:5: degree: must be odd, from 3 to 15 (velocity must vanish at both")


# Recorded trajectories


def write_csv(*columns: str) -> None:
    """A smooth table whose column number k is 900 + k at the start, or a thousandth of it if of positions."""
    time = np.linspace(0, 1, 11)
    sizes = [1e-3 if column.endswith("q") or column.startswith("q") else 1.0 for column in columns]
    table = np.column_stack([time, *(size * (900 + k + time**2) for k, size in enumerate(sizes))])
    lines = [",".join(["time", *columns]), *(",".join(map(str, row)) for row in table.tolist())]
    Path("move.csv").write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("pattern", ["{joint}.{name}", "{name}{number}"])
def test_a_table_has_stiffness_columns_of_antagonistic_joints_alone(pattern: str) -> None:
    of = robot(RIGID, ELASTIC, ANTAGONISTIC)
    q = [pattern.format(name="q", joint=joint, number=number) for number, joint in enumerate("abc", 1)]
    write_csv(*q, pattern.format(name="stiffness", joint="c", number=3))
    found = load_trajectory("move.csv", of)
    assert found.chosen("stiffness").tolist() == [False, False, True]
    np.testing.assert_allclose(found.block(0, 1).commanded["stiffness"][0], [np.nan, np.nan, 903])
    assert inverse_dynamics(of, found).report.self_check.passed


def test_columns_of_joints_that_take_no_stiffness_are_named_and_left() -> None:
    write_csv("a.q", "b.q", "c.q", "a.stiffness", "b.stiffness", "c.stiffness", "b.dstiffness")
    found = load_trajectory("move.csv", robot(RIGID, ELASTIC, ANTAGONISTIC))
    assert found.chosen("stiffness").tolist() == [False, False, True]
    unused = "a.stiffness, b.stiffness, b.dstiffness; only antagonistic or serial joints take a stiffness"
    assert found.notes[0] == f"move.csv: not used: {unused}"
    assert not any("not used" in note for note in found.notes[1:])
    assert found.warnings == (
        f"dq, ddq, d3q, d4q come from a C6 spline through q; {FEW}",
        f"dstiffness, ddstiffness come from a C4 spline through stiffness; {FEW}",
    )


def test_a_table_without_stiffness_serves_a_robot_without_antagonistic_joints() -> None:
    write_csv("a.q", "b.q")
    found = load_trajectory("move.csv", of := robot(RIGID, ELASTIC))
    assert found.warnings == (f"dq, ddq, d3q, d4q come from a C6 spline through q; {FEW}",)
    assert inverse_dynamics(of, found).report.verdict == "ok"
    [problem] = problems(load_trajectory, "move.csv", robot(RIGID, ANTAGONISTIC))
    assert problem.startswith("move.csv:1: the column b.stiffness is missing; a YAML trajectory")


# From Python


TIME = np.linspace(0, 1, 21)
Q = 0.1 * np.sin(TIME)[:, None] * [1.0, 2.0, 3.0]


def test_samples_need_a_stiffness_of_antagonistic_joints_alone() -> None:
    of = load_robot(ROBOT)
    stiffness = np.full_like(Q, np.nan)
    stiffness[:, 2] = 1000 + 50 * TIME**2
    partly = inverse_dynamics(of, Trajectory.from_samples(TIME, Q, stiffness))
    assert partly.report.verdict == "ok"
    again = inverse_dynamics(of, Trajectory.from_samples(TIME, Q, partly.stiffness))
    for name, array in partly.arrays().items():
        np.testing.assert_array_equal(array, getattr(again, name))


def test_samples_without_any_stiffness() -> None:
    free = Trajectory.from_samples(TIME, Q[:, :2])
    assert inverse_dynamics(robot(RIGID, ELASTIC), free).report.verdict == "ok"
    for other in (free, Trajectory.from_samples(TIME, Q[:, :2], np.full((21, 2), np.nan))):
        with pytest.raises(
            InputError, match=r"samples has no stiffness for b; each antagonistic or serial joint needs one"
        ):
            inverse_dynamics(robot(RIGID, ANTAGONISTIC), other)
    with pytest.raises(InputError, match="derivatives of a stiffness are given, but not the stiffness"):
        Trajectory.from_samples(TIME, Q, dstiffness=Q)
    with pytest.raises(InputError, match=r"samples has 2 joints, the robot mixed-3r 3"):
        inverse_dynamics(load_robot(ROBOT), free)


def test_a_stiffness_with_gaps_is_refused() -> None:
    stiffness = np.full_like(Q, 1000.0)
    stiffness[3:5, 1] = np.nan
    with pytest.raises(InputError, match=r"stiffness\[3, 1\] must be finite, not nan .*2 such samples"):
        Trajectory.from_samples(TIME, Q, stiffness)


def test_a_rigid_joint_in_python_has_no_stiffness_to_limit() -> None:
    [joint] = robot(RIGID).joints
    with pytest.raises(InputError, match="has no stiffness to limit"):
        replace(joint, limits=replace(joint.limits, stiffness=(1.0, 2.0)))
