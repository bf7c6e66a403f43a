"""Recordings for identification: columns of CSV files, their faults, and all of them on one even grid.

Columns with stamps of their own are read (`recorded_columns`) and judged one by one: faults that stop a fit,
and doubts that make it unreliable. Then `read_record` resamples them. What only the robot's equations show is
found in `recording_checks`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.simulation_variables import measured
from vsacli.base.units import time_text
from vsacli.base.variables import MOTORS, VARIABLES, Variable
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping
from vsacli.documents.csv_file import split_heading
from vsacli.documents.source import Source
from vsacli.robot.model import Robot
from vsacli.studies.measured.measured_columns import Measured, known_columns, preferred, read_recording
from vsacli.trajectory.recorded.even_stamps import elapsed_times
from vsacli.trajectory.recorded.faults import wraps
from vsacli.trajectory.recorded.health import column_faults
from vsacli.trajectory.recorded.quantization import Quantization
from vsacli.trajectory.recorded.stamps import stamp_faults, step_text
from vsacli.trajectory.recorded.thresholds import (
    GAP_STEPS,
    LARGEST_ANGLE,
    LARGEST_TRAVEL,
    LONGEST_STEP,
    SHORTEST_STEP,
)

POSITION, MOTOR, TORQUE, CURRENT = "q", "theta", "tau_motor", "current"

READINGS = (POSITION, MOTOR, TORQUE)
"""Required columns of a joint.

Readings of sensors in a simulation, `q_measured` and so on, take precedence.
"""

Where: TypeAlias = tuple[str, int, int | None]
"""Variable, index of the joint, and number of the motor or None."""


class Column(NamedTuple):
    """A recorded column.

    Attributes:
        name: in the file.
        place: its variable, joint and motor.
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
    """The possible columns of a robot; see `Jointed`."""

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
        return np.array([joint.has(variable) for joint in self.robot.joints])


def recorded_columns(
    robot: Robot, path: str | Path, mapping: ColumnMapping = AS_NAMED
) -> tuple[list[Column], tuple[str, ...], Source]:
    """Return the columns that are needed, the names of the others, and the file as it was read.

    Args:
        robot: that was recorded.
        path: the CSV file.
        mapping: assignment of columns with other names.

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
    """Return the preferred column for each place: sensor readings first, torques before currents."""
    best = preferred(signals)
    currents = {place: best.pop(place) for place in tuple(best) if place[0] == CURRENT}
    return {(TORQUE, *place[1:]): signal for place, signal in currents.items()} | best


def _torque_of_current(robot: Robot, signal: Measured) -> float:
    """Return the factor of a column to torques, if it holds currents."""
    variable, joint, motor, *_ = signal.place
    if variable != CURRENT or motor is None:
        return 1.0
    return robot.joints[joint].actuator.motors[motor - 1].torque_constant or 1.0


FEWEST_SAMPLES = 200
"""Numbers of a column that are worth a fit: some seconds at 50 Hz."""

NOISY = 1e-7
"""Noise of a torque, over its range, from which on equal readings are no motion at rest."""

CUT_SAMPLES = 10
"""Readings at the very largest value from which on they are no accident."""

CUT_SHARE = 5.0
"""The same, over those at the next value below: 2.4 at the crest of a sine in steps, without noise."""


def stopping_faults(columns: Sequence[Column], robot: Robot) -> Iterator[str]:
    """Yield sentences on unusable recordings."""
    yield from _together((column.name, clause) for column in columns for clause in _stamp_clauses(column))
    yield from _together(
        (column.name, clause)
        for column in columns
        if column.place[0] != TORQUE
        for clause in _position_clauses(column, robot)
    )
    for index, joint in enumerate(robot.joints):
        yield from _still([column for column in columns if column.place[1] == index], joint.name)


def doubts(columns: Sequence[Column]) -> Iterator[str]:
    """Yield sentences on reasons for an unreliable fit."""
    yield from _together((column.name, clause) for column in columns for clause in _doubtful_clauses(column))


def _together(clauses: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield a sentence for each clause that columns share."""
    shared: dict[str, list[str]] = {}
    for name, clause in clauses:
        shared.setdefault(clause, []).append(name)
    for clause, (first, *others) in shared.items():
        beside = f", as {len(others)} more," if others else ""
        yield f"column {first!r}{beside} {clause}"


