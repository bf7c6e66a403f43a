"""What a signal that does not agree looks like: a wrong unit, sign, side of the gear, or column."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from vsacli.studies.measured.agreement import Agreement

ALIKE = 0.98
"""Coefficient of correlation from which on the gain says something about units and signs."""

NEAR = 0.05
"""Relative distance at which a gain is taken for one that a slip makes."""

SURE = 5.0
"""Standard errors from which on a gain or an offset is named; of a million right columns one has that."""

NOTABLE = 0.02
"""Gain less 1, or offset over the range, from which on it is named: few models are better."""

WILD = 20.0
"""Largest error, in root mean squares of the others, from which on samples that were left out are named."""


def slips(signals: Sequence[Agreement], gear_ratios: Sequence[float]) -> Iterator[str]:
    """Sentences on what signals look like that do not agree, each naming its column.

    Args:
        signals: of a recording.
        gear_ratios: of the motor that each is of, NaN if it is of none or not known.
    """
    for signal, ratio in zip(signals, gear_ratios, strict=True):
        if signal.follows is None:
            yield from _slip_of(signal, ratio)
    for variable in dict.fromkeys(signal.variable for signal in signals if signal.follows):
        moved = [signal for signal in signals if signal.variable == variable and signal.follows]
        pairs = ", ".join(f"{signal.column} is like {signal.follows} computed" for signal in moved)
        yield f"columns look exchanged: {pairs}"
    still = [signal.column for signal in signals if signal.still == "computed"]
    if still:
        verb = "holds" if len(still) == 1 else "hold"
        known = "up to rounding or noise: no gain, offset or lag follows"
        yield f"{', '.join(still)} {verb} still as computed, {known}"


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
        (slip for slip, slipped in _gains_of_slips(gear_ratio).items() if abs(size / slipped - 1) < NEAR),
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
    """A sentence on an offset that is known and large."""
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
