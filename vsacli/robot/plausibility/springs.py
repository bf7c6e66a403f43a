"""Plausibility rules of springs and dampers of a robot, and of the stiffness that springs give its joints."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vsacli.actuators.laws import SpringLaw
from vsacli.actuators.transmission import Command, JointVariables
from vsacli.base import units
from vsacli.base.flags import MIN_MARGIN
from vsacli.documents.plausibility import Measured, OtherUnit, Rule
from vsacli.documents.record_values import NumberPath, PathIndex
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.bodies import DEGREES, MILLIMETERS, SIZES, SLIPS_OF_DAMPING, TURN
from vsacli.robot.plausibility.checked_robot import (
    CheckedRobot,
    UnloadedStiffnessRange,
    joint_path,
    motors_in_file,
    ratio_or_nan,
    records_in_file,
)

HALF_TURN = math.pi
TOO_SOFT = (
    OtherUnit("N m/deg", 180 / math.pi, instead_of="N m/rad"),
    OtherUnit("kN m/rad", 1e3, instead_of="N m/rad"),
    OtherUnit("N/mm", 1e3, instead_of="N/m"),
)
NEWTON_MILLIMETERS = OtherUnit("N mm/rad", 1e-3, instead_of="N m/rad")
TOO_STIFF = (NEWTON_MILLIMETERS, OtherUnit("N mm/deg", 0.18 / math.pi, instead_of="N m/rad"))
"""Units in which a stiffness is a smaller number (`TOO_SOFT`) or a larger one than in the expected unit."""

SLACK_DEFLECTION = 0.3
"""Deflection at which springs without stiffness at rest are judged if nothing bounds it, rad (of the reach).

Where a robot is stiff by preload, its springs are deflected that far: `vsacli new` writes quadratic ones with
47 times the torque of the load there, and with 500 times at 1 rad."""


def _stiffness_unit(joint: Joint) -> str:
    return units.STIFFNESS.unit(joint.type)


def _reference_travel(checked: CheckedRobot, joint: Joint) -> float:
    """Return 1 rad, or for a prismatic joint the reach of the robot, m."""
    return 1.0 if joint.is_revolute else checked.sizes.extent


def _joints_with_commanded_stiffness(
    checked: CheckedRobot,
) -> Iterator[tuple[int, Joint, UnloadedStiffnessRange]]:
    """Yield the joints with commanded stiffness, with index and attainable range."""
    for index, joint in checked.joints_with_drives:
        attainable = checked.unloaded_ranges[index]
        if attainable is not None:
            yield index, joint, attainable


def _measure_minimum_stiffness(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the minimum stiffness at rest, where stiffness is commanded, over the load of the joint.

    The load is that of the weight, at the radius of gyration since centers of mass may be on the axis, and
    that of the joint's own damping at 1 rad/s (reach/s).
    """
    for index, joint, attainable in _joints_with_commanded_stiffness(checked):
        unit, travel = _stiffness_unit(joint), _reference_travel(checked, joint)
        load = float(checked.sizes.load_bounds[index]) + joint.damping * travel
        beside = {
            "stiffness": f"{attainable.lower:.4g} {unit}",
            "load": f"{load:.3g} {units.TORQUE.unit(joint.type)}",
        }
        size = ratio_or_nan(attainable.lower * travel, load)
        yield Measured(joint_path(index, joint, "actuator", "spring"), math.nan, unit, size, beside)


