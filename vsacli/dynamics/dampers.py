"""Dampers with commanded damping, in the equations of motion of links and motors.

A damper between the links resists the joint with the torque d q'. A damper parallel to the springs transmits
d (theta_k' - q') to the link from each motor with a spring, in addition to the torque of the spring.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.actuators.transmission import JointVariables
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import DAMPING
from vsacli.base.variables import VARIABLES
from vsacli.compute.vector import Scalar, add, mul
from vsacli.dynamics.recursion_inputs import TorqueDerivatives
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot


def joints_with_parallel_damper(joints: Sequence[Joint]) -> list[int]:
    """Return the joints with a damper parallel to their springs, by index."""
    return [index for index, joint in enumerate(joints) if joint.damper_at("transmission")]


def damper_torque(damping: Sequence[Scalar], rates: Sequence[Scalar]) -> TorqueDerivatives:
    """Return the torque d v of a damper and its first two derivatives.

    Args:
        damping: d, d', d''.
        rates: Velocity v of the damper, v', v''; scalars of any kind.
    """
    (d, d_d, dd_d), (v, dv, ddv) = damping, rates
    return TorqueDerivatives(
        tau=mul(d, v),
        dtau=add(mul(d_d, v), mul(d, dv)),
        ddtau=add(add(mul(dd_d, v), mul(2, mul(d_d, dv))), mul(d, ddv)),
    )


def damper_velocities(joint: Joint, dq: Scalar, dphi: Iterable[Scalar]) -> list[Scalar]:
    """Return the velocity of each damper of a joint from dq and dphi; or accelerations."""
    if joint.damper_at("link"):
        return [dq]
    return [
        rate
        for rate, sprung in zip(dphi, joint.actuator.has_columns(VARIABLES["phi"]), strict=True)
        if sprung
    ]


def parallel_damper_torques(joint: Joint, variables: JointVariables) -> tuple[FloatArray, FloatArray]:
    """Return the torque of a parallel damper on the motors of a joint, and its rate, each (2, samples)."""
    damping, ddamping, dphi, ddtheta = (
        variables.damping,
        variables.ddamping,
        variables.dphi,
        variables.ddtheta,
    )
    torque, rate = np.zeros_like(dphi), np.zeros_like(dphi)
    for motor, has_spring in enumerate(joint.actuator.has_columns(VARIABLES["phi"])):
        if has_spring:
            torque[motor] = damping * dphi[motor]
            rate[motor] = ddamping * dphi[motor] + damping * (ddtheta[motor] - variables.ddq)
    return torque, rate


class ParallelDamperTorques(NamedTuple):
    """Torques of parallel dampers on the links, (..., joints), and against sprung motors, (..., springs)."""

    links: Scalar
    motors: Scalar


class Dampers:
    """The dampers of a robot's joints; commanded signals are (..., joints), by name."""

    def __init__(self, robot: Robot, drivetrain: Drivetrain) -> None:
        locations = [joint.damper and joint.damper.location for joint in robot.joints]
        self._is_between_links = np.array([location == "link" for location in locations])
        parallel = np.array([location == "transmission" for location in locations])
        has_deflection = drivetrain.of_motors(drivetrain.deflected)[drivetrain.sprung]
        self._joint_of_motor = drivetrain.spring_joint
        self._is_parallel = has_deflection & parallel[self._joint_of_motor]
        self._is_absent = np.array([location is None for location in locations])
        self._motor_joint_matrix = np.equal.outer(self._joint_of_motor, np.arange(len(locations))).astype(
            np.float64
        )

    def link_damper_torques(
        self, commanded: Mapping[str, FloatArray], dq: FloatArray, ddq: Scalar = 0, d3q: Scalar = 0
    ) -> TorqueDerivatives:
        """Return the torques of dampers between the links, with derivatives; exact zeros without dampers."""
        if not self._is_between_links.any():
            return TorqueDerivatives(0, 0, 0)
        d, d_d, dd_d = (np.where(self._is_between_links, commanded[name], 0.0) for name in DAMPING.names)
        return damper_torque((d, d_d, dd_d), (dq, ddq, d3q))

    def parallel_torques(
        self, commanded: Mapping[str, FloatArray], dq: FloatArray, dtheta: FloatArray
    ) -> ParallelDamperTorques:
        """Return the torques of dampers parallel to springs, from velocities of joints and sprung motors."""
        if not self._is_parallel.any():
            return ParallelDamperTorques(0, 0)
        damping = np.where(self._is_parallel, commanded[DAMPING.key][..., self._joint_of_motor], 0.0)
        motors: FloatArray = damping * (dtheta - dq[..., self._joint_of_motor])
        return ParallelDamperTorques(motors @ self._motor_joint_matrix, motors)

    def variables(
        self, commanded: Mapping[str, FloatArray], dq: FloatArray, dtheta: FloatArray
    ) -> dict[str, FloatArray]:
        """Return the result variables of the dampers by name, (..., joints); none if there are no dampers."""
        if self._is_absent.all():
            return {}
        damping = commanded[DAMPING.key]
        torque = add(
            self.link_damper_torques(commanded, dq).tau, self.parallel_torques(commanded, dq, dtheta).links
        )
        return {"damping": damping, "tau_damper": np.where(self._is_absent, np.nan, torque)}
