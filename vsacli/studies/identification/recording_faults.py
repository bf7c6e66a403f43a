"""Columns of a recording that identification requires, and their faults.

Each column has its own time stamps, and values in SI units. Faults prevent a fit, or make it unreliable;
those that only the robot's equations reveal are found in `recording_checks`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.simulation_variables import measured
from vsacli.base.texts import counted
from vsacli.base.units import time_text
from vsacli.base.variables import VARIABLES, Variable
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping
from vsacli.documents.csv_file import split_heading
from vsacli.robot.model import Robot
from vsacli.studies.measured.measured_columns import MeasuredSignal, Recording, preferred, read_recording
from vsacli.trajectory.recorded.faults import Quantization, angle_wraps
from vsacli.trajectory.recorded.health import column_faults, stamp_faults, step_text
from vsacli.trajectory.recorded.samples import elapsed_times
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


class RecordedColumn(NamedTuple):
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
        return np.array([joint.has_columns(variable) for joint in self.robot.joints])


def read_recorded_columns(
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
    required_columns = [(name, 0, VARIABLES[name]) for name in (*READINGS, CURRENT)]
    required_columns += [(measured(name), 1, VARIABLES[name]) for name in READINGS]
    recording = read_recording(path, _RobotColumns(robot), required_columns, robot.name, mapping)
    columns_with_unit = {
        name for name, unit in map(split_heading, recording.table.columns) if unit is not None
    }
    times, columns = elapsed_times(recording.time), []
    for variable_index, signal in _preferred_columns(recording.signals).items():
        finite = np.isfinite(signal.values)
        values = signal.values[finite] * _torque_constant(robot, signal)
        columns.append(
            RecordedColumn(
                signal.column, variable_index, times[finite], values, signal.column in columns_with_unit
            )
        )
    used_names = {column.name for column in columns}
    unused_names = [signal.column for signal in recording.signals if signal.column not in used_names]
    return columns, (*unused_names, *recording.table.unknown_columns), recording


def _preferred_columns(signals: Sequence[MeasuredSignal]) -> dict[Where, MeasuredSignal]:
    """Return the preferred column for each place: sensor readings first, torques before currents."""
    preferred_signals = preferred(signals)
    currents = {
        place: preferred_signals.pop(place) for place in tuple(preferred_signals) if place[0] == CURRENT
    }
    return {(TORQUE, *place[1:]): signal for place, signal in currents.items()} | preferred_signals


def _torque_constant(robot: Robot, signal: MeasuredSignal) -> float:
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


def stopping_faults(columns: Sequence[RecordedColumn], robot: Robot) -> Iterator[str]:
    """Yield sentences on faults that make columns unusable."""
    few = [column for column in columns if len(column.time) < FEWEST_SAMPLES]
    if few:
        yield _too_few(few)
        return
    unit = next((clause for column in columns for clause in _unit_of_time(column)), None)
    if unit is not None:  # the columns of a file share their times
        yield unit
        return
    yield from _merge_clauses((column.name, clause) for column in columns for clause in _gap_clauses(column))
    if not any(_gap_clauses(column) for column in columns):
        yield from _too_short_in_common(columns)
    yield from _merge_clauses(
        (column.name, clause)
        for column in columns
        if column.place[0] != TORQUE
        for clause in _position_clauses(column, robot)
    )
    yield from _still(columns, robot.joint_names)


def unreliable_fit_sentences(columns: Sequence[RecordedColumn]) -> Iterator[str]:
    """Yield sentences on reasons for an unreliable fit."""
    yield from _merge_clauses(
        (column.name, clause) for column in columns for clause in _fault_clauses(column)
    )


def _merge_clauses(clauses: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield a sentence for each clause that columns share."""
    shared: dict[str, list[str]] = {}
    for name, clause in clauses:
        shared.setdefault(clause, []).append(name)
    for clause, (first, *others) in shared.items():
        beside = f", as {len(others)} more," if others else ""
        yield f"column {first!r}{beside} {clause}"


def _too_few(few: Sequence[RecordedColumn]) -> str:
    """Return a sentence on columns with too few samples for a fit."""
    fewest = min(few, key=lambda column: len(column.time))
    rows = counted(len(fewest.time), "row")
    name = f" with a value in column {fewest.name!r}"
    return f"has {rows}{name}; identification needs at least {FEWEST_SAMPLES}"


