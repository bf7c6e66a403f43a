"""What motors and gears of a robot are held against."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from vsacli.actuators.motor import Motor
from vsacli.base.variables import VARIABLES
from vsacli.documents.fields import declared
from vsacli.documents.plausibility import Measured, Rule, Slip
from vsacli.documents.record_numbers import Entry, NumberPath
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.body_rules import FASTEST, SIZES
from vsacli.robot.plausibility.facts import Facts, joint_path, motors, ratio

TINY = 0.1
"""m"""

RPM = Slip("rpm", math.pi / 30)
DEGREES_PER_SECOND = Slip("deg/s", math.pi / 180)
GEARS = (*SIZES, "gear ratios", "gear ratios of prismatic joints")
"""Rules on what the motors' sizes behind the gear follow from, and what they are compared with."""


class Driven(NamedTuple):
    """A motor with its joint."""

    number: int
    joint: Joint
    at: NumberPath
    motor: Motor

    def measured(self, name: str, size: float) -> Measured:
        """A field of the motor with a size."""
        kind = self.joint.type if name == "gear_ratio" or self.motor.gear_ratio is None else "revolute"
        unit = declared(Motor)[name][0].quantity.unit(kind)
        path = joint_path(self.number, self.joint, *self.at, name)
        return Measured(path, getattr(self.motor, name), unit, size)


def driven_motors(facts: Facts) -> Iterator[Driven]:
    """All motors, unless they only stand in for others."""
    for number, joint in enumerate(() if facts.placeholder else facts.joints):
        for at, motor in motors(joint):
            yield Driven(number, joint, at, motor)


def carrying_motors(facts: Facts) -> Iterator[Driven]:
    """Those that move with the joint; one that only sets the springs may be as small and fast as it likes."""
    for driven in driven_motors(facts):
        last = driven.at[-1]
        if driven.joint.actuator.has(VARIABLES["phi"])[last.number if isinstance(last, Entry) else 0]:
            yield driven


def _gear_ratios(facts: Facts, *, revolute: bool) -> Iterator[Measured]:
    for driven in driven_motors(facts):
        if driven.motor.gear_ratio is not None and driven.joint.is_revolute == revolute:
            yield driven.measured("gear_ratio", abs(driven.motor.gear_ratio))


def _rotors(facts: Facts) -> Iterator[Measured]:
    for driven in carrying_motors(facts):
        size = ratio(driven.motor.at_joint.inertia, float(facts.sizes.inertias[driven.number]))
        yield driven.measured("inertia", size)


def _heavy_rotors(facts: Facts) -> Iterator[Measured]:
    """Rotors of robots that are not tiny; those of fingers outweigh them by far behind their gears."""
    for driven in carrying_motors(facts) if facts.sizes.extent > TINY else ():
        lever = facts.sizes.extent if driven.joint.is_revolute else 1.0
        size = ratio(driven.motor.at_joint.inertia, facts.sizes.mass * lever**2)
        yield driven.measured("inertia", size)


def _motor_damping(facts: Facts) -> Iterator[Measured]:
    for driven in driven_motors(facts):
        size = driven.motor.damping / driven.motor.inertia
        yield driven.measured("damping", size)


def _velocities(facts: Facts) -> Iterator[tuple[Measured, Driven]]:
    """Limits of velocity in rad/s, each with its motor and as its own size."""
    for driven in carrying_motors(facts):
        measured = driven.measured("max_velocity", driven.motor.max_velocity)
        if measured.unit == "rad/s" and math.isfinite(measured.value):
            yield measured, driven


def _joint_velocities(facts: Facts) -> Iterator[Measured]:
    """Largest velocity that the motor allows the joint, over the limit of the joint."""
    for measured, driven in _velocities(facts):
        limit = max(map(abs, driven.joint.limits.velocity))
        yield measured._replace(size=ratio(driven.motor.at_joint.max_velocity, limit))


def _output_velocities(facts: Facts) -> Iterator[Measured]:
    for measured, driven in _velocities(facts):
        if driven.joint.is_revolute:
            yield measured._replace(size=driven.motor.at_joint.max_velocity)


