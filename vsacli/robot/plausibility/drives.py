"""Plausibility rules of motors, gears, windings, viscous damping and dry friction of a robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from vsacli.actuators.friction import Friction
from vsacli.actuators.motor import SHAFT, JointMotor, Motor
from vsacli.base import units
from vsacli.base.variables import VARIABLES
from vsacli.documents.fields import declared
from vsacli.documents.plausibility import Measured, OtherUnit, Rule
from vsacli.documents.record_values import Entry, NumberPath
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.bodies import DEGREES_PER_SECOND, FASTEST, RPM, SIZES, Measure
from vsacli.robot.plausibility.checked_robot import CheckedRobot, joint_path, motors, ratio

TINY = 0.1
"""Length, m; in shorter robots, such as fingers, rotors behind gears far outweigh the links."""

DAMPING_IN_MILLIMETERS = OtherUnit("N mm s/rad", 1e-3)
ROTARY = (RPM._replace(instead_of="rad/s"), DEGREES_PER_SECOND._replace(instead_of="rad/s"))
OTHER_TORQUES = (OtherUnit("N mm", 1e-3), OtherUnit("N cm", 1e-2), OtherUnit("mN m", 1e-3))
WHICH_SIDE = "with `side: shaft` it is that of the motor's shaft, otherwise that on the joint's side"
GEARS = (*SIZES, "gear ratios", "gear ratios of prismatic joints")
"""Names of rules, of gear ratios and sizes, whose findings explain those of motors behind a gear."""


class _Driven(NamedTuple):
    """A motor with its joint; `torque` and `velocity` are NaN without a bound, `load` without gravity."""

    checked: CheckedRobot
    number: int
    joint: Joint
    at: NumberPath
    motor: Motor

    @property
    def behind(self) -> JointMotor:
        """Motor on the joint side of the gear."""
        return self.motor.at_joint

    @property
    def carries(self) -> bool:
        """Whether the motor carries the load; one that only sets the springs may be small and fast."""
        last = self.at[-1]
        return bool(self.joint.actuator.has(VARIABLES["phi"])[last.number if isinstance(last, Entry) else 0])

    @property
    def torque(self) -> float:
        """Largest torque on the joint side of the gear, N m (N)."""
        return _bounded(self.behind.max_torque)

    @property
    def link_inertia(self) -> float:
        """Inertia of the link alone about its joint, kg m^2 (kg)."""
        return float(self.checked.sizes.inertias[self.number])

    @property
    def scale(self) -> float:
        """Weight of the robot at its reach, N m (N)."""
        return self.checked.sizes.scale(self.joint)

    @property
    def load(self) -> float:
        """Largest torque of the weight of the stretched arm at the joint, N m (N)."""
        return float(self.checked.sizes.loads[self.number]) if any(self.checked.gravity) else math.nan

    @property
    def velocity(self) -> float:
        """Largest velocity on the joint side of the gear, rad/s (m/s)."""
        return _bounded(self.behind.max_velocity)

    @property
    def rotates(self) -> bool:
        """Whether the motor is known to turn; it may be a linear one at a prismatic joint without a gear."""
        return self.joint.is_revolute or self.motor.gear_ratio is not None

    def unit(self, name: str) -> str:
        """Return the unit of a field; a shaft is rotational at any joint."""
        variant = "revolute" if self.motor.side == SHAFT else None
        return declared(Motor)[name][0].quantity.inside(variant).unit(self.joint.type)

    def path(self, name: str) -> NumberPath:
        """Return the path of a field."""
        return joint_path(self.number, self.joint, *self.at, name)

    def measured(self, name: str, size: float) -> Measured:
        """Return the measured value of a field, with a size."""
        return Measured(self.path(name), getattr(self.motor, name), self.unit(name), size)


def _bounded(value: float) -> float:
    return value if math.isfinite(value) else math.nan


def _all_motors(checked: CheckedRobot) -> Iterator[_Driven]:
    for number, joint in checked.driven:
        for at, motor in motors(joint):
            yield _Driven(checked, number, joint, at, motor)


def _motors(
    name: str, size: Callable[[_Driven], float] | None = None, *, unit: str = "", carrying: bool = False
) -> Measure:
    """Return the measure of a field of the motors.

    Args:
        name: name of the field.
        size: function that returns the size of a motor; by default |value|, NaN if 0 or infinite.
        unit: unit of the field; motors with another one are skipped. "" for any unit.
        carrying: whether to skip motors that do not carry the load.
    """

    def measure(checked: CheckedRobot) -> Iterator[Measured]:
        for driven in _all_motors(checked):
            if unit in ("", driven.unit(name)) and (driven.carries or not carrying):
                value = getattr(driven.motor, name) or math.nan
                yield driven.measured(name, _bounded(abs(value)) if size is None else size(driven))

    return measure


def _heavy_rotor(driven: _Driven) -> float:
    sizes = driven.checked.sizes
    lever = sizes.extent if driven.joint.is_revolute else 1.0
    return ratio(driven.behind.inertia, sizes.mass * lever**2) if sizes.extent > TINY else math.nan


def _shaft_velocity(driven: _Driven) -> float:
    """Return the largest velocity of the motor's shaft, as written if the gear ratio is unknown."""
    return driven.velocity * abs(driven.motor.gear_ratio or 1.0) if driven.rotates else math.nan


