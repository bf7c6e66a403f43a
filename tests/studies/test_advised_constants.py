"""The constant stiffness that the cause of a joint advises: doing what the sentence says fixes the motion."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from samples.command_line import ROBOT
from samples.moves import move
from samples.shipped import shipped_robot

from vsacli import (
    Joint,
    Robot,
    Trajectory,
    fixes,
    inverse_dynamics,
    load_robot,
    load_trajectory,
    motor_torques,
)

MIN_MARGIN = 0.01
ADVICE = re.compile(r"a stiffness of at (least|most) (\S+)")

Motion = Callable[[np.ndarray], Trajectory]
"""A motion with a constant stiffness of each joint, (joints,)."""


def random_motion(seed: int) -> tuple[Robot, Motion, np.ndarray]:
    """A robot on a random motion, and a stiffness too low at rest, or too high for its motors (odd seeds)."""
    rng = np.random.default_rng(seed)
    robot = shipped_robot(("vsa_3r", "vsa_3r", "rp_2", "vsa_3r")[seed % 4])
    reach = [0.3 if joint.type == "prismatic" else 1.0 for joint in robot.joints]
    start, end = (tuple((rng.uniform(-1, 1, len(reach)) * reach).tolist()) for _ in range(2))
    duration, rate = float(rng.uniform(0.8, 3)), int(rng.integers(50, 400))

    def motion(stiffness: np.ndarray) -> Trajectory:
        return move(duration, rate, (start, end), degrees=(9, 3), stiffness=(stiffness, stiffness))

    rest = motor_torques(robot, motion(np.full(len(reach), 1e5)).at(np.array([0.0])))
    lowest = rest.stiffness_min[0]
    if seed % 2 == 0:
        return robot, motion, np.round(lowest * rng.uniform(0.85, 1.01, len(reach)), 2)
    stiffness = np.round(1.5 * lowest, 2)
    torque = np.abs(motor_torques(robot, motion(stiffness).at(np.array([0.0]))).tau_motor[0]).max(axis=-1)
    joints = tuple(map(_weakened, robot.joints, (0.85 * torque).tolist()))
    return dataclasses.replace(robot, joints=joints), motion, stiffness


def _weakened(joint: Joint, max_torque: float) -> Joint:
    motors = tuple(dataclasses.replace(motor, max_torque=max_torque) for motor in joint.actuator.motor)
    return dataclasses.replace(joint, actuator=dataclasses.replace(joint.actuator, motor=motors))


def advised(robot: Robot, trajectory: Trajectory) -> Iterator[tuple[int, str]]:
    """The index of each joint whose cause advises a constant, and the constant as it is printed."""
    for cause in fixes(robot, trajectory, MIN_MARGIN).causes:
        if match := ADVICE.search(str(cause)):
            yield robot.joint_names.index(cause.joint), match[2]


def fixed(robot: Robot, trajectory: Trajectory, index: int) -> bool:
    """Whether a joint has its margin and keeps its limits, at samples and between them."""
    joint = inverse_dynamics(robot, trajectory).report.joints[index]
    return joint.margin >= MIN_MARGIN and not any(map(joint.shows, ("infeasible", "singular", "over_limit")))


def check(seed: int) -> int:
    """Follow each advice of a random task; return how many there were."""
    robot, motion, stiffness = random_motion(seed)
    followed = list(advised(robot, motion(stiffness)))
    for index, value in followed:
        assert not fixed(robot, motion(stiffness), index)
        changed = stiffness.copy()
        changed[index] = float(value)
        assert fixed(robot, motion(changed), index)
    return len(followed)


def test_the_advised_constant_fixes_the_motion(vsacli, own_folder) -> None:
    """The minimum at rest does not: the motion needs more."""
    text = """\
format: vsacli-trajectory/1
name: quick
duration: 2
rate: 200
position: {type: polynomial, degree: 9, start: 0, end: [0.8, 0.6, 0.5]}
stiffness: {type: constant, value: [1500, 790, 1500]}
"""
    (own_folder / "quick.yaml").write_text(text)
    robot = load_robot(ROBOT)
    ((_, value),) = advised(robot, load_trajectory("quick.yaml", robot))
    for stiffness, verdict in ((value, "nothing to change"), (float(value) - 0.02, "shoulder: stiffness is")):
        (own_folder / "quick.yaml").write_text(text.replace("790", str(stiffness)))
        assert verdict in vsacli("check-feasibility", ROBOT, "quick.yaml", "--fixes").out


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("first", [0, 1, 2])
def test_every_advised_constant_of_random_tasks_fixes_the_motion(first: int) -> None:
    seeds = range(first, 20, 3)
    assert sum(map(check, seeds)) >= len(seeds)
