"""Derivatives of motor motion and torques by parameters of the actuator and by the torques of its link.

Solvers find deflections and the attainable stiffness from values only. Their result, not their iteration, is
differentiated by the implicit function theorem: from y(phi, p) = (tau_e, sigma) of (14) follows
A dphi = (dtau_e, dsigma) - dy/dp. At an end of the attainable range sigma is extreme along the curve of equal
tau_e, or one phi is at the end of its range; there sigma changes by the Lagrange multiplier of tau_e.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.elasticity import MotorMatrix
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.reach import margin
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.flags import MIN_MARGIN
from vsacli.compute.duals import Dual, seeds, tangent_of, value_of
from vsacli.dynamics.drive import drive_without_limits
from vsacli.dynamics.elastic_torques import TORQUES
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, seeded, with_copied_actuator

AT_END = 1e-9
"""Relative distance below which phi is at the end of its range."""


class _SpringSlopes(NamedTuple):
    """Derivatives of tau_e and sigma by phi, which are the rows of A, and by the directions at fixed phi.

    Attributes:
        torque, stiffness: derivatives by phi_1 and phi_2, (2, samples).
        of_torque, of_stiffness: derivatives by the directions, (directions, samples).
    """

    torque: FloatArray
    stiffness: FloatArray
    of_torque: FloatArray
    of_stiffness: FloatArray


class ImplicitSolution:
    """The solution of (14) for an actuator that carries derivatives.

    Args:
        actuator: actuator with plain parameters.
        carrying: same actuator with parameters that carry derivatives.
        directions: number of derivatives; the last ones are unused and serve phi.
    """

    def __init__(self, actuator: Actuator, carrying: Actuator, directions: int) -> None:
        self._actuator, self._seeded_actuator, self._directions = actuator, carrying, directions

    def solve(self, tau_e: Dual | FloatArray, stiffness: Dual | FloatArray, q: FloatArray) -> PairSolution:
        """Return the solution with derivatives, also of the attainable range; see `Actuator.solve`."""
        solution = self.solve_within(tau_e, stiffness, q)
        if self._actuator.motor_count == 1:
            return solution
        no_slack = np.zeros_like(solution.slack_below)
        fields: dict[str, Any] = {
            "lower": self._range_end(tau_e, solution.lower, solution.lower_critical, solution.slack_below, q),
            "upper": self._range_end(tau_e, solution.upper, solution.upper_critical, no_slack, q),
        }
        return solution._replace(**fields)

    def solve_within(
        self, tau_e: Dual | FloatArray, stiffness: Dual | FloatArray, q: FloatArray
    ) -> PairSolution:
        """Return the solution with derivatives of deflections only, for a constant attainable range."""
        solution = self._actuator.solve(value_of(tau_e), value_of(stiffness), q)
        slopes = self._spring_slopes(solution.deflections[: self._actuator.motor_count], q)
        torque_slopes = self._demand_slopes(tau_e, q) - slopes.of_torque
        stiffness_slopes = self._demand_slopes(stiffness, q) - slopes.of_stiffness
        if self._actuator.motor_count == 1:
            phi_dual: Any = self._dual(solution.phi_1, torque_slopes / slopes.torque[0])
            return solution._replace(phi_1=phi_dual)
        with np.errstate(invalid="ignore"):
            dphi_1, dphi_2 = MotorMatrix(*slopes.torque, *slopes.stiffness).solve(
                torque_slopes, stiffness_slopes
            )
        fields: dict[str, Any] = {
            "phi_1": self._dual(solution.phi_1, dphi_1),
            "phi_2": self._dual(solution.phi_2, dphi_2),
        }
        return solution._replace(**fields)

    def _demand_slopes(self, demand: Dual | FloatArray, q: FloatArray) -> FloatArray:
        """Return the derivatives of a demand in all directions, (directions, samples)."""
        return tangent_of(demand, self._directions, q.shape)

    def _spring_slopes(self, phi: FloatArray, q: FloatArray) -> _SpringSlopes:
        phi_start = self._directions - len(phi)
        deflections: Any = np.stack(seeds(phi, phi_start))  # type: ignore[arg-type]
        springs = self._seeded_actuator.springs(deflections, q)
        torque, stiffness = (
            tangent_of(each, self._directions, q.shape) for each in (springs.tau_e, springs.stiffness)
        )
        zeros = np.zeros((len(phi), *q.shape))
        by_directions = (np.concatenate((each[:phi_start], zeros)) for each in (torque, stiffness))
        return _SpringSlopes(torque[phi_start:], stiffness[phi_start:], *by_directions)

    def _range_end(
        self, tau_e: Dual | FloatArray, end: FloatArray, critical: BoolArray, slack: BoolArray, q: FloatArray
    ) -> Dual | FloatArray:
        """Return an end of the attainable range with derivatives, which are zero where it is unbounded.

        The end is a critical point, or a side goes slack there, or a phi is at the end of its range.
        """
        is_bounded = np.isfinite(end) & (end > 0)
        if not is_bounded.any():
            return end
        phi = self._actuator.solve(value_of(tau_e), np.where(is_bounded, end, np.nan), q).deflections
        slopes = self._spring_slopes(phi, q)
        pinned_motor, pinned_slopes = self._pinned_motors(phi)
        pinned_motor = np.where(slack, np.abs(phi[1]) < np.abs(phi[0]), pinned_motor)
        with np.errstate(divide="ignore", invalid="ignore"):
            multipliers = slopes.stiffness / slopes.torque
        first_is_larger = np.abs(slopes.torque[0]) >= np.abs(slopes.torque[1])
        first_free = np.where(critical, first_is_larger, pinned_motor == 1)
        multiplier = np.where(first_free, multipliers[0], multipliers[1])
        tangent = slopes.of_stiffness + multiplier * (self._demand_slopes(tau_e, q) - slopes.of_torque)
        fixed_motor = np.where(first_free, 1, 0)
        end_slope = (
            np.take_along_axis(slopes.stiffness, fixed_motor[None], 0)[0]
            - multiplier * (np.take_along_axis(slopes.torque, fixed_motor[None], 0)[0])
        )
        tangent = tangent + np.where(critical, 0.0, end_slope * pinned_slopes)
        return self._dual(end, np.where(is_bounded, tangent, 0.0))

    def _dual(self, value: FloatArray, derivatives: FloatArray) -> Dual:
        """Return a dual without the directions of phi, in which derivatives are zero, or NaN out of reach."""
        return Dual.of(value, derivatives[: self._directions - self._actuator.motor_count])

    def _pinned_motors(self, phi: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return which phi is at an end of its range, and the derivatives of that end by the directions."""
        samples = phi.shape[1:]
        pinned_motor = np.zeros(samples)
        end_slopes = np.zeros((self._directions, *samples))
        for motor, ends in enumerate(self._seeded_actuator.phi_ranges):
            for end in ends:
                is_at_end = np.abs(phi[motor] - value_of(end)) <= AT_END * (1 + np.abs(value_of(end)))
                pinned_motor = np.where(is_at_end, motor, pinned_motor)
                end_slopes = np.where(is_at_end, tangent_of(end, self._directions, samples), end_slopes)
        return pinned_motor, end_slopes


