"""How well a measured signal agrees with a computed one, in figures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published, named

Still: TypeAlias = Literal["computed", "measured"]
"""Which of both signals does not move, beyond rounding or noise."""


@dataclass(frozen=True, eq=False)
class Agreement(Published):
    """Measured minus computed, over the samples of the recording for which something was computed.

    Attributes:
        column: of the recording.
        variable, joint, motor: what it was compared with; motor is None if it is none of a motor.
        unit: of the figures.
        samples: how many were compared.
        rms: root mean square of the error.
        share: that, relative to the root mean square of what was computed.
        worst, worst_time: largest error in size, with its sign, and when, s from the beginning of the result.
        offset, gain: of the straight line measured = offset + gain computed, at its lag.
        lag: how much later than the others it follows best, s.
        correlation: of both, at the lag.
        time, computed, measured: (samples,) of all that.
        offset_error, gain_error, lag_error: standard errors. These, and what they are of, are NaN where the
            samples do not determine them, as of signals that hold still.
        follows: column whose computed values it follows instead of its own, if columns are exchanged.
        still: "computed" if that does not move beyond rounding or the noise of the recording, "measured" if
            only
            the recording does not; None if both move.
        left_out: samples far from all others, without which the line was found.
    """

    column: str
    variable: str
    joint: str
    motor: int | None
    unit: str
    samples: int
    rms: float
    share: float
    worst: float
    worst_time: float
    offset: float
    gain: float
    correlation: float
    lag: float
    time: FloatArray = field(repr=False)
    computed: FloatArray = field(repr=False)
    measured: FloatArray = field(repr=False)
    offset_error: float = math.nan
    gain_error: float = math.nan
    lag_error: float = math.nan
    follows: str | None = None
    still: Still | None = None
    left_out: int = 0

    shape: ClassVar = named(
        *("column", "variable", "joint", "motor", "unit", "samples", "rms", "share", "worst", "worst_time"),
        *("offset", "offset_error", "gain", "gain_error", "correlation", "lag", "lag_error"),
        *("follows", "still", "left_out"),
    )


def straight_line(computed: FloatArray, measured: FloatArray) -> tuple[float, float, float]:
    """Of measured = offset + gain computed: offset, gain, coefficient of correlation; NaN if one is flat."""
    spread = float(np.std(computed))
    if not spread > 0 or not np.std(measured) > 0:
        return math.nan, math.nan, math.nan
    correlation = float(np.corrcoef(computed, measured)[0, 1])
    gain = correlation * float(np.std(measured)) / spread
    return float(np.mean(measured) - gain * np.mean(computed)), gain, correlation
