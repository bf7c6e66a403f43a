"""Recorded trajectories: the columns of a CSV table as position and stiffness of joints, and wrench."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsacli.arrays import FloatArray
from vsacli.columns import JOINT_SIGNALS, SIGNALS, TIME, Layout, column_layout
from vsacli.errors import InputError, Problem
from vsacli.profiles import Signal
from vsacli.samples import SampledProfile, SampleProblem, time_problems, value_problems
from vsacli.spec.source import Source
from vsacli.spec.table import Table, line_of, read_table
from vsacli.times import RecordedTimes
from vsacli.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Recording:
    """What was read from a CSV file.

    Attributes:
        times: the column `time`.
        profiles: one for each signal that was asked for, in that order.
        warnings: what of the file is not used.
        source: the file.
    """

    times: RecordedTimes
    profiles: tuple[SampledProfile, ...]
    warnings: tuple[str, ...]
    source: Source

    def check_times(self, other: Recording) -> None:
        """Refuse another recording that is to be combined with this one if its times differ.

        Raises:
            InputError: naming the first row of `other` whose time is not the one here.
        """
        here, there = self.times.time, other.times.time
        common = min(len(here), len(there))
        differ = here[:common] != there[:common]
        if differ.any():
            row = int(np.argmax(differ))
            message = f"time is {there[row]} s, but {here[row]} s in the same row of {self.source.path}"
            raise InputError.one(message, other.source.path, line_of(row))
        if len(here) != len(there):
            message = f"the file has {len(there)} rows, but {self.source.path} has {len(here)}"
            raise InputError.one(message, other.source.path)


def read_recording(
    path: str | os.PathLike[str], joint_names: Sequence[str], wanted: Sequence[Signal] = JOINT_SIGNALS
) -> Recording:
    """Read signals from a CSV file.

    Args:
        path: a file with the columns `time` and those of `column_layout`.
        joint_names: from the base to the tip.
        wanted: the signals to read.

    Raises:
        InputError: with file and line of everything that does not fit.
    """
    table = read_table(path)
    file = table.source.path
    layout = column_layout(table.columns, joint_names, wanted, file)
    time = np.ascontiguousarray(table.values[:, table.columns.index(TIME)])
    profiles = tuple(_profile(signal, time, table, layout) for signal in wanted)

    problems = [
        *time_problems(time),
        *(problem for profile in profiles for problem in value_problems(profile)),
    ]
    if problems:
        raise InputError(_located(problem, table, layout) for problem in problems)
    unused = (
        signal for signal in SIGNALS if signal not in wanted and not layout.keys().isdisjoint(signal.names)
    )
    warnings = tuple(f"{file}: its columns of {signal.names[0]} are not used" for signal in unused)
    return Recording(RecordedTimes(time), profiles, warnings, table.source)


def _profile(signal: Signal, time: FloatArray, table: Table, layout: Layout) -> SampledProfile:
    name, *names = signal.names
    derivatives = tuple(_rows(table, layout[name]) if name in layout else None for name in names)
    return SampledProfile(
        signal=signal, time=time, values=_rows(table, layout[name]), derivatives=derivatives
    )


def _rows(table: Table, columns: list[int]) -> FloatArray:
    return np.stack([table.values[:, column] for column in columns])


def _located(problem: SampleProblem, table: Table, layout: Layout) -> Problem:
    line = 0 if problem.sample is None else line_of(problem.sample)
    column = (
        problem.quantity if problem.joint is None else table.columns[layout[problem.quantity][problem.joint]]
    )
    return Problem(table.source.path, line, f"{column} {problem.message}")


def recorded_trajectory(path: str | os.PathLike[str], joint_names: Sequence[str]) -> Trajectory:
    """A trajectory whose position and stiffness come from one CSV file, named after the file.

    Raises:
        InputError: as `read_recording`.
    """
    recording = read_recording(path, joint_names)
    position, stiffness = recording.profiles
    name, sources = Path(path).stem, [recording.source]
    return Trajectory(recording.times, position, stiffness, name=name, sources=sources)
