"""Data points of a study table: margin and cost of each run over the parameters."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.base.texts import counted
from vsacli.results.charts.parameter_words import parameter_words
from vsacli.results.store.study_table import StoredStudy

NAMED_RUNS = 3
"""Number of runs with the smallest margins that are labeled with their numbers."""

METHODS = {"grid": "grid", "random": "random samples", "latin_hypercube": "Latin hypercube samples"}
"""Sampling methods in words."""

DRAWN = ("random", "latin_hypercube")
"""Methods whose runs are random draws, so that shares of runs estimate probabilities."""

NORMAL_95 = 1.96
"""Half-width of the 95 % interval of a normal distribution, in standard deviations."""

COSTS = {
    "cost_after": "{}",
    "energy_spent": "positive motor work",
    "peak_tau_motor": "peak motor torque",
}
"""Columns that hold the cost of a motion, in order of preference, with their labels; `{}` stands for the
table's."""

OF_OPTIMUM = " of the optimum"
"""End of the description of a cost after the optimization."""

ADDED = "J"
"""Unit of costs that are summed over the joints; of other costs the maximum counts."""


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
        spread = np.sqrt(values * (1 - values) / runs + square / (4 * runs**2))
        half = NORMAL_95 * spread / (1 + square / runs)
        return cls(values, np.maximum(0.0, center - half), np.minimum(1.0, center + half))


class StudyPoints:
    """The values of a study table that figures and pages show.

    Attributes:
        name: name of the study.
        runs: numbers of the runs, (rows,).
        margin: smallest margin of all joints, (rows,), relative; NaN if a run failed.
        feasible: whether every sample was feasible and regular, (rows,).
        random: whether the runs are independent random draws, so that shares of them have intervals.

    Raises:
        InputError: the table has no margins, or no rows.
    """

    def __init__(self, table: StoredStudy) -> None:
        if "margin" not in table.columns or not table.rows:
            what = "no runs" if not table.rows else "no margin; put it into `keep:` of the study"
            raise InputError.one(f"nothing can be drawn: it has {what}", table.path)
        self.name, self.runs, self._table = table.study_name, table.read("run"), table
        self.margin = _least(table.read("margin"))
        self.feasible: BoolArray = np.isin(table.texts("verdict"), ("ok", "over_limit", "unreliable"))
        self._method = str(table.attributes.get("method", ""))
        # each trajectory has the same draws, so that runs of several are not independent
        self.random = self._method in DRAWN and len(set(table.texts("trajectory"))) == 1

    @property
    def title(self) -> str:
        """Names of study and robot, number of runs, and sampling method."""
        runs = [counted(len(self.runs), "run"), *filter(None, [METHODS.get(self._method)])]
        return f"study {self.name} of {self._table.robot_name}: {', '.join(runs)}"

    @cached_property
    def varying(self) -> dict[str, FloatArray]:
        """Values of the numeric parameters that are not the same in all rows, by path."""
        table = self._table
        found = {path: table.read(path) for path in table.parameters if not table.parameter_is_text(path)}
        return {path: values for path, values in found.items() if np.ptp(values) > 0}

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
        return self.cost[0].replace(OF_OPTIMUM, "")

    @property
    def shown(self) -> list[tuple[str, FloatArray]]:
        """Columns to draw over the parameters: margin and cost, or for optima the costs before and after."""
        cost = [] if self.cost is None else [self.cost]
        first = self.cost_before if self.optimized else ("smallest margin [%]", 100 * self.margin)
        return [first, *cost]

    def _cost(self, name: str) -> tuple[str, FloatArray]:
        values, column = _there(self._table.read(name)), self._table.column(name)
        unit = column.quantity.revolute
        words = COSTS.get(name, "{}").format(column.long_name)
        return f"{words} [{unit}]", values.sum(axis=1) if unit == ADDED else values.max(axis=1)

    @property
    def share(self) -> tuple[float, float, float]:
        """Share of the feasible runs, with its interval of 95 % confidence, which holds for random draws."""
        share, low, high = Shares.of(np.array(float(self.feasible.sum())), len(self.feasible))
        return float(share), float(low), float(high)

    @property
    def exceedance(self) -> tuple[FloatArray, Shares]:
        """Margins, ascending, and for each the share of runs with at least this margin."""
        margins = np.sort(self.margin[np.isfinite(self.margin)])
        return margins, Shares.of(np.arange(len(margins), 0.0, -1), len(self.margin))

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
        """Pareto front: feasible rows that cost less than any with a larger margin, by ascending margin."""
        assert self.cost is not None, "a front requires a cost"
        rows = np.flatnonzero(self.feasible & np.isfinite(self.cost[1]) & np.isfinite(self.margin))
        rows = rows[np.lexsort((self.cost[1][rows], -self.margin[rows]))]
        cost = self.cost[1][rows]
        before = np.concatenate([[np.inf], np.minimum.accumulate(cost)[:-1]])
        return rows[cost < before][::-1]


def _least(margins: FloatArray) -> FloatArray:
    """Return the smallest margin of all joints; joints without an attainable range are ignored."""
    least: FloatArray = np.where(np.isnan(margins), np.inf, margins).min(axis=1)
    return np.where(np.isinf(least), np.nan, least)


def _there(costs: FloatArray) -> FloatArray:
    """Return costs (rows, ...) as (rows, columns), without columns that are NaN in every row."""
    costs = costs.reshape(len(costs), -1)
    there = ~np.isnan(costs).all(axis=0)
    return costs[:, there] if there.any() else costs
