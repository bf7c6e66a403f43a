"""Data points of a study table: verdicts, margin and cost of each run over the parameters.

Reports, figures and pages count each verdict apart, and use the same words for it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.base.texts import counted
from vsacli.results.charts.parameter_words import parameter_words
from vsacli.results.store.study_table import FIRST_LIMIT, StoredStudy

OK = "ok"
"""Verdict of a run that is feasible, regular and within every limit."""

DRAWN = ("random", "latin_hypercube")
"""Methods whose runs are random draws, so that shares of runs estimate probabilities."""

NORMAL_95 = 1.96
"""Half-width of the 95 % interval of a normal distribution, in standard deviations."""

NAMED_RUNS = 3
"""Number of runs with the smallest margins that are labeled with their numbers."""

METHODS = {"grid": "grid", "random": "random samples", "latin_hypercube": "Latin hypercube samples"}
"""Sampling methods in words."""

COSTS = {
    "cost_after": "{}",
    "energy_spent": "positive motor work",
    "peak_tau_motor": "peak motor torque",
}
"""Columns that hold the cost of a motion, in order of preference, with their labels; `{}` stands for the
table's."""

OPTIMUM_SUFFIX = " of the optimum"
"""End of the description of a cost after the optimization."""

SUMMED_UNIT = "J"
"""Unit of costs that are summed over the joints; of other costs the maximum counts."""


MARGIN_SHARE, MIN_MARGIN = 0.04, 0.002
"""Space next to the smallest and the largest margin, relative to their distance, and its minimum."""


class Shares(NamedTuple):
    """Shares of runs, with the ends of their intervals of 95 % confidence; all arrays of one shape."""

    values: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, counts: FloatArray, runs: int) -> Shares:
        """Return the shares of counts in a number of runs, with Wilson's intervals (1927)."""
        values, square = counts / runs, NORMAL_95**2
        center = (values + square / (2 * runs)) / (1 + square / runs)
        standard_error = np.sqrt(values * (1 - values) / runs + square / (4 * runs**2))
        half_width = NORMAL_95 * standard_error / (1 + square / runs)
        return cls(values, np.maximum(0.0, center - half_width), np.minimum(1.0, center + half_width))


def count_verdicts(verdicts: Sequence[str]) -> dict[str, int]:
    """Return the number of runs by verdict: ok first, then the most frequent."""
    by_frequency = Counter(verdicts).most_common()
    return dict(sorted(by_frequency, key=lambda entry: entry[0] != OK))


def verdict_label(verdict: str) -> str:
    """Return a verdict as people read it."""
    return verdict.replace("_", " ")


def verdict_counts_text(counts: Mapping[str, int]) -> str:
    """Return how many runs have each verdict, such as `26 ok, 24 infeasible`."""
    return ", ".join(f"{count} {verdict_label(verdict)}" for verdict, count in counts.items())


def runs_are_independent(table: StoredStudy) -> bool:
    """Return whether the runs are independent random draws, so that shares of them have intervals."""
    # each trajectory has the same draws, so that runs of several are not independent
    is_random = str(table.attributes.get("method", "")) in DRAWN
    return is_random and len(set(table.texts("trajectory"))) == 1


def ok_share(counts: Mapping[str, int]) -> tuple[float, float, float]:
    """Return the share of ok runs, with its interval of 95 % confidence, which holds for random draws."""
    share, low, high = Shares.of(np.array(float(counts.get(OK, 0))), sum(counts.values()))
    return float(share), float(low), float(high)


def verdict_shares_lines(counts: Mapping[str, int], *, random: bool) -> list[str]:
    """Return the share of ok runs, with its interval for random draws, and those of other verdicts."""
    share, low, high = (100 * value for value in ok_share(counts))
    interval = f" ({low:.3g} to {high:.3g} %)" if random else ""
    percent = {verdict: 100 * count / sum(counts.values()) for verdict, count in counts.items()}
    other_shares = [
        f"{verdict_label(verdict)} {percent[verdict]:.3g} %" for verdict in counts if verdict != OK
    ]
    return [f"{OK} {share:.3g} %{interval}", *([", ".join(other_shares)] if other_shares else [])]


