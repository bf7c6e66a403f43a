"""Fixes as data, JSON and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from vsacli.analysis.joint_report import JointReport, largest_of_motors
from vsacli.base.json_records import Published, named
from vsacli.base.texts import joined, significant
from vsacli.base.units import TORQUE
from vsacli.dynamics.limits import Finding
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

_OTHER_SPRINGS = (
    "to keep the commanded stiffness, change the springs: vsacli sensitivity ranks their parameters by their "
    "effect on the margin"
)


SIMILAR = 1.05
"""Ratio of sizes up to which the simpler of two fixes, or else the gentler one, is preferred."""

NOT_CONFIRMED = "a change within all limits at the samples exceeds one between them"
"""Reason why a fix that its samples accept is none."""


@dataclass(frozen=True)
class NotPossible(Published):
    """Reasons why a kind of change fixes nothing."""

    reasons: tuple[str, ...]

    possible: ClassVar = False
    shape: ClassVar = named("possible", "reasons")


@dataclass(frozen=True)
class SlowDown(Published):
    """A change that stretches position and stiffness together in time.

    Attributes:
        factor: ratio of the new duration to the commanded one, at least 1.
        duration: commanded time from the first to the last sample, s.
    """

    factor: float
    duration: float

    possible: ClassVar = True
    shape: ClassVar = {**named("possible", "factor"), "duration": "slower", "text": "sentence"}

    @property
    def sentence(self) -> str:
        """Advice as a sentence, without a full stop."""
        return f"slow down by a factor {self.factor:.4g} ({self.duration:.10g} s -> {self.slower:.10g} s)"

    @property
    def slower(self) -> float:
        """New duration, s."""
        return self.factor * self.duration


@dataclass(frozen=True)
class Offset:
    """A constant addition to the stiffness of a joint, N m/rad (N/m)."""

    joint: str
    value: float
    unit: str

    def __str__(self) -> str:
        return f"{self.joint} by {abs(self.value):.10g} {self.unit}"


@dataclass(frozen=True)
class StiffnessOffset(Published):
    """A constant addition to the stiffness of each joint; zero for joints that need none."""

    offsets: tuple[Offset, ...]

    possible: ClassVar = True
    shape: ClassVar = {"possible": "possible", "offsets": "by_joint", "text": "sentence"}

    @property
    def by_joint(self) -> dict[str, float]:
        """Constant of each joint, by name."""
        return {offset.joint: offset.value for offset in self.offsets}

    @property
    def sentence(self) -> str:
        """Advice as a sentence, without a full stop."""
        raised = ", ".join(str(offset) for offset in self.offsets if offset.value > 0)
        lowered = ", ".join(str(offset) for offset in self.offsets if offset.value < 0)
        clauses = {"raise": raised, "lower": lowered}
        return " and ".join(f"{verb} the stiffness of {joints}" for verb, joints in clauses.items() if joints)


@dataclass(frozen=True)
class JointChange(Published):
    """The change of the stiffness of a joint: largest value, its time, root mean square."""

    joint: str
    largest: float
    time: float
    rms: float
    unit: str

    shape: ClassVar = named("largest", "time", "rms")

    def __str__(self) -> str:
        size = (
            f"{'-' if self.largest < 0 else '+'}{significant(abs(self.largest), toward=math.inf)} {self.unit}"
        )
        return f"{self.joint} by up to {size} (at t = {self.time:.3f} s)"


@dataclass(frozen=True)
class StiffnessProfile(Published):
    """Another stiffness profile for each joint that needs one."""

    changes: tuple[JointChange, ...]

    possible: ClassVar = True
    shape: ClassVar = {"possible": "possible", "changes": "by_joint", "text": "sentence"}

    @property
    def by_joint(self) -> dict[str, JointChange]:
        """Change of each joint, by name."""
        return {change.joint: change for change in self.changes}

    @property
    def sentence(self) -> str:
        """Advice as a sentence, without a full stop."""
        return f"reshape the stiffness of {', '.join(map(str, self.changes))}"


@dataclass(frozen=True)
class StiffnessFactor(Published):
    """A factor on the stiffness of joints that move a tool, or are coupled with these."""

    factor: float
    joints: tuple[str, ...]

    def __str__(self) -> str:
        return f"{joined(self.joints)} by {self.factor:.4g}"


@dataclass(frozen=True)
class StifferTools(Published):
    """A factor for each set of joints on which the stiffness of tools that are too soft depends."""

    factors: tuple[StiffnessFactor, ...]

    possible: ClassVar = True
    shape: ClassVar = {**named("possible", "factors"), "text": "sentence"}

    @property
    def sentence(self) -> str:
        """Advice as a sentence, without a full stop."""
        return f"multiply the stiffness of {', '.join(map(str, self.factors))}"


@dataclass(frozen=True)
class LongerTransition(Published):
    """A longer transition between stiffness levels, s; each transition begins when it did before."""

    before: float
    after: float

    possible: ClassVar = True
    shape: ClassVar = {**named("possible", "before", "after"), "text": "sentence"}

    @property
    def sentence(self) -> str:
        """Advice as a sentence, without a full stop."""
        return f"lengthen the transitions of the stiffness from {self.before:.10g} s to {self.after:.10g} s"


@dataclass(frozen=True)
class OtherBranch(Published):
    """A change to the other branch; the new branches are given by joint name."""

    branches: Mapping[str, str]

    shape: ClassVar = {"branches": "branches", "text": "sentence"}

    @property
    def sentence(self) -> str:
        """Advice as a sentence, without a full stop."""
        return "change the branch of " + ", ".join(f"{joint} to {to}" for joint, to in self.branches.items())


def branch_path(robot: Robot, index: int) -> str:
    """Return the path of a joint's branch in the robot file."""
    return f"joints.{index}.actuator.{robot.joints[index].actuator.branch_field}"


