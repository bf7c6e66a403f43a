"""The result of an optimization, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from vsacli.base.json_records import Published, named
from vsacli.base.tables import ReportText, TextReport
from vsacli.base.texts import counted, warnings_and_notes
from vsacli.base.units import in_header
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


VARIED = {"stiffness": "stiffness", "timing": "timing", "both": "timing and stiffness"}
"""Varied quantities in words."""

MIN_FULL_SHARE = 0.995
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

    def rows(self) -> list[tuple[str, ...]]:
        """Return the table of durations."""
        durations = {
            "as commanded": self.before,
            "slowed down or sped up uniformly": self.uniform,
            "local optimum": self.after,
        }
        header = ("timing", "duration\ns", "change\n%")
        finite_durations = {words: value for words, value in durations.items() if not math.isnan(value)}
        rows = [
            (words, f"{value:.4g}", _change_text(self.before, value))
            for words, value in finite_durations.items()
        ]
        return [header, *rows]

    def lines(self) -> Iterator[str]:
        """Yield how it was found, and the active bounds of each joint."""
        yield _search_text(self)
        yield from (
            f"{name}: {_active_bounds_clause(shares, 'path')}" for name, shares in self.bounding.items()
        )


@dataclass(frozen=True)
class Optimum(Published, TextReport):
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
        warnings: sentences about implausible values of robot and commanded trajectory.
        admissible: whether the commanded motion keeps the margin and all limits, as the optimum does.
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
    warnings: tuple[str, ...] = ()
    admissible: bool = True

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
        "warnings": "warnings",
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

    @property
    def title(self) -> str:
        """Names, the objective, and what was gained."""
        objective = f"{self.words} by {VARIED[self.varied]}"
        return f"{self.robot_name}, {self.asked}: {objective}: {self._gain_text()}"

    def _gain_text(self) -> str:
        """Return cost before and after with the change; of several joints, the range of changes."""
        if self.trajectory is None:
            return "nothing feasible was found"
        if self.timing is not None:
            return _cost_text(self.timing.before, self.timing.after, "s")
        if self.together is not None:
            total = self.together
            if total.unit:
                return _cost_text(total.before, total.after, total.unit)
            return f"{_change_text(total.before, total.after)} % on average over the joints"
        if len(self.joints) == 1:
            [only] = self.joints.values()
            return _cost_text(only.before, only.after, only.unit)
        feasible_optima = {name: each for name, each in self.joints.items() if each.before > 0}
        if not feasible_optima:
            return "feasible, which it is not as commanded"
        joint_names = sorted(
            feasible_optima, key=lambda name: feasible_optima[name].after / feasible_optima[name].before
        )
        changes = [
            f"{_change_text(feasible_optima[name].before, feasible_optima[name].after)} % ({name})"
            for name in joint_names
        ]
        return " to ".join(dict.fromkeys((changes[0], changes[-1])))

    def as_text(self) -> ReportText:
        """Return the report in parts."""
        beyond = f"as commanded, the motion breaks a limit or the margin of {100 * self.min_margin:.4g} %"
        notes = (f"{beyond}, which the optimum keeps",) if self.possible and not self.admissible else ()
        warnings = list(warnings_and_notes(self.warnings, notes))
        if self.trajectory is None:
            return ReportText(self.title, [*self.reasons, *warnings])
        if self.timing is not None:
            return ReportText(self.title, warnings, [self.timing.rows()], list(self.timing.lines()))
        slow_down_sentence = (
            f"slowed down by a factor {self.slow_down:.4g} to {self.trajectory.duration:.4g} s: no feasible "
            "timing of the commanded duration was found"
        )
        path_or_time = "time" if self.together is None else "path"
        lines = [
            f"{name}: {_active_bounds_clause(each.bounding, path_or_time)}; {_search_text(each)}"
            for name, each in self.joints.items()
        ]
        findings = [*([slow_down_sentence] if self.slow_down != 1 else []), *warnings]
        return ReportText(self.title, findings, [self._rows()], lines)

    def _rows(self) -> list[tuple[str, ...]]:
        """Return the table of costs, the total last."""
        costs: dict[str, JointOptimum | TotalCost] = dict(self.joints)
        has_constants = self.together is None
        if self.together is not None:
            costs["together" if self.together.unit else "together, relative"] = self.together
        units = in_header(each.unit for each in costs.values() if each.unit)
        names = ("as commanded", *(["best constant"] if has_constants else []), "local optimum")
        rows = [("joint", *(f"{name}\n{units}".rstrip() for name in names), "change\n%")]
        for name, each in costs.items():
            constant_cells = (
                [_format_cost(each.constant)] if has_constants and isinstance(each, JointOptimum) else []
            )
            change_text = _change_text(each.before, each.after)
            rows.append(
                (name, _format_cost(each.before), *constant_cells, _format_cost(each.after), change_text)
            )
        return rows


def _format_cost(cost: float) -> str:
    return "-" if math.isnan(cost) else f"{cost:.4g}"


def _change_text(before: float, after: float) -> str:
    if not before > 0 or math.isnan(after):
        return "-"
    change = round(100 * (after / before - 1), 1)
    return f"{change:+.1f}" if change else "0.0"


def _cost_text(before: float, after: float, unit: str) -> str:
    """Return a cost before and after with its change; only the latter if the former is infeasible."""
    final_cost = f"{_format_cost(after)} {unit}".rstrip()
    if math.isnan(before):
        return f"{final_cost} (infeasible as commanded)"
    change = _change_text(before, after)
    return f"{_format_cost(before)} to {final_cost}" + ("" if change == "-" else f" ({change} %)")


def _active_bounds_clause(bounding: Mapping[str, float], path_or_time: str) -> str:
    """Return a clause with the active bounds and their shares."""
    clauses = [
        f"{name} {'all' if share > MIN_FULL_SHARE else f'{100 * share:.2g} %'} of the {path_or_time}"
        for name, share in bounding.items()
    ]
    return f"active bounds: {', '.join(clauses) or 'none'}"


def _search_text(optimum: JointOptimum | TimingOptimum) -> str:
    outcome = "local optimum" if optimum.found else "no local optimum: the search ended before"
    return f"{outcome}; reached from {optimum.agreeing} of {counted(optimum.starts, 'start')}"
