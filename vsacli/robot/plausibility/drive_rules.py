"""What motors, gears and springs of a robot are held against."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws import SpringLaw
from vsacli.actuators.motor import Motor
from vsacli.documents.plausibility import Entry, Measured, NumberPath, Rule, Slip
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.body_rules import DEGREES, SIZES, TURN
from vsacli.robot.plausibility.facts import Facts, joint_path, motors, ratio, written_once

HALF_TURN = math.pi
RPM = Slip("rpm", math.pi / 30)
DEGREES_PER_SECOND = Slip("deg/s", math.pi / 180)
TOO_SOFT = (
    Slip("N m/deg", 180 / math.pi, instead_of="N m/rad"),
    Slip("kN m/rad", 1e3, instead_of="N m/rad"),
    Slip("N/mm", 1e3, instead_of="N/m"),
)
TOO_STIFF = (
    Slip("N mm/rad", 1e-3, instead_of="N m/rad"),
    Slip("N mm/deg", 0.18 / math.pi, instead_of="N m/rad"),
)
"""Units in which a stiffness is a smaller, or a larger number than in the expected one."""

GEARS = (*SIZES, "gear ratios", "gear ratios of prismatic joints")
"""Rules on what the motors' sizes behind the gear follow from, and what they are compared with."""


class _Driven(NamedTuple):
    """A motor with its joint."""

    number: int
    joint: Joint
    at: NumberPath
    motor: Motor

    def measured(self, name: str, unit: str, size: float) -> Measured:
        """A field of the motor with a size."""
        return Measured(
            joint_path(self.number, self.joint, *self.at, name), getattr(self.motor, name), unit, size
        )

    @property
    def rotary(self) -> bool:
        """Whether its numbers are those of rotation."""
        return self.joint.is_revolute or self.motor.gear_ratio is not None


def _motors(facts: Facts) -> Iterator[_Driven]:
    """All motors, unless they only stand in for others."""
    for index, joint in enumerate(() if facts.placeholder else facts.joints):
        for at, motor in motors(joint):
            yield _Driven(index, joint, at, motor)


def _gear_ratios(facts: Facts, *, revolute: bool) -> Iterator[Measured]:
    for driven in _motors(facts):
        if driven.motor.gear_ratio is not None and driven.joint.is_revolute == revolute:
            yield driven.measured("gear_ratio", "1" if revolute else "rad/m", abs(driven.motor.gear_ratio))


def _rotors(facts: Facts) -> Iterator[Measured]:
    for driven in _motors(facts):
        size = ratio(driven.motor.at_joint.inertia, float(facts.sizes.inertias[driven.number]))
        yield driven.measured("inertia", "kg m^2" if driven.rotary else "kg", size)


def _heavy_rotors(facts: Facts) -> Iterator[Measured]:
    for driven in _motors(facts):
        lever = facts.sizes.extent if driven.joint.is_revolute else 1.0
        size = ratio(driven.motor.at_joint.inertia, facts.sizes.mass * lever**2)
        yield driven.measured("inertia", "kg m^2" if driven.rotary else "kg", size)


def _motor_damping(facts: Facts) -> Iterator[Measured]:
    for driven in _motors(facts):
        size = driven.motor.damping / driven.motor.inertia
        yield driven.measured("damping", "N m s/rad" if driven.rotary else "N s/m", size)


def _shaft_velocities(facts: Facts) -> Iterator[Measured]:
    for driven in _motors(facts):
        if driven.rotary and math.isfinite(driven.motor.max_velocity):
            yield driven.measured("max_velocity", "rad/s", driven.motor.max_velocity)


def _joint_velocities(facts: Facts) -> Iterator[Measured]:
    """Largest velocity that the motor allows the joint, over the limit of the joint."""
    for driven in _motors(facts):
        velocity = driven.motor.at_joint.max_velocity
        limit = max(map(abs, driven.joint.limits.velocity))
        if driven.rotary and math.isfinite(velocity):
            size = velocity / limit if math.isfinite(limit) else math.nan
            yield driven.measured("max_velocity", "rad/s", size)


def _output_velocities(facts: Facts) -> Iterator[Measured]:
    for driven in _motors(facts):
        if driven.joint.is_revolute and math.isfinite(driven.motor.max_velocity):
            yield driven.measured("max_velocity", "rad/s", driven.motor.at_joint.max_velocity)


