"""Agreement of measured with computed signals, and of two results: error figures, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar, cast

import numpy as np

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import FLAG_BITS, Flag, has_flag
from vsacli.base.json_records import Published, named
from vsacli.base.tables import ReportText, TextReport, cell
from vsacli.base.variables import MOTORS
from vsacli.documents.source import Source
from vsacli.results.charts.comparison import check_comparable
from vsacli.results.store.reader import StoredResult
from vsacli.studies.measured.line_fit import Still, root_mean_square


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
class Comparison(Published, TextReport):
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
        **named("format", "result", "recording", "time_offset", "time_offset_error"),
        **named("found", "duration", "compared", "signals", "warnings", "notes"),
    }

    @property
    def title(self) -> str:
        """Names, the largest relative error, and the time offset."""
        offset = with_error(self.time_offset, self.time_offset_error, "s", "+.4f")
        return f"{self.result}, {self.recording}: {self._worst_agreement()}; time offset {offset}"

    def as_text(self) -> ReportText:
        """Return the report in parts."""
        how = "found from the signals" if self.found else "as given"
        covered = f"{self.compared:.4g} s of {self.duration:.4g} s compared; time offset {how}"
        found = [*(f"warning: {warning}" for warning in self.warnings), *self.notes]
        return ReportText(self.title, found, [self._rows()], [covered])

    def _worst_agreement(self) -> str:
        known = [each for each in self.signals if math.isfinite(each.share)]
        worst = max(known, key=lambda each: each.share, default=None)
        if worst is None:
            return "no relative error, since no computed signal changes"
        return f"rms error up to {100 * worst.share:.3g} % ({worst.column})"

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
        return [header, *map(_agreement_row, self.signals)]


def _agreement_row(agreement: Agreement) -> tuple[str, ...]:
    return (
        agreement.column,
        agreement.variable,
        agreement.unit,
        cell(agreement.rms, ".3g"),
        cell(100 * agreement.share, ".3g"),
        cell(agreement.worst, "+.3g"),
        cell(agreement.worst_time, ".3f"),
        with_error(agreement.offset, agreement.offset_error, "", "+.2g"),
        with_error(agreement.gain, agreement.gain_error, "", ".4g"),
        with_error(1e3 * agreement.lag, 1e3 * agreement.lag_error, "", "+.1f"),
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


SHOWN = ("q", "stiffness", "tau_e", "tau_motor")
"""Variables in the text; all are in JSON."""


@dataclass(frozen=True)
class SignalDifference(Published):
    """A variable of a joint or motor in two results, at the times of the first that both have.

    Attributes:
        variable, joint, motor: place in the results; motor is None for variables of joints.
        unit: unit of the values.
        samples: number of samples with a value in both.
        rms: root mean square in the first and in the second result.
        peak: largest magnitude in both.
        difference: root mean square of the second minus the first.
        share: the same relative to the rms of the first; NaN if that is zero.
        worst, worst_time: difference of largest size, with its sign, and its time, s.
    """

    variable: str
    joint: str
    motor: int | None
    unit: str
    samples: int
    rms: tuple[float, float]
    peak: tuple[float, float]
    difference: float
    share: float
    worst: float
    worst_time: float


@dataclass(frozen=True)
class FlagCount(Published):
    """The number of samples with a flag at a joint, in the first and in the second result."""

    joint: str
    flag: str
    samples: tuple[int, int]


@dataclass(frozen=True)
class ResultDifference(Published, TextReport):
    """The comparison of two results.

    Attributes:
        result, other: paths of the files.
        compared: duration that both have in common, s.
        signals: differences of each variable.
        flags: samples of each flag that either has.
        format: format of the JSON object.
    """

    result: str
    other: str
    compared: float
    signals: tuple[SignalDifference, ...]
    flags: tuple[FlagCount, ...]
    format: str = "vsacli-difference/1"

    def as_text(self) -> ReportText:
        """Return the report in parts."""
        table = [_HEADER, *(_difference_row(each) for each in self.signals if each.variable in SHOWN)]
        counts: list[tuple[str, ...]] = [("joint", "flag", "samples", "of the other")]
        counts += [(each.joint, each.flag, *map(str, each.samples)) for each in self.flags]
        lines = f"{self.compared:.4g} s compared; to draw both: vsacli plot {self.result} {self.other}"
        return ReportText(self._headline(), (), [table, counts if self.flags else []], [lines])

    def _headline(self) -> str:
        finite = [each for each in self.signals if each.variable in SHOWN and math.isfinite(each.share)]
        largest = max(finite, key=lambda each: each.share, default=None)
        if largest is None or not largest.share:
            return f"{self.result}, {self.other}: no difference"
        place = f"{largest.joint}.{largest.variable}{f'_{largest.motor}' if largest.motor else ''}"
        return f"{self.result}, {self.other}: rms difference up to {100 * largest.share:.3g} % ({place})"


_HEADER = (
    *("signal", "unit", "rms", "of the other", "peak", "of the other"),
    *("rms difference", "of rms\n%", "largest", "at\ns"),
)


def _difference_row(signal: SignalDifference) -> tuple[str, ...]:
    motor = f"_{signal.motor}" if signal.motor else ""
    return (
        f"{signal.joint}.{signal.variable}{motor}",
        signal.unit,
        *(cell(value, ".4g") for value in (*signal.rms, *signal.peak, signal.difference)),
        cell(100 * signal.share),
        cell(signal.worst, "+.3g"),
        cell(signal.worst_time, ".3f"),
    )


def compare_results(result: StoredResult, other: StoredResult) -> ResultDifference:
    """Compare two results: root mean squares, peaks and differences of each variable, and flags.

    Values of the second result are interpolated linearly to the times of the first.

    Raises:
        InputError: the files are of different kinds, have different joints, or no common time.
    """
    check_comparable([result, other])
    start, end = max(result.time[0], other.time[0]), min(result.time[-1], other.time[-1])
    common = (result.time >= start) & (result.time <= end)
    if not common.any():
        raise InputError.one(f"has no time in common with {result.path}", other.path)
    return ResultDifference(
        str(result.path),
        str(other.path),
        float(end - start),
        tuple(_signal_differences(result, other, common)),
        tuple(_flag_counts(result, other)),
    )


def _signal_differences(
    result: StoredResult, other: StoredResult, common: BoolArray
) -> Iterator[SignalDifference]:
    time = result.time[common]
    for name in result.variables:
        dimensions = result.declared[name].dims
        if name in other.variables and name not in FLAG_BITS and dimensions[0] == "joint":
            result_values, other_values = (
                np.asarray(each.read(name), dtype=np.float64) for each in (result, other)
            )
            for index, joint in enumerate(result.joint_names):
                unit = result.declared[name].quantity.unit(result.joint_types[index])
                for motor in MOTORS if "motor" in dimensions else (None,):
                    value_index = (slice(None), index, *(() if motor is None else (motor - 1,)))
                    with np.errstate(invalid="ignore"):  # infinite values, which are not compared
                        interpolated = np.interp(time, other.time, other_values[value_index])
                    yield _compare_signal(
                        name, joint, motor, unit, time, result_values[value_index][common], interpolated
                    )


def _compare_signal(
    variable: str,
    joint: str,
    motor: int | None,
    unit: str,
    time: FloatArray,
    values: FloatArray,
    other_values: FloatArray,
) -> SignalDifference:
    finite = np.isfinite(values) & np.isfinite(other_values)
    values, other_values = values[finite], other_values[finite]
    error = other_values - values
    worst_index = int(np.argmax(np.abs(error))) if error.size else None
    rms, difference = root_mean_square(values), root_mean_square(error)
    return SignalDifference(
        variable,
        joint,
        motor,
        unit,
        int(error.size),
        (rms, root_mean_square(other_values)),
        (_peak_magnitude(values), _peak_magnitude(other_values)),
        difference,
        difference / rms if rms > 0 else math.nan,
        math.nan if worst_index is None else float(error[worst_index]),
        math.nan if worst_index is None else float(time[finite][worst_index]),
    )


def _peak_magnitude(values: FloatArray) -> float:
    return float(np.abs(values).max()) if values.size else math.nan


def _flag_counts(result: StoredResult, other: StoredResult) -> Iterator[FlagCount]:
    if all("flags" in each.variables for each in (result, other)):
        flags, other_flags = (cast("FlagArray", each.read("flags")) for each in (result, other))
        for index, joint in enumerate(result.joint_names):
            for flag in Flag:
                counts = [
                    int(np.count_nonzero(has_flag(each[:, index], flag))) for each in (flags, other_flags)
                ]
                if any(counts):
                    yield FlagCount(joint, str(flag.name).lower(), (counts[0], counts[1]))
