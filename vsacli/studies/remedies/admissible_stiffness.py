"""What a joint carries along a motion, and which stiffness it may have while it does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.dynamics.inverse import elastic_torques, usual_block
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.motions import Load, motion_between
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

BISECTIONS = 50
"""Bisections of a share of 0 to 1: down to rounding."""


def joint_loads(
    robot: Robot,
    trajectory: Trajectory,
    joints: list[int],
    factor: float = 1.0,
    between: FloatArray | None = None,
) -> list[Load]:
    """The loads of some joints, given by index: at every step, and half-way from one to the next.

    Every second instant, from the first on, is a step, unless there are further instants.

    Args:
        robot: the robot.
        trajectory: a task, or one that was stretched.
        joints: by index.
        factor: of the stretching.
        between: further instants, as times since the start of the task as it is, s.
    """
    instants = 2 * trajectory.samples - 1
    names = Command.names(trajectory.commanded)
    time, rows = np.empty(instants), np.empty((len(joints), len(names), instants))
    samples = usual_block(len(robot.joints))
    for start in range(0, trajectory.samples, samples):
        steps = trajectory.block(start, start + samples + 1)
        middles = trajectory.at((steps.time[:-1] + steps.time[1:]) / 2)
        for motion, first in ((steps, 2 * start), (middles, 2 * start + 1)):
            places = slice(first, first + 2 * len(motion.time), 2)
            time[places], rows[:, :, places] = motion.time, _rows(robot, motion, joints, names)
    if between is not None and between.size:
        motion = motion_between(trajectory, between, factor)
        time, chosen = np.unique(np.concatenate([time, motion.time]), return_index=True)
        rows = np.concatenate([rows, _rows(robot, motion, joints, names)], axis=2)[:, :, chosen]
    commands = (Command.of(dict(zip(names, of_joint, strict=True))) for of_joint in rows)
    return [Load.over(trajectory, factor, time, command) for command in commands]


def _rows(robot: Robot, motion: Motion, joints: list[int], names: tuple[str, ...]) -> FloatArray:
    """What some joints are commanded along a motion, with elastic torques, (joints, names, instants)."""
    if not (joints and len(motion.time)):
        return np.empty((len(joints), len(names), len(motion.time)))
    commanded = {**motion.variables(), **elastic_torques(robot, motion)}
    return np.stack([[commanded[name][:, joint] for name in names] for joint in joints])


class Range(NamedTuple):
    """Smallest and largest admissible stiffness, (samples,); none where low > high or low is NaN."""

    low: FloatArray
    high: FloatArray


def checked_range(acceptance: Acceptance, joint: Joint, load: Load) -> Range:
    """The admissible stiffness at every instant of a load, whose low end always exists.

    Raises:
        ImpossibleError: no stiffness mends the joint, or it has none to choose.
    """
    variable_stiffness_actuator(joint)
    if reason := acceptance.path_reason(joint, load):
        raise ImpossibleError(f"no stiffness changes that {reason}")
    admissible = admissible_stiffness(joint, load.command, acceptance.near_singular)
    if np.isnan(admissible.low).any():
        raise ImpossibleError(acceptance.reason(joint, load))
    return admissible


def variable_stiffness_actuator(joint: Joint) -> Actuator:
    """The actuator of a joint, if its stiffness can be chosen.

    Raises:
        ImpossibleError: the actuator has none to choose.
    """
    if "stiffness" not in joint.actuator.commanded:
        raise ImpossibleError(f"the actuator of {joint.name} has no stiffness to choose")
    return joint.actuator


def admissible_stiffness(joint: Joint, command: Command, near_singular: float) -> Range:
    """Stiffness that keeps the margin, the joint's stiffness limit and the deflection limits.

    The margin min(sigma - lower, upper - sigma)/sigma >= m means lower/(1-m) <= sigma <= upper/(1+m).

    Args:
        joint: with springs and limits.
        command: its elastic torque counts, and its stiffness as a scale.
        near_singular: the margin m.
    """
    actuator = variable_stiffness_actuator(joint)
    corridor = actuator.solve(command.tau_e, command.commanded["stiffness"], command.q)
    least, most = joint.limits.stiffness
    low = np.maximum(corridor.lower / (1 - near_singular), least)
    high = np.minimum(corridor.upper / (1 + near_singular), most)
    if np.isinf(actuator.max_deflections).all():
        return Range(low, high)
    return Range(low, np.minimum(high, _deflection_ceiling(actuator, command, corridor.lower)))


def _deflection_ceiling(actuator: Actuator, command: Command, lower: FloatArray) -> FloatArray:
    """The stiffness from `lower` on up to which both deflections keep their limit.

    With the stiffness grows the preload: phi_1 increases and phi_2 decreases, or the other way round. What is
    halved is a share x of 0 to 1, which maps to all stiffness above `lower`.
    """
    limits = np.array(actuator.max_deflections)[:, None]
    kept, broken = np.zeros_like(lower), np.ones_like(lower)
    for _ in range(BISECTIONS):
        share = (kept + broken) / 2
        stiffness = lower + command.commanded["stiffness"] * share / (1 - share)
        solution = actuator.solve(command.tau_e, stiffness, command.q)
        within = np.all(np.abs(solution.deflections) <= limits, axis=0)
        kept, broken = np.where(within, share, kept), np.where(within, broken, share)
    return lower + command.commanded["stiffness"] * kept / (1 - kept)
