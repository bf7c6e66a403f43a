"""What a remedy has to satisfy, why a motion does not satisfy it, and a search for the smallest that does."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from vsacli.actuators.limit_check import Excess, LimitCheck, OfJoint
from vsacli.actuators.reach import margin
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import VsacliError
from vsacli.base.flags import LIMITS, Flag, has
from vsacli.base.units import STIFFNESS
from vsacli.dynamics.drive import drive
from vsacli.dynamics.inverse import compute_block, usual_block
from vsacli.dynamics.limits import limit_checks, limit_flags
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.remedies.motions import Instants, Load, Passage
from vsacli.studies.remedies.recorded_limits import RecordedLimits
from vsacli.trajectory.trajectory import Trajectory

RESERVED = ("dq", "dtheta", "tau_motor", "current", "voltage")
"""Variables that may be beyond a limit between steps that keep it, and that a search can keep clear of it."""


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
    """When a step of a robot is accepted: a margin of at least `near_singular`, and every limit kept.

    Attributes:
        robot: the robot.
        near_singular: the margin.
        recorded: how limits are judged if the task was recorded.
        reserve: share of each limit of `RESERVED` that is kept clear of.
    """

    robot: Robot
    near_singular: float
    recorded: RecordedLimits | None = None
    reserve: float = 0.0

    def stricter(self, share: float) -> Acceptance:
        """The same with a margin that is larger by a share, which is kept clear of limits as well."""
        return replace(self, near_singular=(1 + share) * self.near_singular, reserve=share)

    def refused(self, passage: Passage) -> BoolArray:
        """The steps that are not accepted, (samples, joints)."""
        block = compute_block(self.robot, passage.motion, self.near_singular)
        values = map(block.of_joint, range(len(self.robot.joints)))
        by_joint = [
            self._refused(joint, of_joint, passage.instants)
            for joint, of_joint in zip(self.robot.joints, values, strict=True)
        ]
        return np.stack(by_joint, axis=1)

    def passages(self, trajectory: Trajectory, factor: float = 1.0) -> Iterator[Passage]:
        """All steps of a task, or of one that was stretched by a factor, block by block."""
        samples = usual_block(len(self.robot.joints))
        for start in range(0, trajectory.samples, samples):
            yield Passage.of(trajectory, start, start + samples, factor)

    def refused_joints(self, trajectory: Trajectory, factor: float = 1.0) -> BoolArray:
        """The joints with any step that is not accepted, (joints,)."""
        joints: BoolArray = np.any(
            [np.any(self.refused(passage), axis=0) for passage in self.passages(trajectory, factor)], axis=0
        )
        return joints

    def refused_steps(self, joint: Joint, load: Load) -> BoolArray:
        """The steps of one joint that are not accepted, (samples,)."""
        return self._refused(joint, self._driven(joint, load), load.instants)

    def position_reasons(self, trajectory: Trajectory) -> tuple[str, ...]:
        """For each joint the limit of its position that the motion exceeds, at whatever speed, if it does."""
        found: dict[str, str] = {}
        for passage in self.passages(trajectory):
            for index, joint in enumerate(self.robot.joints):
                values = {"q": passage.motion.q[:, index]}
                if reason := self._limit_reason(joint, values, passage.motion.time, passage.instants):
                    found.setdefault(joint.name, reason)
        return tuple(found.values())

    def reasons(self, passage: Passage) -> tuple[str, ...]:
        """For each joint that is not accepted throughout, the worst that is wrong with it."""
        loads = passage.loads(self.robot)
        found = (self.reason(joint, load) for joint, load in zip(self.robot.joints, loads, strict=True))
        return tuple(reason for reason in found if reason)

    def reason(self, joint: Joint, load: Load) -> str:
        """The worst that is wrong with the steps of one joint, in a clause; empty if they are accepted."""
        values = self._driven(joint, load)
        limit_reason = self._limit_reason(joint, values, load.time, load.instants)
        return self._reach_reason(joint, load, values) or limit_reason

    def path_reason(self, joint: Joint, load: Load) -> str:
        """A limit that the motion itself exceeds, whatever the stiffness, in a clause; empty if none."""
        values = {"q": load.command.q, "dq": load.command.dq}
        return self._limit_reason(joint, values, load.time, load.instants)

    def _driven(self, joint: Joint, load: Load) -> OfJoint:
        """All variables of one joint, by name."""
        return {**load.command.arrays(), **drive(joint, load.command, self.near_singular).arrays()}

    def _refused(self, joint: Joint, values: OfJoint, instants: Instants) -> BoolArray:
        short = margin(values["stiffness"], values["stiffness_lower"], values["stiffness_upper"])
        flags = values["flags"]
        if self.recorded is not None:
            flags = self.recorded.flags(self.robot, joint, values, instants)
        refused: BoolArray = (short < self.near_singular) | has(flags, Flag.INFEASIBLE | LIMITS)
        return refused | self._near_limits(joint, values)

    def _near_limits(self, joint: Joint, values: OfJoint) -> BoolArray:
        """The steps at which a reserve is used up, (samples,)."""
        near = np.zeros(len(values["flags"]), dtype=np.bool_)
        for check in limit_checks(joint) if self.reserve else ():
            if check.variable in RESERVED:
                near |= check.clearance(values) < self.reserve
        return near

    def _reach_reason(self, joint: Joint, load: Load, values: OfJoint) -> str:
        asked = load.command.commanded["stiffness"]
        lower, upper = values["stiffness_lower"], values["stiffness_upper"]
        gap = margin(asked, lower, upper)
        gap[np.isnan(gap)] = np.inf
        gap[has(values["flags"], Flag.INFEASIBLE) & np.isnan(lower)] = -np.inf
        step = int(gap.argmin())
        if gap[step] >= self.near_singular:
            return ""
        return _corridor_reason(
            joint,
            load.time[step],
            asked[step],
            lower[step] / (1 - self.near_singular),
            upper[step] / (1 + self.near_singular),
        )

    def _limit_reason(self, joint: Joint, values: OfJoint, time: FloatArray, instants: Instants) -> str:
        """The first kind of limit that is exceeded, of those on variables that were computed."""
        flags = limit_flags(joint, values, np.zeros(len(time), dtype=np.uint16))
        if self.recorded is not None:
            flags = self.recorded.flags(self.robot, joint, {**values, "flags": flags}, instants)
        for check in limit_checks(joint):
            if check.variable in values and (excess := check.worst(values, flags)):
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