def _torques(facts: Facts, *, least: bool) -> Iterator[Measured]:
    """Largest torque at the joint, over what its weight can ask of it, or over the weight at full reach."""
    for driven in carrying_motors(facts):
        torque = driven.motor.at_joint.max_torque
        load = float(facts.sizes.loads[driven.number]) if least else facts.sizes.scale(driven.joint)
        if math.isfinite(torque) and (any(facts.gravity) or not least):
            yield driven.measured("max_torque", ratio(torque, load))


def _joint_damping(facts: Facts) -> Iterator[Measured]:
    for number, joint in enumerate(facts.joints):
        yield _damping(number, joint, ratio(joint.damping, facts.sizes.scale(joint)))


def _braking(facts: Facts) -> Iterator[Measured]:
    """What damping takes at the largest velocity of the joint, over the largest torque; 0 without a limit."""
    for driven in carrying_motors(facts):
        joint, motor = driven.joint, driven.motor.at_joint
        velocity = min(motor.max_velocity, max(map(abs, joint.limits.velocity)))
        if velocity < FASTEST:
            yield driven.measured("damping", motor.damping * velocity / motor.max_torque)
            torque = sum(each.max_torque for each in joint.actuator.motors)
            yield _damping(driven.number, joint, joint.damping * velocity / torque)


def _damping(number: int, joint: Joint, size: float) -> Measured:
    unit = "N m s/rad" if joint.is_revolute else "N s/m"
    return Measured(joint_path(number, joint, "damping"), joint.damping, unit, size)


