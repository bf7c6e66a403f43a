"""Derivatives by all numbers of a robot, beside one run of inverse dynamics, and the memory they take."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from commands import taken
from stages import trajectory_of
from subjects import chain, seven_joints
from timing import Seconds, cpu_seconds, medians

from vsacli import Trajectory, inverse_dynamics, sensitivity
from vsacli.robot.parameters import parameters
from vsacli.trajectory.curves import RestToRest

SAMPLES = 4_000
LONG_CHAIN = 20
INVERSE_DYNAMICS, SENSITIVITY = "`inverse_dynamics`, NumPy", "`sensitivity`"


class Sensitivities(NamedTuple):
    """What derivatives of the arm with seven joints take.

    Attributes:
        numbers: by which is differentiated.
        seconds: of each way.
        memory: bytes resident at most, by number of joints.
    """

    numbers: int
    seconds: Seconds
    memory: dict[int, int]


def compare(repeats: int) -> Sensitivities:
    """Time both over the same samples in turn."""
    robot, trajectory = seven_joints(), trajectory_of(SAMPLES)
    ways = {
        INVERSE_DYNAMICS: cpu_seconds(lambda: inverse_dynamics(robot, trajectory)),
        SENSITIVITY: cpu_seconds(lambda: sensitivity(robot, trajectory)),
    }
    memory = {joints: _peak_memory(joints) for joints in (len(robot.joints), LONG_CHAIN)}
    return Sensitivities(len(parameters(robot)), medians(ways, repeats), memory)


def run(joints: int) -> None:
    """Derivatives of the arm's joints over and over again in one chain, each on a tenth of its way."""
    arm = trajectory_of(SAMPLES)
    profiles = [_repeated(each, joints) for each in (arm.position, arm.commanded["stiffness"])]
    position = replace(profiles[0], end=tuple(value / 10 for value in profiles[0].end))
    sensitivity(chain(joints), Trajectory(arm.times, position, {"stiffness": profiles[1]}, name="chain"))


def _repeated(profile: RestToRest, joints: int) -> RestToRest:
    start, end = (
        tuple(values[index % len(values)] for index in range(joints))
        for values in (profile.start, profile.end)
    )
    return replace(profile, start=start, end=end)


def _peak_memory(joints: int) -> int:
    """Of a process of its own."""
    line = f"import sensitivities; sensitivities.run({joints})"
    return taken([sys.executable, "-c", line], Path(__file__).parent).memory
