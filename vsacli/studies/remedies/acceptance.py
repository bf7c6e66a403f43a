"""What a remedy has to satisfy, why a motion does not satisfy it, and a search for the smallest that does."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

import numpy as np

from vsacli.actuators.limit_check import OfJoint
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
from vsacli.studies.remedies.motions import Instants, Load, Passage, evenly_chosen, joined
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
        ignored: joints that do not count, by index.
        between: instants between the steps that count as well, since the start of the task as it is, s.
    """

    robot: Robot
    near_singular: float
    recorded: RecordedLimits | None = None
    reserve: float = 0.0
    ignored: frozenset[int] = frozenset()
    between: FloatArray = field(default_factory=lambda: np.empty(0), compare=False)

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
        refused = np.stack(by_joint, axis=1)
        refused[:, list(self.ignored)] = False
        return refused

    def passages(self, trajectory: Trajectory, factor: float = 1.0) -> Iterator[Passage]:
        """All steps of a task, or of one that was stretched by a factor, in blocks; then what is between."""
        samples = usual_block(len(self.robot.joints))
        for start in range(0, trajectory.samples, samples):
            yield Passage.of(trajectory, start, start + samples, factor)
        if self.between.size:
            yield Passage.between(trajectory, self.between, factor)

    def watched(self, trajectory: Trajectory, steps: int) -> Passage:
        """At most so many steps of a task, and the instants between the steps that count."""
        passages = [evenly_chosen(trajectory, steps)]
        if self.between.size:
            passages.append(Passage.between(trajectory, self.between))
        return joined(passages)

    def refused_joints(self, trajectory: Trajectory, factor: float = 1.0) -> BoolArray:
        """The joints with any step that is not accepted, (joints,)."""
        joints: BoolArray = np.any(
            [np.any(self.refused(passage), axis=0) for passage in self.passages(trajectory, factor)], axis=0
        )
        return joints

    def refused_steps(self, joint: Joint, load: Load) -> BoolArray:
        """The steps of one joint that are not accepted, (samples,)."""
        return self._refused(joint, self._driven(joint, load), load.instants)

    def beyond_position(self, trajectory: Trajectory) -> dict[int, Trouble]:
        """For each joint, by index, how it exceeds a limit of its position, at whatever speed, if it does."""
        found: dict[int, Trouble] = {}
        for passage in self.passages(trajectory):
            for index, joint in enumerate(self.robot.joints):
                values = {"q": passage.motion.q[:, index]}
                trouble = self._limit_trouble(joint, values, passage.motion.time, passage.instants)
                if trouble is not None:
                    found.setdefault(index, trouble)
        return found

    def reasons(self, passage: Passage) -> tuple[str, ...]:
        """For each joint that is not accepted throughout, the worst that is wrong with it."""
        joints = enumerate(zip(self.robot.joints, passage.loads(self.robot), strict=True))
        found = (self.reason(*pair) for index, pair in joints if index not in self.ignored)
        return tuple(reason for reason in found if reason)

    def trouble(self, joint: Joint, load: Load) -> Trouble | None:
        """The worst that is wrong with the steps of one joint; None if they are accepted."""
        values = self._driven(joint, load)
        of_limits = self._limit_trouble(joint, values, load.time, load.instants)
        return self._reach_trouble(joint, load, values) or of_limits

    def reason(self, joint: Joint, load: Load) -> str:
        """The same in a clause; empty if they are accepted."""
        trouble = self.trouble(joint, load)
        return "" if trouble is None else trouble.clause(joint)

    def path_reason(self, joint: Joint, load: Load) -> str:
        """A limit that the motion itself exceeds, whatever the stiffness, in a clause; empty if none."""
        values = {"q": load.command.q, "dq": load.command.dq}
        trouble = self._limit_trouble(joint, values, load.time, load.instants)
        return "" if trouble is None else trouble.clause(joint)

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

    def _reach_trouble(self, joint: Joint, load: Load, values: OfJoint) -> Trouble | None:
        asked = load.command.commanded["stiffness"]
        lower, upper = values["stiffness_lower"], values["stiffness_upper"]
        gap = margin(asked, lower, upper)
        gap[np.isnan(gap)] = np.inf
        gap[has(values["flags"], Flag.INFEASIBLE) & np.isnan(lower)] = -np.inf
        step = int(gap.argmin())
        if gap[step] >= self.near_singular:
            return None
        low, high = lower[step] / (1 - self.near_singular), upper[step] / (1 + self.near_singular)
        bound = low if math.isnan(low) or asked[step] < low else high
        unit = STIFFNESS.unit(joint.type)
        return Trouble("stiffness", "stiffness", load.time[step], asked[step], bound, unit, of_load=True)

    def _limit_trouble(
        self, joint: Joint, values: OfJoint, time: FloatArray, instants: Instants
    ) -> Trouble | None:
        """The first kind of limit that is exceeded, of those on variables that were computed."""
        flags = limit_flags(joint, values, np.zeros(len(time), dtype=np.uint16))
        if self.recorded is not None:
            flags = self.recorded.flags(self.robot, joint, {**values, "flags": flags}, instants)
        for check in limit_checks(joint):
            if check.variable in values and (excess := check.worst(values, flags)):
                whose, unit = check.flag.quantity_of(check.motor), check.unit(joint.type)
                return Trouble(check.variable, whose, time[excess.step], excess.value, excess.bound, unit)
        return None


class Trouble(NamedTuple):
    """The worst step at which a joint is not accepted.

    Attributes:
        variable: what is beyond a bound, by its name in results.
        whose: the same in words.
        time: when, s.
        value: of the variable there.
        bound: that it is beyond; NaN if no stiffness carries the elastic torque.
        unit: of both.
        of_load: whether the bound follows from the load, else it is a limit of the robot.
    """

    variable: str
    whose: str
    time: float
    value: float
    bound: float
    unit: str
    of_load: bool = False

    def clause(self, joint: Joint) -> str:
        """What is wrong, and with which joint."""
        when = f"at t = {self.time:.3f} s"
        if math.isnan(self.bound):
            whatever = "" if math.isnan(self.value) else " at any stiffness"
            return f"the springs of {joint.name} cannot carry its elastic torque {when}{whatever}"
        below = self.value < self.bound
        if self.variable == "stiffness":
            needed = f"{'at least' if below else 'at most'} {stiffness_text(joint, self.bound)}"
            return f"{joint.name} needs {needed} {when} and is asked for {self.value:.6g}"
        asked = f"{self.value:.6g} {self.unit} {when}"
        side = "below" if below else "above"
        return f"the {self.whose} of {joint.name}, {asked}, is {side} its limit {self.bound:g}"


def stiffness_text(joint: Joint, value: float) -> str:
    """A stiffness with its unit."""
    return f"{value:.6g} {STIFFNESS.unit(joint.type)}"


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