def _stamp_clauses(column: Column) -> Iterator[str]:
    if len(column.time) < FEWEST_SAMPLES:
        yield f"has {len(column.time)} numbers; a fit needs {FEWEST_SAMPLES} at least"
        return
    steps = np.diff(column.time)
    usual, longest = float(np.median(steps)), int(np.argmax(steps))
    if not SHORTEST_STEP <= usual <= LONGEST_STEP:
        yield from (f"has a time that {fault.message}" for fault in stamp_faults(column.time))
    elif steps[longest] > GAP_STEPS * usual:
        when = time_text(float(column.time[longest]))
        yield (
            f"has a gap of {step_text(float(steps[longest]))} from t = {when} on, where rows are "
            f"{step_text(usual)} apart: cut the file there and give both parts as records"
        )


def _position_clauses(column: Column, robot: Robot) -> Iterator[str]:
    _, index, motor = column.place
    turns = robot.joints[index].is_revolute
    follows = motor is None or robot.joints[index].actuator.has(VARIABLES["phi"])[motor - 1]
    largest = float(np.max(np.abs(column.values), initial=0.0))
    jumps = wraps(column.values) if turns else None
    if jumps is not None:
        when = time_text(float(column.time[jumps.at]))
        yield f"jumps by 2 pi at t = {when}, a wrapped angle: unwrap it"
    elif follows and not column.has_unit and largest > (LARGEST_ANGLE if turns else LARGEST_TRAVEL):
        wrong, right = ("deg", "rad") if turns else ("mm", "m")
        yield (
            f"goes to {largest:.4g} {right}; is it in {wrong}? Write [{wrong}] after its name in the header, "
            f"or [{right}] if it is right"
        )


def _still(columns: Sequence[Column], joint: str) -> Iterator[str]:
    """Columns of a joint that stand still: all of them, or while others move."""
    still = [column for column in columns if len(column.values) and np.ptp(column.values) == 0]
    moving = [column for column in columns if column not in still]
    if still and not moving:
        yield f"joint {joint} does not move, and tells nothing: leave its columns out"
        return
    for column in still:
        yield (
            f"column {column.name!r} is {column.values[0]:.6g} throughout, while {moving[0].name!r} changes: "
            "a sensor that is not connected, or a column that was not filled in"
        )


def _doubtful_clauses(column: Column) -> Iterator[str]:
    is_torque = column.place[0] == TORQUE
    inner = slice(1, -1) if is_torque else slice(None)  # dry friction jumps where a motion begins and ends
    time, values = column.time[inner], column.values[inner]
    yield from (clause for _, clause in column_faults(time, time, values))
    if is_torque:
        yield from _cut(column)


def _cut(column: Column) -> Iterator[str]:
    """Noisy readings that come to an end at the same largest, or smallest, value again and again."""
    quantization = Quantization.of(column.time, column.values)
    if not np.median(quantization.noise) > NOISY * np.ptp(column.values):
        return
    for end in (np.max, np.min):
        last = end(column.values)
        at = column.values == last
        rest = column.values[~at]
        beside = int(np.count_nonzero(rest == end(rest)))
        if at.sum() >= max(CUT_SAMPLES, CUT_SHARE * beside):
            when = time_text(float(column.time[np.argmax(at)]))
            yield (
                f"is cut off at {last:.4g}, {at.sum()} times, first at t = {when}: the drive or the sensor "
                "goes no further; leave that part out, or move with less torque"
            )


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
        q: positions of the joints, (samples, joints), NaN throughout where there are none.
        theta: positions of the motors, (samples, joints, 2), as above; of a motor that moves with its joint
            the joint's if it was not recorded.
        tau_motor: torques of the motors, (samples, joints, 2).
        columns: names in the file, by variable.
        unused: names of columns that were not needed.
        doubts: likely faults of it, sentences.
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
        mapping: assignment of columns with other names.

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
    """Return even times at the rate of the fastest column, over the span of all columns."""
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
            motors = ("" if motor is None else f"_{motor}" for _, motor in lacking)
            listed = ", ".join(
                f"{joint.name}.{name}{motor}" for (name, _), motor in zip(lacking, motors, strict=True)
            )
            problems.append(Problem(record.path, 0, f"joint {joint.name}: there is no column {listed}"))
    if not found and not problems:
        first = robot.joints[0].name
        sentence = f"has no joint with position and motor torques, as {first}.q and {first}.tau_motor_1"
        problems.append(Problem(record.path, 0, sentence))
    if problems:
        raise InputError(problems)
    return tuple(found)