MOTOR_RULES: tuple[Rule[Facts], ...] = (
    Rule(
        name="gear ratios",
        fields="`gear_ratio`",
        measure=lambda facts: _gear_ratios(facts, revolute=True),
        size="turns of the motor to one of the joint",
        low=1,
        high=5000,
        usual=100,
        finding="is {size} turns of the motor to one of the joint",
        reason="gears of joints reduce; several stages reach some thousands",
        advice="it is the motor's turns over those of the joint, e.g. 100",
    ),
    Rule(
        name="gear ratios of prismatic joints",
        fields="`gear_ratio`",
        measure=lambda facts: _gear_ratios(facts, revolute=False),
        size="rad/m",
        low=5,
        high=1e5,
        usual=600,
        finding="turns the motor by {size} rad for each metre",
        reason="a screw of 0.06 mm a turn has 100,000, a wheel of 0.4 m diameter 5",
        slips=(Slip("rad/mm", 1e3),),
        advice="of a screw it is 2*pi over the travel of a turn in m, e.g. 2*pi/0.020",
    ),
    Rule(
        name="light rotors",
        fields="`motor.inertia`",
        measure=_rotors,
        size="on the joint's side of the gear, over the inertia of the link about its joint",
        low=0.005,
        usual=1,
        finding="is, on the joint's side of the gear, {size} of the inertia of the link about its joint",
        reason="gears multiply the rotor by the square of their ratio, and direct drives have large rotors",
        advice="is it the rotor's own? Then give `gear_ratio` too, or multiply by its square",
        explained_by=GEARS,
    ),
    Rule(
        name="heavy rotors",
        fields="`motor.inertia`",
        measure=_heavy_rotors,
        size="on the joint's side of the gear, over mass times reach squared (mass) of the robot",
        high=100,
        usual=0.1,
        finding="is, on the joint's side of the gear, {size} times mass times reach squared of the robot",
        reason="such a motor would feel nothing of the robot; those shorter than 0.1 m are passed over",
        slips=(Slip("kg cm^2", 1e-4), Slip("g cm^2", 1e-7), Slip("kg mm^2", 1e-6)),
        advice="with `gear_ratio` it is that of the motor's shaft, without that on the joint's side",
        explained_by=GEARS,
    ),
    Rule(
        name="damping of motors",
        fields="`motor.damping`",
        measure=_motor_damping,
        size="1/s, over the inertia of the motor",
        high=500,
        usual=1,
        finding="stops the motor alone at a rate of {size} 1/s",
        reason="a motor that is let go runs on for more than 2 ms",
        slips=(Slip("N mm s/rad", 1e-3), Slip("N m s/krpm", 0.03 / math.pi)),
        advice="check the units of damping and inertia",
    ),
    Rule(
        name="velocities of motors",
        fields="`max_velocity`",
        measure=lambda facts: (measured for measured, _ in _velocities(facts)),
        size="rad/s, as written",
        high=2500,
        usual=400,
        finding="is more than 24,000 turns a minute",
        reason="robots have no faster motors",
        slips=(RPM, DEGREES_PER_SECOND),
        in_angles=True,
    ),
    Rule(
        name="velocities of motors behind the gear",
        fields="`max_velocity`",
        measure=_output_velocities,
        size="rad/s, on the joint's side of the gear",
        high=FASTEST,
        usual=4,
        finding="is, on the joint's side of the gear, {size} rad/s",
        reason="limbs do not turn so fast",
        slips=(RPM, DEGREES_PER_SECOND),
        advice="with `gear_ratio` it would be that of the motor's shaft",
        explained_by=(*GEARS, "velocities of motors"),
    ),
    Rule(
        name="velocities of motors and joints",
        fields="`max_velocity`, `limits.velocity`",
        measure=_joint_velocities,
        size="on the joint's side of the gear, over the limit of the joint",
        high=8,
        usual=1,
        finding="lets the joint go {size} times as fast as its `limits.velocity`",
        reason="the limit of a joint is about what its motor can do",
        slips=(RPM, DEGREES_PER_SECOND),
        advice="check the units of both",
        in_angles=True,
        explained_by=(*GEARS, "velocities of motors", "velocities of motors behind the gear"),
    ),
    Rule(
        name="weak motors",
        fields="`max_torque`",
        measure=lambda facts: _torques(facts, least=True),
        size="on the joint's side of the gear, over what the weight of the stretched arm can ask",
        low=0.05,
        usual=2,
        finding="is, on the joint's side of the gear, {size} of what the weight of the stretched arm can ask",
        reason="such a motor could accelerate the arm by a twentieth of gravity",
        advice="is it the motor's own? Then give `gear_ratio` too, or multiply by it",
        explained_by=GEARS,
    ),
    Rule(
        name="strong motors",
        fields="`max_torque`",
        measure=lambda facts: _torques(facts, least=False),
        size="on the joint's side of the gear, over the weight of the robot at its reach",
        high=300,
        usual=0.5,
        finding="is, on the joint's side of the gear, {size} times the weight of the robot at its reach",
        reason="it would lift 300 such robots",
        slips=(Slip("N mm", 1e-3), Slip("N cm", 1e-2), Slip("mN m", 1e-3)),
        advice="with `gear_ratio` it is that of the motor's shaft, without that on the joint's side",
        explained_by=GEARS,
    ),
    Rule(
        name="damping beside torque",
        fields="`damping`, `motor.damping`",
        measure=_braking,
        size="torque that it takes at the largest velocity, over the largest torque of the motors",
        high=1,
        usual=0.05,
        finding="takes, at the largest velocity of the joint, {size} times the largest torque of its motors",
        reason="the joint could not go as fast as its limits say",
        slips=(Slip("N mm s/rad", 1e-3, instead_of="N m s/rad"),),
        explained_by=(*GEARS, "velocities of motors", "velocities of motors and joints", "weak motors"),
    ),
    Rule(
        name="damping of joints",
        fields="`damping`",
        measure=_joint_damping,
        size="torque at 1 rad/s (force at 1 m/s) over the weight of the robot at its reach",
        high=500,
        usual=1e-3,
        finding="brakes, at 1 rad/s or 1 m/s, with {size} times the weight of the robot at its reach",
        reason="the robot could hardly move; placeholders in descriptions of real robots come to 50",
        slips=(Slip("N mm s/rad", 1e-3),),
        explained_by=(*SIZES, "damping beside torque"),
    ),
)
