"""All variables of a block of steps: recursion, then actuation joint by joint."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vsacli.actuation import Command, Drive, drive
from vsacli.arrays import FloatArray, over_time
from vsacli.errors import InputError
from vsacli.feasibility import NEAR_SINGULAR
from vsacli.motion import Motion
from vsacli.newton_euler import link_torques
from vsacli.robot import Antagonistic, Robot
from vsacli.trajectory import Trajectory
from vsacli.variables import Block


def compute_block(
    robot: Robot,
    motion: Motion,
    near_singular: float = NEAR_SINGULAR,
    followed: FloatArray | None = None,
) -> Block:
    """Inverse dynamics (36)-(74) of a block of steps.

    Args:
        robot: the robot.
        motion: commanded motion and stiffness, (samples, joints); the actuators that are not antagonistic
            have a stiffness of their own, or none.
        near_singular: margin below which a step is near-singular.
        followed: deflections of antagonistic joints to use instead of the root of (14), (joints, 2, samples);
            a step where they are NaN is infeasible.
    """
    commanded: dict[str, Any] = {**motion.variables(), **elastic_torques(robot, motion)}
    deflections = [None] * len(robot.joints) if followed is None else followed
    drives = [
        drive(joint, command_of(index, commanded), near_singular, phi)
        for index, (joint, phi) in enumerate(zip(robot.joints, deflections, strict=True))
    ]
    driven: dict[str, Any] = {
        name: over_time(np.stack([getattr(of_joint, name) for of_joint in drives])) for name in Drive._fields
    }
    return Block(**{**commanded, **driven})


def elastic_torques(robot: Robot, motion: Motion) -> dict[str, FloatArray]:
    """tau_e, dtau_e and ddtau_e, (58)-(60), by name, each (samples, joints); the stiffness plays no part."""
    torques = link_torques(robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench)
    return dict(zip(("tau_e", "dtau_e", "ddtau_e"), torques, strict=True))


def check_fit(robot: Robot, trajectory: Trajectory) -> None:
    """Refuse a trajectory that is not for this robot.

    Raises:
        InputError: it has another number of joints, or no stiffness for an antagonistic one.
    """
    if trajectory.joints != len(robot.joints):
        joints = f"{trajectory.joints} joints, the robot {robot.name} {len(robot.joints)}"
        raise InputError.one(f"the trajectory {trajectory.name} has {joints}")
    lacking = [
        joint.name
        for joint, chosen in zip(robot.joints, trajectory.stiffened, strict=True)
        if isinstance(joint.actuator, Antagonistic) and not chosen
    ]
    if lacking:
        raise InputError.one(
            f"the trajectory {trajectory.name} has no stiffness for {', '.join(lacking)}; "
            "each antagonistic joint needs one"
        )


def command_of(index: int, commanded: Mapping[str, FloatArray]) -> Command:
    """The part of one joint in variables by name, each (samples, joints)."""
    return Command(*(commanded[name][:, index] for name in Command._fields))
