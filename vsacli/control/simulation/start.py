"""The initial state of a run: by inverse dynamics, with position and stiffness off by an error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.flags import Flag, has_flag
from vsacli.base.texts import distinguish
from vsacli.base.units import STIFFNESS
from vsacli.dynamics.forward import State
from vsacli.dynamics.inverse import compute_block
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.robot.plausibility.bodies import ROUNDED, turns
from vsacli.trajectory.trajectory import Motion, Trajectory


@dataclass(frozen=True)
class InitialError:
    """Difference of the initial state from the command, one value for all joints or one for each.

    Attributes:
        q: error of the position, rad (m).
        stiffness: error of the joint stiffness, N m/rad (N/m).
    """

    q: npt.ArrayLike = 0.0
    stiffness: npt.ArrayLike = 0.0

    @property
    def is_zero(self) -> bool:
        """Whether the initial state is as commanded."""
        return not (np.any(self.q) or np.any(self.stiffness))


UNUSABLE = Flag.INFEASIBLE | Flag.SINGULAR
"""Flags of a sample at which a run cannot start."""


def start_state(robot: Robot, trajectory: Trajectory, error: InitialError) -> State:
    """Return the initial state by inverse dynamics, with position and stiffness off by the error.

    All derivatives of both are as commanded.

    Raises:
        InputError: the error has a wrong length, or the state is infeasible or singular.
    """
    motion = trajectory.at(np.array(trajectory.times.span[:1]))
    offsets = {name: _values_by_joint(name, getattr(error, name), robot) for name in ("q", "stiffness")}
    arrays = motion.of_joints
    shifted = {**arrays, **{name: arrays[name] + offset for name, offset in offsets.items()}}
    block = compute_block(robot, Motion.of(motion.time, shifted, motion.wrench))
    unusable, singular = (has_flag(block.flags[0], flags) for flags in (UNUSABLE, Flag.SINGULAR))
    if unusable.any():
        file = trajectory.sources[0].path if trajectory.sources and error.is_zero else ""
        advice = "" if error.is_zero else ", or choose smaller initial errors"
        raise InputError(
            Problem(file, 0, _unusable_start_text(joint, block.of_joint(index), singular[index]) + advice)
            for index, joint in enumerate(robot.joints)
            if unusable[index]
        )
    return State(q=block.q[0], dq=block.dq[0], theta=block.theta[0], dtheta=block.dtheta[0])


def _unusable_start_text(joint: Joint, values: Mapping[str, FloatArray], singular: bool) -> str:
    """Return why a joint cannot start, from its values at the first sample, and what to change."""
    if singular:
        return f"{joint.name}: its springs are singular at the start; change the stiffness there"
    stiffness, low, high = (float(values[f"stiffness{end}"][0]) for end in ("", "_min", "_max"))
    if not (stiffness < low or stiffness > high):  # also where there is no stiffness, or no bound
        return f"{joint.name}: its springs cannot carry the load at the start; reduce it"
    bound, relation, change = (
        (low, "below the minimum", "increase") if stiffness < low else (high, "above the maximum", "decrease")
    )
    value, limit = distinguish(stiffness, bound)
    unit = STIFFNESS.unit(joint.type)
    subject = f"{joint.name}: stiffness {value} {unit} at the start is {relation}"
    return f"{subject} of {limit} {unit} at this load; {change} it"


ERRORS = {"q": "position", "stiffness": "stiffness"}
"""Words for the initial errors."""


def _values_by_joint(name: str, values: npt.ArrayLike, robot: Robot) -> FloatArray:
    array, joints = np.asarray(values, dtype=np.float64), len(robot.joints)
    if array.shape not in ((), (1,), (joints,)):
        array_form = f", or {joints} ({', '.join(robot.joint_names)})" if joints > 1 else ""
        expected = f"expected 1 value{array_form}, found {array.size}"
        raise InputError.one(f"initial {ERRORS[name]} error: {expected}")
    if not np.isfinite(array).all():
        raise InputError.one(f"initial {ERRORS[name]} error: expected finite values")
    return np.broadcast_to(array, (joints,))


def strange_errors(robot: Robot, error: InitialError) -> Iterator[str]:
    """Yield a warning for initial position errors of more than a turn: degrees, in all likelihood."""
    offsets = _values_by_joint("q", error.q, robot)
    for offset in dict.fromkeys(offsets[[joint.is_revolute for joint in robot.joints]].tolist()):
        if (size := turns(offset)) > 1 + ROUNDED:
            degrees = f"{offset:g} deg ({math.radians(offset):.4g} rad)"
            yield f"the initial position error of {offset:g} rad is {size:.2g} turns; did you mean {degrees}?"