def _measure_stiff_transmissions(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the stiffness at rest of single springs, over the weight at full reach, per rad."""
    for joint, measured, solved in _loaded_single_springs(checked):
        if joint.is_revolute:
            yield measured._replace(size=ratio_or_nan(float(solved.stiffness[0]), checked.sizes.scale(joint)))


def _measure_soft_transmissions(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield 1 rad, or the reach, over the deflection under the largest weight, if there is gravity."""
    for joint, measured, solved in _loaded_single_springs(checked) if any(checked.gravity) else ():
        yield measured._replace(size=ratio_or_nan(_reference_travel(checked, joint), float(solved.phi[0, 1])))


def _loaded_single_springs(checked: CheckedRobot) -> Iterator[tuple[Joint, Measured, JointVariables]]:
    """Yield joints without commanded stiffness, with the spring solved at rest and under the largest weight.

    The measured number is the stiffness or the law; callers replace its size.
    """
    for number, joint in checked.joints_with_drives:
        if joint.actuator.sprung and "stiffness" not in joint.actuator.commanded:
            command = Command.at_rest(np.array([0.0, checked.sizes.loads[number]]), np.zeros(2))
            solved = joint.actuator.transmit(command, MIN_MARGIN, None)
            constant = getattr(joint.actuator, "stiffness", None)
            path = joint_path(number, joint, "actuator", "spring" if constant is None else "stiffness")
            value = math.nan if constant is None else constant
            yield joint, Measured(path, value, _stiffness_unit(joint), math.nan), solved


def _springs_in_file(checked: CheckedRobot) -> Iterator[tuple[Joint, NumberPath, SpringLaw]]:
    """Yield the springs as written in the file, with joint and path."""
    for number, joint in checked.joints_with_drives:
        path = joint_path(number, joint, "actuator", "spring")
        for path_in_file, law in records_in_file(path, getattr(joint.actuator, "spring", None) or ()):
            yield joint, path_in_file, law


def _measure_hardening(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the stiffness at half a turn (at the reach) or at the law's end, over that at rest.

    Only springs of joints with commanded stiffness, which depends on hardening.
    """
    for joint, path, law in _springs_in_file(checked):
        if not law.is_linear and "stiffness" in joint.actuator.commanded:
            unit, full = ("rad", HALF_TURN) if joint.is_revolute else ("m", checked.sizes.extent)
            deflection = min(law.domain[1], full)
            at_rest, deflected = law.stiffness(np.array([0.0, deflection])).tolist()
            size = deflected / at_rest if at_rest else math.nan
            yield Measured(path, math.nan, "", size, {"deflection": f"{deflection:.3g} {unit}"})


def _measure_deflection_limits(checked: CheckedRobot) -> Iterator[Measured]:
    for joint, path, law in _springs_in_file(checked):
        ends = {"max_deflection": law.max_deflection, "file": law.domain[1]}
        for name, end in ends.items():
            if math.isfinite(end) and (name == "max_deflection" or law.sources):
                unit, full = ("rad", TURN) if joint.is_revolute else ("m", 2 * checked.sizes.extent)
                yield Measured((*path, name), end, unit, ratio_or_nan(end, full))


def _measure_largest_deflections(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the torque of springs at their largest deflection, over the largest of load and motors.

    Of springs without stiffness at rest, of which nothing else tells how stiff they are, it may be
    `SLACK_DEFLECTION`. Only springs of joints with commanded stiffness.
    """
    for joint, path, law in _springs_in_file(checked):
        end = min(law.max_deflection, law.domain[1] if law.sources else math.inf)
        if math.isinf(min(end, law.domain[1])) and not law.stiffness(np.zeros(1)).any():
            end = SLACK_DEFLECTION * _reference_travel(checked, joint)
        if math.isfinite(end) and "stiffness" in joint.actuator.commanded:
            torque, unit = float(law.torque(np.array([end]))[0]), units.TORQUE.unit(joint.type)
            motors = [motor.at_joint.max_torque for _, motor in motors_in_file(joint)]
            load = float(checked.sizes.load_bounds[checked.joints.index(joint)])
            asked = max(load, *(torque for torque in motors if math.isfinite(torque)), 0.0)
            beside = {
                "end": f"{end:.3g} {units.POSITION.unit(joint.type)}",
                "torque": f"{torque:.3g} {unit}",
                "asked": f"{asked:.3g} {unit}",
            }
            yield Measured(path, math.nan, _stiffness_unit(joint), ratio_or_nan(torque, asked), beside)


def _measure_stiffness_limits(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield limits over the minimum at rest; a lower limit below the attainable range does no harm."""
    for index, joint, attainable in _joints_with_commanded_stiffness(checked):
        beside = {"lower": f"{attainable.lower:.4g}", "unit": _stiffness_unit(joint)}
        for side, limit in enumerate(joint.limits.stiffness):
            ratio = ratio_or_nan(limit, attainable.lower)
            if math.isfinite(limit) and (side or limit > attainable.upper or ratio > 1):
                path = joint_path(index, joint, "limits", "stiffness", PathIndex(side))
                yield Measured(path, limit, _stiffness_unit(joint), ratio, beside)


def _least_stiffness(joint: Joint, attainable: UnloadedStiffnessRange | None) -> float:
    """Return the minimum stiffness of a joint without load, N m/rad (N/m), given its attainable range."""
    if attainable is not None:
        return attainable.lower if attainable.lower > 0 else attainable.upper
    solved = joint.actuator.transmit(Command.at_rest(np.zeros(1), np.zeros(1)), MIN_MARGIN, None)
    return float(solved.stiffness[0])


def _measure_largest_dampings(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the upper end of each damper's range, over twice the root of inertia times stiffness."""
    for number, joint in checked.joints_with_drives:
        if joint.damper is not None and joint.actuator.sprung:
            product = float(checked.sizes.moved_inertias[number]) * _least_stiffness(
                joint, checked.unloaded_ranges[number]
            )
            damping = joint.damper.range[1]
            size = damping / (2 * math.sqrt(product)) if product > 0 else math.nan
            path = joint_path(number, joint, "damper", "range", PathIndex(1))
            yield Measured(path, damping, units.DAMPING.unit(joint.type), size)


SPRING_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("deflections", "`max_deflection`, `file` of a table", _measure_deflection_limits,
        size="turns (twice the reach)", high=0.5, usual=0.05,
        reason="joint springs do not wind up so far",
        finding="is a deflection of more than half a turn (than the reach)",
        units=(DEGREES, MILLIMETERS), in_angles=True),
    Rule("springs at their largest deflection", "`spring`", _measure_largest_deflections,
        size="torque at `max_deflection`, the end of a table or, of springs without stiffness at rest, 0.3 "
        "rad (of the reach), over the largest of load and motor", high=150,
        usual=1, reason="bundled robots: 1 to 25; no motor would deflect them so far",
        finding="has {torque} at {end}, {size} times the {asked} that load or motor can ask of it",
        units=TOO_STIFF, advice="check the units of its constants and of its largest deflection",
        explained_by=(*SIZES, "deflections")),
    Rule("stiff springs", "`spring`", _measure_minimum_stiffness,
        size="stiffness at rest times 1 rad (reach), over weight times gyration, plus damping at 1 rad/s",
        high=2000, usual=20,
        reason="bundled robots have 0.06 to 700",
        finding="makes {stiffness} at rest, per rad (reach) {size} times {load} of weight and damping",
        units=TOO_STIFF, explained_by=(*SIZES, "springs at their largest deflection")),
    Rule("stiff transmissions", "`stiffness`, `spring` of elastic joints", _measure_stiff_transmissions,
        size="of revolute joints, stiffness at rest times 1 rad, over weight times reach",
        high=5000, usual=300,
        reason="light arms with strain wave gears stay below",
        finding="is {size} times the weight of the robot at its reach per rad",
        units=TOO_STIFF, advice="if it does not yield, take `type: rigid`", explained_by=SIZES),
    Rule("soft transmissions", "`stiffness`, `spring` of elastic joints", _measure_soft_transmissions,
        size="1 rad (reach) over the deflection under the stretched arm's weight",
        low=4, usual=50, reason="the arm would hang down",
        finding="yields by more than 0.25 rad (of the reach) to what the weight of the stretched arm can ask",
        units=TOO_SOFT, explained_by=SIZES),
    Rule("hardening of springs", "`spring`", _measure_hardening,
        size="stiffness at half a turn (reach), over that at rest", low=1.5,
        reason="without hardening, the stiffness cannot change",
        finding="is at {deflection} but {size} times as stiff as at rest",
        advice="check the units of its constants: rad, not deg (m, not mm)"),
    Rule("limits of stiffness", "`limits.stiffness`", _measure_stiffness_limits,
        size="over the lowest of the springs at rest", low=1, high=500, usual=2,
        reason="below 1 the limits exclude everything",
        finding="is {size} times the minimum of {lower} {unit} without load",
        units=(*TOO_SOFT, *TOO_STIFF), advice="check the units of limits and springs"),
    Rule("ranges of dampers", "`damper.range`", _measure_largest_dampings,
        size="over 2 sqrt(I sigma): inertia of the stretched arm, least stiffness",
        low=1e-3, high=100, usual=0.7,
        reason="no effect below, creeping above",
        finding="gives the stretched arm on its springs a damping ratio of {size}",
        units=SLIPS_OF_DAMPING, explained_by=SIZES,
        advice="check the units of damping, stiffness and inertia"),
)  # fmt: skip