class StudyPoints:
    """The values of a study table that figures and pages show.

    Attributes:
        name: name of the study.
        runs: numbers of the runs, (rows,).
        margin: smallest margin of all joints, (rows,), relative; NaN if a run failed.
        verdicts: verdict of each run.
        counts: number of runs by verdict, ok first.
        ok: whether the run is feasible, regular, and within every limit, (rows,).
        first_limits: joint and limit first exceeded in each run; empty where none is.
        random: whether the runs are independent random draws, so that shares of them have intervals.

    Raises:
        InputError: the table has no margins, or no rows.
    """

    def __init__(self, table: StoredStudy) -> None:
        if "margin" not in table.columns or not table.rows:
            what = "no runs" if not table.rows else "no margin; put it into `keep:` of the study"
            raise InputError.one(f"nothing can be drawn: it has {what}", table.path)
        self.name, self.runs, self._table = table.study_name, table.read("run"), table
        self.margin = _smallest_margins(table.read("margin"))
        self.verdicts, self.first_limits = table.texts("verdict"), table.texts(FIRST_LIMIT)
        self.counts = count_verdicts(self.verdicts)
        self.ok: BoolArray = self.has_verdict(OK)
        self.random = runs_are_independent(table)
        self._method = str(table.attributes.get("method", ""))

    def has_verdict(self, verdict: str) -> BoolArray:
        """Return whether each run has a verdict, (rows,)."""
        return np.array([run_verdict == verdict for run_verdict in self.verdicts], dtype=np.bool_)

    @property
    def title(self) -> str:
        """Names of study and robot, number of runs, and sampling method."""
        runs = [counted(len(self.runs), "run"), *filter(None, [METHODS.get(self._method)])]
        return f"study {self.name} of {self._table.robot_name}: {', '.join(runs)}"

    @cached_property
    def varying(self) -> dict[str, FloatArray]:
        """Values of the numeric parameters that are not the same in all rows, by path."""
        table = self._table
        numeric_values = {
            path: table.read(path) for path in table.parameters if not table.parameter_is_text(path)
        }
        return {path: values for path, values in numeric_values.items() if np.ptp(values) > 0}

    @cached_property
    def cost(self) -> tuple[str, FloatArray] | None:
        """Label of the cost, and cost of each run, NaN if samples have none; None if no cost is stored."""
        return next((self._cost(name) for name in COSTS if name in self._table.columns), None)

    @property
    def optimized(self) -> bool:
        """Whether each run is an optimum, whose margin is the requested one."""
        return "cost_after" in self._table.columns

    @property
    def cost_before(self) -> tuple[str, FloatArray]:
        """Label and values of the costs as commanded; for studies whose runs are optimized."""
        return self._cost("cost_before")

    @property
    def cost_words(self) -> str:
        """Label of the cost, without saying of which motion; requires a cost."""
        assert self.cost is not None, "a label requires a cost"
        return self.cost[0].replace(OPTIMUM_SUFFIX, "")

    @property
    def drawn_columns(self) -> list[tuple[str, FloatArray]]:
        """Columns to draw over the parameters: margin and cost, or for optima the costs before and after."""
        cost = [] if self.cost is None else [self.cost]
        first = self.cost_before if self.optimized else ("smallest margin [%]", 100 * self.margin)
        return [first, *cost]

    def _cost(self, name: str) -> tuple[str, FloatArray]:
        values, column = _without_empty_columns(self._table.read(name)), self._table.column(name)
        unit = column.quantity.revolute
        words = COSTS.get(name, "{}").format(column.long_name)
        return f"{words} [{unit}]", values.sum(axis=1) if unit == SUMMED_UNIT else values.max(axis=1)

    @property
    def shares_lines(self) -> list[str]:
        """Share of the ok runs, and shares of the runs with other verdicts, in words."""
        return verdict_shares_lines(self.counts, random=self.random)

    def exceedance(self, counted_runs: BoolArray) -> tuple[FloatArray, Shares]:
        """Return margins, ascending, and for each the share of counted runs with at least this margin.

        The first margin is below, and the last one above, those of all runs: the share begins with that of
        all counted runs, and ends with zero. Both arrays are empty if no run has a margin.

        Args:
            counted_runs: whether each run is counted, (rows,); shares are relative to all runs.
        """
        finite = np.isfinite(self.margin)
        if not finite.any():
            return np.empty(0), Shares.of(np.empty(0), len(finite))
        least, largest = (float(ufunc(self.margin[finite])) for ufunc in (np.min, np.max))
        margin = max(MARGIN_SHARE * (largest - least), MIN_MARGIN)
        margins = np.sort(self.margin[finite & counted_runs])
        counts = [len(margins), *range(len(margins), -1, -1)]
        extended_margins = np.concatenate(([least - margin], margins, [largest + margin]))
        return extended_margins, Shares.of(np.array(counts, dtype=float), len(finite))

    def words(self, path: str) -> str:
        """Return a parameter in words."""
        return parameter_words(path, self.unit(path), self._table.joint_names)

    def unit(self, path: str) -> str:
        """Return the unit of a parameter, empty if it has none."""
        unit = self._table.unit(path)
        return "" if unit == "1" else unit

    @property
    def worst(self) -> IndexArray:
        """Rows with the smallest margins."""
        order = np.argsort(np.where(np.isnan(self.margin), np.inf, self.margin), kind="stable")
        return order[: min(NAMED_RUNS, int(np.isfinite(self.margin).sum()))]

    @property
    def front(self) -> IndexArray:
        """Pareto front: ok rows that cost less than any with a larger margin, by ascending margin."""
        assert self.cost is not None, "a front requires a cost"
        rows = np.flatnonzero(self.ok & np.isfinite(self.cost[1]) & np.isfinite(self.margin))
        rows = rows[np.lexsort((self.cost[1][rows], -self.margin[rows]))]
        cost = self.cost[1][rows]
        cheapest_before = np.concatenate([[np.inf], np.minimum.accumulate(cost)[:-1]])
        return rows[cost < cheapest_before][::-1]


def _smallest_margins(margins: FloatArray) -> FloatArray:
    """Return the smallest margin of all joints; joints without an attainable range are ignored."""
    least: FloatArray = np.where(np.isnan(margins), np.inf, margins).min(axis=1)
    return np.where(np.isinf(least), np.nan, least)


def _without_empty_columns(costs_by_run: FloatArray) -> FloatArray:
    """Return costs (rows, ...) as (rows, columns), without columns that are NaN in every row."""
    costs_by_run = costs_by_run.reshape(len(costs_by_run), -1)
    has_cost = ~np.isnan(costs_by_run).all(axis=0)
    return costs_by_run[:, has_cost] if has_cost.any() else costs_by_run
