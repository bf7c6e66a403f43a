"""Likely causes of a signal that does not agree: a wrong unit, sign, side of the gear, or column."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.measured.agreement import Agreement
from vsacli.studies.measured.pairing import FEWEST_SAMPLES, Pairing, exactness, moments_of, tame, unlikeness

SAVED = math.log(4.0)
"""Logarithm by which each exchanged column has to leave less unexplained than under its own name."""

LEFT = math.log(0.1)
"""Logarithm of the largest unexplained part."""

REVERSED = 0.25
"""Share of the squared errors of an exchange below which opposite signs explain the columns better. Torques
of two motors that pull against each other are nearly each other's negatives, so that both explain much."""


def exchanged_places(pairings: Sequence[Pairing], groups: Sequence[object], shift: float) -> list[int]:
    """Return for each column the index of the one that it follows: its own, unless they are exchanged.

    Columns are held against all computed signals of their group, over their own samples, so that rows that
    one of them lacks do not matter.

    Args:
        pairings: of all columns.
        groups: for each, the property shared with columns it may have been exchanged with.
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
    """Return the unexplained part of measured values for each computed signal, (signals,)."""
    moments = [moments_of(each, tame(measured)) for each in computed]
    if min(float(each.samples) for each in moments) < FEWEST_SAMPLES:
        return np.zeros(len(computed))
    scale = max(float(np.max(each.spreads()[:2])) for each in moments)
    return np.array([float(unlikeness(each, exact, scale)) for each in moments])


ALIKE = 0.98
"""Coefficient of correlation from which on the gain says something about units and signs."""

NEAR = 0.05
"""Relative distance at which a gain is taken for that of a likely cause."""

SURE = 5.0
"""Standard errors from which on a gain or an offset is named; of a million right columns one has that."""

NOTABLE = 0.02
"""Gain less 1, or offset over the range, from which on it is named: few models are better."""

WILD = 20.0
"""Largest error, in root mean squares of the others, from which on samples that were left out are named."""


def likely_causes(signals: Sequence[Agreement], gear_ratios: Sequence[float]) -> Iterator[str]:
    """Yield sentences on the likely slips of signals that do not agree, each naming its column.

    Args:
        signals: of a recording.
        gear_ratios: of the motor that each is of, NaN if it is of none or not known.
    """
    for signal, ratio in zip(signals, gear_ratios, strict=True):
        if signal.follows is None:
            yield from _cause_of(signal, ratio)
    for variable in dict.fromkeys(signal.variable for signal in signals if signal.follows):
        moved = [signal for signal in signals if signal.variable == variable and signal.follows]
        pairs = ", ".join(f"{signal.column} is like {signal.follows} computed" for signal in moved)
        yield f"columns look exchanged: {pairs}"
    still = [signal.column for signal in signals if signal.still == "computed"]
    if still:
        verb = "holds" if len(still) == 1 else "hold"
        known = "up to rounding or noise: no gain, offset or lag follows"
        yield f"{', '.join(still)} {verb} still as computed, {known}"


def _gains_of_causes(gear_ratio: float) -> Mapping[str, float]:
    """Return words for gains that slips of units, signs or sides of a gear make.

    Args:
        gear_ratio: of the motor that the signal is of, NaN if it is of none or not known.
    """
    slips = {
        "is in degrees": 180 / math.pi,
        "is in radians, but marked as degrees": math.pi / 180,
        "is in turns": 1 / (2 * math.pi),
        "is in thousandths of the unit": 1000.0,
        "is in thousands of the unit": 0.001,
    }
    if math.isfinite(gear_ratio) and abs(gear_ratio) != 1:
        slips["is of the motor's shaft, or of the other side of its gear"] = abs(gear_ratio)
        slips["is of the other side of the gear"] = 1 / abs(gear_ratio)
    return slips


def _cause_of(agreement: Agreement, gear_ratio: float) -> Iterator[str]:
    """Yield the likely cause of a signal that does not agree."""
    if not agreement.samples:
        yield f"{agreement.column} has no computed value: its joint is infeasible or singular throughout"
        return
    if agreement.left_out:
        samples = "1 sample" if agreement.left_out == 1 else f"{agreement.left_out} samples"
        where = (
            f"the largest error is {agreement.worst:+.3g} {agreement.unit} at {agreement.worst_time:.3f} s"
        )
        out = "left out of gain, offset and lag"
        yield f"{agreement.column} has {samples} far from all others, {out}: {where}"
    if agreement.still == "measured":
        yield f"{agreement.column} does not move, though {agreement.variable} was computed to"
    if not abs(agreement.correlation) >= ALIKE:
        return
    gain, size = agreement.gain, abs(agreement.gain)
    looks = next(
        (cause for cause, gain in _gains_of_causes(gear_ratio).items() if abs(size / gain - 1) < NEAR),
        None,
    )
    if gain < 0:
        yield f"{agreement.column} runs the other way (its gain is {gain:.4g})"
    if looks is not None:
        yield f"{agreement.column} looks as if it {looks} (its gain is {gain:.4g})"
    elif abs(size - 1) > NOTABLE and abs(size - 1) > SURE * agreement.gain_error:
        yield f"{agreement.column} is {size:.4g} times as large as computed"
    yield from _offset(agreement)


def _offset(agreement: Agreement) -> Iterator[str]:
    """Yield a sentence on an offset that is known and large."""
    turns = agreement.offset / (2 * math.pi)
    whole = abs(turns) > 1 / 2 and abs(turns - round(turns)) < NEAR
    if agreement.unit == "rad" and whole and abs(agreement.gain - 1) < NEAR:
        yield f"{agreement.column} is {round(turns):+d} turns off"
        return
    notable, sure = (
        NOTABLE * abs(agreement.gain) * float(np.ptp(agreement.computed)),
        SURE * agreement.offset_error,
    )
    if abs(agreement.offset) > notable and abs(agreement.offset) > sure:
        yield f"{agreement.column} is {agreement.offset:+.3g} {agreement.unit} off"
