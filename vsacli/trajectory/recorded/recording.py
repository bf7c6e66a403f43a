"""Recorded trajectories: columns of a CSV table as position and commanded signals of joints, and wrench."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.progress import Progress, unseen
from vsacli.base.signals import COMMANDED, POSITION, WRENCH, Signal
from vsacli.base.texts import as_name, counted
from vsacli.base.wrench import WRENCH_AXES
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping
from vsacli.documents.reading import ChangeError
from vsacli.documents.source import Source
from vsacli.documents.table import CsvTable, RowLines, read_table
from vsacli.documents.time_column import TIME
from vsacli.robot.commanded_joints import CommandedJoints, describe_commanded_joints
from vsacli.trajectory.fits import AS_IT_ASKS_FOR, INTERPOLATE, FitChoice
from vsacli.trajectory.recorded.columns import (
    ColumnLayout,
    SignalColumn,
    column_layout,
    trajectory_column_names,
)
from vsacli.trajectory.recorded.health import check_health, unit_doubts
from vsacli.trajectory.recorded.problems import (
    Disorder,
    SampleProblem,
    replace_stamps,
    sample_problems,
    time_problems,
)
from vsacli.trajectory.recorded.samples import SampledProfile, SignalSamples, rounding_notes
from vsacli.trajectory.times import RecordedTimes, ResampledTimes, Times
from vsacli.trajectory.trajectory import Trajectory

NEEDED = (POSITION, *(signal for signal in COMMANDED.values() if signal.device is None))
"""Signals of joints that a table must have if it is the whole trajectory."""

MOST_NAMED = 5
"""Most ignored columns that are named."""


@dataclass(frozen=True, eq=False)
class RecordedSignals:
    """The content of a CSV file.

    Attributes:
        times: times of the column `time`.
        profiles: profile of each requested signal, in that order.
        warnings: faults of sensors or log files.
        notes: unused parts of the file, and jumps removed.
        source: file that was read.
        lines: lines of its rows.
        first_stamp: stamp that was subtracted from its times, see `CsvTable`.
        rated: whether its times follow from a rate, see `CsvTable`.
    """

    times: RecordedTimes
    profiles: tuple[SampledProfile, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    source: Source
    lines: RowLines
    first_stamp: int | str | None = None
    rated: bool = False

    def times_at(self, rate: float | None, file: str) -> Times:
        """Return the times of a recorded trajectory: those of the samples, or equally spaced ones.

        Args:
            rate: sample rate, 1/s; None for the recorded times.
            file: path of the file with the rate, for messages.

        Raises:
            InputError: there would be too many or too few samples.
        """
        if rate is None or self.rated:
            return self.times
        try:
            return ResampledTimes(*self.times.span, rate)
        except InputError as error:
            raise InputError.one(f"rate: {error}", file) from None

    def check_times(self, other: RecordedSignals) -> None:
        """Raise an error if another recording, to be combined with this one, has other times.

        Raises:
            InputError: times differ; names the first such row of `other`.
        """
        times, other_times = self.times.time, other.times.time
        common_count = min(len(times), len(other_times))
        differs = times[:common_count] != other_times[:common_count]
        if differs.any():
            row = int(np.argmax(differs))
            message = (
                f"time is {other_times[row]} s, but {times[row]} s in the same row of {self.source.path}"
            )
            raise InputError.one(message, other.source.path, other.lines.of(row))
        if self.first_stamp != other.first_stamp:
            message = f"times begin with {other.first_stamp}, but {self.first_stamp} in {self.source.path}"
            raise InputError.one(message, other.source.path)
        if len(times) != len(other_times):
            message = f"the file has {len(other_times)} rows, but {self.source.path} has {len(times)}"
            raise InputError.one(message, other.source.path)


def read_recorded_signals(
    path: str | os.PathLike[str],
    joints: CommandedJoints,
    wanted: Mapping[Signal, FitChoice] | None = None,
    mapping: ColumnMapping = AS_NAMED,
    *,
    resampled: bool = False,
    unwrap: bool = False,
    progress: Progress = unseen,
) -> RecordedSignals:
    """Read signals from a CSV file.

    Args:
        path: path of a file with the columns `time` and those of `column_layout`.
        joints: commanded joints.
        wanted: signals to read, each with the choice of its spline. None for all signals of joints, and those
            of devices that are in the file, with splines chosen by their noise.
        mapping: assignment of columns with other names.
        resampled: whether samples will be at other times than the recorded ones.
        unwrap: whether to remove jumps by 2 pi from the positions of revolute joints.
        progress: function that opens a progress bar over the samples to fit.

    Raises:
        InputError: the file has problems; lists each with its line.
    """
    table, layout, time, records, replaced = read_samples(path, joints, wanted, mapping)
    file, signals = table.source.path, [record.signal for record in records]
    wanted = dict.fromkeys(signals, AS_IT_ASKS_FOR) if wanted is None else wanted
    turns = list(_unwrap_positions(records, joints)) if unwrap else []
    records, faults = check_health(
        time,
        records,
        list(joints.types.values()),
        [signal for signal, choice in wanted.items() if choice.method == INTERPOLATE],
    )
    faults += unit_doubts(records, _types_without_unit(table, layout, joints))
    warnings = tuple(str(_locate_problem(fault, table, layout)) for fault in faults)
    clauses = (
        *turns,
        *_notes_on_reading(table, replaced),
        *_notes_on_unused_columns(layout, signals, joints),
    )
    notes = tuple(f"{file}: {clause}" for clause in clauses)
    source, lines, first_stamp = table.source, table.lines, table.first_stamp
    rated = table.rated or replaced is not None
    del table  # frees as much memory as the samples need, before they are fitted
    profiles = tuple(
        SampledProfile.of(each, wanted[each.signal], resampled=resampled and not rated, progress=progress)
        for each in records
    )
    times = RecordedTimes(time, rounding_notes(time))
    return RecordedSignals(times, profiles, warnings, notes, source, lines, first_stamp, rated)


class _ReadSamples(NamedTuple):
    """The samples of a recording, before they are fitted.

    Attributes:
        table: rows with numbers.
        layout: columns of the signals.
        time: times of the samples, (samples,), s.
        records: samples of each signal.
        replaced: failure of the stamps to increase, if the rate of the rows stands in their place.
    """

    table: CsvTable
    layout: ColumnLayout
    time: FloatArray
    records: list[SignalSamples]
    replaced: Disorder | None


def read_samples(
    path: str | os.PathLike[str],
    joints: CommandedJoints,
    wanted: Collection[Signal] | None,
    mapping: ColumnMapping,
) -> _ReadSamples:
    """Read the samples of signals, or raise the problems for which a run refuses them.

    See `read_recorded_signals` for the arguments.

    Raises:
        InputError: the file has problems; lists each with its line.
    """
    table = read_table(path, mapping, trajectory_column_names(joints), empty_cells=True)
    table = table.without_hollow_columns().without_empty_rows().with_joined_rows()
    signals = NEEDED if wanted is None else tuple(wanted)
    _check_hollow(table, signals)
    headings = (*table.columns, *table.unknown_columns)
    layout = column_layout(headings, joints, signals, table.source.path, table.header.line)
    _check_filled(table)
    if wanted is None:
        devices = (signal for signal in COMMANDED.values() if signal.device is not None)
        signals += tuple(each for each in devices if layout.quantities.get(each.key))
    time, replaced = replace_stamps(_column_in_si_units(table, layout.time), mapping.rate)
    records = [_samples_from_table(signal, joints.names, time, table, layout) for signal in signals]
    problems = [*time_problems(time), *sample_problems(records)]
    if problems:
        raise InputError(_locate_problem(problem, table, layout) for problem in problems)
    return _ReadSamples(table, layout, time, records, replaced)


def _check_hollow(table: CsvTable, signals: Sequence[Signal]) -> None:
    """Raise an error if a column of required values holds no number; derivatives may be left out."""
    values = {signal.names[0] for signal in signals}
    needed = [
        name for name in table.hollow if name.rpartition(".")[2].rstrip("0123456789") in {TIME, *values}
    ]
    if needed:
        message = f"column {needed[0]!r} holds no number; give another column for it"
        raise InputError.one(message, table.source.path, table.header.line)


def _check_filled(table: CsvTable) -> None:
    """Raise an error for empty cells in rows with numbers, since all signals use the same rows."""
    empty = np.isnan(table.values)
    if not empty.any():
        return
    row, column = (int(place[0]) for place in np.nonzero(empty))
    count = int(np.count_nonzero(empty[:, column]))
    if empty.any(axis=1).all():
        other = table.columns[int(np.flatnonzero(~empty[row])[-1])]
        message = (
            f"columns {table.columns[column]!r} and {other!r} have no numbers in the same rows, as signals"
            " with stamps of their own; interpolate them at common times, then read that file"
        )
    else:
        message = (
            f"column {table.columns[column]!r} has no number here, where others have one"
            f" ({counted(count, 'such row')}); delete {'the row' if count == 1 else 'these rows'}, or fill in"
            " the values"
        )
    raise InputError.one(message, table.source.path, table.line_of(row))


def _notes_on_reading(table: CsvTable, disorder: Disorder | None) -> Iterator[str]:
    if table.hollow:
        holds = "it holds" if len(table.hollow) == 1 else "they hold"
        yield f"left out, as {holds} no number: {', '.join(table.hollow)}"
    if disorder is not None:
        yield f"rate stands in place of the stamps, since {disorder.cause}"
    if table.joined:
        yield f"{counted(table.joined, 'row')} of nearly the same time as the row before joined with it"
    if table.first_stamp is not None:
        yield f"times count from its first stamp, {table.first_stamp}"
    if table.kept is not None and not table.joined:
        yield f"only the {len(table.kept)} rows are read in which these columns have numbers"
    if table.ignored:
        names = [name for name in table.ignored if name]
        if nameless := len(table.ignored) - len(names):
            several = f"{nameless} columns without names"
            names.append("a column without a name" if nameless == 1 else several)
        more = len(names) - MOST_NAMED
        yield f"ignored: {', '.join(names[:MOST_NAMED])}{f' and {more} more' if more > 0 else ''}"


def _notes_on_unused_columns(
    layout: ColumnLayout, wanted: Sequence[Signal], joints: CommandedJoints
) -> Iterator[str]:
    for signal in (POSITION, *COMMANDED.values(), WRENCH, *joints.wrenches.values()):
        if signal not in wanted and any(layout.quantities.get(name) for name in signal.names):
            yield f"its columns of {signal.names[0]} are not used"
    for key, columns in layout.unused.items():
        if columns:
            yield (
                f"not used: {', '.join(columns)}; only"
                f" {describe_commanded_joints(COMMANDED[key], 'joints')} take a {key}"
            )


def _samples_from_table(
    signal: Signal, joint_names: tuple[str, ...], time: FloatArray, table: CsvTable, layout: ColumnLayout
) -> SignalSamples:
    labels = WRENCH_AXES if signal.is_wrench else joint_names
    values, *derivatives = (
        _rows_in_si_units(table, layout.quantities[name], len(labels)) if name in layout.quantities else None
        for name in signal.names
    )
    assert values is not None, "columns of values are required"
    return SignalSamples.recorded(signal, time, values, tuple(derivatives), labels)


def _unwrap_positions(records: Sequence[SignalSamples], joints: CommandedJoints) -> Iterator[str]:
    """Remove jumps by 2 pi from the positions of revolute joints; yield clauses on their number."""
    for record in records:
        for index, (joint, kind) in enumerate(joints.types.items() if record.signal is POSITION else ()):
            row = record.values[index]
            turned = np.unwrap(row) if kind == "revolute" else row
            jumps = int(np.count_nonzero(np.abs(np.diff(turned - row)) > np.pi))
            if jumps:
                row[:] = turned
                yield f"{'a jump' if jumps == 1 else f'{jumps} jumps'} by 2 pi taken out of {joint}.q"


def _types_without_unit(table: CsvTable, layout: ColumnLayout, joints: CommandedJoints) -> dict[int, str]:
    """Return the types of joints whose position has no unit in the header, by index."""
    headings = {
        index: table.columns[column.index]
        for index, column in layout.quantities.get(POSITION.names[0], {}).items()
    }
    types = list(joints.types.values())
    return {index: types[index] for index, heading in headings.items() if "[" not in heading}


def _rows_in_si_units(table: CsvTable, columns: Mapping[int, SignalColumn], components: int) -> FloatArray:
    """Return columns in SI units, (components, samples); NaN for components without a column."""
    rows = np.full((components, len(table.values)), np.nan)
    for component, column in columns.items():
        rows[component] = _column_in_si_units(table, column)
    return rows


def _column_in_si_units(table: CsvTable, column: SignalColumn) -> FloatArray:
    """Return a column in SI units; by division if that is exact, so that 3 ms are 0.003 s."""
    values = np.ascontiguousarray(table.values[:, column.index])
    divisor = round(1 / column.factor)
    if divisor > 1 and math.isclose(divisor * column.factor, 1, rel_tol=1e-14):
        return values / divisor
    with np.errstate(over="ignore"):  # infinite values are reported as problems
        return values * column.factor


def _locate_problem(problem: SampleProblem, table: CsvTable, layout: ColumnLayout) -> Problem:
    line = 0 if problem.sample is None else table.line_of(problem.sample)
    column = (
        problem.quantity if problem.joint is None else layout.quantities[problem.quantity][problem.joint].name
    )
    return Problem(table.source.path, line, f"{column} {problem.message}")


def recorded_trajectory(
    path: str | os.PathLike[str],
    joints: CommandedJoints,
    progress: Progress = unseen,
    rate: float | None = None,
) -> Trajectory:
    """Return a trajectory with position and commanded signals from one CSV file, named after the file.

    Args:
        path: path of the file.
        joints: see `read_recorded_signals`.
        progress: see `read_recorded_signals`.
        rate: sample rate, 1/s, of the file if it has no times, else of the trajectory.

    Raises:
        InputError: see `read_recorded_signals`.
        ChangeError: the rate is not possible.
    """
    mapping, resampled = ColumnMapping(rate=rate), rate is not None
    recording = read_recorded_signals(path, joints, mapping=mapping, resampled=resampled, progress=progress)
    profiles = {profile.signal.key: profile for profile in recording.profiles}
    source = recording.source
    try:
        times = recording.times_at(rate, "")
    except InputError as error:
        raise ChangeError(error.problems, f"rate={rate}") from None
    return Trajectory(
        times,
        profiles[POSITION.key],
        profiles,
        name=as_name(Path(path).stem),
        warnings=recording.warnings,
        notes=recording.notes,
        sources=[source if rate is None else source._replace(changes=json.dumps({"rate": rate}))],
    )
