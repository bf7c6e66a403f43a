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
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.simulation_variables import measured
from vsacli.base.texts import counted
from vsacli.base.units import time_text
from vsacli.base.variables import VARIABLES, Variable
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping
from vsacli.documents.csv_file import split_heading
from vsacli.documents.table import CsvTable
from vsacli.robot.model import Robot
from vsacli.studies.measured.likely_causes import UNWRAP
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
        rows = np.flatnonzero(np.isfinite(signal.values))
        values = signal.values[rows] * _torque_constant(robot, signal)
        columns.append(
            RecordedColumn(
                signal.column, variable_index, times[rows], values, signal.column in columns_with_unit, rows
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


MIN_SAMPLES = 200
"""Smallest number of samples in a column for a fit: four seconds at 50 Hz."""

MIN_NOISE_RATIO = 1e-7
"""Noise of a torque, relative to its range, above which equal readings are not a robot at rest."""

MIN_SATURATED_SAMPLES = 10
"""Number of readings at the extreme value above which they are not an accident."""

MIN_SATURATION_RATIO = 5.0
"""Ratio of readings at the extreme value to those at the next one for a cut-off; the crest of a quantized
sine without noise has 2.4."""


def stopping_faults(columns: Sequence[RecordedColumn], robot: Robot, table: CsvTable) -> Iterator[str]:
    """Yield sentences on faults that make columns unusable."""
    short_columns = [column for column in columns if len(column.time) < MIN_SAMPLES]
    if short_columns:
        yield _too_few_samples_text(short_columns)
        return
    unit = next((clause for column in columns for clause in _time_unit_faults(column)), None)
    if unit is not None:  # the columns of a file share their times
        yield unit
        return
    gaps = [(column.name, clause) for column in columns for clause in _gap_clauses(column, table)]
    yield from _merge_clauses(gaps)
    if not gaps:
        yield from _overlap_faults(columns)
    yield from _merge_clauses(
        (column.name, clause)
        for column in columns
        if column.place[0] != TORQUE
        for clause in _position_clauses(column, robot)
    )
    yield from _constant_column_sentences(columns, robot.joint_names)


def unreliable_fit_sentences(columns: Sequence[RecordedColumn]) -> Iterator[str]:
    """Yield sentences on reasons for an unreliable fit."""
    yield from _merge_clauses(
        (column.name, clause) for column in columns for clause in _fault_clauses(column)
    )


def _merge_clauses(clauses: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield a sentence for each clause that columns share."""
    names_by_clause: dict[str, list[str]] = {}
    for name, clause in clauses:
        names_by_clause.setdefault(clause, []).append(name)
    for clause, (first, *other_names) in names_by_clause.items():
        others_clause = f", as {len(other_names)} more," if other_names else ""
        yield f"column {first!r}{others_clause} {clause}"


def _too_few_samples_text(short_columns: Sequence[RecordedColumn]) -> str:
    """Return a sentence on columns with too few samples for a fit."""
    shortest = min(short_columns, key=lambda column: len(column.time))
    rows = counted(len(shortest.time), "row")
    name = f" with a value in column {shortest.name!r}"
    return f"has {rows}{name}; identification needs at least {MIN_SAMPLES}"


def _median_step(column: RecordedColumn) -> float:
    return float(np.median(np.diff(column.time)))


def _time_unit_faults(column: RecordedColumn) -> Iterator[str]:
    """Yield a sentence if the times are probably not in seconds."""
    if not SHORTEST_STEP <= _median_step(column) <= LONGEST_STEP:
        yield from (f"time {fault.message}" for fault in stamp_faults(column.time))


def _gap_clauses(column: RecordedColumn, table: CsvTable) -> list[str]:
    steps, median_step = np.diff(column.time), _median_step(column)
    longest_index = int(np.argmax(steps))
    if steps[longest_index] <= GAP_STEPS * median_step:
        return []
    when = time_text(float(column.time[longest_index]))
    before, after = (table.line_of(int(row)) for row in column.rows[longest_index : longest_index + 2])
    above = table.line_of(0) - 1  # preamble, header and units, which the second part needs as well
    head = f"{'line 1' if above == 1 else f'lines 1 to {above}'} with " if above > 0 else ""
    return [
        f"has a gap of {step_text(float(steps[longest_index]))} from t = {when} on, where rows are "
        f"{step_text(median_step)} apart: cut the file there and give both parts as recordings: lines 1 to "
        f"{before}, and {head}those from {after} on"
    ]


def _overlap_faults(columns: Sequence[RecordedColumn]) -> Iterator[str]:
    """Yield a sentence if the columns have too little time in common for a fit."""
    latest_column = max(columns, key=lambda column: column.time[0])
    earliest_column = min(columns, key=lambda column: column.time[-1])
    common_duration = float(earliest_column.time[-1] - latest_column.time[0])
    if common_duration < (MIN_SAMPLES - 1) * min(map(_median_step, columns)):
        begins, ends = time_text(float(latest_column.time[0])), time_text(float(earliest_column.time[-1]))
        yield (
            f"column {latest_column.name!r} begins at t = {begins} and column "
            f"{earliest_column.name!r} ends at t = {ends}: "
            f"{max(common_duration, 0.0):.3g} s in common are fewer than {MIN_SAMPLES} samples"
        )


def _position_clauses(column: RecordedColumn, robot: Robot) -> Iterator[str]:
    _, index, motor = column.place
    is_revolute = robot.joints[index].is_revolute
    follows = motor is None or robot.joints[index].actuator.has_columns(VARIABLES["phi"])[motor - 1]
    max_magnitude = float(np.max(np.abs(column.values), initial=0.0))
    wrap = angle_wraps(column.values) if is_revolute else None
    if wrap is not None:
        when = time_text(float(column.time[wrap.at]))
        yield f"jumps by 2 pi at t = {when}, a wrapped angle: set {UNWRAP}"
    elif (
        follows and not column.has_unit and max_magnitude > (LARGEST_ANGLE if is_revolute else LARGEST_TRAVEL)
    ):
        likely_unit, file_unit = ("deg", "rad") if is_revolute else ("mm", "m")
        yield (
            f"goes to {max_magnitude:.4g} {file_unit}; is it in {likely_unit}? Write "
            f"[{likely_unit}] after its name in the header, or [{file_unit}] if it is right"
        )


def _constant_column_sentences(columns: Sequence[RecordedColumn], joints: Sequence[str]) -> Iterator[str]:
    """Yield sentences on joints that do not move, and on constant columns while others of a joint change."""
    resting_joints = []
    for index, joint in enumerate(joints):
        joint_columns = [column for column in columns if column.place[1] == index]
        constant_columns = [
            column for column in joint_columns if len(column.values) and np.ptp(column.values) == 0
        ]
        changing_columns = [column for column in joint_columns if column not in constant_columns]
        if constant_columns and not changing_columns:
            resting_joints.append(joint)
            continue
        for column in constant_columns:
            yield (
                f"column {column.name!r} is {column.values[0]:.6g} throughout, while "
                f"{changing_columns[0].name!r} changes: a sensor that is not connected, or a column that was "
                "not filled in"
            )
    if resting_joints:
        verb, them = ("joint {} does", "its") if len(resting_joints) == 1 else ("joints {} do", "their")
        yield (
            f"{verb.format(', '.join(resting_joints))} not move, so nothing can be identified; remove {them} "
            "columns, or record a motion (vsacli identify ROBOT --plan)"
        )


def _fault_clauses(column: RecordedColumn) -> Iterator[str]:
    is_torque = column.place[0] == TORQUE
    inner = slice(1, -1) if is_torque else slice(None)  # dry friction jumps at both ends of a motion
    time, values = column.time[inner], column.values[inner]
    yield from (clause for _, clause in column_faults(time, time, values))
    if is_torque:
        yield from _saturation_clauses(column)


def _saturation_clauses(column: RecordedColumn) -> Iterator[str]:
    """Yield sentences on noisy readings that saturate at the largest or smallest value."""
    quantization = Quantization.of(column.time, column.values)
    if not np.median(quantization.noise) > MIN_NOISE_RATIO * np.ptp(column.values):
        return
    for end in (np.max, np.min):
        extreme = end(column.values)
        is_extreme = column.values == extreme
        other_values = column.values[~is_extreme]
        next_count = int(np.count_nonzero(other_values == end(other_values)))
        if is_extreme.sum() >= max(MIN_SATURATED_SAMPLES, MIN_SATURATION_RATIO * next_count):
            when = time_text(float(column.time[np.argmax(is_extreme)]))
            yield (
                f"is cut off at {extreme:.4g}, {is_extreme.sum()} times, first at t = {when}: the "
                "drive or the sensor goes no further; leave that part out, or move with less torque"
            )
