"""What a signal that does not agree looks like: a wrong unit, sign, side of the gear, or column."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from vsacli.studies.measured.agreement import Agreement, straight_line

ALIKE = 0.98
"""Coefficient of correlation from which on the gain says something about units and signs."""

NEAR = 0.05
"""Relative distance at which a gain is taken for one that a slip makes."""

RESTING = 1e-3
"""Share of the computed range below which a measured signal does not move."""

EXCHANGED = 0.25
"""Share of the squared errors that may remain where columns look exchanged."""


def slips(signals: Sequence[Agreement], gear_ratios: Sequence[float]) -> Iterator[str]:
    """Sentences on what signals look like that do not agree, each naming its column.

    Args:
        signals: of a recording.
        gear_ratios: of the motor that each is of, NaN if it is of none or not known.
    """
    for signal, ratio in zip(signals, gear_ratios, strict=True):
        yield from _slip_of(signal, ratio)
    for variable in dict.fromkeys(signal.variable for signal in signals):
        yield from _exchanged([signal for signal in signals if signal.variable == variable])


def _gains_of_slips(gear_ratio: float) -> Mapping[str, float]:
    """What a gain looks like, by the gain that a slip of units, signs or sides of a gear makes.

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


def _slip_of(agreement: Agreement, gear_ratio: float) -> Iterator[str]:
    """What a signal looks like that does not agree."""
    if not agreement.samples:
        yield f"{agreement.column} has no computed value: its joint is infeasible or singular throughout"
        return
    moves = float(np.ptp(agreement.computed))
    if moves > 0 and np.ptp(agreement.measured) < RESTING * moves:
        yield f"{agreement.column} does not move, though {agreement.variable} was computed to"
        return
    if not abs(agreement.correlation) >= ALIKE:
        return
    sign, size = math.copysign(1.0, agreement.gain), abs(agreement.gain)
    looks = next(
        (slip for slip, gain in _gains_of_slips(gear_ratio).items() if abs(size / gain - 1) < NEAR), None
    )
    if sign < 0:
        yield f"{agreement.column} runs the other way (its gain is {agreement.gain:.4g})"
    if looks is not None:
        yield f"{agreement.column} looks as if it {looks} (its gain is {agreement.gain:.4g})"
    turns = agreement.offset / (2 * math.pi)
    whole = abs(turns) > 1 / 2 and abs(turns - round(turns)) < NEAR
    if agreement.unit == "rad" and whole and abs(agreement.gain - 1) < NEAR:
        yield f"{agreement.column} is {round(turns):+d} turns off"


def _exchanged(signals: Sequence[Agreement]) -> Iterator[str]:
    """Columns of a variable that agree much better with each other's computed values."""
    units = {signal.unit for signal in signals}
    if len(signals) < 2 or len(units) > 1 or len({signal.samples for signal in signals}) > 1:
        return
    from scipy.optimize import linear_sum_assignment

    costs = np.array([[np.sum((one.measured - other.computed) ** 2) for other in signals] for one in signals])
    rows, columns = linear_sum_assignment(costs)
    moved = [
        (signals[row], signals[column])
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
        if row != column
    ]
    alike = all(straight_line(other.computed, one.measured)[2] >= ALIKE for one, other in moved)
    if alike and costs[rows, columns].sum() < EXCHANGED * np.trace(costs):
        pairs = ", ".join(f"{one.column} is like {other.column} computed" for one, other in moved)
        yield f"columns look exchanged: {pairs}"
