"""What dry friction and the windings of motors are held against."""

from __future__ import annotations

import math
from collections.abc import Iterator

from vsacli.actuators.friction import Friction
from vsacli.documents.plausibility import Measured, Rule, Slip
from vsacli.documents.record_numbers import Entry, NumberPath
from vsacli.robot.plausibility.body_rules import SIZES
from vsacli.robot.plausibility.facts import Facts, joint_path, ratio
from vsacli.robot.plausibility.motor_rules import DEGREES_PER_SECOND, GEARS, RPM, driven_motors

OTHER_TORQUES = (Slip("N mm", 1e-3), Slip("N cm", 1e-2), Slip("mN m", 1e-3))


def _coulomb(friction: Friction, path: NumberPath) -> Iterator[tuple[NumberPath, float]]:
    """The sizes as they are written, once if they are one."""
    backward, forward = friction.coulomb
    if backward == forward:
        yield path, forward
    else:
        yield from (((*path, Entry(side)), size) for side, size in enumerate((backward, forward)))


def _of_motors(facts: Facts) -> Iterator[Measured]:
    """Coulomb friction of motors over their largest torque."""
    for driven in driven_motors(facts):
        friction, torque = driven.motor.friction, driven.motor.max_torque
        if friction is not None and math.isfinite(torque):
            path = joint_path(driven.number, driven.joint, *driven.at, "friction", "coulomb")
            for each, size in _coulomb(friction, path):
                yield Measured(each, size, driven.measured("max_torque", 0).unit, size / torque)


def _beside_weight(facts: Facts) -> Iterator[Measured]:
    """Coulomb friction of motors and joints, joint side, over the weight of the robot at its reach."""
    for driven in driven_motors(facts):
        friction, geared = driven.motor.friction, abs(driven.motor.gear_ratio or 1.0)
        if friction is not None:
            path = joint_path(driven.number, driven.joint, *driven.at, "friction", "coulomb")
            unit, scale = driven.measured("max_torque", 0).unit, facts.sizes.scale(driven.joint)
            for each, size in _coulomb(friction, path):
                yield Measured(each, size, unit, ratio(size * geared, scale))
    for number, joint in enumerate(facts.joints):
        if joint.friction is not None:
            path = joint_path(number, joint, "friction", "coulomb")
            unit = "N m" if joint.is_revolute else "N"
            for each, size in _coulomb(joint.friction, path):
                yield Measured(each, size, unit, ratio(size, facts.sizes.scale(joint)))


def _widths(facts: Facts) -> Iterator[Measured]:
    """Widths of friction at revolute joints, joint side."""
    for driven in driven_motors(facts):
        friction, geared = driven.motor.friction, abs(driven.motor.gear_ratio or 1.0)
        if friction is not None and driven.joint.is_revolute:
            path = joint_path(driven.number, driven.joint, *driven.at, "friction", "width")
            yield Measured(path, friction.width, "rad/s", friction.width / geared)
    for number, joint in enumerate(facts.joints):
        if joint.friction is not None and joint.is_revolute:
            path = joint_path(number, joint, "friction", "width")
            yield Measured(path, joint.friction.width, "rad/s", joint.friction.width)


def _torque_constants(facts: Facts) -> Iterator[Measured]:
    for driven in driven_motors(facts):
        constant = driven.motor.torque_constant
        if constant is not None:
            yield driven.measured("torque_constant", constant)


def _resistances(facts: Facts) -> Iterator[Measured]:
    for driven in driven_motors(facts):
        if driven.motor.resistance:
            yield driven.measured("resistance", driven.motor.resistance)


def _speed_voltages(facts: Facts) -> Iterator[Measured]:
    """Voltage that the largest velocity of a motor makes, over its largest voltage."""
    for driven in driven_motors(facts):
        motor = driven.motor
        constant, bound, velocity = motor.torque_constant, motor.max_voltage, motor.max_velocity
        if constant is not None and bound is not None and math.isfinite(bound) and math.isfinite(velocity):
            yield driven.measured("torque_constant", constant * velocity / bound)


DRIVE_RULES: tuple[Rule[Facts], ...] = (
    Rule(
        name="dry friction beside torque",
        fields="`motor.friction.coulomb`",
        measure=_of_motors,
        size="over the largest torque of the motor",
        high=1,
        usual=0.1,
        finding="is {size} times the largest torque of the motor",
        reason="such a motor could not move at all",
        slips=OTHER_TORQUES,
        explained_by=GEARS,
    ),
    Rule(
        name="dry friction beside weight",
        fields="`friction.coulomb`, `motor.friction.coulomb`",
        measure=_beside_weight,
        size="on the joint's side of the gear, over the weight of the robot at its reach",
        high=100,
        usual=0.05,
        finding="is, on the joint's side of the gear, {size} times the weight of the robot at its reach",
        reason="a hundred such robots would hang on the joint without moving it",
        slips=OTHER_TORQUES,
        advice="with `gear_ratio` it is that of the motor's shaft, without that on the joint's side",
        explained_by=(*SIZES, *GEARS, "dry friction beside torque"),
    ),
    Rule(
        name="widths of friction",
        fields="`friction.width`, `motor.friction.width` of revolute joints",
        measure=_widths,
        size="rad/s, on the joint's side of the gear",
        high=3,
        usual=0.05,
        finding="smooths friction over {size} rad/s on the joint's side of the gear",
        reason="that is as fast as joints go, so that it would be viscous friction",
        slips=(DEGREES_PER_SECOND, RPM),
        explained_by=GEARS,
    ),
    Rule(
        name="torque constants",
        fields="`torque_constant`",
        measure=_torque_constants,
        size="N m/A",
        low=1e-4,
        high=30,
        usual=0.1,
        finding="is that of no motor",
        reason="the smallest motors have 0.0003 N m/A, direct drives as wide as a door a few",
        slips=(Slip("mN m/A", 1e-3), Slip("N cm/A", 1e-2)),
        advice="from volts per 1000 turns a minute it is 0.00955 N m/A for each of them",
    ),
    Rule(
        name="resistances of windings",
        fields="`resistance`",
        measure=_resistances,
        size="ohm",
        low=1e-3,
        high=1000,
        usual=1,
        finding="is that of no winding of a robot's motor",
        reason="large motors have some milliohm, those of watches hundreds of ohm",
        slips=(Slip("mohm", 1e-3),),
    ),
    Rule(
        name="voltages at the largest velocity",
        fields="`torque_constant`, `max_velocity`, `max_voltage`",
        measure=_speed_voltages,
        size="that the velocity makes, over the largest voltage",
        high=5,
        usual=0.8,
        finding="makes {size} times the largest voltage at the motor's largest velocity",
        reason="the motor could not go a fifth as fast as its limit says",
        slips=(Slip("mN m/A", 1e-3),),
        explained_by=("velocities of motors", "torque constants"),
    ),
)
