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
        self._actuator, self._carrying, self._directions = actuator, carrying, directions

    def solve(self, tau_e: Dual | FloatArray, stiffness: Dual | FloatArray, q: FloatArray) -> PairSolution:
        """Return the solution with derivatives, also of the attainable range; see `Actuator.solve`."""
        found = self.solve_within(tau_e, stiffness, q)
        if self._actuator.motor_count == 1:
            return found
        never = np.zeros_like(found.slack_below)
        derived: dict[str, Any] = {
            "lower": self._end(tau_e, found.lower, found.lower_critical, found.slack_below, q),
            "upper": self._end(tau_e, found.upper, found.upper_critical, never, q),
        }
        return found._replace(**derived)

    def solve_within(
        self, tau_e: Dual | FloatArray, stiffness: Dual | FloatArray, q: FloatArray
    ) -> PairSolution:
        """Return the solution with derivatives of deflections only, for a constant attainable range."""
        found = self._actuator.solve(value_of(tau_e), value_of(stiffness), q)
        slopes = self._slopes(found.deflections[: self._actuator.motor_count], q)
        torque = self._all(tau_e, q) - slopes.of_torque
        change = self._all(stiffness, q) - slopes.of_stiffness
        if self._actuator.motor_count == 1:
            alone: Any = self._dual(found.phi_1, torque / slopes.torque[0])
            return found._replace(phi_1=alone)
        with np.errstate(invalid="ignore"):
            dphi_1, dphi_2 = MotorMatrix(*slopes.torque, *slopes.stiffness).solve(torque, change)
        derived: dict[str, Any] = {
            "phi_1": self._dual(found.phi_1, dphi_1),
            "phi_2": self._dual(found.phi_2, dphi_2),
        }
        return found._replace(**derived)

    def _all(self, demanded: Dual | FloatArray, q: FloatArray) -> FloatArray:
        """Return the derivatives of a demand in all directions, (directions, samples)."""
        return tangent_of(demanded, self._directions, q.shape)

    def _slopes(self, phi: FloatArray, q: FloatArray) -> _SpringSlopes:
        last = self._directions - len(phi)
        deflections: Any = np.stack(seeds(phi, last))  # type: ignore[arg-type]
        springs = self._carrying.springs(deflections, q)
        torque, stiffness = (
            tangent_of(each, self._directions, q.shape) for each in (springs.tau_e, springs.stiffness)
        )
        none = np.zeros((len(phi), *q.shape))
        by_directions = (np.concatenate((each[:last], none)) for each in (torque, stiffness))
        return _SpringSlopes(torque[last:], stiffness[last:], *by_directions)

    def _end(
        self, tau_e: Dual | FloatArray, end: FloatArray, critical: BoolArray, slack: BoolArray, q: FloatArray
    ) -> Dual | FloatArray:
        """Return an end of the attainable range with derivatives, which are zero where it is unbounded.

        The end is a critical point, or a side goes slack there, or a phi is at the end of its range.
        """
        bounded = np.isfinite(end) & (end > 0)
        if not bounded.any():
            return end
        phi = self._actuator.solve(value_of(tau_e), np.where(bounded, end, np.nan), q).deflections
        slopes = self._slopes(phi, q)
        pinned, by_pinned = self._pinned(phi)
        pinned = np.where(slack, np.abs(phi[1]) < np.abs(phi[0]), pinned)
        with np.errstate(divide="ignore", invalid="ignore"):
            multipliers = slopes.stiffness / slopes.torque
        larger = np.abs(slopes.torque[0]) >= np.abs(slopes.torque[1])
        first_free = np.where(critical, larger, pinned == 1)
        multiplier = np.where(first_free, multipliers[0], multipliers[1])
        tangent = slopes.of_stiffness + multiplier * (self._all(tau_e, q) - slopes.of_torque)
        fixed = np.where(first_free, 1, 0)
        at_end = (
            np.take_along_axis(slopes.stiffness, fixed[None], 0)[0]
            - multiplier * (np.take_along_axis(slopes.torque, fixed[None], 0)[0])
        )
        tangent = tangent + np.where(critical, 0.0, at_end * by_pinned)
        return self._dual(end, np.where(bounded, tangent, 0.0))

    def _dual(self, value: FloatArray, derivatives: FloatArray) -> Dual:
        """Return a dual without the directions of phi, in which derivatives are zero, or NaN out of reach."""
        return Dual.of(value, derivatives[: self._directions - self._actuator.motor_count])

    def _pinned(self, phi: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return which phi is at an end of its range, and the derivatives of that end by the directions."""
        samples = phi.shape[1:]
        pinned = np.zeros(samples)
        moved = np.zeros((self._directions, *samples))
        for motor, ends in enumerate(self._carrying.phi_ranges):
            for end in ends:
                there = np.abs(phi[motor] - value_of(end)) <= AT_END * (1 + np.abs(value_of(end)))
                pinned = np.where(there, motor, pinned)
                moved = np.where(there, tangent_of(end, self._directions, samples), moved)
        return pinned, moved


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
    numbers, motors = len(chosen), 2
    directions = numbers + len(TORQUES) + motors
    carrying = with_copied_actuator(seeded(robot, chosen).joints[index])
    torques: dict[str, Any] = dict(
        zip(TORQUES, seeds([getattr(command, name) for name in TORQUES], numbers), strict=True)
    )
    implicit = ImplicitSolution(robot.joints[index].actuator, carrying.actuator, directions)
    object.__setattr__(carrying.actuator, "solve", implicit.solve)  # a search would lose the derivatives
    with np.errstate(invalid="ignore", divide="ignore"):
        driven = drive_without_limits(carrying, command._replace(**torques), MIN_MARGIN)
        gap = margin(driven.stiffness, driven.stiffness_min, driven.stiffness_max)
    found = {name: getattr(driven, name) for name in (*OF_MOTORS, SPEED)} | {MARGIN: gap}
    tangents = {
        name: np.where(np.isnan(each), np.nan, tangent_of(each, directions, np.shape(each)))
        for name, each in found.items()
    }
    return DriveDerivatives(
        {name: tangent[:numbers] for name, tangent in tangents.items()},
        {name: tangent[numbers : numbers + len(TORQUES)] for name, tangent in tangents.items()},
    )
