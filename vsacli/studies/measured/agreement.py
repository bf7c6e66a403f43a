"""How well a measured signal agrees with a computed one, in figures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published, named


@dataclass(frozen=True, eq=False)
class Agreement(Published):
    """Measured minus computed, over the samples of the recording for which something was computed.

    Attributes:
        column: of the recording.
        variable, joint, motor: what it is; motor is None if it is none of a motor.
        unit: of the figures.
        samples: how many were compared.
        rms: root mean square of the error.
        share: that, relative to the root mean square of what was computed.
        worst, worst_time: largest error in size, with its sign, and when, s from the beginning of the result.
        offset, gain: of the straight line measured = offset + gain computed; NaN if nothing moves.
        correlation: of both; NaN if nothing moves.
        lag: how much later than the others it follows best, s; NaN if nothing moves.
        time, computed, measured: (samples,) of all that.
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

    shape: ClassVar = named(
        *("column", "variable", "joint", "motor", "unit", "samples", "rms", "share", "worst", "worst_time"),
        *("offset", "gain", "correlation", "lag"),
    )


def straight_line(computed: FloatArray, measured: FloatArray) -> tuple[float, float, float]:
    """Of measured = offset + gain computed: offset, gain, coefficient of correlation; NaN if one is flat."""
    spread = float(np.std(computed))
    if not spread > 0 or not np.std(measured) > 0:
        return math.nan, math.nan, math.nan
    correlation = float(np.corrcoef(computed, measured)[0, 1])
    gain = correlation * float(np.std(measured)) / spread
    return float(np.mean(measured) - gain * np.mean(computed)), gain, correlation
