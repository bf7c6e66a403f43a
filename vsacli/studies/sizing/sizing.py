"""Sizing of drives: the demands of trajectories, suitable motors, and the robot's file with these.

`demanded` runs all trajectories, `choices` ranks the motors of a catalog for each motor of the robot.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.actuators.motor import SHAFT, JointMotor
from vsacli.actuators.reach import LIMIT_ROUNDING
from vsacli.analysis.tool_report import unjudged_tools_text
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, check_type
from vsacli.documents.edited import edited, moved_files, unaliased
from vsacli.documents.record_table import RecordTable
from vsacli.robot.file import text_to_change
from vsacli.robot.model import Robot, check_robot
from vsacli.studies.sizing.catalog import CatalogMotor, Shaft, read_catalog
from vsacli.studies.sizing.choices import (
    CRITERIA,
    Choice,
    check_criterion,
    choices,
    coupled_choices,
    usual_criterion,
)
from vsacli.studies.sizing.demand import MotorDemand, demanded
from vsacli.studies.sizing.motor_sizing import MotorSizing, OwnMotor, WorkingPoints
from vsacli.studies.sizing.ratios import Gears, gears_of_joints, ratios_within
from vsacli.studies.sizing.sizing_report import Sizing
from vsacli.trajectory.trajectory import Trajectory


def size_drives(
    robot: Robot,
    trajectories: Sequence[Trajectory],
    catalog: str | os.PathLike[str] | None = None,
    gears: Sequence[str] = (),
    minimize: str | None = None,
    *,
    progress: Callable[[int], object] = lambda _: None,
) -> Sizing:
    """Return the demands on motors and springs, and the motors and gears of a catalog that meet them.

    Peaks are the largest over all trajectories; means are over all trajectories executed in turn as a cycle.

    Args:
        robot: robot to size.
        trajectories: trajectories to execute.
        catalog: path of a CSV file of motors; None to check only the robot's own motors.
        gears: ratios such as "50,80,100", or a range such as "30..160", for all joints, or for one joint as
            in "slide=500..3000"; any ratio if empty. Motors that have a gear in the catalog keep it.
        minimize: criterion for the best choice, "copper_loss", "utilization" or "mass"; if None,
            "copper_loss" if the catalog has all resistances, otherwise "utilization".
        progress: function to call with the number of further samples that are done.

    Raises:
        InputError: there is no trajectory, one does not fit the robot, the catalog cannot be read or has no
            rotors heavy enough for a coupled inertia, or gears or criterion are invalid.
        TypeError: an argument is of another type.
    """
    check_robot(robot)
    check_type("trajectories", trajectories, Sequence, "size_drives(robot, [trajectory]) takes one")
    if not trajectories:
        raise InputError.one("there is no trajectory to size for")
    gears_by_joint = gears_of_joints(gears, robot.joint_names)
    table = None if catalog is None else read_catalog(catalog)
    criterion = _checked_criterion(table, gears, minimize)
    demand = demanded(robot, trajectories, progress)
    own_motors = [motor for joint in robot.joints for motor in joint.actuator.motors]
    offered_choices = _offered_choices(robot, demand.motors, table, gears_by_joint, criterion)
    motor_sizings = [
        _motor_sizing(*each, table) for each in zip(demand.motors, own_motors, offered_choices, strict=True)
    ]
    trajectory_warnings = [warning for motion in trajectories for warning in motion.warnings]
    warnings = [*robot.warnings, *trajectory_warnings, *_repetition_warnings(trajectories)]
    return Sizing(
        robot=robot.name,
        outcomes=demand.outcomes,
        catalog=None if table is None else table.source.path,
        candidates=0 if table is None else len(table.records),
        criterion=criterion,
        motors=tuple(motor_sizings),
        springs=demand.springs,
        warnings=tuple(dict.fromkeys(warnings)),
        notes=tuple(_assumption_notes(robot, table)),
    )


INSTANTS = 9
"""Evenly spread times at which two trajectories with the same file are compared."""


def _repetition_warnings(trajectories: Sequence[Trajectory]) -> Iterator[str]:
    """Yield a warning for each trajectory that is given several times, which weights means."""

    def content(trajectory: Trajectory) -> tuple[Any, ...]:
        motion = trajectory.at(np.linspace(*trajectory.times.span, INSTANTS))
        path = trajectory.sources[0].path if trajectory.sources else trajectory.name
        return (path, *(array.tobytes() for array in motion.of_joints.values()))

    for (path, *_), times in Counter(map(content, trajectories)).items():
        if times > 1:
            count_text = "twice" if times == 2 else f"{times} times"
            yield f"{path} is given {count_text}; give each trajectory once"


def _checked_criterion(
    table: RecordTable[CatalogMotor] | None, gears: Sequence[str], minimize: str | None
) -> str | None:
    if table is None:
        for option, words in ((gears, "gears need"), (minimize, "minimize needs")):
            if option:
                raise InputError.one(f"{words} a catalog of motors; give one")
        return None
    if minimize is None:
        return usual_criterion(table.records)
    if minimize not in CRITERIA:
        raise InputError.one(f"unknown criterion {minimize!r}{did_you_mean(minimize, CRITERIA)}")
    check_criterion(minimize, table.records, table.source.path)
    return minimize


def _offered_choices(
    robot: Robot,
    demands: Sequence[MotorDemand],
    table: RecordTable[CatalogMotor] | None,
    gears: Mapping[str, Gears],
    criterion: str | None,
) -> list[tuple[Choice, ...]]:
    """Return the choices from the catalog for each motor of the robot that allow its coupled inertias."""
    if table is None or criterion is None:
        return [()] * len(demands)
    choices_by_motor = [
        choices(each, table.records, gears[each.joint], criterion) if each.time.size else ()
        for each in demands
    ]
    motors = {each.name: each for each in table.records}
    for joint in robot.joints:
        motor_indices = [place for place, each in enumerate(demands) if each.joint == joint.name]
        if joint.actuator.coupled_rotors and all(choices_by_motor[place] for place in motor_indices):
            first, second = motor_indices
            choices_by_motor[first], choices_by_motor[second] = coupled_choices(
                joint, choices_by_motor[first], choices_by_motor[second], motors, criterion
            )
    return choices_by_motor


def _motor_sizing(
    demand: MotorDemand,
    motor: JointMotor,
    motor_choices: tuple[Choice, ...],
    table: RecordTable[CatalogMotor] | None,
) -> MotorSizing:
    """Return the sizing of one motor of the robot, without results if no sample is feasible."""
    if not demand.time.size:
        return MotorSizing(demand, motor.gear_ratio)
    own_points = WorkingPoints.as_it_is(demand, motor)
    best_record = (
        next((each for each in table.records if each.name == motor_choices[0].motor), None) if table else None
    )
    return MotorSizing(
        demand,
        motor.gear_ratio,
        own=_own_motor(demand, motor, own_points),
        choices=motor_choices,
        record=best_record,
        shaft=Shaft.of_joint_motor(motor) if best_record is None else best_record.shaft,
        points=own_points
        if best_record is None
        else WorkingPoints.with_gear(demand, best_record.shaft, motor_choices[0].ratio),
    )


def _own_motor(demand: MotorDemand, motor: JointMotor, points: WorkingPoints) -> OwnMotor:
    shaft = Shaft.of_joint_motor(motor)
    shares = points.shares(shaft)
    own = OwnMotor(points, shares, max(shares.values(), default=0.0) <= 1 + LIMIT_ROUNDING)
    if motor.gear_ratio is None or (motor.friction is not None and motor.friction.width):
        return own
    possible_ratios = ratios_within(demand, Shaft.of([shaft]))
    low, high = (
        (math.nan, math.nan)
        if possible_ratios.empty[0]
        else (possible_ratios.low[0], possible_ratios.high[0])
    )
    return replace(own, low=float(low), high=float(high))


def _assumption_notes(robot: Robot, table: RecordTable[CatalogMotor] | None) -> Iterator[str]:
    """Yield notes on assumptions that are not obvious."""
    coupled = [joint.name for joint in robot.joints if joint.actuator.coupled_rotors]
    if coupled and table is not None:
        yield f"{', '.join(coupled)}: the coupled inertia stays as it is, whatever the motors"
    if robot.limited_tools:
        yield unjudged_tools_text(robot.limited_tools)
    if table is not None and table.unknown_columns:
        yield f"columns of the catalog that were left out: {', '.join(table.unknown_columns)}"


SHARED_COLUMNS = ("max_torque", "max_velocity", "torque_constant", "resistance", "max_current", "max_voltage")
"""Columns of a catalog that a robot file has under the same name."""


def sized_text(robot: Robot, sizing: Sizing, folder: str | Path) -> str:
    """Return the text of the robot's file with the best motors.

    Everything else, comments included, remains as the user wrote it. Masses of links do not change, nor does
    a coupled inertia on the joint side; a robot file has no continuous torque and no gear efficiency.

    Args:
        robot: robot as read from its file.
        sizing: result of the sizing, with a choice for each motor.
        folder: folder of the new file.

    Raises:
        InputError: the robot was not read from a file.
    """
    source_text, source_folder = text_to_change(robot)
    values: dict[str, Any] = {}
    for index, joint in enumerate(robot.joints):
        joint_sizings = [motor for motor in sizing.motors if motor.joint == joint.name]
        actuator_path = f"joints.{index}.actuator"
        motors = [_as_in_robot_file(each) for each in joint_sizings]
        values[f"{actuator_path}.motor"] = motors[0] if len(motors) == 1 else motors
        if joint.actuator.coupled_rotors:
            ratios = math.prod(motor["gear_ratio"] for motor in motors)
            values[f"{actuator_path}.coupled_inertia"] = joint.actuator.coupled_rotors / ratios
    files = dict(moved_files(source_text, source_folder, Path(folder)))
    return edited(unaliased(source_text, values), {**values, **files})


def _as_in_robot_file(sizing: MotorSizing) -> dict[str, Any]:
    """Return the chosen motor with its gear, as `motor:` of an actuator."""
    motor, choice = sizing.record, sizing.best
    assert motor is not None, "as of every place"
    assert choice is not None, "likewise"
    fields: dict[str, Any] = {"inertia": motor.inertia, "gear_ratio": choice.ratio, "side": SHAFT}
    fields |= {name: getattr(motor, name) for name in SHARED_COLUMNS if getattr(motor, name) is not None}
    if motor.damping:
        fields["damping"] = motor.damping
    if motor.coulomb:
        fields["friction"] = {"coulomb": motor.coulomb}
    return fields
