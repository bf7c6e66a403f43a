"""Columns of a variable that stand under each other's names."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.measured.likeness import exactness, moments_of, unlikeness
from vsacli.studies.measured.pairing import FEWEST_SAMPLES, Pairing, tame

SAVED = math.log(4.0)
"""Logarithm by which each exchanged column has to leave less unexplained than under its own name."""

LEFT = math.log(0.1)
"""Logarithm of what it may leave at most."""

REVERSED = 0.25
"""Share of the squared errors of an exchange below which opposite signs explain the columns better. Torques
of two motors that pull against each other are nearly each other's negatives, so that both explain much."""


def exchanged_places(pairings: Sequence[Pairing], groups: Sequence[object], shift: float) -> list[int]:
    """Return for each column the index of the one that it follows: its own, unless they are exchanged.

    Columns are held against all computed signals of their group, over their own samples, so that rows that
    one of them lacks do not matter.

    Args:
        pairings: of all columns.
        groups: for each, what it has in common with those with which it may have been exchanged.
        shift: time of the recording, s, at which the result begins.
    """
    places = list(range(len(pairings)))
    for group in dict.fromkeys(groups):
        members = [index for index, of_it in enumerate(groups) if of_it == group]
        exact = [exactness(tame(pairings[member].measured)) for member in members]
        thin = [pairings[member].thinned() for member in members]

        def computed(row: int, thin: Sequence[Pairing] = thin) -> list[FloatArray]:
            return [each.computed.at(thin[row].time - shift) for each in thin]

        for row, column in exchanged([each.measured for each in thin], exact, computed):
            places[members[row]] = members[column]
    return places


def exchanged(
    measured: Sequence[FloatArray], exact: Sequence[float], computed: Callable[[int], Sequence[FloatArray]]
) -> list[tuple[int, int]]:
    """Indices of the columns that are exchanged, each with that of the signal which it follows.

    Args:
        measured: values of each column.
        exact: of each, the share of its variance below which nothing counts as unexplained.
        computed: all signals at the times of the column with an index.
    """
    if len(measured) < 2:
        return []
    from scipy.optimize import linear_sum_assignment

    costs = np.array([_costs(values, exact[row], computed(row)) for row, values in enumerate(measured)])
    rows, columns = linear_sum_assignment(costs)
    moved = rows != columns
    left, own = costs[rows, columns][moved], np.diag(costs)[moved]
    if not np.all((left <= own - SAVED) & (left <= LEFT)):
        return []
    found = list(zip(rows[moved].tolist(), columns[moved].tolist(), strict=True))
    return [] if _reversed(measured, computed, found) else found


def _reversed(
    measured: Sequence[FloatArray],
    computed: Callable[[int], Sequence[FloatArray]],
    found: Sequence[tuple[int, int]],
) -> bool:
    """Return whether opposite signs explain the columns much better than an exchange does."""
    opposite = sum(float(np.nansum((measured[row] + computed(row)[row]) ** 2)) for row, _ in found)
    exchange = sum(float(np.nansum((measured[row] - computed(row)[column]) ** 2)) for row, column in found)
    return opposite < REVERSED * exchange


@np.errstate(all="ignore")  # signals that hold still explain nothing
def _costs(measured: FloatArray, exact: float, computed: Sequence[FloatArray]) -> FloatArray:
    """What measured values leave unexplained by each computed signal, (signals,)."""
    moments = [moments_of(each, tame(measured)) for each in computed]
    if min(float(each.samples) for each in moments) < FEWEST_SAMPLES:
        return np.zeros(len(computed))
    scale = max(float(np.max(each.spreads()[:2])) for each in moments)
    return np.array([float(unlikeness(each, exact, scale)) for each in moments])
