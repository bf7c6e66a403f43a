"""Plausibility rules of motors, gears, windings, viscous damping and dry friction of a robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from vsacli.actuators.motor import JOINT, SHAFT, JointMotor, Motor
from vsacli.base import units
from vsacli.base.variables import VARIABLES
from vsacli.documents.fields import declared_fields
from vsacli.documents.plausibility import Measured, OtherUnit, Rule
from vsacli.documents.record_values import NumberPath, PathIndex
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.bodies import (
    DEGREES_PER_SECOND,
    RPM,
    SIZES,
    SLIPS_OF_DAMPING,
    Measure,
)
from vsacli.robot.plausibility.checked_robot import CheckedRobot, joint_path, motors_in_file, ratio_or_nan

TINY = 0.1
"""Length, m; in shorter robots, such as fingers, rotors behind gears far outweigh the links."""

ROTARY = (RPM._replace(instead_of="rad/s"), DEGREES_PER_SECOND._replace(instead_of="rad/s"))
OTHER_TORQUES = (OtherUnit("N mm", 1e-3), OtherUnit("N cm", 1e-2), OtherUnit("mN m", 1e-3))
UNITS_OF_ROTORS = (OtherUnit("kg cm^2", 1e-4), OtherUnit("g cm^2", 1e-7), OtherUnit("kg mm^2", 1e-6))
WHICH_SIDE = "with `side: shaft` it is that of the motor's shaft, otherwise that on the joint's side"
GEARS = (*SIZES, "gear ratios", "gear ratios of prismatic joints")
"""Names of rules, of gear ratios and sizes, whose findings explain those of motors behind a gear."""


class _CheckedMotor(NamedTuple):
    """A motor with its joint; `torque` and `velocity` are NaN without a bound, `load` without gravity."""

    checked: CheckedRobot
    number: int
    joint: Joint
    path_in_joint: NumberPath
    motor: Motor

    @property
    def at_joint_side(self) -> JointMotor:
        """Motor on the joint side of the gear."""
        return self.motor.at_joint

    @property
    def carries_load(self) -> bool:
        """Whether the motor carries the load; one that only sets the springs may be small and fast."""
        last = self.path_in_joint[-1]
        return bool(
            self.joint.actuator.has_columns(VARIABLES["phi"])[
                last.number if isinstance(last, PathIndex) else 0
            ]
        )

    @property
    def torque(self) -> float:
        """Largest torque on the joint side of the gear, N m (N)."""
        return _nan_if_infinite(self.at_joint_side.max_torque)

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
        return _nan_if_infinite(self.at_joint_side.max_velocity)

    @property
    def rotates(self) -> bool:
        """Whether the motor is known to turn; it may be a linear one at a prismatic joint without a gear."""
        return self.joint.is_revolute or self.motor.gear_ratio is not None

    def unit(self, name: str) -> str:
        """Return the unit of a field; a shaft is rotational at any joint."""
        variant = "revolute" if self.motor.side == SHAFT else None
        return declared_fields(Motor)[name][0].quantity.inside(variant).unit(self.joint.type)

    def path(self, name: str) -> NumberPath:
        """Return the path of a field."""
        return joint_path(self.number, self.joint, *self.path_in_joint, name)

    def measure(self, name: str, size: float) -> Measured:
        """Return the measured value of a field, with a size."""
        return Measured(self.path(name), getattr(self.motor, name), self.unit(name), size)


def _nan_if_infinite(value: float) -> float:
    return value if math.isfinite(value) else math.nan


def _checked_motors(checked: CheckedRobot) -> Iterator[_CheckedMotor]:
    for number, joint in checked.joints_with_drives:
        for path, motor in motors_in_file(joint):
            yield _CheckedMotor(checked, number, joint, path, motor)


def _motor_measurements(
    field: str,
    magnitude: Callable[[_CheckedMotor], float] | None = None,
    *,
    unit: str = "",
    loaded_only: bool = False,
) -> Measure:
    """Return the measure of a field of the motors.

    Args:
        field: name of the field.
        magnitude: function that returns the size of a motor; by default |value|, NaN if 0 or infinite.
            Motors with NaN are skipped.
        unit: unit of the field; motors with another one are skipped. "" for any unit.
        loaded_only: whether to skip motors that do not carry the load.
    """

    def motor_measurements(checked: CheckedRobot) -> Iterator[Measured]:
        for motor in _checked_motors(checked):
            value = getattr(motor.motor, field) or math.nan
            size = _nan_if_infinite(abs(value)) if magnitude is None else magnitude(motor)
            counts = not math.isnan(size) and (motor.carries_load or not loaded_only)
            if counts and unit in ("", motor.unit(field)):
                yield motor.measure(field, size)

    return motor_measurements


def _rotor_inertia_share(drive: _CheckedMotor, *, tiny: bool) -> float:
    """Return the inertia of the rotor over that of the robot, if this is a tiny one or not."""
    sizes = drive.checked.sizes
    lever = sizes.extent if drive.joint.is_revolute else 1.0
    of_kind = tiny == (sizes.extent <= TINY)
    return ratio_or_nan(drive.at_joint_side.inertia, sizes.mass * lever**2) if of_kind else math.nan


def _shaft_velocity(drive: _CheckedMotor, *, side: str) -> float:
    """Return the largest velocity of the motor's shaft, if the file gives that of this side of the gear.

    It is as written if the gear ratio is unknown.
    """
    of_side = drive.rotates and side == (drive.motor.side or JOINT)
    return drive.velocity * abs(drive.motor.gear_ratio or 1.0) if of_side else math.nan


def _joint_velocity(drive: _CheckedMotor) -> float:
    """Return the largest velocity that the motor allows the joint, over the limit of the joint."""
    limit = max(map(abs, drive.joint.limits.velocity))
    return ratio_or_nan(drive.velocity, limit) if drive.rotates else math.nan


def _deflection_of_springs(drive: _CheckedMotor) -> float:
    """Return the deflection of springs at rest under the largest torque, rad (of the reach)."""
    attainable = drive.checked.unloaded_ranges[drive.number]
    travel = 1.0 if drive.joint.is_revolute else drive.checked.sizes.extent
    return math.nan if attainable is None else ratio_or_nan(drive.torque, attainable.lower * travel)


def _measure_viscous_losses(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield damping of joints and motors, with its torque at the motor's largest velocity over its largest.

    Of motors without a largest velocity it is that at 1 rad/s (reach/s).
    """
    for drive in _checked_motors(checked):
        if drive.carries_load and not math.isnan(drive.torque):
            travel = 1.0 if drive.joint.is_revolute else checked.sizes.extent
            share = (travel if math.isnan(drive.velocity) else drive.velocity) / drive.torque
            yield drive.measure("damping", drive.at_joint_side.damping * share)
            path, damping = joint_path(drive.number, drive.joint, "damping"), drive.joint.damping
            yield Measured(path, damping, units.DAMPING.unit(drive.joint.type), damping * share)