def _usual_step(column: RecordedColumn) -> float:
    return float(np.median(np.diff(column.time)))


def _unit_of_time(column: RecordedColumn) -> Iterator[str]:
    """Yield a sentence if the times are probably not in seconds."""
    if not SHORTEST_STEP <= _usual_step(column) <= LONGEST_STEP:
        yield from (f"time {fault.message}" for fault in stamp_faults(column.time))


def _gap_clauses(column: RecordedColumn) -> list[str]:
    steps, usual = np.diff(column.time), _usual_step(column)
    longest = int(np.argmax(steps))
    if steps[longest] <= GAP_STEPS * usual:
        return []
    when = time_text(float(column.time[longest]))
    return [
        f"has a gap of {step_text(float(steps[longest]))} from t = {when} on, where rows are "
        f"{step_text(usual)} apart: cut the file there and give both parts as recordings"
    ]


def _too_short_in_common(columns: Sequence[RecordedColumn]) -> Iterator[str]:
    """Yield a sentence if the columns have too little time in common for a fit."""
    last = max(columns, key=lambda column: column.time[0])
    first = min(columns, key=lambda column: column.time[-1])
    common = float(first.time[-1] - last.time[0])
    if common < (FEWEST_SAMPLES - 1) * min(map(_usual_step, columns)):
        begins, ends = time_text(float(last.time[0])), time_text(float(first.time[-1]))
        yield (
            f"column {last.name!r} begins at t = {begins} and column {first.name!r} ends at t = {ends}: "
            f"{max(common, 0.0):.3g} s in common are fewer than {FEWEST_SAMPLES} samples"
        )


def _position_clauses(column: RecordedColumn, robot: Robot) -> Iterator[str]:
    _, index, motor = column.place
    turns = robot.joints[index].is_revolute
    follows = motor is None or robot.joints[index].actuator.has_columns(VARIABLES["phi"])[motor - 1]
    largest = float(np.max(np.abs(column.values), initial=0.0))
    jumps = angle_wraps(column.values) if turns else None
    if jumps is not None:
        when = time_text(float(column.time[jumps.at]))
        yield f"jumps by 2 pi at t = {when}, a wrapped angle: unwrap it"
    elif follows and not column.has_unit and largest > (LARGEST_ANGLE if turns else LARGEST_TRAVEL):
        wrong, right = ("deg", "rad") if turns else ("mm", "m")
        yield (
            f"goes to {largest:.4g} {right}; is it in {wrong}? Write [{wrong}] after its name in the header, "
            f"or [{right}] if it is right"
        )


def _still(columns: Sequence[RecordedColumn], joints: Sequence[str]) -> Iterator[str]:
    """Yield sentences on joints that do not move, and on constant columns while others of a joint change."""
    resting = []
    for index, joint in enumerate(joints):
        own = [column for column in columns if column.place[1] == index]
        still = [column for column in own if len(column.values) and np.ptp(column.values) == 0]
        moving = [column for column in own if column not in still]
        if still and not moving:
            resting.append(joint)
            continue
        for column in still:
            yield (
                f"column {column.name!r} is {column.values[0]:.6g} throughout, while {moving[0].name!r} "
                "changes: a sensor that is not connected, or a column that was not filled in"
            )
    if resting:
        verb, them = ("joint {} does", "its") if len(resting) == 1 else ("joints {} do", "their")
        yield (
            f"{verb.format(', '.join(resting))} not move, so nothing can be identified; remove {them} "
            "columns, or record a motion (vsacli identify ROBOT --plan)"
        )


def _fault_clauses(column: RecordedColumn) -> Iterator[str]:
    is_torque = column.place[0] == TORQUE
    inner = slice(1, -1) if is_torque else slice(None)  # dry friction jumps at both ends of a motion
    time, values = column.time[inner], column.values[inner]
    yield from (clause for _, clause in column_faults(time, time, values))
    if is_torque:
        yield from _cut(column)


def _cut(column: RecordedColumn) -> Iterator[str]:
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