def _torques(facts: Facts, *, least: bool) -> Iterator[Measured]:
    """Largest torque at the joint, over what its weight can ask of it, or over the weight at full reach."""
    for driven in _motors(facts):
        torque = driven.motor.at_joint.max_torque
        load = float(facts.sizes.loads[driven.number]) if least else facts.sizes.scale(driven.joint)
        if math.isfinite(torque) and (any(facts.gravity) or not least):
            yield driven.measured("max_torque", "N m" if driven.rotary else "N", ratio(torque, load))


def _joint_damping(facts: Facts) -> Iterator[Measured]:
    for index, joint in enumerate(facts.joints):
        unit = "N m s/rad" if joint.is_revolute else "N s/m"
        size = ratio(joint.damping, facts.sizes.scale(joint))
        yield Measured(joint_path(index, joint, "damping"), joint.damping, unit, size)


class Corridor(NamedTuple):
    """The stiffness that a joint can have while it carries nothing, N m/rad (N/m)."""

    lower: float
    upper: float


def corridor(joint: Joint) -> Corridor | None:
    """That of a joint; None if its stiffness cannot be commanded."""
    if "stiffness" not in joint.actuator.commanded:
        return None
    solution = joint.actuator.solve(np.zeros(1), np.ones(1))
    return Corridor(float(solution.lower[0]), float(solution.upper[0]))


def _soft_ends(facts: Facts) -> Iterator[Measured]:
    """The stiffness of pairs of springs at rest, over the weight at full reach, per rad or per reach."""
    for index, joint in enumerate(() if facts.placeholder else facts.joints):
        found = corridor(joint)
        if found is not None:
            size = ratio(found.lower * _travel(facts, joint), facts.sizes.scale(joint))
            unit = "N m/rad" if joint.is_revolute else "N/m"
            beside = {"stiffness": f"{found.lower:.4g} {unit}"}
            yield Measured(joint_path(index, joint, "actuator", "spring"), math.nan, unit, size, beside)


def _travel(facts: Facts, joint: Joint) -> float:
    """A radian, or for a prismatic joint the reach of the robot, m."""
    return 1.0 if joint.is_revolute else facts.sizes.extent


def _constant_springs(facts: Facts, *, stiff: bool) -> Iterator[Measured]:
    for index, joint in enumerate(() if facts.placeholder else facts.joints):
        stiffness = getattr(joint.actuator, "stiffness", None)
        if stiffness is not None:
            travel = _travel(facts, joint)
            load = facts.sizes.scale(joint) if stiff else float(facts.sizes.loads[index])
            size = ratio(stiffness * travel, load)
            unit = "N m/rad" if joint.is_revolute else "N/m"
            yield Measured(joint_path(index, joint, "actuator", "stiffness"), stiffness, unit, size)


def _springs(facts: Facts) -> Iterator[tuple[Joint, NumberPath, SpringLaw]]:
    """The springs with their joints, as they are written."""
    for number, joint in enumerate(() if facts.placeholder else facts.joints):
        path = joint_path(number, joint, "actuator", "spring")
        for at, law in written_once(path, getattr(joint.actuator, "spring", ())):
            yield joint, at, law


def _hardening(facts: Facts) -> Iterator[Measured]:
    for joint, path, law in _springs(facts):
        if not law.is_linear:
            far = min(law.domain[1], HALF_TURN if joint.is_revolute else facts.sizes.extent)
            rest, there = law.stiffness(np.array([0.0, far])).tolist()
            size = there / rest if rest else math.nan
            yield Measured(
                path, math.nan, "", size, {"far": f"{far:.3g} {'rad' if joint.is_revolute else 'm'}"}
            )


def _deflections(facts: Facts) -> Iterator[Measured]:
    for joint, path, law in _springs(facts):
        ends = {"max_deflection": law.max_deflection, "file": law.domain[1]}
        for name, end in ends.items():
            if math.isfinite(end) and (name == "max_deflection" or law.sources):
                unit, full = ("rad", TURN) if joint.is_revolute else ("m", 2 * facts.sizes.extent)
                yield Measured((*path, name), end, unit, ratio(end, full))


