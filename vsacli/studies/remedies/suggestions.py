"""What is suggested: data, JSON and sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
        """What to do, without a full stop."""
        return f"slow down by a factor {self.factor:.10g} ({self.duration:.10g} s -> {self.slower:.10g} s)"

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
        """What to do, without a full stop."""
        raised = ", ".join(str(offset) for offset in self.offsets if offset.value > 0)
        lowered = ", ".join(str(offset) for offset in self.offsets if offset.value < 0)
        clauses = {"raise": raised, "lower": lowered}
        return " and ".join(f"{verb} the stiffness of {joints}" for verb, joints in clauses.items() if joints)


@dataclass(frozen=True)
class JointChange(Published):
    """How far the stiffness of a joint moves: the largest change and when, and the root mean square."""

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
        """What to do, without a full stop."""
        return f"reshape the stiffness of {', '.join(map(str, self.changes))}"


@dataclass(frozen=True)
class OtherPreload(Published):
    """Take the other preload: what it becomes, by joint."""

    preloads: Mapping[str, str]

    shape: ClassVar = {"preloads": "preloads", "text": "sentence"}

    @property
    def sentence(self) -> str:
        """What to do, without a full stop."""
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
    """

    size: float
    robot: Robot = field(repr=False, compare=False)
    declared: Trajectory = field(repr=False, compare=False)
    factor: float = field(default=1.0, repr=False, compare=False, kw_only=True)
    slow_down: SlowDown | None = None
    stiffness_offset: StiffnessOffset | None = None
    stiffness_profile: StiffnessProfile | None = None
    preload: OtherPreload | None = None

    PARTS: ClassVar = ("slow_down", "preload", "stiffness_offset", "stiffness_profile")
    shape: ClassVar = {"size": "size", **{f"{part}?": part for part in PARTS}, "text": "sentence"}

    @property
    def trajectory(self) -> Trajectory:
        """What the robot is to do."""
        return self.declared if self.factor == 1 else self.declared.stretched(self.factor)

    @property
    def longer(self) -> float:
        """Growth of the duration, relative to it."""
        return 0.0 if self.slow_down is None else self.slow_down.factor - 1

    @property
    def kinds(self) -> frozenset[str]:
        """Which kinds of change it takes; a profile is a more general constant."""
        kinds = {part for part in self.PARTS if getattr(self, part) is not None}
        return frozenset(kinds | ({"stiffness_offset"} if self.stiffness_profile else set()))

    @property
    def sentence(self) -> str:
        """What to do, without a full stop."""
        parts = [getattr(self, part) for part in self.PARTS]
        return ", and ".join(part.sentence for part in parts if part is not None)


@dataclass(frozen=True)
class Suggestions(Published):
    """What makes a task possible: each kind of change by itself, and combinations.

    Each kind is the smallest change that does, or why there is none; None where nothing needs to change.

    Attributes:
        near_singular: the margin that every step shall have.
        remedies: what to choose from, the smallest first, those with another preload last.
    """

    near_singular: float
    slow_down: SlowDown | NotPossible | None = None
    stiffness_offset: StiffnessOffset | NotPossible | None = None
    stiffness_profile: StiffnessProfile | NotPossible | None = None
    remedies: tuple[Remedy, ...] = ()

    KINDS: ClassVar = {
        "slow_down": "slow-down",
        "stiffness_offset": "constant change of stiffness",
        "stiffness_profile": "other course of stiffness",
    }

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        """A numbered sentence for each remedy under a heading, and why kinds do not do by themselves."""
        margin = f"a margin of at least {100 * self.near_singular:.6g} %"
        if self.slow_down is None:
            yield f"nothing to change: every step has {margin} and keeps every limit"
            return
        if self.remedies:
            yield f"suggestions, with any one of which every step has {margin} and keeps every limit:"
        else:
            yield f"nothing that was tried gives every step {margin} and keeps every limit:"
        yield from (f"{number}. {remedy.sentence}" for number, remedy in enumerate(self.remedies, 1))
        yield from self._reasons()

    def _reasons(self) -> Iterator[str]:
        """Why kinds of change do not do by themselves, in one sentence if it is the same for all."""
        found = {name: getattr(self, kind) for kind, name in self.KINDS.items()}
        impossible = {name: each.reasons for name, each in found.items() if isinstance(each, NotPossible)}
        if len(impossible) == len(found) and len(set(impossible.values())) == 1:
            yield f"- another motion is needed: {'; '.join(impossible.popitem()[1])}"
        else:
            yield from (f"- no {name} alone: {'; '.join(reasons)}" for name, reasons in impossible.items())
