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
"""Varied quantities in words."""

FULL = 0.995
"""Share of the time or path from which on the text says "all"."""


@dataclass(frozen=True)
class JointOptimum(Published):
    """The best stiffness found for a joint.

    Attributes:
        before: cost with the commanded stiffness; NaN if that is infeasible.
        constant: cost with the best constant; NaN if there is none.
        after: cost with the best profile.
        unit: unit of the costs.
        found: whether the conditions for a local optimum hold.
        starts: number of starts of the search.
        agreeing: number of starts that reached this optimum.
        bounding: share of the time, or of the path, during which each bound is active, by name of the bound.
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
    """The cost of all joints together, which is minimized if they share a timing.

    Attributes:
        before: cost as commanded; NaN if that is infeasible.
        after: cost with the best timing.
        unit: unit of the costs; empty if each joint counts relative to its commanded cost.
    """

    before: float
    after: float
    unit: str


@dataclass(frozen=True)
class TimingOptimum(Published):
    """The fastest timing found along the path of a motion.

    Attributes:
        before: commanded duration, s.
        uniform: duration of the fastest motion that is uniformly slowed down or sped up, s; NaN if there is
            none.
        after: duration with the best timing, s.
        found: whether the conditions for a local optimum hold, to about 0.1 % of the duration.
        starts: number of starts of the search.
        agreeing: number of starts that reached this optimum.
        bounding: share of the path on which each bound is active, by joint and name of the bound.
    """

    before: float
    uniform: float
    after: float
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, dict[str, float]]

    def lines(self) -> Iterator[str]:
        """Yield the durations, and the active bounds of each joint."""
        yield f"as commanded {self.before:.4g} s"
        if not math.isnan(self.uniform):
            yield f"fastest when slowed down or sped up as a whole {self.uniform:.4g} s"
        than = "" if math.isnan(self.uniform) else f", {100 * (1 - self.after / self.uniform):.1f} % less"
        yield f"{_search(self)}: {self.after:.4g} s{than}"
        yield from (f"{name}: {_along(shares, 'path')}" for name, shares in self.bounding.items())


@dataclass(frozen=True)
class Optimum(Published):
    """The result of an optimization: the best trajectory that was found.

    Attributes:
        robot: robot that executes the trajectory.
        asked: name of the trajectory to be improved.
        minimized: objective: torque, energy, copper_loss, peak or time.
        words: objective in words.
        varied: varied quantity: stiffness, timing or both.
        min_margin: margin that every sample has.
        joints: results by joint name; empty if nothing was found, or if time is minimized.
        together: total cost of the joints if they share a timing, otherwise None.
        slow_down: factor by which the motion is slower than commanded, if a cost is minimized and no feasible
            timing of the commanded duration was found; otherwise 1.
        timing: result if time is minimized; None if it is not, or if nothing was found.
        reasons: reasons why nothing was found, as clauses.
        trajectory: best trajectory; None if nothing was found.
        pace: pace dt/ds along the path, a spline whose argument is s; None if the timing is unchanged.
    """

    robot: Robot = field(repr=False)
    asked: str
    minimized: str
    words: str
    varied: str
    min_margin: float
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
        **named("minimized", "varied", "min_margin", "joints"),
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
        """Factor of the slow-down; None without one."""
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
    """Return a clause with the active bounds and their shares."""
    along = [
        f"the {name} {'all' if share > FULL else f'{100 * share:.2g} %'} of the {whole}"
        for name, share in bounding.items()
    ]
    return "inside all bounds" if not along else f"along {', '.join(along)}"


def _search(optimum: JointOptimum | TimingOptimum) -> str:
    ended = "local optimum" if optimum.found else "no local optimum, the search ended before"
    return f"{ended}, from {optimum.agreeing} of {optimum.starts} starts"
