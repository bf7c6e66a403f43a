"""What is suggested: data, JSON and sentences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

from vsacli.base.json_records import Published, named
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
    """Give the stiffness another profile.

    Attributes:
        changes: of the joints that are not fine.
        trajectory: the same motion with the new stiffness.
    """

    changes: tuple[JointChange, ...]
    trajectory: Trajectory = field(repr=False, compare=False)

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
class Suggestions(Published):
    """For each kind of change the smallest that makes a task possible, or why there is none.

    All are None where nothing needs to change.

    Attributes:
        near_singular: the margin that every step shall have.
    """

    near_singular: float
    slow_down: SlowDown | NotPossible | None = None
    stiffness_offset: StiffnessOffset | NotPossible | None = None
    stiffness_profile: StiffnessProfile | NotPossible | None = None

    KINDS: ClassVar = {
        "slow_down": "slow-down",
        "stiffness_offset": "constant change of stiffness",
        "stiffness_profile": "other course of stiffness",
    }

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        """One sentence for each kind, under a heading."""
        margin = f"a margin of at least {100 * self.near_singular:.6g} %"
        if self.slow_down is None:
            yield f"nothing to change: every step has {margin} and keeps every limit"
            return
        yield f"suggestions, with any one of which every step has {margin} and keeps every limit:"
        for kind, name in self.KINDS.items():
            found = getattr(self, kind)
            if isinstance(found, NotPossible):
                yield f"- no {name}: {'; '.join(found.reasons)}"
            else:
                yield f"- {found.sentence}"