OF_MOTORS = ("tau_motor", "theta", "motor_power")
"""Differentiated variables of the motors."""

SPEED = "dtheta"
"""Variable whose sign determines dry friction; differentiated as well."""

MARGIN = "margin"
"""Name of the relative margin of the stiffness to the nearer end of its attainable range."""


class DriveDerivatives(NamedTuple):
    """Derivatives of the variables of a joint, by name: (..., 2, samples) of its motors, else (..., samples).

    Attributes:
        by_numbers: derivatives by the parameters of the actuator, (parameters, ...), per SI unit of each.
        by_torques: derivatives by tau_e, tau_e', tau_e'', (3, ...).
    """

    by_numbers: dict[str, FloatArray]
    by_torques: dict[str, FloatArray]


def drive_derivatives(
    robot: Robot, index: int, command: Command, chosen: Sequence[Parameter]
) -> DriveDerivatives:
    """Differentiate (61)-(74) of a joint.

    Derivatives are NaN where the variable does not exist, and where the decoupling matrix is singular.

    Args:
        robot: robot with the joint.
        index: index of the joint.
        command: command of the joint.
        chosen: parameters of its actuator.
    """
    parameter_count, motor_count = len(chosen), 2
    directions = parameter_count + len(TORQUES) + motor_count
    seeded_joint = with_copied_actuator(seeded(robot, chosen).joints[index])
    torques: dict[str, Any] = dict(
        zip(TORQUES, seeds([getattr(command, name) for name in TORQUES], parameter_count), strict=True)
    )
    implicit = ImplicitSolution(robot.joints[index].actuator, seeded_joint.actuator, directions)
    object.__setattr__(seeded_joint.actuator, "solve", implicit.solve)  # a search would lose the derivatives
    with np.errstate(invalid="ignore", divide="ignore"):
        drive_variables = drive_without_limits(seeded_joint, command._replace(**torques), MIN_MARGIN)
        joint_margin = margin(
            drive_variables.stiffness, drive_variables.stiffness_min, drive_variables.stiffness_max
        )
    variables = {name: getattr(drive_variables, name) for name in (*OF_MOTORS, SPEED)} | {
        MARGIN: joint_margin
    }
    tangents = {
        name: np.where(np.isnan(each), np.nan, tangent_of(each, directions, np.shape(each)))
        for name, each in variables.items()
    }
    return DriveDerivatives(
        {name: tangent[:parameter_count] for name, tangent in tangents.items()},
        {
            name: tangent[parameter_count : parameter_count + len(TORQUES)]
            for name, tangent in tangents.items()
        },
    )
