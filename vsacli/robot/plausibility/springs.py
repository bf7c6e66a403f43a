"""Plausibility rules of springs and dampers of a robot, and of the stiffness that springs give its joints."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vsacli.actuators.laws import SpringLaw
from vsacli.actuators.reach import OfJoint
from vsacli.actuators.transmission import Command
from vsacli.base import units
from vsacli.base.flags import MIN_MARGIN
from vsacli.documents.plausibility import Measured, OtherUnit, Rule
from vsacli.documents.record_values import NumberPath, PathIndex
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.bodies import DEGREES, MILLIMETERS, SIZES, TURN
from vsacli.robot.plausibility.checked_robot import CheckedRobot, Corridor, joint_path, ratio, written_once

HALF_TURN = math.pi
TOO_SOFT = (
    OtherUnit("N m/deg", 180 / math.pi, instead_of="N m/rad"),
    OtherUnit("kN m/rad", 1e3, instead_of="N m/rad"),
    OtherUnit("N/mm", 1e3, instead_of="N/m"),
)
NEWTON_MILLIMETERS = OtherUnit("N mm/rad", 1e-3, instead_of="N m/rad")
TOO_STIFF = (NEWTON_MILLIMETERS, OtherUnit("N mm/deg", 0.18 / math.pi, instead_of="N m/rad"))
"""Units in which a stiffness is a smaller number (`TOO_SOFT`) or a larger one than in the expected unit."""

SLIPS_OF_DAMPING = (
    OtherUnit("N mm s/rad", 1e-3, instead_of="N m s/rad"),
    OtherUnit("N m s/deg", 180 / math.pi, instead_of="N m s/rad"),
    OtherUnit("N s/mm", 1e3, instead_of="N s/m"),
)


def _unit(joint: Joint) -> str:
    return units.STIFFNESS.unit(joint.type)


def _travel(checked: CheckedRobot, joint: Joint) -> float:
    """Return 1 rad, or for a prismatic joint the reach of the robot, m."""
    return 1.0 if joint.is_revolute else checked.sizes.extent


def _corridors(checked: CheckedRobot) -> Iterator[tuple[int, Joint, Corridor]]:
    """Yield the joints with commanded stiffness, with index and attainable range."""
    for index, joint in checked.driven:
        found = checked.corridors[index]
        if found is not None:
            yield index, joint, found


def _soft_ends(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the minimum stiffness at rest, where stiffness is commanded, over the weight at full reach."""
    for index, joint, found in _corridors(checked):
        size = ratio(found.lower * _travel(checked, joint), checked.sizes.scale(joint))
        beside = {"stiffness": f"{found.lower:.4g} {_unit(joint)}"}
        yield Measured(joint_path(index, joint, "actuator", "spring"), math.nan, _unit(joint), size, beside)