def _measure_dry_friction(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield Coulomb friction of motors as written: one number if it is equal in both directions."""
    for drive in _checked_motors(checked):
        if drive.motor.friction is not None:
            backward, forward = drive.motor.friction.coulomb
            directions = (
                {PathIndex(0): backward, PathIndex(1): forward} if backward != forward else {None: forward}
            )
            for direction, torque in directions.items():
                path = (*drive.path("friction"), "coulomb", *(() if direction is None else (direction,)))
                size = torque / _nan_if_infinite(drive.motor.max_torque)
                yield Measured(path, torque, drive.unit("max_torque"), size)


GEAR_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("gear ratios", "`gear_ratio`", _motor_measurements("gear_ratio", unit="1"),
        size="motor turns per joint turn", low=1, high=5000, usual=100,
        reason="several stages reach some thousands",
        finding="is {size} turns of the motor to one of the joint",
        advice="it is the motor's turns over those of the joint, e.g. 100"),
    Rule("gear ratios of prismatic joints", "`gear_ratio`", _motor_measurements("gear_ratio", unit="rad/m"),
        size="rad/m", low=5, high=1e5, usual=600,
        reason="5: a wheel of 0.4 m; 100,000: a screw of 0.06 mm pitch",
        finding="turns the motor by {size} rad for each meter", units=(OtherUnit("rad/mm", 1e3),),
        advice="of a screw it is 2*pi over the travel of a turn in m, e.g. 2*pi/0.020"),
)  # fmt: skip

MOTOR_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("light rotors", "`motor.inertia`",
        _motor_measurements(
            "inertia", lambda m: ratio_or_nan(m.at_joint_side.inertia, m.link_inertia), loaded_only=True
        ),
        size="joint-side, over the link's inertia about its joint", low=0.005,
        reason="gears multiply by the ratio squared; direct drives have large rotors",
        finding="is, on the joint's side of the gear, {size} of the inertia of the link about its joint",
        advice="is it the rotor's own? Then give `gear_ratio` and `side: shaft`, or multiply by its square",
        explained_by=GEARS),
    *(
        Rule(name, "`motor.inertia`",
            _motor_measurements("inertia", partial(_rotor_inertia_share, tiny=tiny), loaded_only=True),
            size="joint-side, over mass times reach squared (mass)",
            high=high, usual=0.1, reason=reason,
            finding="is, on the joint's side of the gear, {size} times mass times reach squared of the robot",
            units=UNITS_OF_ROTORS, advice=WHICH_SIDE, explained_by=GEARS)
        for name, tiny, high, reason in (
            ("heavy rotors", False, 100, "it would not feel the robot; not for robots below 0.1 m"),
            ("heavy rotors of tiny robots", True, 1e5, "for robots below 0.1 m; bundled: up to 27"),
        )
    ),
    Rule("starting times", "`motor.inertia`",
        _motor_measurements("inertia", lambda m: m.at_joint_side.inertia * m.velocity / m.torque),
        size="s, in which `max_torque` accelerates the rotor alone to `max_velocity`", high=5, usual=0.01,
        reason="electric motors need some hundredths",
        finding="lets the motor alone start in no less than {size} s", units=UNITS_OF_ROTORS,
        advice="check its unit and those of `max_torque` and `max_velocity`",
        explained_by=(*GEARS, "heavy rotors", "heavy rotors of tiny robots")),
    *(
        Rule(name, "`max_velocity`",
            _motor_measurements("max_velocity", partial(_shaft_velocity, side=side), loaded_only=True),
            size=f"rad/s, of the motor's shaft, {condition}", high=2500, usual=usual,
            reason="robots have no faster motors",
            finding="is more than 24,000 turns a minute of the motor", units=units_of_side, in_angles=True)
        for name, side, condition, usual, units_of_side in (
            ("velocities of motors", JOINT, "if the file gives it for the joint's side", 400, ROTARY),
            ("velocities of shafts", SHAFT, "if the file gives it with `side: shaft`", 800, ROTARY[:1]),
        )
    ),
    Rule("velocities of motors and joints", "`max_velocity`, `limits.velocity`",
        _motor_measurements("max_velocity", _joint_velocity, loaded_only=True),
        size="joint-side, over the joint's limit", high=8,
        reason="a joint's limit is about what its motor can do",
        finding="lets the joint go {size} times as fast as its `limits.velocity`",
        units=ROTARY, advice="check the units of both", in_angles=True,
        explained_by=(*GEARS, "velocities of motors", "velocities of shafts")),
    Rule("weak motors", "`max_torque`",
        _motor_measurements("max_torque", lambda m: ratio_or_nan(m.torque, m.load), loaded_only=True),
        size="joint-side, over the load of the stretched arm's weight",
        low=0.05, usual=2,
        reason="it could accelerate the arm by only 0.05 g",
        finding="is, on the joint's side of the gear, {size} of what the weight of the stretched arm can ask",
        advice="is it the motor's own? Then give `gear_ratio` and `side: shaft`, or multiply by it",
        explained_by=GEARS),
    Rule("strong motors", "`max_torque`",
        _motor_measurements("max_torque", lambda m: ratio_or_nan(m.torque, m.scale), loaded_only=True),
        size="joint-side, over weight times reach",
        high=300, usual=0.5, reason="it would lift 300 such robots",
        finding="is, on the joint's side of the gear, {size} times the weight of the robot at its reach",
        units=OTHER_TORQUES, advice=WHICH_SIDE, explained_by=GEARS),
)  # fmt: skip

RESISTANCE_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("viscous losses", "`damping`, `motor.damping`", _measure_viscous_losses,
        size="torque at the motor's largest velocity, else at 1 rad/s (reach/s), over its largest",
        high=0.5, usual=0.01,
        reason="the motor would hardly reach this velocity",
        finding="requires {size} times the largest torque of the motor at the largest velocity",
        units=SLIPS_OF_DAMPING,
        explained_by=(
            *GEARS, "weak motors", "strong motors", "velocities of motors", "velocities of shafts")),
    Rule("dry friction compared with torque", "`motor.friction.coulomb`", _measure_dry_friction,
        size="over the motor's largest torque", high=1, usual=0.1,
        reason="the motor could not move",
        finding="is {size} times the largest torque of the motor", units=OTHER_TORQUES, explained_by=GEARS),
)  # fmt: skip

WINDING_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("torque constants", "`torque_constant`", _motor_measurements("torque_constant"),
        size="N m/A", low=1e-4, high=30, usual=0.1,
        reason="from the smallest motors, 0.0003, to large direct drives, a few",
        finding="is that of no motor", units=(OtherUnit("mN m/A", 1e-3), OtherUnit("N cm/A", 1e-2)),
        advice="from volts per 1000 turns a minute it is 0.00955 N m/A for each of them"),
)  # fmt: skip

RULES_OF_MOTORS_AND_SPRINGS: tuple[Rule[CheckedRobot], ...] = (
    Rule("motors compared with springs", "`max_torque`, `spring`",
        _motor_measurements("max_torque", _deflection_of_springs, loaded_only=True),
        size="deflection of the springs at rest under this torque, rad (of the reach)",
        low=0.01, reason="bundled robots: 0.03 to 6; the springs would not count",
        finding="deflects the springs of the joint by only {size} rad (of the reach)",
        advice="check the units of the springs, then those of the motor",
        explained_by=(*GEARS, "weak motors", "springs at their largest deflection", "stiff springs")),
)  # fmt: skip
"""Rules that follow those of springs."""

DRIVE_RULES = (*GEAR_RULES, *MOTOR_RULES, *RESISTANCE_RULES, *WINDING_RULES)
