"""Several starts at once: each search is what it is alone, and they share evaluations."""

from __future__ import annotations

import numpy as np
import pytest

from vsacli.studies.search.interior_point import minimize, minimize_all
from vsacli.studies.search.separable import Group, SeparableProblem

TIME = np.linspace(0, 1, 21)


class Wells:
    """Two wells of different depth at each instant, between bounds."""

    def __call__(self, rows, _instants):
        """Return the cost, and the bounds on both sides."""
        (value,) = rows
        return [(value * value - 1) * (value * value - 1) + 0.2 * value], [-2 - value, value - 2]


class Counted(SeparableProblem):
    """A problem that counts the calls with derivatives."""

    calls = 0

    def at(self, places):
        """See `SeparableProblem.at`."""
        type(self).calls += 1
        return super().at(places)


def problem(kind=SeparableProblem):
    basis = np.stack([1 - TIME, TIME], axis=-1)[None]
    weights = np.full((1, len(TIME)), 1 / len(TIME))
    there = np.ones((2, len(TIME)), dtype=bool)
    return kind([Group(Wells(), np.arange(len(TIME)), basis, np.arange(2), weights, there, np.ones(1))])


STARTS = [np.array(start) for start in ((0.5, 0.5), (-0.5, -0.4), (1.5, 0.3), (-1.9, -1.9))]


def test_searches_together_end_where_each_ends_alone():
    alone = [minimize(problem(), start) for start in STARTS]
    together = minimize_all(problem(), STARTS)
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_allclose(one.unknowns, other.unknowns, rtol=1e-9)
        assert (one.cost, one.found) == (pytest.approx(other.cost, rel=1e-12), other.found)
    assert len({round(each.cost, 4) for each in together}) == 2


def test_searches_together_share_evaluations():
    Counted.calls = 0
    minimize_all(problem(Counted), STARTS)
    together, Counted.calls = Counted.calls, 0
    longest = 0
    for start in STARTS:
        before = Counted.calls
        minimize(problem(Counted), start)
        longest = max(longest, Counted.calls - before)
    assert together < 0.6 * Counted.calls
    assert together >= longest


def test_no_start_is_no_search():
    assert minimize_all(problem(), []) == []
