"""What a remedy has to satisfy, why a motion does not satisfy it, and a search for the smallest that does."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vsacli.actuators.limit_check import Excess, LimitCheck, OfJoint
from vsacli.actuators.reach import margin
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.errors import VsacliError
from vsacli.base.flags import LIMITS, Flag, has
from vsacli.base.units import STIFFNESS
from vsacli.dynamics.drive import Drive, drive
from vsacli.dynamics.inverse import command_of, compute_block, elastic_torques, usual_block
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory


class ImpossibleError(VsacliError):
    """No change of a kind mends a motion.

    Attributes:
        reasons: why, in clauses; one for each joint that cannot be mended.
    """

    def __init__(self, *reasons: str) -> None:
        super().__init__("; ".join(reasons))
        self.reasons = reasons


@dataclass(frozen=True)
class Acceptance:
    """When a step of a robot is accepted: a margin of at least `near_singular`, and every limit kept."""

    robot: Robot
    near_singular: float

    def refused(self, motion: Motion) -> BoolArray:
        """The steps that are not accepted, (samples, joints)."""
        block = compute_block(self.robot, motion, self.near_singular)
        return self._refused(block.flags, block.stiffness, block.stiffness_lower, block.stiffness_upper)

    def blocks(self, trajectory: Trajectory) -> Iterator[Motion]:
        """All steps of a trajectory, block by block."""
        samples = usual_block(len(self.robot.joints))
        for start in range(0, trajectory.samples, samples):
            yield trajectory.block(start, start + samples)

    def refused_joints(self, trajectory: Trajectory) -> BoolArray:
        """The joints with any step that is not accepted, (joints,)."""
        joints: BoolArray = np.any(
            [np.any(self.refused(motion), axis=0) for motion in self.blocks(trajectory)], axis=0
        )
        return joints

    def refused_commands(self, joint: Joint, command: Command) -> BoolArray:
        """The steps of one joint that are not accepted, (samples,)."""
        driven = drive(joint, command, self.near_singular)
        asked = command.commanded["stiffness"]
        return self._refused(driven.flags, asked, driven.stiffness_lower, driven.stiffness_upper)

    def position_reasons(self, trajectory: Trajectory) -> tuple[str, ...]:
        """For each joint the limit of its position that the motion exceeds, at whatever speed, if it does."""
        found: dict[str, str] = {}
        for motion in self.blocks(trajectory):
            for index, joint in enumerate(self.robot.joints):
                if reason := _limit_reason(joint, motion.time, {"q": motion.q[:, index]}):
                    found.setdefault(joint.name, reason)
        return tuple(found.values())

    def reasons(self, motion: Motion) -> tuple[str, ...]:
        """For each joint that is not accepted throughout, the worst that is wrong with it."""
        commanded = {**motion.variables(), **elastic_torques(self.robot, motion)}
        found = (
            self.reason(joint, motion.time, command_of(index, commanded))
            for index, joint in enumerate(self.robot.joints)
        )
        return tuple(reason for reason in found if reason)

    def reason(self, joint: Joint, time: FloatArray, command: Command) -> str:
        """The worst that is wrong with the steps of one joint, in a clause; empty if they are accepted."""
        driven = drive(joint, command, self.near_singular)
        computed = {**command.arrays(), **driven._asdict()}
        return self._reach_reason(joint, time, command, driven) or _limit_reason(joint, time, computed)

    def _refused(
        self, flags: FlagArray, stiffness: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> BoolArray:
        short = margin(stiffness, lower, upper) < self.near_singular
        refused: BoolArray = short | has(flags, Flag.INFEASIBLE | LIMITS)
        return refused

    def _reach_reason(self, joint: Joint, time: FloatArray, command: Command, driven: Drive) -> str:
        gap = margin(command.commanded["stiffness"], driven.stiffness_lower, driven.stiffness_upper)
        gap[np.isnan(gap)] = np.inf
        gap[has(driven.flags, Flag.INFEASIBLE) & np.isnan(driven.stiffness_lower)] = -np.inf
        step = int(gap.argmin())
        if gap[step] >= self.near_singular:
            return ""
        return _corridor_reason(
            joint,
            time[step],
            command.commanded["stiffness"][step],
            driven.stiffness_lower[step] / (1 - self.near_singular),
            driven.stiffness_upper[step] / (1 + self.near_singular),
        )


def path_reason(joint: Joint, time: FloatArray, command: Command) -> str:
    """A limit that the motion itself exceeds, whatever the stiffness, in a clause; empty if there is none."""
    return _limit_reason(joint, time, {"q": command.q, "dq": command.dq})


def _limit_reason(joint: Joint, time: FloatArray, computed: OfJoint) -> str:
    """The first kind of limit that is exceeded, of those on variables that were computed."""
    for check in limit_checks(joint):
        if check.variable in computed and (excess := check.worst(computed, check.flags(computed))):
            return _limit_text(joint, time[excess.step], check, excess)
    return ""


def stiffness_text(joint: Joint, value: float) -> str:
    """A stiffness with its unit."""
    return f"{value:.6g} {STIFFNESS.unit(joint.type)}"


def _corridor_reason(joint: Joint, time: float, asked: float, low: float, high: float) -> str:
    """A step whose stiffness is not between the smallest and the largest that would be accepted."""
    when = f"at t = {time:.3f} s"
    if math.isnan(low):
        whatever = "" if math.isnan(asked) else " at any stiffness"
        return f"the springs of {joint.name} cannot carry its elastic torque {when}{whatever}"
    side, bound = ("at least", low) if asked < low else ("at most", high)
    return f"{joint.name} needs {side} {stiffness_text(joint, bound)} {when} and is asked for {asked:.6g}"


def _limit_text(joint: Joint, time: float, check: LimitCheck, excess: Excess) -> str:
    """A step that exceeds a limit."""
    whose, side = check.flag.quantity_of(check.motor), "below" if excess.value < excess.bound else "above"
    asked = f"{excess.value:.6g} {check.unit(joint.type)} at t = {time:.3f} s"
    return f"the {whose} of {joint.name}, {asked}, is {side} its limit {excess.bound:g}"


class Candidates(Protocol):
    """Whole numbers that stand for changes of growing size, judged on a few watched steps or on all."""

    def stride(self, number: int) -> int:
        """How far a scan goes from a refused number, at least 1."""

    def accepts(self, number: int) -> bool:
        """Whether the change is accepted at the watched steps."""

    def confirms(self, number: int) -> bool:
        """Whether it is accepted at all steps; some of those that refuse it are watched from now on."""


def smallest_confirmed(candidates: Candidates, start: int, stop: int) -> int | None:
    """The smallest number from `start` to `stop` that scan, bisection and confirmation find; None if none."""
    number: int | None = start if start <= stop else None
    while number is not None:
        number = _smallest_accepted(candidates, number, stop)
        if number is not None and candidates.confirms(number):
            break
    return number


def _smallest_accepted(candidates: Candidates, start: int, stop: int) -> int | None:
    """Go up in strides to the first accepted number, then bisect down to the last refused one.

    Numbers between strides that are accepted while their neighbours are not may be missed.
    """
    refused, number = start - 1, start
    while not candidates.accepts(number):
        if number == stop:
            return None
        refused, number = number, min(number + candidates.stride(number), stop)
    while number - refused > 1:
        middle = (number + refused) // 2
        if candidates.accepts(middle):
            number = middle
        else:
            refused = middle
    return number
