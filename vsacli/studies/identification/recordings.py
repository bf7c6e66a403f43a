"""Recordings for identification: columns of CSV files, their faults, and all of them on one uniform grid.

`recorded_columns` reads columns, each with its own time stamps. They are checked one by one for faults that
prevent a fit and for faults that make it unreliable; then `read_record` resamples them. Faults that only the
robot's equations reveal are found in `recording_checks`.
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
from vsacli.studies.measured.measured_columns import Measured, preferred, read_recording
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

Simulated sensor readings, `q_measured` and so on, take precedence.
"""

Where: TypeAlias = tuple[str, int, int | None]
"""Variable, joint index, and number of the motor or None."""


class Column(NamedTuple):
    """A recorded column.

    Attributes:
        name: name in the file.
        place: variable, joint and motor.
        time: times of the samples, (samples,) in s since the first row of the file.
        values: values, (samples,), SI units on the joint side of the gear.
        has_unit: whether the file gives a unit after the name.
    """

    name: str
    place: Where
    time: FloatArray
    values: FloatArray
    has_unit: bool


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
        return np.array([joint.has(variable) for joint in self.robot.joints])


def recorded_columns(
    robot: Robot, path: str | Path, mapping: ColumnMapping = AS_NAMED
) -> tuple[list[Column], tuple[str, ...], Source]:
    """Return the required columns, the names of the others, and the file as read.

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
    """Return the factor that converts a column to torques if it holds currents, otherwise 1."""
    variable, joint, motor, *_ = signal.place
    if variable != CURRENT or motor is None:
        return 1.0
    return robot.joints[joint].actuator.motors[motor - 1].torque_constant or 1.0


FEWEST_SAMPLES = 200
"""Smallest number of samples in a column for a fit: four seconds at 50 Hz."""

NOISY = 1e-7
"""Noise of a torque, relative to its range, above which equal readings are not a robot at rest."""

CUT_SAMPLES = 10
"""Number of readings at the extreme value above which they are not an accident."""

CUT_SHARE = 5.0
"""Ratio of readings at the extreme value to those at the next one for a cut-off; the crest of a quantized
sine without noise has 2.4."""


def stopping_faults(columns: Sequence[Column], robot: Robot) -> Iterator[str]:
    """Yield sentences on faults that make columns unusable."""
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
    yield from _together((column.name, clause) for column in columns for clause in _fault_clauses(column))


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
    """Yield sentences on a joint that does not move, or on constant columns while others change."""
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


def _fault_clauses(column: Column) -> Iterator[str]:
    is_torque = column.place[0] == TORQUE
    inner = slice(1, -1) if is_torque else slice(None)  # dry friction jumps at both ends of a motion
    time, values = column.time[inner], column.values[inner]
    yield from (clause for _, clause in column_faults(time, time, values))
    if is_torque:
        yield from _cut(column)


def _cut(column: Column) -> Iterator[str]:
    """Yield sentences on noisy readings that saturate at the largest or smallest value."""
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
"""Degree of the spline that resamples a column."""

EVEN = 1e-6
"""Deviation of time stamps from the grid, in sampling intervals, below which no interpolation is needed."""


class Record(NamedTuple):
    """A recording on a uniform grid, in SI units on the joint side of the gears.

    Attributes:
        path: path of the file.
        source: file as read.
        time: times, (samples,) in s since the first row of the file.
        q: joint positions, (samples, joints); columns without data are NaN.
        theta: motor positions, (samples, joints, 2), NaN without data; the joint position for a motor of a
            joint without springs, unless its own was recorded.
        tau_motor: motor torques, (samples, joints, 2).
        columns: names in the file, by variable, joint and motor.
        unused: names of columns that were not required.
        doubts: likely faults, as sentences.
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
    """Read a recording, a CSV file with columns named as by `vsacli export`, each at its own rate.

    Args:
        robot: recorded robot.
        path: path of the file.
        mapping: mapping of other column names.

    Raises:
        InputError: no column is required, a unit does not fit its variable, times do not ascend, or faults
            prevent a fit.
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
    """Check that recordings differ; a copy would confirm its own noise.

    Raises:
        InputError: two recordings have the same values.
    """
    for before, record in combinations(records, 2):
        pairs = (before.q, record.q), (before.theta, record.theta), (before.tau_motor, record.tau_motor)
        if all(np.array_equal(*pair, equal_nan=True) for pair in pairs):
            message = f"has the same numbers as {before.path}, given before; a record counts once"
            raise InputError.one(message, record.path)


def _grid(columns: Sequence[Column]) -> FloatArray:
    """Return uniform times at the rate of the fastest column, over the time span common to all columns."""
    fastest = max(columns, key=lambda column: (len(column.time) - 1) / np.ptp(column.time))
    step = float(np.ptp(fastest.time)) / (len(fastest.time) - 1)
    start = max(float(column.time[0]) for column in columns)
    stop = min(float(column.time[-1]) for column in columns)
    return np.asarray(start + step * np.arange(int((stop - start) / step + EVEN) + 1))


def _on_grid(column: Column, time: FloatArray) -> FloatArray:
    """Return values at the times of the grid: samples if they lie on it, otherwise a spline through them."""
    from scipy.interpolate import make_interp_spline

    step = float(time[1] - time[0])
    first = int(np.argmin(np.abs(column.time - time[0])))
    own = column.time[first : first + len(time)]
    if len(own) == len(time) and np.max(np.abs(own - time)) <= EVEN * step:
        return column.values[first : first + len(time)]
    return np.asarray(make_interp_spline(column.time, column.values, k=INTERPOLATION)(time))


def complete_joints(robot: Robot, record: Record) -> tuple[int, ...]:
    """Return the indices of the joints with all required columns.

    Raises:
        InputError: a joint with motor columns lacks others, or no joint is complete.
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
