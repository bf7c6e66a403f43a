"""What is suggested, as plain data, JSON and sentences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class NotPossible:
    """There is no suggestion of a kind, and why."""

    reasons: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """JSON values."""
        return {"possible": False, "reasons": list(self.reasons)}


@dataclass(frozen=True)
class SlowDown:
    """Stretch position and stiffness together in time.

    Attributes:
        factor: at least 1.
        duration: from the first to the last step as commanded, s.
    """

    factor: float
    duration: float

    def as_json(self) -> dict[str, Any]:
        """JSON values; the duration is the new one."""
        return {"possible": True, "factor": self.factor, "duration": self._slower, "text": self.sentence}

    @property
    def sentence(self) -> str:
        """What to do."""
        return f"slow down by a factor {self.factor:.10g} ({self.duration:.10g} s -> {self._slower:.10g} s)"

    @property
    def _slower(self) -> float:
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
class StiffnessOffset:
    """Add a constant to the stiffness of each joint; joints that are fine get zero."""

    offsets: tuple[Offset, ...]

    def as_json(self) -> dict[str, Any]:
        """JSON values."""
        values = {offset.joint: offset.value for offset in self.offsets}
        return {"possible": True, "offsets": values, "text": self.sentence}

    @property
    def sentence(self) -> str:
        """What to do."""
        raised = ", ".join(str(offset) for offset in self.offsets if offset.value > 0)
        lowered = ", ".join(str(offset) for offset in self.offsets if offset.value < 0)
        clauses = {"raise": raised, "lower": lowered}
        return " and ".join(f"{verb} the stiffness of {joints}" for verb, joints in clauses.items() if joints)


@dataclass(frozen=True)
class JointChange:
    """How far the stiffness of a joint moves: the largest change and when, and the root mean square."""

    joint: str
    largest: float
    time: float
    rms: float
    unit: str

    def __str__(self) -> str:
        return f"{self.joint} by up to {self.largest:+.4g} {self.unit} (at t = {self.time:.3f} s)"


@dataclass(frozen=True)
class StiffnessProfile:
    """Give the stiffness another profile.

    Attributes:
        changes: of the joints that are not fine.
        trajectory: the same motion with the new stiffness.
    """

    changes: tuple[JointChange, ...]
    trajectory: Trajectory = field(repr=False, compare=False)

    def as_json(self) -> dict[str, Any]:
        """JSON values."""
        changes = {
            change.joint: {"largest": change.largest, "time": change.time, "rms": change.rms}
            for change in self.changes
        }
        return {"possible": True, "changes": changes, "text": self.sentence}

    @property
    def sentence(self) -> str:
        """What to do."""
        return f"reshape the stiffness of {', '.join(map(str, self.changes))}"


@dataclass(frozen=True)
class Suggestions:
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

    def as_json(self) -> dict[str, Any]:
        """JSON values; a kind is null where nothing needs to change."""
        kinds = {kind: getattr(self, kind) for kind in self.KINDS}
        return {
            "near_singular": self.near_singular,
            **{kind: None if found is None else found.as_json() for kind, found in kinds.items()},
        }

    def lines(self) -> Iterator[str]:
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
