"""Feedback linearization of joints with springs, III-C and IV-C: (32)-(35), (60), (69)-(74)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from vsacli.actuators.drivetrain import DrivetrainState
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.base.wrench import Wrench
from vsacli.compute.vector import add
from vsacli.control.gains import Gains, Integral, linear_control
from vsacli.dynamics.forward import Plant
from vsacli.trajectory.motion import Motion


class LinkMotion(NamedTuple):
    """What the state says about the links, each ([samples,] joints).

    The stiffness of an elastic joint is that of its spring.
    """

    tau_e: FloatArray
    dtau_e: FloatArray
    ddq: FloatArray
    d3q: FloatArray
    stiffness: FloatArray
    dstiffness: FloatArray


class Decoupling:
    """The law for a robot all of whose motors act through springs.

    States are without the entries of absent motors, as in `Plant`.
    """

    def __init__(self, plant: Plant, gains: Gains) -> None:
        self._plant = plant
        self._gains = gains

    def torque(
        self,
        q: FloatArray,
        dq: FloatArray,
        theta: FloatArray,
        dtheta: FloatArray,
        reference: Motion,
        integral: Integral,
        slip: FloatArray | None = None,
    ) -> FloatArray:
        """Motor torques, (..., motors); NaN at a joint whose A is singular.

        Friction is compensated by the velocities of the motors; where it is sharp by their direction `slip`,
        (motors,), if that is given, and not at all at rest.
        """
        drivetrain = self._plant.drivetrain
        springs = drivetrain.state(q, theta, dq, dtheta)
        link = self._link_motion(q, dq, springs, reference.wrench, reference.commanded)
        v_q = linear_control(  # (32a)
            (reference.q, reference.dq, reference.ddq, reference.d3q, reference.d4q),
            (q, dq, link.ddq, link.d3q),
            self._gains.position, self._gains.position_integral, integral.q,
        )  # fmt: skip
        v_sigma = linear_control(  # (32b)
            tuple(reference.commanded[name] for name in STIFFNESS.names),
            (link.stiffness, link.dstiffness),
            self._gains.stiffness, self._gains.stiffness_integral, integral.stiffness,
        )  # fmt: skip
        ddtau_e = self._plant.chain.torque_acceleration(  # (60)
            q, dq, link.ddq, link.d3q, v_q, reference.wrench
        )
        dampers = self._plant.dampers.of_links(reference.commanded, dq, link.ddq, link.d3q)
        ddtau_e = add(ddtau_e, dampers.ddtau)
        ddtheta = springs.motor_accelerations(link.ddq, ddtau_e, v_sigma)
        of_rotors = drivetrain.rotors.torques(ddtheta)
        torque = of_rotors + drivetrain.damping * dtheta + springs.tau_spring  # (73)-(74)
        friction = drivetrain.friction
        return torque if friction is None else torque + friction.torque(dtheta, slip)

    def link_motion(
        self,
        q: FloatArray,
        dq: FloatArray,
        theta: FloatArray,
        dtheta: FloatArray,
        wrench: Wrench | None,
        commanded: Mapping[str, FloatArray] = MappingProxyType({}),
    ) -> LinkMotion:
        """What the state says about the links, under a wrench and the damping that is commanded."""
        return self._link_motion(q, dq, self._plant.drivetrain.state(q, theta, dq, dtheta), wrench, commanded)

    def _link_motion(
        self,
        q: FloatArray,
        dq: FloatArray,
        springs: DrivetrainState,
        wrench: Wrench | None,
        commanded: Mapping[str, FloatArray],
    ) -> LinkMotion:
        chain, tau_e, dtau_e = self._plant.chain, springs.tau_e, springs.dtau_e
        matrix = chain.mass_matrix(q)
        dampers = self._plant.dampers
        bias = add(chain.bias(q, dq, wrench), dampers.of_links(commanded, dq).tau)
        ddq = chain.solve(matrix, tau_e - bias)  # (34)
        rate = add(chain.torque_rate(q, dq, ddq, wrench), dampers.of_links(commanded, dq, ddq).dtau)
        d3q = chain.solve(matrix, dtau_e - rate)  # (35)
        return LinkMotion(tau_e, dtau_e, ddq, d3q, springs.stiffness, springs.dstiffness)