@dataclass(frozen=True)
class Fix(Published):
    """A fix: changes that together make a task feasible, confirmed by a run over all samples.

    Attributes:
        size: root of the sum of the squares of all relative changes: the factor of the slow-down less 1, and
            for each joint the rms change of its stiffness over its rms stiffness.
        robot: robot with the new branches.
        declared: trajectory with the changes, except for a slow-down that follows a fit.
        factor: factor of that slow-down; 1 if `declared` is stretched already, see `Task`.
        asked: trajectory without the changes.
        joints: findings at each joint of the run that confirmed it.
    """

    size: float
    robot: Robot = field(repr=False, compare=False)
    declared: Trajectory = field(repr=False, compare=False)
    factor: float = field(default=1.0, repr=False, compare=False, kw_only=True)
    asked: Trajectory | None = field(default=None, repr=False, compare=False, kw_only=True)
    joints: Sequence[JointReport] = field(default=(), repr=False, compare=False, kw_only=True)
    slow_down: SlowDown | None = None
    stiffness_offset: StiffnessOffset | None = None
    transition: LongerTransition | None = None
    stiffness_profile: StiffnessProfile | None = None
    branch: OtherBranch | None = None
    stiffness_factor: StifferTools | None = None

    PARTS: ClassVar = (
        *("slow_down", "branch", "transition"),
        *("stiffness_offset", "stiffness_profile", "stiffness_factor"),
    )
    shape: ClassVar = {**named("size", "motors"), **{f"{part}?": part for part in PARTS}, "text": "sentence"}

    @property
    def trajectory(self) -> Trajectory:
        """Trajectory with all changes."""
        return self.declared if self.factor == 1 else self.declared.stretched(self.factor)

    @property
    def longer(self) -> float:
        """Growth of the duration, relative to the commanded duration."""
        return 0.0 if self.slow_down is None else self.slow_down.factor - 1

    @property
    def motors(self) -> dict[str, dict[str, tuple[float, float]]]:
        """Peak torque and initial torque discontinuity of both motors, by name of the joint."""
        return {
            joint.name: {
                "peak_tau_motor": joint.peak_tau_motor,
                "torque_discontinuity": joint.torque_discontinuity,
            }
            for joint in self.joints
        }

    @property
    def gentleness(self) -> tuple[float, ...]:
        """Largest peak torque of a motor, and largest initial discontinuity; the smaller, the gentler."""
        return tuple(value for value, _ in filter(None, self._largest_torques.values()))

    @property
    def _largest_torques(self) -> dict[str, tuple[float, JointReport] | None]:
        """Largest torques of the run of the fix by their names, with their joints."""
        return {
            "peak motor torque": largest_of_motors(self.joints, lambda joint: joint.peak_tau_motor),
            "initial torque discontinuity": largest_of_motors(
                self.joints, lambda joint: joint.torque_discontinuity
            ),
        }

    @property
    def torques(self) -> str:
        """Largest torques of the run of the fix, in words."""
        return ", ".join(
            f"{name} {significant(largest[0])} {TORQUE.unit(largest[1].type)} ({largest[1].name})"
            for name, largest in self._largest_torques.items()
            if largest is not None
        )

    @property
    def stiffens(self) -> bool:
        """Whether the stiffness of a joint increases."""
        offsets = self.stiffness_offset.offsets if self.stiffness_offset else ()
        changes = self.stiffness_profile.changes if self.stiffness_profile else ()
        return any(each.value > 0 for each in offsets) or any(each.largest > 0 for each in changes)

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of change in the fix; a profile includes a constant, which it generalizes."""
        kinds = {part for part in self.PARTS if getattr(self, part) is not None}
        return frozenset(kinds | ({"stiffness_offset"} if self.stiffness_profile else set()))

    @property
    def sentence(self) -> str:
        """Advice as a sentence, without a full stop."""
        parts = [getattr(self, part) for part in self.PARTS]
        return ", and ".join(part.sentence for part in parts if part is not None)


def in_order(fixes: Iterable[Fix]) -> Iterator[Fix]:
    """Yield the smallest fix first, or the gentlest of about its size; another branch comes last."""
    rest = sorted(fixes, key=lambda fix: (fix.branch is not None, fix.size))
    while rest:
        (branch, size), gentlest = (rest[0].branch, rest[0].size), rest[0]
        for fix in rest:
            if (fix.branch is None) == (branch is None) and fix.size <= SIMILAR * size:
                gentlest = min(gentlest, fix, key=lambda each: each.gentleness)
        rest.remove(gentlest)
        yield gentlest


@dataclass(frozen=True)
class Fixes(Published):
    """The fixes of a task: the smallest change of each kind alone, and combinations.

    Each kind is the change, the reasons why none suffices, or None if nothing needs to change or the
    stiffness has no transitions.

    Attributes:
        min_margin: margin required of every sample.
        causes: reason why each refused joint is refused.
        fixes: fixes to choose from, the smallest first; those with another branch come last.
    """

    min_margin: float
    slow_down: SlowDown | NotPossible | None = None
    stiffness_offset: StiffnessOffset | NotPossible | None = None
    stiffness_profile: StiffnessProfile | NotPossible | None = None
    transition: LongerTransition | NotPossible | None = None
    stiffness_factor: StifferTools | NotPossible | None = None
    causes: tuple[Finding, ...] = ()
    fixes: tuple[Fix, ...] = ()

    shape: ClassVar = {
        **named("min_margin", "slow_down", "stiffness_offset", "stiffness_profile", "transition"),
        "stiffness_factor?": "stiffness_factor",
        "causes": "published_causes",
        "fixes": "fixes",
    }

    @property
    def needed(self) -> bool:
        """Whether anything needs to change."""
        return self.slow_down is not None or self.stiffness_factor is not None

    @property
    def published_causes(self) -> list[dict[str, Any]]:
        """JSON values of the causes, with their words."""
        return [
            {"joint": cause.joint or None, "text": cause.text, "fixable": cause.fixable, "kind": cause.kind}
            | cause.as_json()
            for cause in self.causes
        ]

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        """Yield the causes, a heading, and a numbered sentence for each fix."""
        margin = f"a margin of at least {100 * self.min_margin:.6g} %"
        if not self.needed:
            yield f"nothing to change: every sample has {margin} and is within all limits"
            return
        yield from map(str, self.causes)
        left = [cause.tool or cause.joint for cause in self.causes if not cause.fixable]
        members = "joints and tools" if any(cause.tool for cause in self.causes) else "joints"
        but = f" of all {members} but {joined(left)}" if left and self.fixes else ""
        if self.fixes:
            yield f"fixes; with any of them every sample{but} has {margin} and is within all limits:"
        else:
            yield f"no fix that was tried gives every sample {margin} within all limits"
        for number, fix in enumerate(self.fixes, 1):
            yield f"{number}. {fix.sentence}"
            yield f"   {fix.torques}"
        if any(fix.stiffens for fix in self.fixes):
            yield _OTHER_SPRINGS
