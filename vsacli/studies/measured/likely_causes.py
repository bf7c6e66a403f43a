"""Likely causes of a disagreement: a wrong unit, sign, side of the gear, or column."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray
from vsacli.base.units import time_text
from vsacli.studies.measured.agreement import Agreement
from vsacli.studies.measured.pairing import FEWEST_SAMPLES, Pairing, exactness, moments_of, tame, unlikeness
from vsacli.trajectory.recorded.faults import Faults, angle_wraps

SAVED = math.log(4.0)
"""Required decrease of the log of the unexplained part of each column by an exchange."""

LEFT = math.log(0.1)
"""Largest log of the unexplained part of an exchanged column."""

REVERSED = 0.25
"""Ratio of squared errors, with opposite signs to with an exchange, below which the former explains columns
better. Torques of two motors that pull against each other are nearly opposite, so that both explain much."""


def exchanged_places(pairings: Sequence[Pairing], groups: Sequence[object], shift: float) -> list[int]:
    """Return, for each column, the index of the column whose computed signal it follows.

    It is the column's own index unless columns are exchanged. Each column is compared with all computed
    signals of its group over its own samples, so that empty cells in other columns do not matter.

    Args:
        pairings: pairings of all columns.
        groups: group of each column; columns of a group may be exchanged with each other.
        shift: time in the recording at which the result begins, s.
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
    """Return the indices of exchanged columns, each with the index of the signal that it follows.

    Args:
        measured: values of each column.
        exact: smallest unexplained share of the variance that counts, for each column.
        computed: function that returns all signals at the times of a column, given by index.
    """
    if len(measured) < 2:
        return []
    costs = np.array(
        [_unexplained_parts(values, exact[row], computed(row)) for row, values in enumerate(measured)]
    )
    rows, columns = scipy.optimize.linear_sum_assignment(costs)
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


@np.errstate(all="ignore")  # constant signals explain nothing
def _unexplained_parts(measured: FloatArray, exact: float, computed: Sequence[FloatArray]) -> FloatArray:
    """Return the unexplained part of measured values for each computed signal, (signals,)."""
    moments = [moments_of(each, tame(measured)) for each in computed]
    if min(float(each.samples) for each in moments) < FEWEST_SAMPLES:
        return np.zeros(len(computed))
    scale = max(float(np.max(each.spreads()[:2])) for each in moments)
    return np.array([float(unlikeness(each, exact, scale)) for each in moments])


ALIKE = 0.98
"""Correlation coefficient from which on the gain is evidence of wrong units and signs."""

NEAR = 0.05
"""Relative distance of a gain from that of a likely cause."""

SURE = 5.0
"""Deviation in standard errors from which on a gain or an offset is reported; one in a million correct
columns exceeds it."""

NOTABLE = 0.02
"""Deviation of a gain from 1, or ratio of an offset to the range, from which on it is reported: few models
are better."""

UNWRAP = "unwrap: true in the file of --columns"
"""Way to read wrapped angles."""

TORQUES = "tau_motor"
"""Variable whose gains show a wrong model."""

FEWEST_OFF = 2
"""Fewest torques with another gain that are evidence of a wrong model rather than a wrong sensor."""

WILD = 20.0
"""Ratio of the largest error to the rms of the others from which on outliers are reported."""


def likely_causes(signals: Sequence[Agreement], gear_ratios: Sequence[float]) -> Iterator[str]:
    """Yield sentences on the likely causes of disagreements, each naming its column.

    Args:
        signals: agreements of a recording.
        gear_ratios: gear ratio of the motor of each signal; NaN without a motor, or if unknown.
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


def wrong_model(signals: Sequence[Agreement], gear_ratios: Sequence[float]) -> Iterator[str]:
    """Yield a sentence if several torques have a gain that points to the model rather than a sensor.

    Args:
        signals: agreements of a recording.
        gear_ratios: gear ratio of the motor of each signal; NaN without a motor, or if unknown.
    """
    rated = zip(signals, gear_ratios, strict=True)
    torques = [each for each, ratio in rated if each.variable == TORQUES and _gain_is_off(each, ratio)]
    if len(torques) >= FEWEST_OFF:
        yield "gains of several torques differ: the model may be wrong; run vsacli identify ROBOT RECORDING"


def _gains_of_causes(gear_ratio: float) -> Mapping[str, float]:
    """Return the gains that wrong units or sides of a gear cause, by clause.

    Args:
        gear_ratio: gear ratio of the signal's motor; NaN without a motor, or if unknown.
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


def _looks(size: float, gear_ratio: float) -> str | None:
    """Return the clause of the likely cause of a gain of this size; None if it is like none."""
    gains = _gains_of_causes(gear_ratio).items()
    return next((cause for cause, gain in gains if abs(size / gain - 1) < NEAR), None)


def mistaken(agreement: Agreement, gear_ratio: float) -> bool:
    """Return whether a mistake explains an error: column, sign, unit, offset, wraps, or side of the gear.

    Args:
        agreement: agreement of a column.
        gear_ratio: gear ratio of its motor; NaN without a motor, or if unknown.
    """
    if agreement.follows is not None or _wraps(agreement):
        return True
    size = abs(agreement.gain)
    likely = abs(size - 1) < NEAR or _looks(size, gear_ratio) is not None
    return abs(agreement.correlation) >= ALIKE and likely


def _cause_of(agreement: Agreement, gear_ratio: float) -> Iterator[str]:
    """Yield sentences on the likely cause of a signal's disagreement."""
    if not agreement.samples:
        yield f"{agreement.column} has no computed value: its joint is infeasible or singular throughout"
        return
    if wraps := _wraps(agreement):
        jumps = "jumps by 2 pi" + ("" if wraps.count == 1 else f" {wraps.count} times, first")
        when = time_text(float(agreement.time[wraps.at]))
        yield f"{agreement.column} {jumps} at {when}, a wrapped angle: set {UNWRAP}"
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
    looks = _looks(size, gear_ratio)
    if gain < 0:
        yield f"{agreement.column} runs the other way (its gain is {gain:.4g})"
    if looks is not None:
        yield f"{agreement.column} looks as if it {looks} (its gain is {gain:.4g})"
    elif _gain_is_off(agreement, gear_ratio):
        yield f"{agreement.column} is {size:.4g} times as large as computed"
    yield from _offset(agreement)


def _wraps(agreement: Agreement) -> Faults | None:
    return angle_wraps(agreement.measured) if agreement.unit == "rad" else None


def _gain_is_off(agreement: Agreement, gear_ratio: float) -> bool:
    """Return whether a gain surely differs from 1, without a likely mistake as the cause."""
    size = abs(agreement.gain)
    similar = abs(agreement.correlation) >= ALIKE and agreement.follows is None
    off = abs(size - 1) > NOTABLE and abs(size - 1) > SURE * agreement.gain_error  # not if it is NaN
    return similar and off and _looks(size, gear_ratio) is None


def _offset(agreement: Agreement) -> Iterator[str]:
    """Yield a sentence on an offset that is significant and large."""
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
