"""Description of a foreign CSV file: columns, rate, faults, and a proposed mapping of its columns."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.base.progress import Progress, unseen
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import for_yaml
from vsacli.documents.column_mapping import REST, ColumnMapping, MappedColumn
from vsacli.documents.columns_file import FORMAT, checked_rate
from vsacli.documents.csv_file import read_header, split_heading
from vsacli.documents.expression import conversion_factor
from vsacli.documents.table import Table, read_table
from vsacli.documents.time_column import TIME
from vsacli.files.recordings.first_rows import (
    FirstRows,
    TimeColumn,
    read_first_rows,
    time_column,
    unread_times,
)
from vsacli.files.recordings.guesses import TAKEN, Guess, guesses
from vsacli.files.recordings.recording_text import is_proposed, mapping_lines
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.model import Robot
from vsacli.trajectory import file as trajectory_file
from vsacli.trajectory.recorded.columns import column_layout
from vsacli.trajectory.recorded.disorder import find_disorder
from vsacli.trajectory.recorded.even_stamps import elapsed_times
from vsacli.trajectory.recorded.health import column_faults
from vsacli.trajectory.recorded.recording import NEEDED
from vsacli.trajectory.recorded.stamps import stamp_faults

TOGETHER = 16
"""Columns read at a time: a million rows of them take 128 MB, however many columns the table has."""

AS_WRITTEN = "-"
"""Placeholder unit of numbers that are shown as written."""

JITTERS = "jitters"
"""Beginning of the message on stamps for which a rate would help."""

FEWEST_ROWS = 10
"""Minimum number of values of a column to be checked for faults."""


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
    time = time_column(rows)
    if rate is not None:
        rate = checked_rate(rate)
    if time is not None and rate is not None:
        if not time.guessed:
            name = rows.columns[time.place] or time.place + 1
            raise InputError.one(f"has times in column {name!r}; leave --rate out", rows.path)
        time = None
    found = guesses(rows, time, joint_names)
    surveyed = _Survey(rows, time, found, progress, rate)
    taken = [guess for guess in found if guess.quantity in TAKEN]
    stamps = {time.place, time.nanoseconds} - {None} if time else set()

    def lines(proposed: Sequence[Guess]) -> list[str]:
        used = stamps | {guess.place for guess in proposed if is_proposed(guess)}
        return list(mapping_lines(time, proposed, joint_names, len(used) < len(rows.columns), rate))

    of_trajectory = lines([guess for guess in found if not guess.of_motor])
    stated = [] if rate is None else [f"rate: {rate:g}"]
    return {
        "kind": "recording",
        "name": Path(path).name,
        "rows": surveyed.rows,
        "time": surveyed.time,
        "columns": surveyed.columns,
        "warnings": surveyed.warnings,
        "mapping": "\n".join([f"format: {FORMAT}", *stated, *lines(found)]),
        "trajectory": "\n".join(
            _trajectory(
                Path(path).name, of_trajectory, taken, robot, stated or _proposed_rate(time, surveyed.rate)
            )
        ),
    }


def _proposed_rate(time: TimeColumn | None, jittering: str) -> list[str]:
    """Return a comment on the rate in the proposed trajectory if it is required or useful."""
    if time is None:
        return ["# rate: ...  # rows per second: no column holds times"]
    if jittering:
        return [f"# rate: {jittering}  # stamps jitter; this makes the steps of the torques equal"]
    return []


def _trajectory(
    file: str, mapping: Sequence[str], taken: Sequence[Guess], robot: Robot | None, rate: Sequence[str]
) -> Iterator[str]:
    """Yield a trajectory file with the positions of the recording."""
    yield f"format: {trajectory_file.FORMAT}"
    yield "name: recorded"
    yield from rate
    yield "position:"
    yield "  type: csv"
    yield f"  file: {for_yaml(file)}"
    yield from (f"  {line}" for line in mapping)
    if any(guess.quantity == STIFFNESS.key for guess in taken):
        yield f"stiffness: {{type: csv, file: {for_yaml(file)}}}"
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


class _Survey:
    """Findings on all rows, read a few columns at a time.

    Attributes:
        rows: number of rows.
        time: findings on the stamps; None without stamps.
        columns: findings on each column.
        warnings: faults of stamps and signals.
        rate: rate in few digits, 1/s; empty unless stamps jitter.
    """

    def __init__(
        self,
        rows: FirstRows,
        time: TimeColumn | None,
        found: Sequence[Guess],
        progress: Progress,
        rate: float | None,
    ) -> None:
        self._rows, self._time, self._stated = rows, time, rate
        self._guesses = {guess.place: guess for guess in found}
        self.rows = 0
        self.time: dict[str, Any] | None = None
        file = Path(rows.path).name
        self.warnings = [f"{file}: {sentence}" for sentence in unread_times(rows)]
        self.rate = ""
        stamps = () if time is None else (time.place, time.nanoseconds)
        numbers = [place for place in rows.of_numbers if place not in stamps]
        numbers.sort(key=lambda place: place not in self._guesses)
        self.columns = [self._unread(place) for place in range(len(rows.columns))]
        size = os.path.getsize(rows.path) if rows.path != "-" else 0
        with progress(size) as bar:
            for first in range(0, max(1, len(numbers)), TOGETHER):
                part = numbers[first : first + TOGETHER]
                self._look(part, self._read(part))
                bar.update(size * len(part) // max(1, len(numbers)))

    def _unread(self, place: int) -> dict[str, Any]:
        filled = self._rows.filled(place)
        kind = "index" if self._rows.is_index(place) else "text" if filled else "nothing"
        if self._time is not None and place in (self._time.place, self._time.nanoseconds):
            kind = "time"
        return {
            "number": place + 1,
            "name": self._rows.columns[place],
            "holds": kind,
            "first": filled[0] if filled else None,
            "min": math.nan,
            "max": math.nan,
            "rows": None,
        }

    def _read(self, places: Sequence[int]) -> Table:
        columns = {str(place): MappedColumn(column=place + 1, unit=AS_WRITTEN) for place in places}
        if self._time is not None:
            rest = self._time.nanoseconds
            unit = self._time.source.unit or ("s" if rest is None else None)
            at = None if rest is None else rest + 1
            columns[TIME] = MappedColumn(column=self._time.place + 1, unit=unit, nanoseconds=at)
        mapping = ColumnMapping(columns, REST, self._stated)
        return read_table(self._rows.path, mapping, set(columns), empty_cells=True)

    def _look(self, places: Sequence[int], table: Table) -> None:
        self.rows = len(table.values)
        headings = [split_heading(heading)[0] for heading in table.columns]
        shown = next((place for place in places if place in self._guesses), None)
        stamps = self._stamps(table, None if shown is None else headings.index(str(shown)))
        for place in places:
            values = table.values[:, headings.index(str(place))]
            there = np.isfinite(values)
            described = self.columns[place]
            described |= {
                "holds": described["holds"] if described["holds"] == "index" else "numbers",
                "min": float(values[there].min(initial=math.inf)) if there.any() else math.nan,
                "max": float(values[there].max(initial=-math.inf)) if there.any() else math.nan,
                "rows": int(np.count_nonzero(there)),
            }
            if stamps is not None and np.count_nonzero(there) >= FEWEST_ROWS and not _counts(values[there]):
                self._judge(place, stamps[there], values[there], table, np.flatnonzero(there))

    def _stamps(self, table: Table, signal: int | None) -> FloatArray | None:
        """Return the times of the rows, s; None if they do not increase.

        At the first call they are described, over the rows in which a signal has numbers, since others are of
        another topic.
        """
        at = next((i for i, name in enumerate(table.columns) if split_heading(name)[0] == TIME), None)
        if at is None:
            return None
        unit = split_heading(table.columns[at])[1] or "s"
        stamps = table.values[:, at] * conversion_factor(unit, "s")
        rising = bool(np.all(np.diff(stamps) > 0))
        if self.time is None:
            own = stamps if signal is None else stamps[np.isfinite(table.values[:, signal])]
            self.time = self._described(own, unit, table.first_stamp)
            file = Path(self._rows.path).name
            if rising and len(own) > 1:
                faults = [fault.message for fault in stamp_faults(own)]
                self.warnings += [f"{file}: time {fault}" for fault in faults]
                if any(fault.startswith(JITTERS) for fault in faults):
                    self.rate = f"{self.time['rate']:.3g}"
            elif len(stamps) > 1:
                disorder = find_disorder(stamps)
                self.warnings.append(f"{file}:{table.line_of(disorder.sample)}: time {disorder.message}")
        return stamps if rising else None

    def _described(self, stamps: FloatArray, unit: str, first_stamp: int | str | None) -> dict[str, Any]:
        time = self._time
        steps = np.diff(stamps) if len(stamps) > 1 else np.array([math.nan])
        duration = float(stamps[-1] - stamps[0])
        return {
            "column": None if time is None else self._rows.columns[time.place] or time.place + 1,
            "unit": "clock" if time is not None and time.clock else unit,
            "first": float(stamps[0]) if first_stamp is None else first_stamp,
            "duration": duration,
            "rate": 1 / float(np.median(steps)) if np.median(steps) > 0 else math.nan,
            "step": {
                "min": float(steps.min()),
                "median": float(np.median(steps)),
                "max": float(steps.max()),
            },
        }

    def _judge(
        self, place: int, stamps: FloatArray, values: FloatArray, table: Table, rows: IndexArray
    ) -> None:
        guess = self._guesses.get(place)
        angle = guess is not None and guess.quantity == "q"
        name = self._rows.columns[place] or f"column {place + 1}"
        for first, sentence in column_faults(stamps, elapsed_times(stamps), values, angle=angle):
            line = table.line_of(int(rows[first]))
            self.warnings.append(f"{Path(self._rows.path).name}:{line}: {name} {sentence}")


def _counts(values: FloatArray) -> bool:
    """Return whether values are whole numbers that never decrease, as of a counter rather than a sensor."""
    return bool(np.all(values == np.round(values)) and np.all(np.diff(values) >= 0))


def is_trajectory(path: str, robot: Robot) -> bool:
    """Return whether a CSV file has, by their names, the columns of a trajectory of a robot."""
    try:
        column_layout(read_header(path).columns, CommandedJoints.of(robot), NEEDED, path)
    except InputError:
        return False
    return True
