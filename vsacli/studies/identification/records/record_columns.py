"""Columns of a record that say what joints and motors do, each with stamps of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.simulation_variables import measured
from vsacli.base.variables import VARIABLES, Variable
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping
from vsacli.documents.source import Source
from vsacli.documents.table_header import split_heading
from vsacli.robot.model import Robot
from vsacli.studies.measured.measured_columns import Measured, known_columns, preferred, read_recording
from vsacli.trajectory.recorded.even_stamps import elapsed_times

POSITION, MOTOR, TORQUE, CURRENT = "q", "theta", "tau_motor", "current"

READINGS = (POSITION, MOTOR, TORQUE)
"""What is needed of a joint. What sensors of a simulation read, `q_measured` and so on, goes before."""

Where: TypeAlias = tuple[str, int, int | None]
"""Variable, index of the joint, and number of the motor or None."""


class Column(NamedTuple):
    """A recorded column.

    Attributes:
        name: in the file.
        place: what it is.
        time: of its samples, (samples,), s from the first row of the file on.
        values: (samples,), SI units, joint side of the gear.
        has_unit: whether a unit follows its name.
    """

    name: str
    place: Where
    time: FloatArray
    values: FloatArray
    has_unit: bool


class _RobotColumns(NamedTuple):
    """What columns there are of a robot; see `Jointed`."""

    robot: Robot

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.robot.joint_names

    @property
    def joint_types(self) -> tuple[str, ...]:
        return self.robot.joint_types

    @property
    def gear_ratio(self) -> FloatArray:
        """Of the motors, (joints, 2); NaN where the file gives none."""
        sides = [side for actuator in self.robot.actuators for side in actuator.sides]
        ratios = [side.gear_ratio if side and side.gear_ratio else math.nan for side in sides]
        return np.array(ratios).reshape(-1, SIDES)

    def existing(self, variable: Variable) -> BoolArray:
        """Which columns of a variable of joints there are."""
        return np.array([joint.has(variable) for joint in self.robot.joints])


def recorded_columns(
    robot: Robot, path: str | Path, mapping: ColumnMapping = AS_NAMED
) -> tuple[list[Column], tuple[str, ...], Source]:
    """The columns that are needed, the names of the others, and the file as it was read.

    Args:
        robot: that was recorded.
        path: the CSV file.
        mapping: what columns with other names stand for.

    Raises:
        InputError: there is none, a unit is one of something else, or times do not ascend.
    """
    wanted = [(name, 0, VARIABLES[name]) for name in (*READINGS, CURRENT)]
    wanted += [(measured(name), 1, VARIABLES[name]) for name in READINGS]
    recording = read_recording(path, known_columns(_RobotColumns(robot), wanted), "the robot", mapping)
    united = {name for name, unit in map(split_heading, recording.table.columns) if unit is not None}
    stamps, columns = elapsed_times(recording.time), []
    for place, signal in _preferred(recording.signals).items():
        there = np.isfinite(signal.values)
        values = signal.values[there] * _torque_of_current(robot, signal)
        columns.append(Column(signal.column, place, stamps[there], values, signal.column in united))
    used = {column.name for column in columns}
    others = [signal.column for signal in recording.signals if signal.column not in used]
    return columns, (*others, *recording.others), recording.table.source


def _preferred(signals: Sequence[Measured]) -> dict[Where, Measured]:
    """For each place the column that counts: what sensors read if it is there, torques before currents."""
    best = preferred(signals)
    currents = {place: best.pop(place) for place in tuple(best) if place[0] == CURRENT}
    return {(TORQUE, *place[1:]): signal for place, signal in currents.items()} | best


def _torque_of_current(robot: Robot, signal: Measured) -> float:
    """What the numbers of a column are multiplied by to be torques, if they are currents."""
    variable, joint, motor, *_ = signal.place
    if variable != CURRENT or motor is None:
        return 1.0
    return robot.joints[joint].actuator.motors[motor - 1].torque_constant or 1.0
