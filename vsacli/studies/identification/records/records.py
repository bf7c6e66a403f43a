"""Records of a robot for identification: complete, and on one even grid."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.variables import MOTORS
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping
from vsacli.documents.source import Source
from vsacli.robot.model import Robot
from vsacli.studies.identification.records.record_columns import (
    MOTOR,
    POSITION,
    TORQUE,
    Column,
    Where,
    recorded_columns,
)
from vsacli.studies.identification.records.record_faults import doubts, stopping_faults

INTERPOLATION = 3
"""Degree of the spline between samples that are not on the grid."""

EVEN = 1e-6
"""Deviation of stamps from even ones, in steps, that needs no interpolation."""


class Record(NamedTuple):
    """A record on an even grid, SI units, joint side of the gears.

    Attributes:
        path: of the file.
        source: the file as it was read.
        time: (samples,), s, from the first row of the file on.
        q: positions of the joints, (samples, joints), NaN throughout where there is none.
        theta: positions of the motors, (samples, joints, 2), likewise; of a motor that moves with its joint
            the joint's if it was not recorded.
        tau_motor: torques of the motors, (samples, joints, 2).
        columns: names in the file, by what they are.
        unused: names of columns that were not needed.
        doubts: what looks wrong with it, sentences.
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


def read_record(robot: Robot, path: str | Path, mapping: ColumnMapping = AS_NAMED) -> Record:
    """Read a record, a CSV file with columns as `vsacli export` names them, at rates of their own.

    Args:
        robot: that was recorded.
        path: the file.
        mapping: what columns with other names stand for.

    Raises:
        InputError: there is no such column, a unit is one of something else, times do not ascend, or there
            are faults with which nothing can be fitted.
    """
    columns, unused, source = recorded_columns(robot, path, mapping)
    faults = list(stopping_faults(columns, robot))
    if faults:
        raise InputError(Problem(str(path), 0, sentence) for sentence in faults)
    time = _grid(columns)
    arrays = {
        variable: np.full((len(time), len(robot.joints), count), np.nan)
        for variable, count in ((POSITION, 1), (MOTOR, SIDES), (TORQUE, SIDES))
    }
    for column in columns:
        variable, joint, motor = column.place
        arrays[variable][:, joint, (motor or 1) - 1] = _on_grid(column, time)
    for index, joint_ in enumerate(robot.joints):
        if not joint_.actuator.sprung and np.isnan(arrays[MOTOR][:, index, 0]).all():
            arrays[MOTOR][:, index, 0] = arrays[POSITION][:, index, 0]
    return Record(
        path=str(path),
        source=source,
        time=time,
        q=arrays[POSITION][..., 0],
        theta=arrays[MOTOR],
        tau_motor=arrays[TORQUE],
        columns={column.place: column.name for column in columns},
        unused=unused,
        doubts=tuple(doubts(columns)),
    )


def check_distinct(records: Sequence[Record]) -> None:
    """Refuse a record that is there twice: the same noise would seem to confirm itself.

    Raises:
        InputError: two have the same numbers, whatever their files are called.
    """
    for before, record in combinations(records, 2):
        pairs = (before.q, record.q), (before.theta, record.theta), (before.tau_motor, record.tau_motor)
        if all(np.array_equal(*pair, equal_nan=True) for pair in pairs):
            message = f"has the same numbers as {before.path}, given before; a record counts once"
            raise InputError.one(message, record.path)


def _grid(columns: Sequence[Column]) -> FloatArray:
    """Even times at the rate of the fastest column, over what all cover."""
    fastest = max(columns, key=lambda column: (len(column.time) - 1) / np.ptp(column.time))
    step = float(np.ptp(fastest.time)) / (len(fastest.time) - 1)
    start = max(float(column.time[0]) for column in columns)
    stop = min(float(column.time[-1]) for column in columns)
    return np.asarray(start + step * np.arange(int((stop - start) / step + EVEN) + 1))


def _on_grid(column: Column, time: FloatArray) -> FloatArray:
    """Values at the times of the grid: samples if they are there, else a spline through them."""
    from scipy.interpolate import make_interp_spline

    step = float(time[1] - time[0])
    first = int(np.argmin(np.abs(column.time - time[0])))
    own = column.time[first : first + len(time)]
    if len(own) == len(time) and np.max(np.abs(own - time)) <= EVEN * step:
        return column.values[first : first + len(time)]
    return np.asarray(make_interp_spline(column.time, column.values, k=INTERPOLATION)(time))


def complete_joints(robot: Robot, record: Record) -> tuple[int, ...]:
    """Indices of the joints of which all was recorded.

    Raises:
        InputError: of a joint some columns are there and others are missing, or no joint is complete.
    """
    found, problems = [], []
    for index, joint in enumerate(robot.joints):
        needed = [(POSITION, None), *((MOTOR, motor) for motor in MOTORS), *((TORQUE, m) for m in MOTORS)]
        count = len(joint.actuator.motors)
        own = [(name, motor) for name, motor in needed if motor is None or motor <= count]
        if not joint.actuator.sprung:
            own = [(name, motor) for name, motor in own if name != MOTOR]
        lacking = [each for each in own if (each[0], index, each[1]) not in record.columns]
        if not lacking:
            found.append(index)
        elif any(name != POSITION for name, _ in set(own) - set(lacking)):
            listed = ", ".join(_column_name(joint.name, *each) for each in lacking)
            problems.append(Problem(record.path, 0, f"joint {joint.name}: there is no column {listed}"))
    if not found and not problems:
        first = robot.joints[0].name
        sentence = f"has no joint with position and motor torques, as {first}.q and {first}.tau_motor_1"
        problems.append(Problem(record.path, 0, sentence))
    if problems:
        raise InputError(problems)
    return tuple(found)


def _column_name(joint: str, variable: str, motor: int | None) -> str:
    return f"{joint}.{variable}" if motor is None else f"{joint}.{variable}_{motor}"
