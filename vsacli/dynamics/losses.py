"""What friction, dampers and windings take: power at a step, and energy between the steps of a run.

Whatever takes energy at a joint adds a term to `dissipated_power` and to `LossMeter`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.friction import FrictionLaws
from vsacli.base.arrays import FloatArray, by_joint
from vsacli.base.variables import VARIABLES, Block
from vsacli.dynamics.dampers import damper_velocities
from vsacli.dynamics.quadrature import integrals, positive_part, trapezoids
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

MOTION = ("time", "q", "dq", "ddq", "theta", "dtheta", "ddtheta")
"""What losses follow from."""

DAMPED = ("damping", "ddamping", "dphi")
"""The same of dampers."""


def dissipated_power(joint: Joint, motion: Mapping[str, Any]) -> FloatArray:
    """Power that friction and damping of a joint and its motors take, (samples,), W.

    Args:
        joint: the joint with its actuator.
        motion: `dq`, (samples,), and `dtheta`, (2, samples), among other variables of the joint; of one with
            a damper `damping` and `dphi` as well.
    """
    power: FloatArray = _taken(joint.damping, FrictionLaws.of([joint.friction]), motion["dq"])
    for velocity in damper_velocities(joint, motion["dq"], motion["dphi"]) if joint.damper else ():
        power = power + motion["damping"] * velocity * velocity
    for index, motor in enumerate(joint.actuator.motors):
        power = power + _taken(motor.damping, FrictionLaws.of([motor.friction]), motion["dtheta"][index])
    return power


def _taken(damping: float, friction: FrictionLaws | None, velocity: FloatArray) -> FloatArray:
    torque = damping * velocity
    if friction is not None:
        torque = torque + friction.torque(velocity)
    power: FloatArray = torque * velocity
    return power


class Lost(NamedTuple):
    """Energy that is lost in intervals between steps, J.

    Attributes:
        motor_friction: to dry friction of each motor, (joints, 2, intervals).
        dissipated: to all friction and damping of each joint, (joints, intervals).
        copper: to the windings of each motor, (joints, 2, intervals); None if no resistance is given.
    """

    motor_friction: FloatArray
    dissipated: FloatArray
    copper: FloatArray | None

    def taken(self, intervals: slice) -> Lost:
        """The same of some of the intervals."""
        copper = None if self.copper is None else self.copper[..., intervals]
        return Lost(self.motor_friction[..., intervals], self.dissipated[..., intervals], copper)


class LossMeter:
    """Finds what is lost between steps; `add` blocks in order."""

    def __init__(self, robot: Robot) -> None:
        sides = [side for joint in robot.joints for side in joint.actuator.sides]
        laws = FrictionLaws.of([side.friction if side else None for side in sides])
        self._of_motors = laws and FrictionLaws(*(values.reshape(-1, SIDES, 1) for values in laws))
        of_joints = FrictionLaws.of([joint.friction for joint in robot.joints])
        self._of_joints = of_joints and of_joints.with_axis_behind()
        self._there = np.array([side is not None for side in sides]).reshape(-1, SIDES)
        self._motor_damping = np.array([side.damping if side else 0.0 for side in sides]).reshape(-1, SIDES)
        self._joint_damping = np.array([joint.damping for joint in robot.joints])
        self._robot = robot
        heated = robot.has(VARIABLES["copper_loss"])
        damped = robot.has(VARIABLES["damping"])
        self._names = (*MOTION, *(["copper_loss"] if heated else []), *(DAMPED if damped else []))
        self._last: dict[str, FloatArray] = {}

    def add(self, block: Block) -> Lost:
        """What is lost from the step before to each step of a block; nothing before the first."""
        rows = {name: by_joint(getattr(block, name)) for name in self._names}
        before = self._last or _step(rows, 0)
        self._last = _step(rows, -1)
        return self.between({name: np.concatenate((before[name], rows[name]), axis=-1) for name in rows})

    def between(self, rows: Mapping[str, FloatArray]) -> Lost:
        """What is lost from step to step, from variables by name, samples last."""
        intervals = np.diff(rows["time"])
        of_motors = [rows[name] for name in ("theta", "dtheta", "ddtheta")]
        of_joints = [rows[name] for name in ("q", "dq", "ddq")]
        motor_friction = _friction_work(self._of_motors, intervals, *of_motors)
        taken = motor_friction + _damping_work(self._motor_damping, intervals, *of_motors[1:])
        dissipated = np.sum(taken, axis=1, where=self._there[..., None])
        dissipated += _damping_work(self._joint_damping, intervals, *of_joints[1:])
        dissipated += _friction_work(self._of_joints, intervals, *of_joints)
        for index, joint in enumerate(self._robot.joints):
            if joint.damper is not None:
                of_joint = {name: rows[name][index] for name in self._names if name != "time"}
                dissipated[index] += _damper_work(joint, intervals, of_joint)
        heat = rows.get("copper_loss")
        return Lost(motor_friction, dissipated, None if heat is None else trapezoids(intervals, heat))


def _step(rows: Mapping[str, FloatArray], step: int) -> dict[str, FloatArray]:
    return {name: values[..., [step]] for name, values in rows.items()}


def _damping_work(
    damping: FloatArray, intervals: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    return damping[..., None] * integrals(intervals, velocity * velocity, 2 * velocity * acceleration)


def _damper_work(joint: Joint, intervals: FloatArray, of_joint: Mapping[str, FloatArray]) -> FloatArray:
    damping, d_damping, dq, ddq = (of_joint[name] for name in ("damping", "ddamping", "dq", "ddq"))
    velocities = damper_velocities(joint, dq, of_joint["dphi"])
    accelerations = damper_velocities(joint, ddq, of_joint["ddtheta"] - ddq)
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
    """Of smooth friction the integral of its power; of the sign function size times way, which is exact."""
    way = np.diff(position)
    if laws is None:
        return np.zeros_like(way)
    work = integrals(intervals, *laws.power(velocity, acceleration))
    if laws.sharp.any():
        forward = positive_part(intervals, velocity, way)
        work += np.where(laws.sharp, laws.forward * forward + laws.backward * (forward - way), 0.0)
    return work