def _stiffness_limits(facts: Facts) -> Iterator[Measured]:
    for index, joint in enumerate(() if facts.placeholder else facts.joints):
        found = corridor(joint)
        for side, limit in enumerate(joint.limits.stiffness if found else ()):
            if found and math.isfinite(limit):
                path = joint_path(index, joint, "limits", "stiffness", Entry(side))
                unit = "N m/rad" if joint.is_revolute else "N/m"
                beside = {"lower": f"{found.lower:.4g}", "unit": unit}
                size = ratio(limit, found.lower) if side else _lowest_size(limit, found)
                yield Measured(path, limit, unit, size, beside)


def _lowest_size(limit: float, found: Corridor) -> float:
    """The lower limit over the lower end of the corridor; NaN if it is below that end, which does no harm."""
    size = ratio(limit, found.lower)
    return size if limit > found.upper or size > 1 else math.nan


DRIVE_RULES: tuple[Rule[Facts], ...] = (
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
        reason="such a motor would feel nothing of the robot",
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
        measure=_shaft_velocities,
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
        high=60,
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
        name="damping of joints",
        fields="`damping`",
        measure=_joint_damping,
        size="torque at 1 rad/s (force at 1 m/s) over the weight of the robot at its reach",
        high=500,
        usual=1e-3,
        finding="brakes, at 1 rad/s or 1 m/s, with {size} times the weight of the robot at its reach",
        reason="the robot could hardly move; placeholders in descriptions of real robots come to 50",
        slips=(Slip("N mm s/rad", 1e-3),),
        explained_by=SIZES,
    ),
    Rule(
        name="stiff springs",
        fields="`spring`",
        measure=_soft_ends,
        size="stiffness of the pair at rest, times 1 rad (the reach), over the robot's weight at its reach",
        high=1000,
        usual=4,
        finding="makes {stiffness} at rest, {size} times the robot's weight at its reach per rad (per reach)",
        reason="such a pair yields by a thousandth under the whole weight; shipped robots have 0.03 to 100",
        slips=TOO_STIFF,
        explained_by=SIZES,
    ),
    Rule(
        name="stiff transmissions",
        fields="`stiffness`",
        measure=lambda facts: _constant_springs(facts, stiff=True),
        size="times 1 rad or the reach, over the weight of the robot at its reach",
        high=1e5,
        usual=300,
        finding="is {size} times the weight of the robot at its reach per rad (per reach)",
        reason="stiffer than strain wave gears on light arms",
        slips=TOO_STIFF,
        advice="if it does not yield, take `type: rigid`",
        explained_by=SIZES,
    ),
    Rule(
        name="soft transmissions",
        fields="`stiffness`",
        measure=lambda facts: _constant_springs(facts, stiff=False),
        size="times 1 rad or the reach, over what the weight of the stretched arm can ask",
        low=4,
        usual=50,
        finding="yields by more than 0.25 rad (of the reach) to what the weight of the stretched arm can ask",
        reason="the arm would hang down",
        slips=TOO_SOFT,
        explained_by=SIZES,
    ),
    Rule(
        name="hardening of springs",
        fields="`spring`",
        measure=_hardening,
        size="stiffness at a deflection of half a turn (of the reach), over that at rest",
        low=1.5,
        finding="is at {far} but {size} times as stiff as at rest",
        reason="a pair that hardly hardens cannot change its stiffness",
        advice="check the units of its constants: rad, not deg (m, not mm)",
    ),
    Rule(
        name="deflections",
        fields="`max_deflection`, `file` of a table",
        measure=_deflections,
        size="turns (twice the reach)",
        high=0.5,
        usual=0.05,
        finding="is a deflection of more than half a turn (than the reach)",
        reason="springs in joints do not wind up so far",
        slips=(DEGREES, Slip("mm", 1e-3)),
        in_angles=True,
    ),
    Rule(
        name="limits of stiffness",
        fields="`limits.stiffness`",
        measure=_stiffness_limits,
        size="over the lowest that the springs give at rest",
        low=1,
        high=1000,
        usual=2,
        finding="is {size} times the lowest that the springs give, {lower} {unit}",
        reason="below 1 nothing is within the limits, and springs do not become a thousand times as stiff",
        slips=(*TOO_SOFT, *TOO_STIFF),
        advice="check the units of limits and springs",
    ),
)
