"""Agreement of measured with computed signals: error figures of each, and the report as text and as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published, named
from vsacli.base.tables import ReportText, cell
from vsacli.documents.source import Source

Still: TypeAlias = Literal["computed", "measured"]
"""Signal that does not change beyond rounding or noise."""


@dataclass(frozen=True, eq=False)
class Agreement(Published):
    """The agreement of a measured with a computed signal; errors are measured minus computed values.

    Attributes:
        column: column of the recording.
        variable, joint, motor: place in the result; motor is None for variables of joints.
        unit: unit of the figures.
        samples: number of compared samples.
        rms: rms error.
        share: rms error relative to the rms computed value.
        worst, worst_time: error of largest size, with its sign, and its time, s since the result's start.
        offset, gain: coefficients of the line measured = offset + gain computed, at the lag.
        lag: delay of the measured signal against the alignment of all signals, s.
        correlation: correlation of measured and computed values at the lag.
        time, computed, measured: times and values of the compared samples, (samples,).
        offset_error, gain_error, lag_error: standard errors. A value and its error are NaN if the samples do
            not determine them, for example for constant signals.
        follows: column whose computed values the signal follows instead of its own, if columns are exchanged.
        still: "computed" if the computed signal does not change beyond rounding or the noise of the
            recording, "measured" if only the recording does not; None if both change.
        left_out: number of outliers that the line fit ignores.
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
    """Return offset, gain and correlation of measured = offset + gain computed; NaN if one is flat."""
    spread = float(np.std(computed))
    if not spread > 0 or not np.std(measured) > 0:
        return math.nan, math.nan, math.nan
    correlation = float(np.corrcoef(computed, measured)[0, 1])
    gain = correlation * float(np.std(measured)) / spread
    return float(np.mean(measured) - gain * np.mean(computed)), gain, correlation


MOST_DECIMALS = 6
"""Decimals beyond which a standard error is printed with an exponent, as for exact data."""

SHOWN_LAG = 5e-4
"""Smallest common lag, s, that is reported as a possible offset between clocks."""


@dataclass(frozen=True)
class Comparison(Published):
    """The comparison of measurements with a result.

    Attributes:
        result, recording: paths of the files.
        time_offset: time in the recording at which the result begins, s since the first sample.
        time_offset_error: standard error of `time_offset`, s; NaN if it was given.
        found: whether `time_offset` was found from the signals.
        duration: duration of the result, s.
        compared: duration of the part that the recording covers, s.
        signals: agreement of each compared column.
        notes: likely mistakes, and columns that were not compared.
        warnings: reasons why the figures may mean nothing, as sentences.
        sources: recording as read; not in JSON.
    """

    result: str
    recording: str
    time_offset: float
    time_offset_error: float
    found: bool
    duration: float
    compared: float
    signals: tuple[Agreement, ...]
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    sources: tuple[Source, ...] = field(repr=False, default=())

    format: ClassVar[str] = "vsacli-comparison/2"
    shape: ClassVar = {
        "format": "format",
        **{name: name for name in ("result", "recording", "time_offset", "time_offset_error")},
        **{name: name for name in ("found", "duration", "compared")},
        **{name: name for name in ("signals", "warnings", "notes")},
    }

    def __str__(self) -> str:
        return str(self.as_text())

    @property
    def title(self) -> str:
        """Names, the largest relative error, and the time offset."""
        return f"{self.result}, {self.recording}: {self._worst()}; {self._alignment()}"

    def as_text(self) -> ReportText:
        """Return the report in parts."""
        how = "found from the signals" if self.found else "as given"
        covered = f"{self.compared:.4g} s of {self.duration:.4g} s compared; time offset {how}"
        found = [*(f"warning: {warning}" for warning in self.warnings), *self.notes]
        return ReportText(self.title, found, [self._rows()], [covered])

    def _worst(self) -> str:
        known = [each for each in self.signals if math.isfinite(each.share)]
        worst = max(known, key=lambda each: each.share, default=None)
        if worst is None:
            return "no relative error, since no computed signal changes"
        return f"rms error up to {100 * worst.share:.3g} % ({worst.column})"

    def _alignment(self) -> str:
        """Return at which time in the recording the result begins."""
        return f"time offset {with_error(self.time_offset, self.time_offset_error, 's', '+.4f')}"

    def _rows(self) -> list[tuple[str, ...]]:
        header = (
            "measured",
            "compared with",
            "unit",
            "rms error",
            "of rms\n%",
            "largest",
            "at\ns",
            "offset",
            "gain",
            "lag\nms",
        )
        return [header, *map(_row, self.signals)]


def _row(signal: Agreement) -> tuple[str, ...]:
    return (
        signal.column,
        signal.variable,
        signal.unit,
        cell(signal.rms, ".3g"),
        cell(100 * signal.share, ".3g"),
        cell(signal.worst, "+.3g"),
        cell(signal.worst_time, ".3f"),
        with_error(signal.offset, signal.offset_error, "", "+.2g"),
        with_error(signal.gain, signal.gain_error, "", ".4g"),
        with_error(1e3 * signal.lag, 1e3 * signal.lag_error, "", "+.1f"),
    )


def with_error(value: float, error: float, unit: str, form: str) -> str:
    """Return a value rounded to one digit of its standard error, with it; by the form without one."""
    if not math.isfinite(value):
        return "-"
    if not (math.isfinite(error) and error > 0):
        return f"{value:{form}} {unit}".rstrip()
    decimals = -math.floor(math.log10(error))
    if decimals > MOST_DECIMALS:
        return f"{value:{form}} +- {error:.1g} {unit}".rstrip()
    rounded, sign = (
        round(value, decimals) or 0.0,
        "+" if form.startswith("+") and round(value, decimals) else "",
    )
    shown, spread = (f"{each:{kind}.{max(decimals, 0)}f}" for each, kind in ((rounded, sign), (error, "")))
    return f"{shown} +- {spread} {unit}".rstrip()
