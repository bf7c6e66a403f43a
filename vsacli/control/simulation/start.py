"""The state in which a run starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag, has
from vsacli.dynamics.forward import State
from vsacli.dynamics.inverse import compute_block
from vsacli.robot.model import Robot
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class InitialError:
    """How far from the command a run starts: actual minus commanded, for all joints or one number each.

    Attributes:
        q: of the position, rad (m).
        stiffness: of the joint stiffness, N m/rad (N/m).
    """

    q: npt.ArrayLike = 0.0
    stiffness: npt.ArrayLike = 0.0


def start_state(robot: Robot, trajectory: Trajectory, error: InitialError) -> State:
    """State at the first step: of the inverse dynamics, with position and stiffness off by the error.

    All derivatives of both are as commanded.

    Raises:
        InputError: the error has another length than the robot has joints, or the state cannot be had.
    """
    motion = trajectory.at(np.array(trajectory.times.span[:1]))
    joints = len(robot.joints)
    offsets = {name: _per_joint(name, getattr(error, name), joints) for name in ("q", "stiffness")}
    arrays = motion.of_joints
    shifted = {**arrays, **{name: arrays[name] + offset for name, offset in offsets.items()}}
    block = compute_block(robot, Motion.of(motion.time, shifted, motion.wrench))
    failing = has(block.flags[0], Flag.INFEASIBLE | Flag.SINGULAR)
    if failing.any():
        names = ", ".join(name for name, fails in zip(robot.joint_names, failing, strict=True) if fails)
        raise InputError.one(
            f"no state at the start has this position and stiffness ({names}: out of reach, or singular); "
            "raise the stiffness at the start, or choose smaller initial errors"
        )
    return State(q=block.q[0], dq=block.dq[0], theta=block.theta[0], dtheta=block.dtheta[0])


def _per_joint(name: str, values: npt.ArrayLike, joints: int) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (1,), (joints,)) or not np.isfinite(array).all():
        raise InputError.one(
            f"the initial error of {name} must be one finite number, or one for each of the {joints} joints"
        )
    return np.broadcast_to(array, (joints,))
