"""The result of an optimization, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from vsacli.base.json_records import Published, named
from vsacli.base.tables import aligned
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


VARIED = {"stiffness": "stiffness", "timing": "timing", "both": "timing and stiffness"}
"""Words for the varied quantities."""

FULL = 0.995
"""Share of the time that is all of it, as it is printed."""


@dataclass(frozen=True)
class JointOptimum(Published):
    """The best stiffness of a joint that was found.

    Attributes:
        before: cost with the stiffness that is commanded; NaN where that is out of reach.
        constant: with the best constant; NaN if there is none.
        after: with the best profile.
        unit: of the costs.
        found: whether the conditions for a local optimum hold.
        starts: with how many profiles the search began.
        agreeing: from how many of them it came to this optimum.
        bounding: share of the time during which the profile runs along a bound, by the name of the bound.
    """

    before: float
    constant: float
    after: float
    unit: str
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, float]


@dataclass(frozen=True)
class TotalCost(Published):
    """The cost of all joints together, which is minimized where they share a timing.

    Attributes:
        before: as commanded; NaN where that is out of reach.
        after: with the best timing.
        unit: of the costs; empty where each joint counts relative to its cost as commanded.
    """

    before: float
    after: float
    unit: str


@dataclass(frozen=True)
class TimingOptimum(Published):
    """The fastest pace that was found along the path of a motion.

    Attributes:
        before: duration as commanded, s.
        uniform: of the fastest motion that is slowed down or sped up as a whole, s; NaN if there is none.
        after: of the best, s.
        found: whether the conditions for a local optimum hold, to about a thousandth of the duration.
        starts: with how many paces the search began.
        agreeing: from how many of them it came to this optimum.
        bounding: share of the path along each bound, by joint and name of the bound.
    """

    before: float
    uniform: float
    after: float
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, dict[str, float]]

    def lines(self) -> Iterator[str]:
        """Yield the durations, and the bounds that hold each joint back."""
        yield f"as commanded {self.before:.4g} s"
        if not math.isnan(self.uniform):
            yield f"fastest when slowed down or sped up as a whole {self.uniform:.4g} s"
        than = "" if math.isnan(self.uniform) else f", {100 * (1 - self.after / self.uniform):.1f} % less"
        yield f"{_search(self)}: {self.after:.4g} s{than}"
        yield from (f"{name}: {_along(shares, 'path')}" for name, shares in self.bounding.items())


@dataclass(frozen=True)
class Optimum(Published):
    """The trajectory with which a cost is least, as far as was searched.

    Attributes:
        robot: the robot.
        asked: name of the trajectory that was to be improved.
        minimised: torque, energy, copper, peak or time.
        words: the same in words.
        varied: stiffness, timing or both.
        margin: that every step has.
        joints: by name; empty if nothing was found, and where time is minimised.
        together: their total cost, if they share a timing; else None.
        slow_down: factor by which the motion is slower than commanded, where a cost is minimised and no pace
            in its duration was found that is feasible; else 1.
        timing: None if time is not minimised, or nothing was found.
        reasons: why nothing was found, in clauses.
        trajectory: the best; None if nothing was found.
        pace: along the path, dt/ds, a spline whose argument is s; None if it is as commanded.
    """

    robot: Robot = field(repr=False)
    asked: str
    minimised: str
    words: str
    varied: str
    margin: float
    joints: dict[str, JointOptimum] = field(default_factory=dict)
    together: TotalCost | None = None
    slow_down: float = 1.0
    timing: TimingOptimum | None = None
    reasons: tuple[str, ...] = ()
    trajectory: Trajectory | None = field(default=None, repr=False)
    pace: BSpline[np.float64] | None = field(default=None, repr=False)

    format: ClassVar[str] = "vsacli-optimum/2"
    shape: ClassVar = {
        "format": "format",
        "robot": "robot_name",
        "trajectory": "asked",
        "possible": "possible",
        **named("minimised", "varied", "margin", "joints"),
        "together?": "together",
        "slow_down?": "slowed_down",
        "timing?": "timing",
        "reasons?": "reasons",
    }

    @property
    def possible(self) -> bool:
        """Whether anything feasible was found."""
        return self.trajectory is not None

    @property
    def slowed_down(self) -> float | None:
        """The factor of the slow-down, if there is any."""
        return None if self.slow_down == 1 else self.slow_down

    @property
    def robot_name(self) -> str:
        """Name of the robot."""
        return self.robot.name

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        title = f"{self.robot_name}, {self.asked}: {self.words} by another {VARIED[self.varied]}"
        if self.trajectory is None:
            yield f"{title}: nothing feasible was found"
            yield from (f"- {reason}" for reason in self.reasons)
            return
        yield title
        if self.timing is not None:
            yield from self.timing.lines()
            return
        if self.slow_down != 1:
            yield (
                f"slowed down by a factor {self.slow_down:.4g} to {self.trajectory.duration:.4g} s: nothing "
                "feasible was found that lasts as commanded"
            )
        yield from aligned(list(self._rows()))
        whole = "time" if self.together is None else "path"
        yield from (
            f"{name}: {_along(each.bounding, whole)}; {_search(each)}" for name, each in self.joints.items()
        )

    def _rows(self) -> Iterator[tuple[str, ...]]:
        if self.together is not None:
            yield ("joint", "as commanded", "local optimum", "change")
            costs: dict[str, JointOptimum | TotalCost] = {**self.joints, "together": self.together}
            for name, of in costs.items():
                before, after = (_cost(cost, of.unit) for cost in (of.before, of.after))
                yield (name, before, after, _change(of.before, of.after))
            return
        yield ("joint", "as commanded", "best constant", "local optimum", "change")
        for name, each in self.joints.items():
            found = [_cost(cost, each.unit) for cost in (each.before, each.constant, each.after)]
            yield (name, *found, _change(each.before, each.after))


def _cost(cost: float, unit: str) -> str:
    return "-" if math.isnan(cost) else f"{cost:.4g} {unit}".rstrip()


def _change(before: float, after: float) -> str:
    return "-" if not before > 0 or math.isnan(after) else f"{100 * (after / before - 1):+.1f} %"


def _along(bounding: Mapping[str, float], whole: str) -> str:
    """Along which bounds a joint runs, and for which share."""
    along = [
        f"the {name} {'all' if share > FULL else f'{100 * share:.2g} %'} of the {whole}"
        for name, share in bounding.items()
    ]
    return "inside all bounds" if not along else f"along {', '.join(along)}"


def _search(optimum: JointOptimum | TimingOptimum) -> str:
    ended = "local optimum" if optimum.found else "no local optimum, the search ended before"
    return f"{ended}, from {optimum.agreeing} of {optimum.starts} starts"