def _output_velocity(driven: _Driven) -> float:
    return driven.velocity if driven.joint.is_revolute else math.nan


def _joint_velocity(driven: _Driven) -> float:
    """Return the largest velocity that the motor allows the joint, over the limit of the joint."""
    limit = max(map(abs, driven.joint.limits.velocity))
    return ratio(driven.velocity, limit) if driven.rotates else math.nan


def _speed_voltage(driven: _Driven) -> float:
    """Return the voltage that the largest velocity of a motor induces, over its largest voltage."""
    constant, bound = driven.behind.torque_constant, driven.motor.max_voltage
    if constant is None or bound is None:
        return math.nan
    return abs(constant) * driven.velocity / _bounded(bound)


def _damping(number: int, joint: Joint, size: float) -> Measured:
    path = joint_path(number, joint, "damping")
    return Measured(path, joint.damping, units.DAMPING.unit(joint.type), size)


def _braking(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the torque of damping at the largest velocity, over the largest torque; 0 if that is infinite."""
    for driven in _all_motors(checked):
        joint, motor = driven.joint, driven.behind
        velocity = min(motor.max_velocity, max(map(abs, joint.limits.velocity)))
        if velocity < FASTEST and driven.carries:
            yield driven.measured("damping", motor.damping * velocity / motor.max_torque)
            torque = sum(each.max_torque for each in joint.actuator.motors)
            yield _damping(driven.number, joint, joint.damping * velocity / torque)


def _joint_damping(checked: CheckedRobot) -> Iterator[Measured]:
    for number, joint in enumerate(checked.joints):
        yield _damping(number, joint, ratio(joint.damping, checked.sizes.scale(joint)))


class _Rubbing(NamedTuple):
    """Dry friction of a motor, or of a joint, which has no gear and no largest torque.

    Attributes:
        gear: torque on the joint side over that on the side of the values.
    """

    path: NumberPath
    friction: Friction
    joint: Joint
    scale: float
    unit: str
    gear: float = 1.0
    max_torque: float = math.nan


def _rubbing(checked: CheckedRobot) -> Iterator[_Rubbing]:
    for driven in _all_motors(checked):
        friction, joint, gear = driven.motor.friction, driven.joint, abs(driven.motor.ratio_of_side)
        if friction is not None:
            path, unit, bound = driven.path("friction"), driven.unit("max_torque"), driven.motor.max_torque
            yield _Rubbing(path, friction, joint, driven.scale, unit, gear, _bounded(bound))
    for number, joint in enumerate(checked.joints):
        if joint.friction is not None:
            path, unit = joint_path(number, joint, "friction"), units.TORQUE.unit(joint.type)
            yield _Rubbing(path, joint.friction, joint, checked.sizes.scale(joint), unit)


def _coulomb(size: Callable[[_Rubbing, float], float]) -> Measure:
    """Return the measure of Coulomb friction as written: one number if it is equal in both directions."""

    def measure(checked: CheckedRobot) -> Iterator[Measured]:
        for rubbing in _rubbing(checked):
            backward, forward = rubbing.friction.coulomb
            sides = {Entry(0): backward, Entry(1): forward} if backward != forward else {None: forward}
            for side, torque in sides.items():
                path = (*rubbing.path, "coulomb", *(() if side is None else (side,)))
                yield Measured(path, torque, rubbing.unit, size(rubbing, torque))

    return measure


def _widths(checked: CheckedRobot) -> Iterator[Measured]:
    for rubbing in _rubbing(checked):
        if rubbing.joint.is_revolute:
            width = rubbing.friction.width
            yield Measured((*rubbing.path, "width"), width, "rad/s", width / rubbing.gear)


GEAR_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("gear ratios", "`gear_ratio`", _motors("gear_ratio", unit="1"),
        size="motor turns per joint turn", low=1, high=5000, usual=100,
        reason="several stages reach some thousands",
        finding="is {size} turns of the motor to one of the joint",
        advice="it is the motor's turns over those of the joint, e.g. 100"),
    Rule("gear ratios of prismatic joints", "`gear_ratio`", _motors("gear_ratio", unit="rad/m"),
        size="rad/m", low=5, high=1e5, usual=600,
        reason="5: a wheel of 0.4 m; 100,000: a screw of 0.06 mm pitch",
        finding="turns the motor by {size} rad for each meter", units=(OtherUnit("rad/mm", 1e3),),
        advice="of a screw it is 2*pi over the travel of a turn in m, e.g. 2*pi/0.020"),
)  # fmt: skip

MOTOR_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("light rotors", "`motor.inertia`",
        _motors("inertia", lambda m: ratio(m.behind.inertia, m.link_inertia), carrying=True),
        size="joint-side, over the link's inertia about its joint", low=0.005,
        reason="gears multiply by the ratio squared; direct drives have large rotors",
        finding="is, on the joint's side of the gear, {size} of the inertia of the link about its joint",
        advice="is it the rotor's own? Then give `gear_ratio` and `side: shaft`, or multiply by its square",
        explained_by=GEARS),
    Rule("heavy rotors", "`motor.inertia`", _motors("inertia", _heavy_rotor, carrying=True),
        size="joint-side, over mass times reach squared (mass)",
        high=100, usual=0.1,
        reason="it would not feel the robot; robots below 0.1 m pass",
        finding="is, on the joint's side of the gear, {size} times mass times reach squared of the robot",
        units=(OtherUnit("kg cm^2", 1e-4), OtherUnit("g cm^2", 1e-7), OtherUnit("kg mm^2", 1e-6)),
        advice=WHICH_SIDE, explained_by=GEARS),
    Rule("damping of motors", "`motor.damping`",
        _motors("damping", lambda m: m.motor.damping / m.motor.inertia),
        size="1/s, over the inertia of the motor", high=500,
        reason="motors coast for more than 2 ms",
        finding="stops the motor alone at a rate of {size} 1/s",
        units=(DAMPING_IN_MILLIMETERS, OtherUnit("N m s/krpm", 0.03 / math.pi)),
        advice="check the units of damping and inertia"),
    Rule("velocities of motors", "`max_velocity`",
        _motors("max_velocity", _shaft_velocity, carrying=True),
        size="rad/s, of the motor's shaft", high=2500, usual=400, reason="robots have no faster motors",
        finding="is more than 24,000 turns a minute of the motor", units=ROTARY, in_angles=True),
    Rule("velocities of motors behind the gear", "`max_velocity`",
        _motors("max_velocity", _output_velocity, unit="rad/s", carrying=True),
        size="joint-side, rad/s", high=FASTEST, usual=4,
        reason="limbs are slower",
        finding="is, on the joint's side of the gear, {size} rad/s", units=ROTARY,
        advice="with `gear_ratio` and `side: shaft` it would be that of the motor's shaft",
        explained_by=(*GEARS, "velocities of motors")),
    Rule("velocities of motors and joints", "`max_velocity`, `limits.velocity`",
        _motors("max_velocity", _joint_velocity, carrying=True),
        size="joint-side, over the joint's limit", high=8,
        reason="a joint's limit is about what its motor can do",
        finding="lets the joint go {size} times as fast as its `limits.velocity`",
        units=ROTARY, advice="check the units of both", in_angles=True,
        explained_by=(*GEARS, "velocities of motors", "velocities of motors behind the gear")),
    Rule("weak motors", "`max_torque`",
        _motors("max_torque", lambda m: ratio(m.torque, m.load), carrying=True),
        size="joint-side, over the load of the stretched arm's weight",
        low=0.05, usual=2,
        reason="it could accelerate the arm by only 0.05 g",
        finding="is, on the joint's side of the gear, {size} of what the weight of the stretched arm can ask",
        advice="is it the motor's own? Then give `gear_ratio` and `side: shaft`, or multiply by it",
        explained_by=GEARS),
    Rule("strong motors", "`max_torque`",
        _motors("max_torque", lambda m: ratio(m.torque, m.scale), carrying=True),
        size="joint-side, over weight times reach",
        high=300, usual=0.5, reason="it would lift 300 such robots",
        finding="is, on the joint's side of the gear, {size} times the weight of the robot at its reach",
        units=OTHER_TORQUES, advice=WHICH_SIDE, explained_by=GEARS),
)  # fmt: skip

RESISTANCE_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("damping compared with torque", "`damping`, `motor.damping`", _braking,
        size="its torque at the largest velocity, over the motors' largest torque",
        high=1, usual=0.05,
        reason="the joint could not reach its velocity limit",
        finding="takes, at the largest velocity of the joint, {size} times the largest torque of its motors",
        units=(DAMPING_IN_MILLIMETERS._replace(instead_of="N m s/rad"),),
        explained_by=(*GEARS, "velocities of motors", "velocities of motors and joints", "weak motors")),
    Rule("damping of joints", "`damping`", _joint_damping,
        size="torque at 1 rad/s (force at 1 m/s), over weight times reach",
        high=500, usual=1e-3,
        reason="placeholders in real descriptions reach 50",
        finding="brakes, at 1 rad/s or 1 m/s, with {size} times the weight of the robot at its reach",
        units=(DAMPING_IN_MILLIMETERS,), explained_by=(*SIZES, "damping compared with torque")),
    Rule("dry friction compared with torque", "`motor.friction.coulomb`",
        _coulomb(lambda rubbing, torque: torque / rubbing.max_torque),
        size="over the motor's largest torque", high=1, usual=0.1,
        reason="the motor could not move",
        finding="is {size} times the largest torque of the motor", units=OTHER_TORQUES, explained_by=GEARS),
    Rule("dry friction compared with weight", "`friction.coulomb`, `motor.friction.coulomb`",
        _coulomb(lambda rubbing, torque: ratio(torque * rubbing.gear, rubbing.scale)),
        size="joint-side, over weight times reach",
        high=100, usual=0.05, reason="a hundred such robots would hang on the joint without moving it",
        finding="is, on the joint's side of the gear, {size} times the weight of the robot at its reach",
        units=OTHER_TORQUES, advice=WHICH_SIDE,
        explained_by=(*SIZES, *GEARS, "dry friction compared with torque")),
    Rule("widths of friction", "`friction.width`, `motor.friction.width` of revolute joints", _widths,
        size="joint-side, rad/s", high=3, usual=0.05,
        reason="above, it is viscous friction",
        finding="smooths friction over {size} rad/s on the joint's side of the gear",
        units=(DEGREES_PER_SECOND, RPM), explained_by=GEARS),
)  # fmt: skip

WINDING_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("torque constants", "`torque_constant`", _motors("torque_constant"),
        size="N m/A", low=1e-4, high=30, usual=0.1,
        reason="from the smallest motors, 0.0003, to large direct drives, a few",
        finding="is that of no motor", units=(OtherUnit("mN m/A", 1e-3), OtherUnit("N cm/A", 1e-2)),
        advice="from volts per 1000 turns a minute it is 0.00955 N m/A for each of them"),
    Rule("resistances of windings", "`resistance`", _motors("resistance"),
        size="ohm", low=1e-3, high=1000,
        reason="from large motors to those of watches",
        finding="is that of no winding of a robot's motor", units=(OtherUnit("mohm", 1e-3),)),
    Rule("voltages at the largest velocity", "`torque_constant`, `max_velocity`, `max_voltage`",
        _motors("torque_constant", _speed_voltage),
        size="back-EMF at this velocity, over the largest voltage", high=5, usual=0.8,
        reason="the motor could not reach a fifth of its limit",
        finding="makes {size} times the largest voltage at the motor's largest velocity",
        units=(OtherUnit("mN m/A", 1e-3),), explained_by=("velocities of motors", "torque constants")),
)  # fmt: skip

DRIVE_RULES = (*GEAR_RULES, *MOTOR_RULES, *RESISTANCE_RULES, *WINDING_RULES)
