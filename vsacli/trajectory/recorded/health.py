"""The health of a recording, checked before it is fitted: faults of stamps, sensors and log files.

A warning summarizes a kind of fault in a column: number, first time, largest size, and advice. Outliers are
left out: a smooth curve through their neighbors replaces them. Stamps may have gaps, jitter, or a unit other
than seconds.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import POSITION, Signal
from vsacli.base.units import Quantity, WrenchQuantity, time_text
from vsacli.documents.time_column import UNITS, unit_of_steps
from vsacli.trajectory.recorded.faults import (
    ORDER,
    Faults,
    Outliers,
    Quantization,
    angle_wraps,
    derivative_outliers,
    frozen_stretches,
    outliers,
    rows_per_value,
    saturated_stretches,
)
from vsacli.trajectory.recorded.problems import SampleProblem
from vsacli.trajectory.recorded.samples import SignalSamples, stamp_resolution
from vsacli.trajectory.recorded.thresholds import (
    ENOUGH_ROWS,
    GAP_STEPS,
    JITTER_SHARE,
    LARGEST_ANGLE,
    LARGEST_TRAVEL,
    LONGEST_STEP,
    SHORTEST_STEP,
)


def stamp_faults(stamps: FloatArray) -> Iterator[SampleProblem]:
    """Yield the faults of ascending stamps, (samples,), s."""
    steps = np.diff(stamps)
    median_step = float(np.median(steps))
    if len(stamps) >= ENOUGH_ROWS and not SHORTEST_STEP <= median_step <= LONGEST_STEP:
        yield SampleProblem("time", _suspect_unit(median_step, float(stamps[-1] - stamps[0])))
        return
    long_indices = np.flatnonzero(steps > GAP_STEPS * median_step)
    if long_indices.size:
        longest_index = long_indices[np.argmax(steps[long_indices])]
        gaps = "a gap" if len(long_indices) == 1 else f"{len(long_indices)} gaps, the longest"
        yield SampleProblem(
            "time",
            f"has {gaps} of {step_text(float(steps[longest_index]))} from t = "
            f"{time_text(float(stamps[longest_index]))} on;"
            f" rows are usually {step_text(median_step)} apart. Motion and torques meanwhile are "
            "a guess of the"
            " spline: cut the recording there, or record again",
            sample=int(longest_index) + 1,
        )
    jitter = _jitter(stamps, steps, median_step)
    if jitter > JITTER_SHARE:
        rate = mean_rate(stamps)
        yield SampleProblem(
            "time",
            f"jitters: steps of about {step_text(1 / rate)} change by {100 * jitter:.2g} % from one to the"
            " next. Where stamps are late, not samples, this is noise of the motion. For torques at equal"
            f" steps, as drives need them, set rate: {rate:g} in a trajectory file",
        )


def mean_rate(stamps: FloatArray) -> float:
    """Return the mean rate of the rows, 1/s, without gaps, in the digits that it is known to."""
    steps = np.diff(stamps)
    return float(f"{1 / np.mean(steps[steps <= GAP_STEPS * np.median(steps)]):.3g}")


def step_text(step: float) -> str:
    """Return the text of a short time with a suitable unit."""
    size, unit = (step, "s") if step >= 1 else (1e3 * step, "ms") if step >= 9.9e-4 else (1e6 * step, "us")
    return f"{size:.3g} {unit}"


def _suspect_unit(median_step: float, duration: float) -> str:
    rows = f"rows are {median_step:.4g} s apart, and the recording lasts {float(f'{duration:.4g}'):g} s"
    unit = unit_of_steps(median_step)
    if unit is None:
        return f"is hardly in seconds: {rows}; write its unit in the header, e.g. time[ms]"
    interval_text = step_text(median_step * UNITS[unit])
    return f"looks like {unit}: {rows}; if rows are {interval_text} apart, write time[{unit}] in the header"


def _jitter(stamps: FloatArray, steps: FloatArray, median_step: float) -> float:
    """Return the median change of successive intervals, in intervals, beyond that due to their resolution."""
    if len(steps) < 2:
        return 0.0
    change = float(np.median(np.abs(np.diff(steps))))
    return max(0.0, change - 2 * stamp_resolution(stamps)) / median_step


class CheckedSignals(NamedTuple):
    """Recorded signals without outliers.

    Attributes:
        records: signals with a smooth curve through the neighbors of outliers in their place.
        problems: probable faults of the recording.
    """

    records: list[SignalSamples]
    problems: list[SampleProblem]


def check_health(
    stamps: FloatArray,
    records: Sequence[SignalSamples],
    types: Sequence[str] = (),
    interpolated: Collection[Signal] = (),
) -> CheckedSignals:
    """Find probable faults of a usable recording, and leave outliers out.

    Args:
        stamps: recorded stamps, (samples,), s.
        records: signals that are used, without problems.
        types: joint types, "revolute" or "prismatic", for units; empty if unknown.
        interpolated: signals whose spline passes all samples; those with all derivatives are computed, as
            the tables of fixes and optima are, and are not checked.
    """
    if len(stamps) <= ORDER:
        return CheckedSignals(list(records), [])
    checked = CheckedSignals([], list(stamp_faults(stamps)))
    for record in records:
        columns = {name: rows.copy() for name, rows in record.columns.items()}
        names = record.signal.names
        # a stiffness with its derivatives is computed, not measured: outliers are kinks of its profile
        measured = record.signal is POSITION or columns.keys() == {names[0]}
        quantities = () if record.complete and record.signal in interpolated else record.signal.quantities
        for quantity, name, lower in zip(quantities, names, (None, *names), strict=False):
            if name not in columns or not (lower is None or measured):
                continue
            for component in np.flatnonzero(record.has_values).tolist():
                row, unit = columns[name][component], _format_unit(quantity, component, types)
                if lower is None:
                    is_angle = record.signal is POSITION
                    ends = LEFT_OUT if measured else USED
                    column_outliers, sentences = _check_values(
                        stamps, record.time, row, unit, ends, angle=is_angle
                    )
                else:
                    lower_values = columns.get(lower)
                    lower_values = None if lower_values is None else lower_values[component]
                    column_outliers, sentences = _check_derivative(
                        stamps, record.time, lower_values, row, unit
                    )
                if column_outliers is not None and measured:
                    row[:] = column_outliers.smoothed(row)
                checked.problems.extend(
                    SampleProblem(name, sentence, component, first) for first, sentence in sentences
                )
        checked.records.append(record.with_columns(columns))
    return checked


def unit_doubts(records: Sequence[SignalSamples], types: Mapping[int, str]) -> Iterator[SampleProblem]:
    """Yield positions that are too large for rad or m.

    Args:
        records: signals that are used.
        types: types, "revolute" or "prismatic", of joints without a unit in the header, by index.
    """
    for record in records:
        for index, kind in types.items() if record.signal is POSITION else ():
            name, max_magnitude = POSITION.names[0], float(np.abs(record.values[index]).max())
            if kind == "revolute" and max_magnitude > LARGEST_ANGLE:
                extent = f"{max_magnitude:.4g} rad, {max_magnitude / (2 * np.pi):.3g} turns"
                yield SampleProblem(
                    name, f"goes to {extent}; are these degrees? {_advise_unit('deg')}", index
                )
            elif kind == "prismatic" and max_magnitude > LARGEST_TRAVEL:
                yield SampleProblem(
                    name, f"goes to {max_magnitude:.4g} m; are these mm? {_advise_unit('mm')}", index
                )


LEFT_OUT = "left out, with the curve in its place", "left out, with the curve in their place"
USED = (
    "derivatives follow such outliers; delete the row",
    "derivatives follow such outliers; delete these rows",
)
"""Ends of sentences on one outlier or several, by whether the reader leaves them out."""


def column_faults(
    stamps: FloatArray,
    time: FloatArray,
    values: FloatArray,
    unit: str = "",
    *,
    angle: bool = False,
    left_out: bool = False,
) -> Iterator[tuple[int, str]]:
    """Yield the first sample of each kind of fault of a column, and a sentence without its subject.

    Args:
        stamps: recorded stamps, (samples,), s.
        time: times from the first sample on, (samples,), s.
        values: column, (samples,), more than four samples.
        unit: unit of its values, after a space.
        angle: whether the values may be wrapped angles.
        left_out: whether outliers are left out where the column is used.
    """
    ends = LEFT_OUT if left_out else USED
    yield from _check_values(stamps, time, values, unit, ends, angle=angle)[1]


_ColumnCheck = tuple[Outliers | None, list[tuple[int, str]]]
"""Outliers of a column, and the first sample of each kind of fault with a sentence."""


def _check_values(
    stamps: FloatArray,
    time: FloatArray,
    values: FloatArray,
    unit: str,
    ends: tuple[str, str],
    *,
    angle: bool,
) -> _ColumnCheck:
    """Check a column of values, see `column_faults`; `ends` are the ends of sentences on outliers."""
    if np.ptp(values) == 0:
        return None, []
    quantization = Quantization.of(time, values)
    if (rows := rows_per_value(values, quantization)) > 1:
        sensor_sentence = (
            f"has each value in {rows} rows: its sensor is slower than the stamps; keep one row in {rows}"
        )
        return None, [(0, sensor_sentence)]
    column_outliers = outliers(time, values, quantization)
    smoothed = values if column_outliers is None else column_outliers.smoothed(values)
    return column_outliers, [
        *_outlier_sentences(column_outliers, stamps, unit, ends),
        *_stretch_faults(stamps, time, smoothed, quantization, unit, angle=angle),
    ]


def _check_derivative(
    stamps: FloatArray, time: FloatArray, lower: FloatArray | None, values: FloatArray, unit: str
) -> _ColumnCheck:
    """Check a column of a given derivative, which may rest, saturate or be held while the values move."""
    if np.ptp(values) == 0:
        return None, []
    column_outliers = derivative_outliers(time, lower, values, Quantization.of(time, values))
    return column_outliers, list(_outlier_sentences(column_outliers, stamps, unit, LEFT_OUT))


def _outlier_sentences(
    column_outliers: Outliers | None, stamps: FloatArray, unit: str, ends: tuple[str, str]
) -> Iterator[tuple[int, str]]:
    if column_outliers is not None:
        extent = _format_worst(
            column_outliers, stamps, [f"{size:.3g}{unit}" for size in column_outliers.sizes.tolist()]
        )
        yield (
            column_outliers.at,
            f"is off {_format_occasions(column_outliers, stamps)}, by {extent} from a smooth "
            "curve, amid samples that"
            f" are on it: {ends[column_outliers.count > 1]}",
        )


def _stretch_faults(
    stamps: FloatArray,
    time: FloatArray,
    values: FloatArray,
    quantization: Quantization,
    unit: str,
    *,
    angle: bool,
) -> Iterator[tuple[int, str]]:
    if frozen := frozen_stretches(time, values, quantization):
        yield (
            frozen.at,
            f"is frozen {_format_occasions(frozen, stamps)}, for {_format_longest(frozen, stamps)},"
            f" {_count_equal_samples(frozen)}, while the motion goes on: these samples were lost;"
            f" {_advise_frozen_rows(frozen, stamps)}, or record again",
        )
    if saturated := saturated_stretches(time, values, quantization):
        at = f"{values[saturated.first[0]]:.4g}{unit}"
        yield (
            saturated.at,
            f"is cut off at {at} {_format_occasions(saturated, stamps)}, for "
            f"{_format_longest(saturated, stamps)}"
            " while the motion goes on: the sensor or the log file has no larger range; record again",
        )
    if angle and (wrapped := angle_wraps(values)):
        yield (
            wrapped.at,
            f"jumps by 2 pi {_format_occasions(wrapped, stamps)}: an angle that was wrapped? Set unwrap: true"
            " under position in a trajectory file, or in the file of --columns",
        )


def _format_unit(quantity: Quantity, component: int, types: Sequence[str]) -> str:
    """Return the unit after a space; "" if unknown."""
    if isinstance(quantity, WrenchQuantity):
        return f" {quantity.of_axis(component)}"
    return f" {quantity.unit(types[component])}" if types else ""


def _advise_unit(unit: str) -> str:
    return f"Write [{unit}] after its name in the header, or [rad] or [m] if it is right"


def _format_occasions(faults: Faults, stamps: FloatArray) -> str:
    """Return a phrase with the time of a fault, or the number of faults and the first time."""
    when = f"at t = {time_text(float(stamps[faults.first[0]]))}"
    return when if faults.count == 1 else f"{faults.count} times, first {when}"


def _format_longest(faults: Faults, stamps: FloatArray) -> str:
    return _format_worst(faults, stamps, [step_text(size) for size in faults.sizes.tolist()])


def _count_equal_samples(frozen: Faults) -> str:
    """Return the number of equal samples of the longest frozen stretch."""
    return f"{int(frozen.last[frozen.worst] - frozen.first[frozen.worst]) + 1} equal samples"


def _advise_frozen_rows(frozen: Faults, stamps: FloatArray) -> str:
    """Return what to do with frozen stretches: within a recording, deleting a long one leaves a gap."""
    is_inner = (frozen.first > 0) & (frozen.last + 1 < len(stamps))
    if not is_inner.any():
        return "delete these rows"
    gaps = stamps[frozen.last[is_inner] + 1] - stamps[frozen.first[is_inner]]
    if gaps.max() > GAP_STEPS * float(np.median(np.diff(stamps))):
        return "cut the recording in two there"
    return "delete all but the first of these rows"


def _format_worst(faults: Faults, stamps: FloatArray, sizes: Sequence[str]) -> str:
    """Return the size of a single fault, or of the worst with its time."""
    size = sizes[faults.worst]
    when = time_text(float(stamps[faults.first[faults.worst]]))
    return size if faults.count == 1 else f"up to {size} (at t = {when})"
