"""Comparison of two results, or two simulations, of the same joints: variables and flags."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import FLAG_BITS, Flag, has_flag
from vsacli.base.json_records import Published
from vsacli.base.tables import ReportText, TextReport, cell
from vsacli.base.variables import MOTORS
from vsacli.results.charts.comparison import check_comparable
from vsacli.results.store.reader import StoredResult
from vsacli.studies.measured.line_fit import root_mean_square

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
        dims = result.declared[name].dims
        if name in other.variables and name not in FLAG_BITS and dims[0] == "joint":
            first, second = (np.asarray(each.read(name), dtype=np.float64) for each in (result, other))
            for index, joint in enumerate(result.joint_names):
                unit = result.declared[name].quantity.unit(result.joint_types[index])
                for motor in MOTORS if "motor" in dims else (None,):
                    column = (slice(None), index, *(() if motor is None else (motor - 1,)))
                    with np.errstate(invalid="ignore"):  # infinite values, which are not compared
                        moved = np.interp(time, other.time, second[column])
                    yield _compare_signal(name, joint, motor, unit, time, first[column][common], moved)


def _compare_signal(
    variable: str,
    joint: str,
    motor: int | None,
    unit: str,
    time: FloatArray,
    values: FloatArray,
    others: FloatArray,
) -> SignalDifference:
    there = np.isfinite(values) & np.isfinite(others)
    values, others = values[there], others[there]
    error = others - values
    worst = int(np.argmax(np.abs(error))) if error.size else None
    rms, difference = root_mean_square(values), root_mean_square(error)
    return SignalDifference(
        variable,
        joint,
        motor,
        unit,
        int(error.size),
        (rms, root_mean_square(others)),
        (_peak_magnitude(values), _peak_magnitude(others)),
        difference,
        difference / rms if rms > 0 else math.nan,
        math.nan if worst is None else float(error[worst]),
        math.nan if worst is None else float(time[there][worst]),
    )


def _peak_magnitude(values: FloatArray) -> float:
    return float(np.abs(values).max()) if values.size else math.nan


def _flag_counts(result: StoredResult, other: StoredResult) -> Iterator[FlagCount]:
    if all("flags" in each.variables for each in (result, other)):
        flags, others = (cast("FlagArray", each.read("flags")) for each in (result, other))
        for index, joint in enumerate(result.joint_names):
            for flag in Flag:
                counts = [int(np.count_nonzero(has_flag(each[:, index], flag))) for each in (flags, others)]
                if any(counts):
                    yield FlagCount(joint, str(flag.name).lower(), (counts[0], counts[1]))
