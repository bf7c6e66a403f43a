"""Notes on a trajectory that its robot cannot execute, found without computing torques."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import together
from vsacli.base.units import time_text
from vsacli.robot.model import Robot
from vsacli.robot.plausibility.checked_robot import UnloadedStiffnessRange
from vsacli.trajectory.trajectory import Trajectory

BLOCK_SAMPLES = 8192

ADVICE = "check it with vsacli check-feasibility"


def unattainable(robot: Robot, trajectory: Trajectory) -> Iterator[str]:
    """Yield notes on positions outside the limits, and on stiffness below the minimum without load.

    Joints with the same fault share a note. Nothing is said of a stiffness about which there is a warning.
    """
    first_outside, lowest_stiffness = _limit_findings(robot, trajectory)
    joints_by_fault: dict[str, list[int]] = {}
    for index, time, value in first_outside:
        limits = robot.joints[index].limits.position
        unit = units.POSITION.unit(robot.joint_types[index])
        limits_text = f"limits.position [{limits[0]:.4g}, {limits[1]:.4g}] {unit}"
        fault = f"is {value:.4g} {unit} at t = {time_text(time)}, outside {limits_text}; {ADVICE}"
        joints_by_fault.setdefault(f"position of {{}} {fault}", []).append(index)
    if not any(warning.message.startswith(STIFFNESS.key) for warning in trajectory.located_warnings):
        for index, unloaded_range in sorted(_unloaded_ranges(robot)):
            if unloaded_range is not None and lowest_stiffness[index] < unloaded_range.lower:
                unit = units.STIFFNESS.unit(robot.joint_types[index])
                minimum = f"below the minimum of {unloaded_range.lower:.4g} {unit} without load"
                fault = f"is {lowest_stiffness[index]:.4g} {unit} at its lowest, {minimum}; {ADVICE}"
                joints_by_fault.setdefault(f"stiffness of {{}} {fault}", []).append(index)
    yield from (
        fault.format(together(joints, robot.joint_names)) for fault, joints in joints_by_fault.items()
    )


def _unloaded_ranges(robot: Robot) -> Iterator[tuple[int, UnloadedStiffnessRange | None]]:
    for subtree in robot.checked_subtrees:
        yield from zip(subtree.numbers_in_robot, subtree.unloaded_ranges, strict=True)


def _limit_findings(
    robot: Robot, trajectory: Trajectory
) -> tuple[list[tuple[int, float, float]], FloatArray]:
    """Return the first position outside the limits, with joint and time, and the lowest stiffness."""
    limits = np.array([joint.limits.position for joint in robot.joints])
    first_outside: dict[int, tuple[int, float, float]] = {}
    lowest_stiffness = np.full(len(robot.joints), np.inf)
    for start in range(0, trajectory.samples, BLOCK_SAMPLES):
        block = trajectory.block(start, start + BLOCK_SAMPLES)
        outside = (block.q < limits[:, 0]) | (block.q > limits[:, 1])
        for index in np.flatnonzero(outside.any(axis=0)).tolist():
            sample = int(np.argmax(outside[:, index]))
            finding = (index, float(block.time[sample]), float(block.q[sample, index]))
            first_outside.setdefault(index, finding)
        if STIFFNESS.key in block.commanded:
            lowest_stiffness = np.fmin(lowest_stiffness, block.commanded[STIFFNESS.key].min(axis=0))
    return [first_outside[index] for index in sorted(first_outside)], lowest_stiffness
