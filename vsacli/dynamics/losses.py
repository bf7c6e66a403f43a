"""Losses: power dissipated by friction, dampers and windings, and its quadrature over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.friction import FrictionLaws
from vsacli.actuators.transmission import JointVariables
from vsacli.base.arrays import FloatArray, by_joint
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.control_flow import where_needed
from vsacli.dynamics.dampers import damper_velocities
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot


def integrals(intervals: FloatArray, values: FloatArray, rates: FloatArray) -> FloatArray:
    """Return the time integral over each interval of the cubic with these values and rates; error O(h^5).

    Args:
        intervals: Lengths h, (samples - 1,), s.
        values: Integrand, (..., samples).
        rates: Derivative of the integrand, (..., samples).
    """
    before, after = ((values[..., ends], rates[..., ends]) for ends in (slice(None, -1), slice(1, None)))
    return integral(intervals, before, after)


def integral(
    interval: FloatArray, before: tuple[FloatArray, FloatArray], after: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return `integrals` of single intervals, from value and rate before and after each."""
    (value, rate), (next_value, next_rate) = before, after
    return ((rate - next_rate) * (interval / 6) + next_value + value) * (interval / 2)


def work_on_each_other(
    interval: FloatArray, before: tuple[FloatArray, FloatArray], after: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Integrate each motor's velocity times the acceleration of the other over each interval, (2, ...).

    The integrand is that of the cubics with the velocities and accelerations at the ends; error O(h^5). The
    sum of both integrals is exactly the change of theta_1' theta_2'.

    Args:
        interval: Length h, s.
        before: Velocities and accelerations of both motors at the beginning, each (2, ...).
        after: Velocities and accelerations at the end.
    """
    (velocity, acceleration), (next_velocity, next_acceleration) = before, after
    acceleration, next_acceleration = interval * acceleration, interval * next_acceleration

    def antisymmetric(first: FloatArray, second: FloatArray) -> FloatArray:
        """Return the product of one motor's value with the other's, minus that with the motors exchanged."""
        return first * second[::-1] - second * first[::-1]

    area = antisymmetric(velocity, next_velocity) - antisymmetric(acceleration, next_acceleration) / 30
    area = (
        area
        + (
            antisymmetric(velocity, acceleration - next_acceleration)
            + antisymmetric(acceleration - next_acceleration, next_velocity)
        )
        / 5
    )
    total = (next_velocity * next_velocity[::-1] - velocity * velocity[::-1]) + area
    return total / 2


def positive_part(intervals: FloatArray, power: FloatArray, work: FloatArray) -> FloatArray:
    """Return the time integral of the positive part of a power over each interval.

    Args:
        intervals: Lengths h, (samples - 1,), s.
        power: Power, (..., samples); linear in intervals in which it changes its sign, error O(h^3).
        work: Integral of the power over each interval, (..., samples - 1), a lower bound of the result.
    """
    return positive_work(np.broadcast_to(intervals, work.shape), power[..., :-1], power[..., 1:], work)


def positive_work(
    interval: FloatArray, before: FloatArray, after: FloatArray, work: FloatArray
) -> FloatArray:
    """Return `positive_part` of single intervals, from the power before and after; arrays of one shape."""
    positive = np.maximum(work, 0.0)
    (spent,) = where_needed(
        before * after < 0, _linear_positive_work, (interval, before, after, positive), (positive,)
    )
    return spent


def _linear_positive_work(
    interval: FloatArray, before: FloatArray, after: FloatArray, least_work: FloatArray
) -> tuple[FloatArray]:
    """Return the positive work of a linear power that changes its sign, at least the given one."""
    lower_power, higher_power = np.minimum(before, after), np.maximum(before, after)
    return (np.maximum(interval / 2 * higher_power**2 / (higher_power - lower_power), least_work),)


def trapezoidal_weights(time: FloatArray) -> FloatArray:
    """Return the weights of the trapezoidal rule, (samples,) in s."""
    halves = np.diff(time) / 2
    return np.asarray(np.append(halves, 0.0) + np.append(0.0, halves))


def trapezoidal_integrals(intervals: FloatArray, values: FloatArray) -> FloatArray:
    """Return the time integral over each interval of a piecewise linear function; error O(h^3)."""
    integral: FloatArray = intervals / 2 * (values[..., 1:] + values[..., :-1])
    return integral


MOTION = ("time", "q", "dq", "ddq", "theta", "dtheta", "ddtheta")
"""Variables from which losses follow."""

DAMPED = ("damping", "ddamping", "dphi")
"""Variables from which losses in dampers follow."""


def dissipated_power(joint: Joint, motion: JointVariables) -> FloatArray:
    """Return the power dissipated by friction and damping of a joint and its motors, (samples,), W.

    Args:
        joint: Joint with its actuator.
        motion: Velocities `dq` and `dtheta`, and for a joint with a damper `damping` and `dphi`.
    """
    power: FloatArray = _lost_power(joint.damping, FrictionLaws.over_samples([joint.friction]), motion.dq)
    for velocity in damper_velocities(joint, motion.dq, motion.dphi) if joint.damper else ():
        power = power + motion.damping * velocity * velocity
    for index, motor in enumerate(joint.actuator.motors):
        power = power + _lost_power(
            motor.damping, FrictionLaws.over_samples([motor.friction]), motion.dtheta[index]
        )
    return power


def _lost_power(damping: float, friction: FrictionLaws | None, velocity: FloatArray) -> FloatArray:
    torque = damping * velocity
    if friction is not None:
        torque = torque + friction.torque(velocity)[0]
    power: FloatArray = torque * velocity
    return power


class LostEnergy(NamedTuple):
    """Energy lost in the intervals between samples, J.

    Attributes:
        motor_friction: Energy lost to dry friction of each motor, (joints, 2, intervals).
        dissipated: Energy lost to all friction and damping of each joint, (joints, intervals).
        copper: Heat in the windings of each motor, (joints, 2, intervals); None without a resistance.
    """

    motor_friction: FloatArray
    dissipated: FloatArray
    copper: FloatArray | None

    def select_intervals(self, intervals: slice) -> LostEnergy:
        """Return the losses in a slice of the intervals."""
        copper = None if self.copper is None else self.copper[..., intervals]
        return LostEnergy(self.motor_friction[..., intervals], self.dissipated[..., intervals], copper)


class LossMeter:
    """Losses between samples, block by block; `add` blocks in order."""

    def __init__(self, robot: Robot) -> None:
        sides = [side for joint in robot.joints for side in joint.actuator.sides]
        laws = FrictionLaws.of([side.friction if side else None for side in sides])
        self._motor_friction = laws and FrictionLaws(*(values.reshape(-1, SIDES, 1) for values in laws))
        self._joint_friction = FrictionLaws.over_samples([joint.friction for joint in robot.joints])
        self._has_motor = np.array([side is not None for side in sides]).reshape(-1, SIDES)
        self._motor_damping = np.array([side.damping if side else 0.0 for side in sides]).reshape(-1, SIDES)
        self._joint_damping = np.array([joint.damping for joint in robot.joints])
        self._robot = robot
        has_windings = robot.has_variable(VARIABLES["copper_loss"])
        has_dampers = robot.has_variable(VARIABLES["damping"])
        self._names = (*MOTION, *(["copper_loss"] if has_windings else []), *(DAMPED if has_dampers else []))
        self._last_sample: dict[str, FloatArray] = {}

    def add(self, block: Block) -> LostEnergy:
        """Return the losses from the previous sample to each sample of a block; zero before the first."""
        rows = {name: by_joint(getattr(block, name)) for name in self._names}
        before = self._last_sample or _sample_rows(rows, 0)
        self._last_sample = _sample_rows(rows, -1)
        return self.interval_losses(
            {name: np.concatenate((before[name], rows[name]), axis=-1) for name in rows}
        )

    def interval_losses(self, rows: Mapping[str, FloatArray]) -> LostEnergy:
        """Return the losses from sample to sample, from variables by name with samples on the last axis."""
        intervals = np.diff(rows["time"])
        motor_motion = [rows[name] for name in ("theta", "dtheta", "ddtheta")]
        joint_motion = [rows[name] for name in ("q", "dq", "ddq")]
        motor_friction = _friction_work(self._motor_friction, intervals, *motor_motion)
        motor_losses = motor_friction + _damping_work(self._motor_damping, intervals, *motor_motion[1:])
        dissipated = np.sum(motor_losses, axis=1, where=self._has_motor[..., None])
        dissipated += _damping_work(self._joint_damping, intervals, *joint_motion[1:])
        dissipated += _friction_work(self._joint_friction, intervals, *joint_motion)
        for index, joint in enumerate(self._robot.joints):
            if joint.damper is not None:
                variables = {name: rows[name][index] for name in self._names if name != "time"}
                dissipated[index] += _damper_work(joint, intervals, variables)
        heat = rows.get("copper_loss")
        return LostEnergy(
            motor_friction, dissipated, None if heat is None else trapezoidal_integrals(intervals, heat)
        )


def _sample_rows(rows: Mapping[str, FloatArray], index: int) -> dict[str, FloatArray]:
    return {name: values[..., [index]] for name, values in rows.items()}


def _damping_work(
    damping: FloatArray, intervals: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    return damping[..., None] * integrals(intervals, velocity * velocity, 2 * velocity * acceleration)


def _damper_work(joint: Joint, intervals: FloatArray, variables: Mapping[str, FloatArray]) -> FloatArray:
    damping, d_damping, dq, ddq = (variables[name] for name in ("damping", "ddamping", "dq", "ddq"))
    velocities = damper_velocities(joint, dq, variables["dphi"])
    accelerations = damper_velocities(joint, ddq, variables["ddtheta"] - ddq)
    work = np.zeros_like(intervals)
    for velocity, acceleration in zip(velocities, accelerations, strict=True):
        rate = (d_damping * velocity + 2 * damping * acceleration) * velocity
        work += integrals(intervals, damping * velocity * velocity, rate)
    return work


def _friction_work(
    laws: FrictionLaws | None,
    intervals: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
) -> FloatArray:
    """Return the work of friction: integrated for smooth laws, torque times path for sharp ones."""
    travel = np.diff(position)
    if laws is None:
        return np.zeros_like(travel)
    work = integrals(intervals, *laws.power(velocity, acceleration))
    if laws.sharp.any():
        forward = positive_part(intervals, velocity, travel)
        work += np.where(laws.sharp, laws.forward * forward + laws.backward * (forward - travel), 0.0)
    return work