def _stiff_transmissions(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the stiffness at rest of single springs, over the weight at full reach, per rad."""
    for joint, measured, held in _single_springs(checked):
        if joint.is_revolute:
            yield measured._replace(size=ratio(float(held["stiffness"][0]), checked.sizes.scale(joint)))


def _soft_transmissions(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield 1 rad, or the reach, over the deflection under the largest weight, if there is gravity."""
    for joint, measured, held in _single_springs(checked) if any(checked.gravity) else ():
        yield measured._replace(size=ratio(_travel(checked, joint), float(held["phi"][0, 1])))


def _single_springs(checked: CheckedRobot) -> Iterator[tuple[Joint, Measured, OfJoint]]:
    """Yield joints without commanded stiffness, with the spring solved at rest and under the largest weight.

    The measured number is the stiffness or the law; callers replace its size.
    """
    for number, joint in checked.driven:
        if joint.actuator.sprung and "stiffness" not in joint.actuator.commanded:
            command = Command.at_rest(np.array([0.0, checked.sizes.loads[number]]), np.zeros(2))
            held = joint.actuator.transmit(command, MIN_MARGIN, None)
            constant = getattr(joint.actuator, "stiffness", None)
            path = joint_path(number, joint, "actuator", "spring" if constant is None else "stiffness")
            value = math.nan if constant is None else constant
            yield joint, Measured(path, value, _unit(joint), math.nan), held


def _springs(checked: CheckedRobot) -> Iterator[tuple[Joint, NumberPath, SpringLaw]]:
    """Yield the springs as written in the file, with joint and path."""
    for number, joint in checked.driven:
        path = joint_path(number, joint, "actuator", "spring")
        for at, law in written_once(path, getattr(joint.actuator, "spring", None) or ()):
            yield joint, at, law


def _hardening(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the stiffness at half a turn (at the reach) or at the law's end, over that at rest.

    Only springs of joints with commanded stiffness, which depends on hardening.
    """
    for joint, path, law in _springs(checked):
        if not law.is_linear and "stiffness" in joint.actuator.commanded:
            unit, full = ("rad", HALF_TURN) if joint.is_revolute else ("m", checked.sizes.extent)
            deflection = min(law.domain[1], full)
            rest, there = law.stiffness(np.array([0.0, deflection])).tolist()
            size = there / rest if rest else math.nan
            yield Measured(path, math.nan, "", size, {"deflection": f"{deflection:.3g} {unit}"})


def _deflections(checked: CheckedRobot) -> Iterator[Measured]:
    for joint, path, law in _springs(checked):
        ends = {"max_deflection": law.max_deflection, "file": law.domain[1]}
        for name, end in ends.items():
            if math.isfinite(end) and (name == "max_deflection" or law.sources):
                unit, full = ("rad", TURN) if joint.is_revolute else ("m", 2 * checked.sizes.extent)
                yield Measured((*path, name), end, unit, ratio(end, full))


def _stiffness_limits(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield limits over the minimum at rest; a lower limit below the attainable range does no harm."""
    for index, joint, found in _corridors(checked):
        beside = {"lower": f"{found.lower:.4g}", "unit": _unit(joint)}
        for side, limit in enumerate(joint.limits.stiffness):
            size = ratio(limit, found.lower)
            if math.isfinite(limit) and (side or limit > found.upper or size > 1):
                path = joint_path(index, joint, "limits", "stiffness", PathIndex(side))
                yield Measured(path, limit, _unit(joint), size, beside)


def _least_stiffness(joint: Joint, found: Corridor | None) -> float:
    """Return the minimum stiffness of a joint without load, N m/rad (N/m), given its attainable range."""
    if found is not None:
        return found.lower if found.lower > 0 else found.upper
    held = joint.actuator.transmit(Command.at_rest(np.zeros(1), np.zeros(1)), MIN_MARGIN, None)
    return float(held["stiffness"][0])


def _largest_dampings(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the upper end of each damper's range, over twice the root of inertia times stiffness."""
    for number, joint in checked.driven:
        if joint.damper is not None and joint.actuator.sprung:
            product = float(checked.sizes.moved[number]) * _least_stiffness(joint, checked.corridors[number])
            damping = joint.damper.range[1]
            size = damping / (2 * math.sqrt(product)) if product > 0 else math.nan
            path = joint_path(number, joint, "damper", "range", PathIndex(1))
            yield Measured(path, damping, units.DAMPING.unit(joint.type), size)


SPRING_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("stiff springs", "`spring`", _soft_ends,
        size="stiffness at rest times 1 rad (reach), over weight times reach",
        high=1000, usual=4,
        reason="bundled robots have 0.03 to 100",
        finding="makes {stiffness} at rest, {size} times the robot's weight at its reach per rad (per reach)",
        units=TOO_STIFF, explained_by=SIZES),
    Rule("stiff transmissions", "`stiffness`, `spring` of elastic joints", _stiff_transmissions,
        size="of revolute joints, stiffness at rest times 1 rad, over weight times reach",
        high=5000, usual=300,
        reason="light arms with strain wave gears stay below",
        finding="is {size} times the weight of the robot at its reach per rad",
        units=TOO_STIFF, advice="if it does not yield, take `type: rigid`", explained_by=SIZES),
    Rule("soft transmissions", "`stiffness`, `spring` of elastic joints", _soft_transmissions,
        size="1 rad (reach) over the deflection under the stretched arm's weight",
        low=4, usual=50, reason="the arm would hang down",
        finding="yields by more than 0.25 rad (of the reach) to what the weight of the stretched arm can ask",
        units=TOO_SOFT, explained_by=SIZES),
    Rule("hardening of springs", "`spring`", _hardening,
        size="stiffness at half a turn (reach), over that at rest", low=1.5,
        reason="without hardening, the stiffness cannot change",
        finding="is at {deflection} but {size} times as stiff as at rest",
        advice="check the units of its constants: rad, not deg (m, not mm)"),
    Rule("deflections", "`max_deflection`, `file` of a table", _deflections,
        size="turns (twice the reach)", high=0.5, usual=0.05,
        reason="joint springs do not wind up so far",
        finding="is a deflection of more than half a turn (than the reach)",
        units=(DEGREES, MILLIMETERS), in_angles=True),
    Rule("limits of stiffness", "`limits.stiffness`", _stiffness_limits,
        size="over the lowest of the springs at rest", low=1, high=500, usual=2,
        reason="below 1 the limits exclude everything",
        finding="is {size} times the minimum of {lower} {unit} without load",
        units=(*TOO_SOFT, *TOO_STIFF), advice="check the units of limits and springs"),
    Rule("ranges of dampers", "`damper.range`", _largest_dampings,
        size="over 2 sqrt(I sigma): inertia of the stretched arm, least stiffness",
        low=1e-3, high=100, usual=0.7,
        reason="no effect below, creeping above",
        finding="gives the stretched arm on its springs a damping ratio of {size}",
        units=SLIPS_OF_DAMPING, explained_by=SIZES,
        advice="check the units of damping, stiffness and inertia"),
)  # fmt: skip
