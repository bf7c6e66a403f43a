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
    by_joint = gears_of_joints(gears, robot.joint_names)
    table = None if catalog is None else read_catalog(catalog)
    criterion = _criterion(table, gears, minimize)
    demand = demanded(robot, trajectories, progress)
    own = [motor for joint in robot.joints for motor in joint.actuator.motors]
    offered = _offered(robot, demand.motors, table, by_joint, criterion)
    found = [_sized(*each, table) for each in zip(demand.motors, own, offered, strict=True)]
    of_motions = [warning for motion in trajectories for warning in motion.warnings]
    warnings = [*robot.warnings, *of_motions, *_repetition_warnings(trajectories)]
    return Sizing(
        robot=robot.name,
        outcomes=demand.outcomes,
        catalog=None if table is None else table.source.path,
        candidates=0 if table is None else len(table.records),
        criterion=criterion,
        motors=tuple(found),
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
            often = "twice" if times == 2 else f"{times} times"
            yield f"{path} is given {often}; give each trajectory once"


def _criterion(
    table: RecordTable[CatalogMotor] | None, gears: Sequence[str], minimize: str | None
) -> str | None:
    if table is None:
        for given, words in ((gears, "gears need"), (minimize, "minimize needs")):
            if given:
                raise InputError.one(f"{words} a catalog of motors; give one")
        return None
    if minimize is None:
        return usual_criterion(table.records)
    if minimize not in CRITERIA:
        raise InputError.one(f"unknown criterion {minimize!r}{did_you_mean(minimize, CRITERIA)}")
    check_criterion(minimize, table.records, table.source.path)
    return minimize


def _offered(
    robot: Robot,
    demands: Sequence[MotorDemand],
    table: RecordTable[CatalogMotor] | None,
    gears: Mapping[str, Gears],
    criterion: str | None,
) -> list[tuple[Choice, ...]]:
    """Return the choices from the catalog for each motor of the robot that allow its coupled inertias."""
    if table is None or criterion is None:
        return [()] * len(demands)
    found = [
        choices(each, table.records, gears[each.joint], criterion) if each.time.size else ()
        for each in demands
    ]
    motors = {each.name: each for each in table.records}
    for joint in robot.joints:
        places = [place for place, each in enumerate(demands) if each.joint == joint.name]
        if joint.actuator.coupled_rotors and all(found[place] for place in places):
            first, second = places
            found[first], found[second] = coupled_choices(
                joint, found[first], found[second], motors, criterion
            )
    return found


def _sized(
    demand: MotorDemand,
    motor: JointMotor,
    found: tuple[Choice, ...],
    table: RecordTable[CatalogMotor] | None,
) -> MotorSizing:
    """Return the sizing of one motor of the robot, without results if no sample is feasible."""
    if not demand.time.size:
        return MotorSizing(demand, motor.gear_ratio)
    own = WorkingPoints.as_it_is(demand, motor)
    best = next((each for each in table.records if each.name == found[0].motor), None) if table else None
    return MotorSizing(
        demand,
        motor.gear_ratio,
        own=_own(demand, motor, own),
        choices=found,
        record=best,
        shaft=Shaft.of_joint_motor(motor) if best is None else best.shaft,
        points=own if best is None else WorkingPoints.with_gear(demand, best.shaft, found[0].ratio),
    )


def _own(demand: MotorDemand, motor: JointMotor, points: WorkingPoints) -> OwnMotor:
    shaft = Shaft.of_joint_motor(motor)
    shares = points.shares(shaft)
    own = OwnMotor(points, shares, max(shares.values(), default=0.0) <= 1 + LIMIT_ROUNDING)
    if motor.gear_ratio is None or (motor.friction is not None and motor.friction.width):
        return own
    possible = ratios_within(demand, Shaft.of([shaft]))
    low, high = (math.nan, math.nan) if possible.empty[0] else (possible.low[0], possible.high[0])
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


KEPT = ("max_torque", "max_velocity", "torque_constant", "resistance", "max_current", "max_voltage")
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
    own, home = text_to_change(robot)
    values: dict[str, Any] = {}
    for index, joint in enumerate(robot.joints):
        places = [motor for motor in sizing.motors if motor.joint == joint.name]
        place = f"joints.{index}.actuator"
        motors = [_as_in_robot_file(each) for each in places]
        values[f"{place}.motor"] = motors[0] if len(motors) == 1 else motors
        if joint.actuator.coupled_rotors:
            ratios = math.prod(motor["gear_ratio"] for motor in motors)
            values[f"{place}.coupled_inertia"] = joint.actuator.coupled_rotors / ratios
    files = dict(moved_files(own, home, Path(folder)))
    return edited(unaliased(own, values), {**values, **files})


def _as_in_robot_file(place: MotorSizing) -> dict[str, Any]:
    """Return the chosen motor with its gear, as `motor:` of an actuator."""
    motor, choice = place.record, place.best
    assert motor is not None, "as of every place"
    assert choice is not None, "likewise"
    found: dict[str, Any] = {"inertia": motor.inertia, "gear_ratio": choice.ratio, "side": SHAFT}
    found |= {name: getattr(motor, name) for name in KEPT if getattr(motor, name) is not None}
    if motor.damping:
        found["damping"] = motor.damping
    if motor.coulomb:
        found["friction"] = {"coulomb": motor.coulomb}
    return found
