"""Suggested fixes as data, JSON and sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from vsacli.base.json_records import Published, named
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class NotPossible(Published):
    """There is no suggestion of a kind, and why."""

    reasons: tuple[str, ...]

    possible: ClassVar = False
    shape: ClassVar = named("possible", "reasons")


@dataclass(frozen=True)
class SlowDown(Published):
    """Stretch position and stiffness together in time.

    Attributes:
        factor: at least 1.
        duration: from the first to the last step as commanded, s.
    """

    factor: float
    duration: float

    possible: ClassVar = True
    shape: ClassVar = {**named("possible", "factor"), "duration": "slower", "text": "sentence"}

    @property
    def sentence(self) -> str:
        """Return the advice, without a full stop."""
        return f"slow down by a factor {self.factor:.4g} ({self.duration:.10g} s -> {self.slower:.10g} s)"

    @property
    def slower(self) -> float:
        """The new duration, s."""
        return self.factor * self.duration


@dataclass(frozen=True)
class Offset:
    """Add a constant to the stiffness of a joint, N m/rad (N/m)."""

    joint: str
    value: float
    unit: str

    def __str__(self) -> str:
        return f"{self.joint} by {abs(self.value):.10g} {self.unit}"


@dataclass(frozen=True)
class StiffnessOffset(Published):
    """Add a constant to the stiffness of each joint; joints that are fine get zero."""

    offsets: tuple[Offset, ...]

    possible: ClassVar = True
    shape: ClassVar = {"possible": "possible", "offsets": "by_joint", "text": "sentence"}

    @property
    def by_joint(self) -> dict[str, float]:
        """The constant of each joint."""
        return {offset.joint: offset.value for offset in self.offsets}

    @property
    def sentence(self) -> str:
        """Return the advice, without a full stop."""
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
        return f"{self.joint} by up to {self.largest:+.4g} {self.unit} (at t = {self.time:.3f} s)"


@dataclass(frozen=True)
class StiffnessProfile(Published):
    """Give the stiffness of the joints that are not fine another profile."""

    changes: tuple[JointChange, ...]

    possible: ClassVar = True
    shape: ClassVar = {"possible": "possible", "changes": "by_joint", "text": "sentence"}

    @property
    def by_joint(self) -> dict[str, JointChange]:
        """The change of each joint."""
        return {change.joint: change for change in self.changes}

    @property
    def sentence(self) -> str:
        """Return the advice, without a full stop."""
        return f"reshape the stiffness of {', '.join(map(str, self.changes))}"


@dataclass(frozen=True)
class LongerTransition(Published):
    """Give the stiffness more time to go from level to level, s; each change begins when it did."""

    before: float
    after: float

    possible: ClassVar = True
    shape: ClassVar = {**named("possible", "before", "after"), "text": "sentence"}

    @property
    def sentence(self) -> str:
        """Return the advice, without a full stop."""
        return f"lengthen the transitions of the stiffness from {self.before:.10g} s to {self.after:.10g} s"


@dataclass(frozen=True)
class OtherPreload(Published):
    """Take the other preload: the new one, by joint."""

    preloads: Mapping[str, str]

    shape: ClassVar = {"preloads": "preloads", "text": "sentence"}

    @property
    def sentence(self) -> str:
        """Return the advice, without a full stop."""
        return "change the preload of " + ", ".join(f"{joint} to {to}" for joint, to in self.preloads.items())


@dataclass(frozen=True)
class Remedy(Published):
    """Changes that together make a task possible, as a whole run has confirmed.

    Attributes:
        size: root of the sum of the squares of all relative changes: the factor of the slow-down less 1, and
            of each joint the root mean square of its change of stiffness over that of its stiffness.
        robot: with another preload, if that is among the changes.
        declared: the trajectory with the changes, but for the factor by which it is passed more slowly.
        factor: this factor; formulas are stretched already, see `Task`.
        asked: the trajectory without the changes.
    """

    size: float
    robot: Robot = field(repr=False, compare=False)
    declared: Trajectory = field(repr=False, compare=False)
    factor: float = field(default=1.0, repr=False, compare=False, kw_only=True)
    asked: Trajectory | None = field(default=None, repr=False, compare=False, kw_only=True)
    slow_down: SlowDown | None = None
    stiffness_offset: StiffnessOffset | None = None
    transition: LongerTransition | None = None
    stiffness_profile: StiffnessProfile | None = None
    preload: OtherPreload | None = None

    PARTS: ClassVar = ("slow_down", "preload", "transition", "stiffness_offset", "stiffness_profile")
    shape: ClassVar = {"size": "size", **{f"{part}?": part for part in PARTS}, "text": "sentence"}

    @property
    def trajectory(self) -> Trajectory:
        """Trajectory of the task."""
        return self.declared if self.factor == 1 else self.declared.stretched(self.factor)

    @property
    def longer(self) -> float:
        """Growth of the duration, relative to it."""
        return 0.0 if self.slow_down is None else self.slow_down.factor - 1

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of change it takes; a profile is a more general constant."""
        kinds = {part for part in self.PARTS if getattr(self, part) is not None}
        return frozenset(kinds | ({"stiffness_offset"} if self.stiffness_profile else set()))

    @property
    def sentence(self) -> str:
        """Return the advice, without a full stop."""
        parts = [getattr(self, part) for part in self.PARTS]
        return ", and ".join(part.sentence for part in parts if part is not None)


@dataclass(frozen=True)
class Cause(Published):
    """Why a joint keeps a task from being possible.

    Attributes:
        joint: its name.
        text: the trouble, and whether a change helps at rest, in a clause.
        fixable: whether anything that was tried helps.
    """

    joint: str
    text: str
    fixable: bool = True

    def __str__(self) -> str:
        return f"{self.joint}: {self.text}"


@dataclass(frozen=True)
class Suggestions(Published):
    """The fixes of a task: each kind of change on its own, and combinations.

    Each kind is the smallest change that does, or why there is none; None where nothing needs to change, and
    where the stiffness has no transitions.

    Attributes:
        near_singular: the margin that every step shall have.
        causes: why each joint that falls short does.
        remedies: the choices, the smallest first, those with another preload last.
    """

    near_singular: float
    slow_down: SlowDown | NotPossible | None = None
    stiffness_offset: StiffnessOffset | NotPossible | None = None
    stiffness_profile: StiffnessProfile | NotPossible | None = None
    transition: LongerTransition | NotPossible | None = None
    causes: tuple[Cause, ...] = ()
    remedies: tuple[Remedy, ...] = ()

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        """Yield a numbered sentence for each fix under a heading, and why single kinds are not enough."""
        margin = f"a margin of at least {100 * self.near_singular:.6g} %"
        if self.slow_down is None:
            yield f"nothing to change: every step has {margin} and keeps every limit"
            return
        yield from map(str, self.causes)
        left = [cause.joint for cause in self.causes if not cause.fixable]
        rest = f"every step of all joints but {and_joined(left)}" if left and self.remedies else "every step"
        if self.remedies:
            yield f"suggestions, with any one of which {rest} has {margin} and keeps every limit:"
        else:
            yield f"nothing that was tried gives {rest} {margin} and keeps every limit"
        yield from (f"{number}. {remedy.sentence}" for number, remedy in enumerate(self.remedies, 1))


def and_joined(names: Sequence[str]) -> str:
    """Names in a sentence."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
