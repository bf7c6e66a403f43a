"""Recorded trajectories: the columns of a CSV table as position and stiffness of joints, and wrench."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
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
    path: str | os.PathLike[str],
    joint_names: Sequence[str],
    wanted: Sequence[Signal] = JOINT_SIGNALS,
    without_stiffness: Collection[str] = (),
) -> Recording:
    """Read signals from a CSV file.

    Args:
        path: a file with the columns `time` and those of `column_layout`.
        joint_names: from the base to the tip.
        wanted: the signals to read.
        without_stiffness: joints for which no stiffness is read.

    Raises:
        InputError: with file and line of everything that does not fit.
    """
    table = read_table(path)
    file = table.source.path
    layout = column_layout(table.columns, joint_names, wanted, file, without_stiffness)
    time = np.ascontiguousarray(table.values[:, table.columns.index(TIME)])
    profiles = tuple(
        _profile(signal, signal.components or len(joint_names), time, table, layout) for signal in wanted
    )

    problems = [
        *time_problems(time),
        *(problem for profile in profiles for problem in value_problems(profile)),
    ]
    if problems:
        raise InputError(_located(problem, table, layout) for problem in problems)
    warnings = tuple(f"{file}: {clause}" for clause in _unused(table, layout, wanted))
    return Recording(RecordedTimes(time), profiles, warnings, table.source)


def _unused(table: Table, layout: Layout, wanted: Sequence[Signal]) -> Iterator[str]:
    for signal in SIGNALS:
        if signal not in wanted and any(layout.get(name) for name in signal.names):
            yield f"its columns of {signal.names[0]} are not used"
    used = {TIME, *(table.columns[column] for columns in layout.values() for column in columns.values())}
    if left := [column for column in table.columns if column not in used]:
        yield f"not used: {', '.join(left)}; only antagonistic joints take a stiffness"


def _profile(
    signal: Signal, components: int, time: FloatArray, table: Table, layout: Layout
) -> SampledProfile:
    values, *derivatives = (
        _rows(table, layout[name], components) if name in layout else None for name in signal.names
    )
    assert values is not None, "columns of values are required"
    return SampledProfile(signal=signal, time=time, values=values, derivatives=tuple(derivatives))


def _rows(table: Table, columns: Mapping[int, int], components: int) -> FloatArray:
    """(components, samples), NaN where a component has no column."""
    rows = np.full((components, len(table.values)), np.nan)
    for component, column in columns.items():
        rows[component] = table.values[:, column]
    return rows


def _located(problem: SampleProblem, table: Table, layout: Layout) -> Problem:
    line = 0 if problem.sample is None else line_of(problem.sample)
    column = (
        problem.quantity if problem.joint is None else table.columns[layout[problem.quantity][problem.joint]]
    )
    return Problem(table.source.path, line, f"{column} {problem.message}")


def recorded_trajectory(
    path: str | os.PathLike[str], joint_names: Sequence[str], without_stiffness: Collection[str] = ()
) -> Trajectory:
    """A trajectory whose position and stiffness come from one CSV file, named after the file.

    Raises:
        InputError: as `read_recording`.
    """
    recording = read_recording(path, joint_names, without_stiffness=without_stiffness)
    position, stiffness = recording.profiles
    return Trajectory(
        recording.times,
        position,
        stiffness,
        name=Path(path).stem,
        warnings=recording.warnings,
        sources=[recording.source],
    )
