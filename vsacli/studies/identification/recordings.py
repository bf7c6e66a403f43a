"""Recordings for identification: all required columns of CSV files on one uniform grid."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.texts import listed
from vsacli.base.variables import MOTORS, VARIABLES
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping
from vsacli.documents.source import Source
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.identification.recording_faults import (
    MOTOR,
    POSITION,
    TORQUE,
    RecordedColumn,
    Where,
    read_recorded_columns,
    stopping_faults,
    unreliable_fit_sentences,
)
from vsacli.studies.measured.measured_columns import nearest_turn

INTERPOLATION = 3
"""Degree of the spline that resamples a column."""

GRID_TOLERANCE = 1e-6
"""Deviation of time stamps from the grid, in sampling intervals, below which no interpolation is needed."""


class Record(NamedTuple):
    """A recording on a uniform grid, in SI units on the joint side of the gears.

    Attributes:
        path: path of the file.
        source: file as read.
        time: times, (samples,) in s since the first row of the file.
        q: joint positions, (samples, joints); columns without data are NaN.
        theta: motor positions, (samples, joints, 2), NaN without data; the joint position for a motor of a
            joint without springs.
        tau_motor: motor torques, (samples, joints, 2).
        columns: names in the file, by variable, joint and motor.
        unused: names of columns that were not required.
        doubts: likely faults, as sentences, the most serious first.
    """

    path: str
    source: Source
    time: FloatArray
    q: FloatArray
    theta: FloatArray
    tau_motor: FloatArray
    columns: dict[Where, str]
    unused: tuple[str, ...]
    doubts: tuple[str, ...]


def read_motor_recording(robot: Robot, path: str | Path, mapping: ColumnMapping = AS_NAMED) -> Record:
    """Read a recording, a CSV file with columns named as by `vsacli export`, each at its own rate.

    Args:
        robot: recorded robot.
        path: path of the file.
        mapping: mapping of other column names.

    Raises:
        InputError: no column is required, a unit does not fit its variable, times do not ascend, or faults
            prevent a fit.
    """
    recorded, unused, recording = read_recorded_columns(robot, path, mapping)
    required = {place for index in range(len(robot.joints)) for place in _required_columns(robot, index)}
    columns = [column for column in recorded if column.place in required] or recorded
    unused = (*(column.name for column in recorded if column.place not in required), *unused)
    faults = list(stopping_faults(columns, robot, recording.table))
    if faults:
        raise InputError(Problem(str(path), 0, sentence) for sentence in faults)
    time = _uniform_times(columns)
    arrays = {
        variable: np.full((len(time), len(robot.joints), count), np.nan)
        for variable, count in ((POSITION, 1), (MOTOR, SIDES), (TORQUE, SIDES))
    }
    for column in columns:
        variable, joint, motor = column.place
        arrays[variable][:, joint, (motor or 1) - 1] = _resample_column(column, time)
    for index, joint_ in enumerate(robot.joints):
        if not joint_.actuator.sprung:
            arrays[MOTOR][:, index, 0] = arrays[POSITION][:, index, 0]
        elif mapping.unwrap and joint_.is_revolute:
            _turn_motors(arrays[MOTOR][:, index], arrays[POSITION][:, index, 0], joint_)
    return Record(
        path=str(path),
        source=recording.table.source,
        time=time,
        q=arrays[POSITION][..., 0],
        theta=arrays[MOTOR],
        tau_motor=arrays[TORQUE],
        columns={column.place: column.name for column in columns},
        unused=unused,
        doubts=(*filter(None, [recording.stranger]), *unreliable_fit_sentences(columns)),
    )


def _turn_motors(theta: FloatArray, q: FloatArray, joint: Joint) -> None:
    """Bring motors behind springs, (samples, 2), into the turn of their joint, which unwrapping may miss."""
    follow = joint.actuator.has_columns(VARIABLES["phi"])
    ungeared = [side is not None and side.gear_ratio in (None, 1) for side in joint.actuator.sides]
    for motor in np.flatnonzero(np.logical_and(follow, ungeared)):
        theta[:, motor] = nearest_turn(theta[:, motor], q)


COPY_TOLERANCE = 1e-7
"""Difference of the values of two recordings, relative to their range, below which they are the same one:
written with fewer digits, but below the noise of any sensor."""


def check_distinct(records: Sequence[Record]) -> None:
    """Check that recordings differ; a copy would confirm its own noise.

    Raises:
        InputError: two recordings have the same values.
    """
    problems = []
    for other, record in combinations(records, 2):
        if other.path == record.path:
            problems.append(Problem(record.path, 0, "is given twice; give each recording once"))
        elif all(map(_equal_arrays, _signal_values(other), _signal_values(record))):
            problems.append(Problem(record.path, 0, f"equals {other.path}; give each recording once"))
    if problems:
        raise InputError(problems)


def _signal_values(record: Record) -> tuple[FloatArray, ...]:
    return record.q, record.theta, record.tau_motor


def _equal_arrays(first: FloatArray, second: FloatArray) -> bool:
    """Return whether arrays, with NaN for missing columns, are equal up to rounding."""
    if first.shape != second.shape or not np.array_equal(np.isnan(first), np.isnan(second)):
        return False
    is_finite = np.isfinite(first)
    return not is_finite.any() or bool(
        np.max(np.abs(first[is_finite] - second[is_finite])) <= COPY_TOLERANCE * np.ptp(first[is_finite])
    )


def _uniform_times(columns: Sequence[RecordedColumn]) -> FloatArray:
    """Return uniform times at the rate of the fastest column, over the time span common to all columns."""
    fastest_column = max(columns, key=lambda column: (len(column.time) - 1) / np.ptp(column.time))
    sampling_interval = float(np.ptp(fastest_column.time)) / (len(fastest_column.time) - 1)
    start = max(float(column.time[0]) for column in columns)
    stop = min(float(column.time[-1]) for column in columns)
    return np.asarray(
        start + sampling_interval * np.arange(int((stop - start) / sampling_interval + GRID_TOLERANCE) + 1)
    )


def _resample_column(column: RecordedColumn, time: FloatArray) -> FloatArray:
    """Return values at the times of the grid: samples if they lie on it, otherwise a spline through them."""
    sampling_interval = float(time[1] - time[0])
    start_index = int(np.argmin(np.abs(column.time - time[0])))
    times_on_grid = column.time[start_index : start_index + len(time)]
    if (
        len(times_on_grid) == len(time)
        and np.max(np.abs(times_on_grid - time)) <= GRID_TOLERANCE * sampling_interval
    ):
        return column.values[start_index : start_index + len(time)]
    return np.asarray(scipy.interpolate.make_interp_spline(column.time, column.values, k=INTERPOLATION)(time))


MOST_LISTED = 3
"""Largest number of missing columns of a kind that a message names."""

KINDS = {POSITION: "joint positions", MOTOR: "motor positions", TORQUE: "motor torques"}
"""Required columns in words."""


def complete_joints(robot: Robot, record: Record) -> tuple[int, ...]:
    """Return the indices of the joints with all required columns.

    Raises:
        InputError: a joint with motor columns lacks others, or no joint is complete.
    """
    complete: list[int] = []
    missing_columns: list[Where] = []
    for index in range(len(robot.joints)):
        required = _required_columns(robot, index)
        missing = [place for place in required if place not in record.columns]
        if not missing:
            complete.append(index)
        elif any(name != POSITION for name, _, _ in set(required) - set(missing)):
            missing_columns += missing
    if not (complete or missing_columns):  # positions alone, or columns of no joint
        required = [place for index in range(len(robot.joints)) for place in _required_columns(robot, index)]
        missing_columns = [place for place in required if place not in record.columns]
    if missing_columns:
        raise InputError.one(_missing_columns_text(robot, missing_columns), record.path)
    return tuple(complete)


def _required_columns(robot: Robot, index: int) -> list[Where]:
    """Return the columns that identification requires for a joint."""
    actuator = robot.joints[index].actuator
    motors = MOTORS[: len(actuator.motors)]
    positions = [(MOTOR, index, motor) for motor in motors] if actuator.sprung else []
    return [(POSITION, index, None), *positions, *((TORQUE, index, motor) for motor in motors)]


def _missing_columns_text(robot: Robot, places: Sequence[Where]) -> str:
    """Return a sentence on missing columns, by kind."""
    clauses = []
    for variable, words in KINDS.items():
        names = [
            f"{robot.joint_names[index]}.{name}" + ("" if motor is None else f"_{motor}")
            for name, index, motor in places
            if name == variable
        ]
        if names:
            clauses.append(f"{listed(names, MOST_LISTED)} ({words})")
    is_single = len(places) == 1
    sentence = (
        f"the {'column' if is_single else 'columns'} {' and '.join(clauses)} "
        f"{'is' if is_single else 'are'} missing"
    )
    lacks_torque = any(name == TORQUE for name, *_ in places)
    advice = "record torques or motor currents; " if lacks_torque else ""
    return (
        f"{sentence}; {advice}if {'it has another name' if is_single else 'they have other names'}, "
        "use --columns"
    )
