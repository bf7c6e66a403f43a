"""Feedback linearization of joints with springs, III-C and IV-C: (32)-(35), (60), (69)-(74)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.pairs.decoupling_matrix import beta, determinant, solve
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.base.wrench import Wrench
from vsacli.control.gains import Gains
from vsacli.control.linear_control import Integral, linear_control
from vsacli.dynamics.forward import Plant
from vsacli.trajectory.motion import Motion


class LinkMotion(NamedTuple):
    """What the state says about the links, each ([samples,] joints).

    The stiffness of an elastic joint is its constant, with derivative zero.
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
    ) -> FloatArray:
        """Motor torques, (..., motors); NaN at a joint whose A is singular."""
        springs, dphi = self._springs(q, dq, theta, dtheta)
        link = self._link_motion(q, dq, springs, dphi, reference.wrench)
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
        ddtheta = self._motor_acceleration(springs, dphi, link, ddtau_e, v_sigma)
        drivetrain = self._plant.drivetrain
        return drivetrain.inertia * ddtheta + drivetrain.damping * dtheta + springs.tau  # (73)-(74)

    def link_motion(
        self, q: FloatArray, dq: FloatArray, theta: FloatArray, dtheta: FloatArray, wrench: Wrench | None
    ) -> LinkMotion:
        """What the state says about the links."""
        return self._link_motion(q, dq, *self._springs(q, dq, theta, dtheta), wrench)

    def _springs(
        self, q: FloatArray, dq: FloatArray, theta: FloatArray, dtheta: FloatArray
    ) -> tuple[SpringState, FloatArray]:
        """The springs, and phi' by (69)."""
        springs = self._plant.drivetrain.springs(self._plant.deflections(q, theta))
        return springs, self._plant.deflections(dq, dtheta)

    def _link_motion(
        self, q: FloatArray, dq: FloatArray, springs: SpringState, dphi: FloatArray, wrench: Wrench | None
    ) -> LinkMotion:
        chain, total = self._plant.chain, self._plant.drivetrain.joint_sum
        tau_e, dtau_e = total(springs.tau), total(springs.sigma * dphi)  # (6), (17)
        matrix = chain.mass_matrix(q)
        ddq = chain.solve(matrix, tau_e - chain.bias(q, dq, wrench))  # (34)
        d3q = chain.solve(matrix, dtau_e - chain.torque_rate(q, dq, ddq, wrench))  # (35)
        return LinkMotion(
            tau_e, dtau_e, ddq, d3q, total(springs.sigma), total(springs.zeta * dphi)
        )  # (11), (18)

    def _motor_acceleration(
        self,
        springs: SpringState,
        dphi: FloatArray,
        link: LinkMotion,
        ddtau_e: FloatArray,
        ddsigma: FloatArray,
    ) -> FloatArray:
        """Motor accelerations by (70)-(72), (..., springs); of a single, linear spring by (70) alone."""
        drivetrain = self._plant.drivetrain
        first, second, single = drivetrain.first, drivetrain.second, drivetrain.single
        of_pair, of_single = drivetrain.spring_joint[first], drivetrain.spring_joint[single]
        one, two, alone = springs.take(first), springs.take(second), springs.take(single)

        det_a = determinant(one, two)  # (67)
        divisor = np.where(det_a == 0, np.nan, det_a)
        accelerating = beta(
            one,
            two,
            (dphi[..., first], dphi[..., second]),
            ddtau_e[..., of_pair],
            ddsigma[..., of_pair],
            link.ddq[..., of_pair],
        )
        ddtheta = np.empty_like(dphi)
        ddtheta[..., first], ddtheta[..., second] = solve(one, two, divisor, *accelerating)  # (72)
        ddtheta[..., single] = ddtau_e[..., of_single] / alone.sigma + link.ddq[..., of_single]
        return ddtheta
