"""Columns of a recording that identification requires, each with its own time stamps, in SI units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.simulation_variables import measured
from vsacli.base.variables import VARIABLES, Variable
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping
from vsacli.documents.csv_file import split_heading
from vsacli.robot.model import Robot
from vsacli.studies.measured.measured_columns import MeasuredSignal, Recording, preferred, read_recording
from vsacli.trajectory.recorded.even_stamps import elapsed_times

POSITION, MOTOR, TORQUE, CURRENT = "q", "theta", "tau_motor", "current"

READINGS = (POSITION, MOTOR, TORQUE)
"""Required columns of a joint.

Simulated sensor readings, `q_measured` and so on, take precedence.
"""

Where: TypeAlias = tuple[str, int, int | None]
"""Variable, joint index, and number of the motor or None."""


class RecordedColumn(NamedTuple):
    """A recorded column.

    Attributes:
        name: name in the file.
        place: variable, joint and motor.
        time: times of the samples, (samples,) in s since the first row of the file.
        values: values, (samples,), SI units on the joint side of the gear.
        has_unit: whether the file gives a unit after the name.
        rows: rows of the table in which the column has a value, (samples,).
    """

    name: str
    place: Where
    time: FloatArray
    values: FloatArray
    has_unit: bool
    rows: IndexArray


class _RobotColumns(NamedTuple):
    """The possible columns of a robot, as a `Jointed`."""

    robot: Robot

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.robot.joint_names

    @property
    def joint_types(self) -> tuple[str, ...]:
        return self.robot.joint_types

    @property
    def gear_ratio(self) -> FloatArray:
        """Gear ratios of the motors, (joints, 2); NaN where the file gives none."""
        sides = [side for actuator in self.robot.actuators for side in actuator.sides]
        ratios = [side.gear_ratio if side and side.gear_ratio else math.nan for side in sides]
        return np.array(ratios).reshape(-1, SIDES)

    def existing(self, variable: Variable) -> BoolArray:
        """Return the existing columns of a variable of joints."""
        return np.array([joint.has_columns(variable) for joint in self.robot.joints])


def recorded_columns(
    robot: Robot, path: str | Path, mapping: ColumnMapping = AS_NAMED
) -> tuple[list[RecordedColumn], tuple[str, ...], Recording]:
    """Return the required columns, the names of the others, and the recording as read.

    Args:
        robot: recorded robot.
        path: path of the CSV file.
        mapping: mapping of other column names.

    Raises:
        InputError: no column is required, a unit does not fit its variable, or times do not ascend.
    """
    wanted = [(name, 0, VARIABLES[name]) for name in (*READINGS, CURRENT)]
    wanted += [(measured(name), 1, VARIABLES[name]) for name in READINGS]
    recording = read_recording(path, _RobotColumns(robot), wanted, robot.name, mapping)
    united = {name for name, unit in map(split_heading, recording.table.columns) if unit is not None}
    stamps, columns = elapsed_times(recording.time), []
    for place, signal in _preferred_columns(recording.signals).items():
        rows = np.flatnonzero(np.isfinite(signal.values))
        values = signal.values[rows] * _torque_of_current(robot, signal)
        columns.append(
            RecordedColumn(signal.column, place, stamps[rows], values, signal.column in united, rows)
        )
    used = {column.name for column in columns}
    others = [signal.column for signal in recording.signals if signal.column not in used]
    return columns, (*others, *recording.table.unknown_columns), recording


def _preferred_columns(signals: Sequence[MeasuredSignal]) -> dict[Where, MeasuredSignal]:
    """Return the preferred column for each place: sensor readings first, torques before currents."""
    best = preferred(signals)
    currents = {place: best.pop(place) for place in tuple(best) if place[0] == CURRENT}
    return {(TORQUE, *place[1:]): signal for place, signal in currents.items()} | best


def _torque_of_current(robot: Robot, signal: MeasuredSignal) -> float:
    """Return the factor that converts a column to torques if it holds currents, otherwise 1."""
    variable, joint, motor, *_ = signal.place
    if variable != CURRENT or motor is None:
        return 1.0
    return robot.joints[joint].actuator.motors[motor - 1].torque_constant or 1.0
