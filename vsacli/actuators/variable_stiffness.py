"""Actuators with two motors and a commanded stiffness: their part of the inverse dynamics, (14), (61)-(72).

The springs differ between the kinds, the path does not. The unknowns of (14) are one per motor: deflections
phi_1 and phi_2 of an antagonistic pair, deflection phi and setting theta_2 of a serial actuator.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.motor import Motor
from vsacli.actuators.reach import deflections_within_reach
from vsacli.actuators.transmission import Command, JointVariables
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS


class VariableStiffness(Actuator):
    """Two motors that move the link and set its stiffness through springs.

    Attributes:
        motor: Motors 1 and 2; a declared field of each kind.
    """

    motor: tuple[Motor, Motor]
    motor_count = 2
    commanded = (STIFFNESS.key,)

    @abstractmethod
    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """See `Actuator.solve`."""

    def deflections(self, unknowns: FloatArray) -> FloatArray:
        """Return phi, (2, samples), from the unknowns, or its rates; NaN for a motor without a deflection."""
        return unknowns

    def transmit(self, command: Command, min_margin: float, prescribed: FloatArray | None) -> JointVariables:
        """Compute deflections on the actuator's branch, motion of the motors, and torques of the springs.

        NaN at infeasible samples; rates and accelerations, which need A^-1, also at singular ones. See
        `Actuator.transmit`.
        """
        stiffness, dstiffness, ddstiffness = (command.commanded[name] for name in STIFFNESS.names)
        solution = self.solve(command.tau_e, stiffness, command.q)  # (14)
        unknowns, reach = deflections_within_reach(stiffness, solution, min_margin, prescribed)  # (61)
        # (62)-(64), (66); `springs.matrix` is A with its determinant (67). Unknowns of a pair: phi_1, phi_2.
        springs = self.springs(unknowns, command.q)
        rates = np.stack(springs.rates(command.dtau_e, dstiffness, command.dq))  # (68)
        rates = np.where(reach.singular, np.nan, rates)
        ddtheta = springs.motor_accelerations(rates, command.ddq, command.ddtau_e, ddstiffness)  # (70)-(72)
        return command.variables()._replace(
            phi=self.deflections(unknowns),
            dphi=self.deflections(rates),
            theta=self.motor_positions(unknowns, command.q),  # theta = phi + q
            dtheta=self.motor_positions(rates, command.dq),  # its rate, (69)
            ddtheta=np.stack(ddtheta),
            tau_transmission=np.stack(springs.tau_transmission),  # (62)
            elastic_energy=springs.energy,
            det_A=springs.determinant,  # (67)
            stiffness_min=solution.lower,
            stiffness_max=solution.upper,
            flags=reach.flags,
        )
