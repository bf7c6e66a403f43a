"""Description of a foreign CSV file: columns, rate, faults, and a proposed mapping of its columns."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base import file_formats
from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.progress import Progress, unseen
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.base.simulation_variables import measured
from vsacli.base.texts import for_yaml, joined
from vsacli.base.variables import VARIABLES
from vsacli.documents.column_mapping import REST, ColumnMapping, MappedColumn
from vsacli.documents.columns_file import parse_rate
from vsacli.documents.csv_file import read_header, split_heading
from vsacli.documents.expression import conversion_factor
from vsacli.documents.table import CsvTable, find_surroundings, read_table
from vsacli.documents.time_column import TIME
from vsacli.files.recordings.first_rows import (
    GUESSED,
    FirstRows,
    TimeColumn,
    read_first_rows,
    time_columns,
    unread_times,
)
from vsacli.files.recordings.guesses import TAKEN, Guess, guesses, names_torque
from vsacli.files.recordings.recording_text import is_proposed, mapping_lines
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.model import Robot
from vsacli.trajectory.recorded.columns import column_layout
from vsacli.trajectory.recorded.header_words import COMMANDED, ERROR, role_of
from vsacli.trajectory.recorded.health import column_faults, mean_rate, stamp_faults
from vsacli.trajectory.recorded.problems import Disorder, find_disorder
from vsacli.trajectory.recorded.recording import NEEDED, read_samples
from vsacli.trajectory.recorded.samples import elapsed_times

COLUMNS_AT_ONCE = 16
"""Columns read at a time: a million rows of them take 128 MB, however many columns the table has."""

UNCONVERTED_UNIT = "-"
"""Placeholder unit of numbers that are shown as written."""

JITTERS = "jitters"
"""Beginning of the message on stamps for which a rate would help."""

FEWEST_ROWS = 10
"""Minimum number of values of a column to be checked for faults."""

_COMMAND_COLUMN = re.compile(rf"(.+\.)?({'|'.join([TIME, *VARIABLES])})({measured('')}|_shaft)?\d*(_[12])?")
"""Names by which commands read a column although no mapping names it."""


@dataclass(frozen=True)
class _Clock:
    """The stamps of a recording, over the rows in which its joints have numbers.

    Attributes:
        column: column of the stamps.
        table: table of the stamps, for lines and the first stamp.
        stamps: stamps, (rows,), s.
        disorder: failure of the stamps to increase; None if they can be used.
    """

    column: TimeColumn
    table: CsvTable
    stamps: FloatArray
    disorder: Disorder | None


def describe_recording(
    path: str | os.PathLike[str],
    robot: Robot | None = None,
    progress: Progress = unseen,
    rate: float | None = None,
) -> dict[str, Any]:
    """Describe a CSV file with any column names as JSON values.

    Args:
        path: path of the file.
        robot: robot that was recorded, to whose joints columns are assigned.
        progress: opens a progress bar over the bytes of the file.
        rate: rows per second of a file without times.

    Raises:
        InputError: the file is not a table, or has times although a rate is given.
    """
    rows = read_first_rows(path)
    joint_names = robot.joint_names if robot else ()
    clock = _choose_clock(rows, joint_names)
    time = clock.column if clock and clock.disorder is None else None
    if rate is not None:
        rate = parse_rate(rate)
        if time is not None and not time.reason.startswith(GUESSED):
            name = rows.columns[time.place] or time.place + 1
            raise InputError.one(f"has times in column {name!r}; leave --rate out", rows.path)
        time = None
    disorder = clock.disorder if clock else None
    derived_rate = disorder.rate if disorder else None
    likely_rate = rate or (None if derived_rate is None or math.isnan(derived_rate) else derived_rate)
    column_guesses = guesses(rows, clock.column if clock else None, joint_names)
    survey = _RecordingSurvey(rows, time, column_guesses, progress, likely_rate)
    if clock is not None and (rate is None or (disorder and not disorder.is_replaced_by(rate))):
        survey.describe_clock(clock)
    proposal = _ProposedMapping(rows, time, column_guesses, likely_rate, None if rate else disorder)
    refusal = proposal.refusal(robot)
    return {
        "kind": "recording",
        "name": Path(path).name,
        "rows": survey.rows,
        "time": survey.time,
        "columns": survey.columns,
        "warnings": survey.warnings,
        "refusal": refusal,
        "mapping": "\n".join(proposal.columns_file(joint_names)),
        "trajectory": "\n".join(proposal.trajectory(robot, refusal, survey.rate)),
    }


def _choose_clock(rows: FirstRows, joint_names: Sequence[str]) -> _Clock | None:
    """Return the first column of stamps that increase where the joints have numbers, or nearly do."""
    clocks: list[_Clock] = []
    for column in time_columns(rows):
        column_indices = [
            guess.place for guess in guesses(rows, column, joint_names) if guess.quantity in TAKEN
        ]
        table = _read_columns(rows, column_indices, column).without_empty_rows().with_joined_rows()
        stamps = _seconds(table)
        clocks.append(_Clock(column, table, stamps, find_disorder(stamps)))
        if clocks[-1].disorder is None:
            return clocks[-1]
    return min(clocks, key=lambda clock: np.count_nonzero(~(np.diff(clock.stamps) > 0)), default=None)


def _read_columns(
    rows: FirstRows, places: Sequence[int], time: TimeColumn | None, rate: float | None = None
) -> CsvTable:
    """Return columns of all rows under their positions, as written, and the times."""
    columns = {
        str(column_index): MappedColumn(column=column_index + 1, unit=UNCONVERTED_UNIT)
        for column_index in places
    }
    if time is not None:
        columns[TIME] = time.source
    mapping = ColumnMapping(columns, REST, rate, rows.skip_rows)
    return read_table(rows.path, mapping, set(columns), empty_cells=True)


def _seconds(table: CsvTable) -> FloatArray:
    time_index = next(
        column_index for column_index, name in enumerate(table.columns) if split_heading(name)[0] == TIME
    )
    unit = split_heading(table.columns[time_index])[1] or "s"
    return np.asarray(table.values[:, time_index] * conversion_factor(unit, "s"))


class _ProposedMapping:
    """A mapping of the columns of a recording, as text and as the reader takes it.

    Args:
        rows: first rows of the table.
        time: column of stamps; None if a rate stands in their place, or nothing does.
        found: likely meanings of the columns.
        rate: rows per second; None if there is a column of stamps, or nothing tells it.
        disorder: failure of the stamps to increase, from which this rate follows; None if they do, or if the
            rate is stated.
    """

    def __init__(
        self,
        rows: FirstRows,
        time: TimeColumn | None,
        column_guesses: Sequence[Guess],
        rate: float | None,
        disorder: Disorder | None,
    ) -> None:
        self._rows, self._time, self._column_guesses = rows, time, column_guesses
        self._rate, self._disorder = rate, disorder

    def _ignored_columns(self, included: Sequence[Guess]) -> str | tuple[str | int, ...]:
        """Return the columns to ignore: all others, one by one if commands know some by their names."""
        stamps = (self._time.place, self._time.nanoseconds) if self._time else ()
        used_columns = {*stamps, *(guess.place for guess in included if is_proposed(guess))}
        unused_columns = [
            column_index
            for column_index in range(len(self._rows.columns))
            if column_index not in used_columns
        ]
        names = [split_heading(self._rows.columns[column_index])[0] for column_index in unused_columns]
        if not any(map(_COMMAND_COLUMN.fullmatch, names)):
            return REST if unused_columns else ()
        return tuple(self._rows.called(column_index) for column_index in unused_columns)

    def _mapping_lines(self, taken: Sequence[Guess], joint_names: Sequence[str]) -> Iterator[str]:
        yield from mapping_lines(
            self._time, taken, joint_names, self._ignored_columns(taken), self._rate, self._rows.skip_rows
        )

    def columns_file(self, joint_names: Sequence[str]) -> Iterator[str]:
        """Yield a file for `--columns`."""
        yield f"format: {file_formats.COLUMNS}"
        yield from self._rate_lines()
        yield from self._mapping_lines(self._column_guesses, joint_names)
        places = {guess.place for guess in self._column_guesses}
        torques = [place for place, name in enumerate(self._rows.columns) if names_torque(name)]
        yield from (
            f"# {self._rows.called(place)}: not recognized" for place in torques if place not in places
        )

    def _rate_lines(self) -> Iterator[str]:
        if self._rate is not None:
            yield f"rate: {self._rate:g}" + (
                "  # guessed from the stamps, which do not increase" * bool(self._disorder)
            )

    def trajectory(self, robot: Robot | None, refusal: str, jittering: float | None) -> Iterator[str]:
        """Yield a trajectory file with the positions of the recording."""
        joint_names, file = robot.joint_names if robot else (), for_yaml(Path(self._rows.path).name)
        yield from [f"# not complete: {refusal}"] if refusal else []
        yield f"format: {file_formats.TRAJECTORY}"
        yield "name: recorded"
        yield from self._rate_lines()
        if self._rate is None and self._time is None and not self._disorder:
            yield "# rate: ...  # rows per second: no column holds times"
        elif jittering is not None:
            yield f"# rate: {jittering:g}  # stamps jitter; this makes the steps of the torques equal"
        yield "position:"
        yield "  type: csv"
        yield f"  file: {file}"
        yield from (f"  {line}" for line in self._mapping_lines(self._trajectory_guesses, joint_names))
        if any(guess.quantity == STIFFNESS.key for guess in self._trajectory_guesses):
            yield f"stiffness: {{type: csv, file: {file}}}"
            return
        stiffnesses = {}
        if robot is not None:
            from vsacli.files.templates import first_stiffnesses

            stiffnesses = first_stiffnesses(robot)
        if stiffnesses:
            values = ", ".join(f"{name}: {value:g}" for name, value in stiffnesses.items())
            yield f"stiffness: {{type: constant, value: {{{values}}}}}  # to begin with; choose yours"
        elif robot is None:
            yield "# stiffness: {type: constant, value: ...}  # N m/rad, of joints of variable stiffness"

    @property
    def _trajectory_guesses(self) -> list[Guess]:
        return [guess for guess in self._column_guesses if not guess.of_motor]

    def refusal(self, robot: Robot | None) -> str:
        """Return why a run with this robot would refuse the trajectory, a clause; empty if it would not."""
        if self._time is None and self._rate is None:
            if self._disorder:
                return f"time {self._disorder.message}"
            return "no column holds times; give the rate of the rows with --rate HZ"
        if robot is None:
            return ""
        included = [guess for guess in self._trajectory_guesses if guess.quantity in TAKEN]
        names = {guess.name for guess in included}
        missing = [joint for joint in robot.joint_names if f"{joint}.{POSITION.names[0]}" not in names]
        if missing:
            return f"no column is recognized as the position of {joined(missing)}; write it below"
        columns = {guess.name: guess.source for guess in included}
        if self._time is not None:
            columns[TIME] = self._time.source
        mapping = ColumnMapping(columns, self._ignored_columns(included), self._rate, self._rows.skip_rows)
        signals = [
            POSITION,
            *([STIFFNESS] if any(guess.quantity == STIFFNESS.key for guess in included) else []),
        ]
        try:
            read_samples(self._rows.path, CommandedJoints.of(robot), signals, mapping)
        except InputError as error:
            problem = error.problems[0]
            return str(Problem(Path(problem.file).name, problem.line, problem.message))
        return ""


class _RecordingSurvey:
    """Findings on all rows, read a few columns at a time.

    Attributes:
        rows: number of rows.
        time: findings on the stamps; None without stamps.
        columns: findings on each column.
        warnings: faults of stamps and signals.
        rate: rate in few digits, 1/s; None unless stamps jitter.
    """

    def __init__(
        self,
        rows: FirstRows,
        time: TimeColumn | None,
        column_guesses: Sequence[Guess],
        progress: Progress,
        rate: float | None,
    ) -> None:
        self._rows, self._time = rows, time
        self._guesses = {guess.place: guess for guess in column_guesses}
        self.rows = 0
        self.time: dict[str, Any] | None = None
        self._file = Path(rows.path).name
        self.warnings = [f"{self._file}: {clause}" for clause in (*unread_times(rows), *_list_columns(rows))]
        self.rate: float | None = None
        stamps = () if time is None else (time.place, time.nanoseconds)
        numeric_columns = [column_index for column_index in rows.of_numbers if column_index not in stamps]
        numeric_columns.sort(key=lambda place: place not in self._guesses)
        self.columns = [self._unread_description(column_index) for column_index in range(len(rows.columns))]
        size = os.path.getsize(rows.path) if rows.path != "-" else 0
        with progress(size) as bar:
            for start in range(0, max(1, len(numeric_columns)), COLUMNS_AT_ONCE):
                chunk = numeric_columns[start : start + COLUMNS_AT_ONCE]
                self._survey_columns(chunk, _read_columns(rows, chunk, time, rate))
                bar.update(size * len(chunk) // max(1, len(numeric_columns)))

    def _unread_description(self, column_index: int) -> dict[str, Any]:
        cells = self._rows.filled(column_index)
        kind = "index" if self._rows.is_index(column_index) else "text" if cells else "nothing"
        if kind == "text" and self._rows.list_length(column_index):
            kind = "list"
        if self._time is not None and column_index in (self._time.place, self._time.nanoseconds):
            kind = "time"
        return {
            "number": column_index + 1,
            "name": self._rows.columns[column_index],
            "holds": kind,
            "first": cells[0] if cells else None,
            "min": math.nan,
            "max": math.nan,
            "rows": None,
        }

    def _survey_columns(self, column_indices: Sequence[int], table: CsvTable) -> None:
        self.rows = len(table.values)
        headings = [split_heading(heading)[0] for heading in table.columns]
        stamps = _seconds(table) if TIME in headings else None
        for column_index in column_indices:
            values = table.values[:, headings.index(str(column_index))]
            finite = np.isfinite(values)
            description = self.columns[column_index]
            description |= {
                "holds": description["holds"] if description["holds"] == "index" else "numbers",
                "min": float(values[finite].min(initial=math.inf)) if finite.any() else math.nan,
                "max": float(values[finite].max(initial=-math.inf)) if finite.any() else math.nan,
                "rows": int(np.count_nonzero(finite)),
            }
            if (
                stamps is not None
                and np.count_nonzero(finite) >= FEWEST_ROWS
                and not _is_counter(values[finite])
            ):
                self._add_faults(column_index, stamps[finite], values[finite], table, np.flatnonzero(finite))

    def describe_clock(self, clock: _Clock) -> None:
        """Describe the stamps, and put their faults before those of the signals."""
        stamps, disorder = clock.stamps, clock.disorder
        steps = np.diff(stamps) if len(stamps) > 1 else np.array([math.nan])
        rate = 1 / float(np.median(steps)) if np.median(steps) > 0 else math.nan
        duration = float(stamps[-1] - stamps[0])
        if disorder is not None:
            rate = math.nan if disorder.rate is None else disorder.rate
            duration = (len(stamps) - 1) / rate
        column, first_stamp = clock.column, clock.table.first_stamp
        unit = (
            "clock"
            if isinstance(first_stamp, str)
            else "ns"
            if column.source.nanoseconds
            else column.source.unit or "s"
        )
        self.time = {
            "column": self._rows.columns[column.place] or column.place + 1,
            "unit": unit,
            "unit_guessed": column.unit_guessed,
            "first": float(stamps[0]) if first_stamp is None else first_stamp,
            "duration": duration,
            "rate": rate,
            "step": {
                "min": float(steps.min()),
                "median": float(np.median(steps)),
                "max": float(steps.max()),
            },
        }
        if disorder is not None:
            line = clock.table.line_of(disorder.sample)
            self.warnings.insert(0, f"{self._file}:{line}: time {disorder.message}")
        elif len(stamps) > 1:
            faults = [fault.message for fault in stamp_faults(stamps)]
            self.warnings[:0] = [f"{self._file}: time {fault}" for fault in faults]
            if any(fault.startswith(JITTERS) for fault in faults):
                self.rate = mean_rate(stamps)

    def _add_faults(
        self, column_index: int, stamps: FloatArray, values: FloatArray, table: CsvTable, rows: IndexArray
    ) -> None:
        """Add the faults of a column, unless it holds commands or errors, or its stamps do not increase."""
        if role_of(self._rows.columns[column_index])[0] in (COMMANDED, ERROR) or not np.all(
            np.diff(stamps) > 0
        ):
            return
        guess = self._guesses.get(column_index)
        is_angle, is_included = (
            guess is not None and guess.quantity in quantities for quantities in (("q",), TAKEN)
        )
        name = self._rows.columns[column_index] or f"column {column_index + 1}"
        time = elapsed_times(stamps)
        for first_row, sentence in column_faults(stamps, time, values, angle=is_angle, left_out=is_included):
            line = table.line_of(int(rows[first_row]))
            self.warnings.append(f"{self._file}:{line}: {name} {sentence}")


def _list_columns(rows: FirstRows) -> Iterator[str]:
    """Yield that columns hold several values in each cell."""
    for column_index, name in enumerate(rows.columns):
        if count := rows.list_length(column_index):
            advice = f"split it into {count} columns, one for each"
            yield f"column {name or column_index + 1!r} holds lists of {count} values in its cells; {advice}"


def _is_counter(values: FloatArray) -> bool:
    """Return whether values are whole numbers that never decrease, as of a counter rather than a sensor."""
    return bool(np.all(values == np.round(values)) and np.all(np.diff(values) >= 0))


def is_trajectory(path: str, robot: Robot) -> bool:
    """Return whether a CSV file has, by their names, the columns of a trajectory of a robot."""
    try:
        column_layout(read_header(path).columns, CommandedJoints.of(robot), NEEDED, path)
    except InputError:
        return False
    return not find_surroundings(path).lines
