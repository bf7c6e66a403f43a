"""Springs with a parallel damper, as in CompAct: the torque on the link is tau_l = T(phi) + d w.

Here w is the velocity of the damper, the sum of theta_k' - q' over the motors with springs, and T the torque
of the springs. The motors' velocities follow from w and from the rate of the stiffness,

    [[b_1, b_2], [g_1, g_2]] (theta_1', theta_2') = (w + (b_1 + b_2) q', sigma' - sigma_q q')

with b_k = 1 if motor k has a spring, else 0, and g_k the derivative of sigma over theta_k; the accelerations
follow from the same matrix. It is singular where its determinant, the pivot b_1 g_2 - b_2 g_1, is zero, and
not where det A is. With one motor there is only the first row.

The spread is the sum of the deflections whose rate is w, and a state of the motion: spread' = (tau_l - T)/d.
At constant stiffness the derivative of that over the spread is -(det A/pivot)/d.
"""

from __future__ import annotations

import operator
from functools import reduce
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.elasticity import Components, ElasticState, MotorMatrix
from vsacli.actuators.reach import Reach, classify_stiffness
from vsacli.actuators.transmission import Command, InternalMotion, JointVariables
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.flags import SINGULAR_MARGIN, Flag, flags_where
from vsacli.base.signals import DAMPING, STIFFNESS
from vsacli.base.variables import VARIABLES

NEWTON_STEPS = 4
"""Newton steps: from a guess with an error of 1e-4, three converge to rounding; one more is for safety."""


CONTINUATION_STEPS = 200
"""Steps from the equilibrium to the start of the motion given in the robot file."""


class _DampedState(NamedTuple):
    """State of the springs at deflections.

    Attributes:
        state: Springs with their derivatives.
        spreading: Matrix that gives the motors' velocities from w and the rate of the stiffness; None if no
            stiffness is commanded.
    """

    state: ElasticState
    spreading: MotorMatrix | None

    @property
    def pivot(self) -> FloatArray:
        """Determinant of that matrix; 1 without one."""
        if self.spreading is None:
            return np.ones_like(self.state.tau_e)
        return self.spreading.determinant

    @property
    def slope(self) -> FloatArray:
        """dT/d(spread) at constant stiffness, det A/pivot: positive where the internal motion is stable."""
        return self.state.stiffness if self.spreading is None else self.state.determinant / self.divisor

    @property
    def divisor(self) -> FloatArray:
        """Pivot, NaN instead of zero."""
        return np.where(self.pivot == 0, np.nan, self.pivot)


class DampedSprings:
    """Springs of an actuator with a parallel damper.

    Deflections phi are (2, samples), values of motors (motors, samples), others (samples,).
    """

    def __init__(self, actuator: Actuator) -> None:
        self._actuator = actuator
        self._motor_count = actuator.motor_count
        self._stiffness_commanded = STIFFNESS.key in actuator.commanded
        self._has_spring = np.array(actuator.has_columns(VARIABLES["phi"])[: self._motor_count], dtype=float)

    def spread(self, phi: FloatArray) -> FloatArray:
        """Return the spread: the sum of the deflections parallel to the damper."""
        terms = [factor * row for factor, row in zip(self._has_spring, phi, strict=False)]
        return reduce(operator.add, terms)

    def slope(self, phi: FloatArray, q: FloatArray) -> FloatArray:
        """Return dT/d(spread) at constant stiffness: positive where the internal motion is stable."""
        return self.springs_at(phi, q).slope

    def laws_hold(self, phi: FloatArray) -> BoolArray:
        """Return where the springs' laws hold."""
        lowest, highest = np.array(self._actuator.phi_ranges).T[..., None]
        inside: BoolArray = (phi[: self._motor_count] >= lowest) & (phi[: self._motor_count] <= highest)
        return np.asarray(np.all(inside, axis=0))

    def deflections_at_spread(self, spread: FloatArray, phi: FloatArray, command: Command) -> FloatArray:
        """Return the deflections with a spread and the commanded stiffness near a guess; NaN if none."""
        spread_error = (spread - self.spread(phi)) / sum(self._has_spring)
        shares = zip_longest(phi, self._has_spring, fillvalue=0.0)
        phi = np.stack([row + spread_error * share for row, share in shares])
        if not self._stiffness_commanded:
            return phi
        stiffness = command.commanded[STIFFNESS.key]
        direction = self._rates_at_constant_spread(spread)
        for _ in range(NEWTON_STEPS):
            springs = self.springs_at(phi, command.q)
            phi = phi + direction * ((stiffness - springs.state.stiffness) / springs.divisor)
        stiffness_error = stiffness - self._elastic_state(phi, command.q).stiffness
        return np.where(np.abs(stiffness_error) < SINGULAR_MARGIN * stiffness, phi, np.nan)

    def equilibrium(self, command: Command, spread: float | None = None) -> FloatArray:
        """Return the deflections at which the springs carry the torque alone; or with a spread, if given."""
        if self._stiffness_commanded:
            phi = self._actuator.solve(command.tau_e, command.commanded[STIFFNESS.key], command.q).deflections
        else:
            phi = self._actuator.transmit(command, SINGULAR_MARGIN, None).phi
        if spread is None:
            return phi
        start_spread = self.spread(phi)
        for share in np.linspace(0, 1, CONTINUATION_STEPS + 1)[1:]:
            phi = self.deflections_at_spread(start_spread + (spread - start_spread) * share, phi, command)
        return phi

    def damper_motion(self, phi: FloatArray, command: Command) -> tuple[FloatArray, FloatArray]:
        """Return w = (tau_l - T)/d and w' = (tau_l' - d' w - T')/d at deflections."""
        damping, d_damping = (command.commanded[name] for name in DAMPING.names[:2])
        springs = self.springs_at(phi, command.q)
        velocity = (command.tau_e - springs.state.tau_e) / damping
        dtheta = self._motor_velocities(springs, velocity, command)
        rate = springs.state.torque_rate(self._coordinate_rates(command.dq, dtheta))
        return velocity, (command.dtau_e - d_damping * velocity - rate) / damping

    def transmit(self, command: Command, motion: InternalMotion, min_margin: float) -> JointVariables:
        """Compute stiffness, motor motion and spring torques of an internal motion; see `Actuator.transmit`.

        The attainable range is that at the springs' torque. A sample is singular where the pivot is zero, not
        where det A is; INTERNAL_INSTABILITY is set where the slope is not positive.
        """
        phi = self.deflections_at_spread(self.spread(motion.phi), motion.phi, command)
        _, rate, acceleration = motion
        if rate is None or acceleration is None:
            rate, acceleration = self.damper_motion(phi, command)
        springs = self.springs_at(phi, command.q)
        lower, upper, reach = self._attainable_range_and_reach(springs, phi, command, min_margin)
        velocity = np.where(reach.singular | reach.infeasible, np.nan, rate)
        dtheta = self._motor_velocities(springs, velocity, command)
        rates = self._coordinate_rates(command.dq, dtheta)
        ddtheta = self._motor_accelerations(springs, acceleration, rates, command)
        absent = np.full_like(command.q, np.nan)

        def mask_infeasible(values: Components) -> FloatArray:
            rows = [values[0], values[1] if self._motor_count > 1 else absent]
            return np.where(reach.infeasible, np.nan, np.stack(rows))

        unstable = ~reach.infeasible & ~(springs.slope > 0)
        has_spring = self._has_spring[:, None] > 0
        stiffness = zip(
            STIFFNESS.names, self._stiffness_derivatives(springs, rates, ddtheta, command), strict=True
        )
        return command.variables()._replace(
            **dict(stiffness),
            phi=np.where(has_spring, mask_infeasible(phi), np.nan),
            dphi=np.where(has_spring, mask_infeasible(rates), np.nan),
            theta=mask_infeasible(self._motor_positions(phi, command.q)),
            dtheta=mask_infeasible(dtheta),
            ddtheta=mask_infeasible(ddtheta),
            tau_transmission=mask_infeasible(springs.state.tau_transmission),
            elastic_energy=np.where(reach.infeasible, np.nan, springs.state.energy),
            det_A=np.where(reach.infeasible, np.nan, springs.state.determinant),
            stiffness_min=lower,
            stiffness_max=upper,
            flags=reach.flags | flags_where(Flag.INTERNAL_INSTABILITY, unstable),
        )

    def _attainable_range_and_reach(
        self, springs: _DampedState, phi: FloatArray, command: Command, min_margin: float
    ) -> tuple[FloatArray, FloatArray, Reach]:
        """Return minimum and maximum stiffness at the torque of the springs, and the reach of the samples."""
        is_lost, absent = ~np.isfinite(phi[0]), np.full_like(command.q, np.nan)
        nowhere = np.zeros_like(is_lost)
        if not self._stiffness_commanded:
            return absent, absent, Reach(is_lost, nowhere, nowhere, nowhere)
        stiffness = command.commanded[STIFFNESS.key]
        solution = self._actuator.solve(springs.state.tau_e, stiffness, command.q)
        reach = classify_stiffness(stiffness, solution, min_margin)
        margin = self._distance_from_extremum(springs, stiffness)
        return (
            solution.lower,
            solution.upper,
            Reach(
                infeasible=reach.infeasible | is_lost,
                slack=reach.slack,
                singular=margin <= SINGULAR_MARGIN,
                near_singular=(margin > SINGULAR_MARGIN) & (margin < min_margin),
            ),
        )

    def _distance_from_extremum(self, springs: _DampedState, stiffness: FloatArray) -> FloatArray:
        """Return the distance of the stiffness from its extremum at the same spread, relative to itself."""
        curvature = springs.state.stiffness_curvature(
            self._coordinate_rates(0 * stiffness, self._rates_at_constant_spread(stiffness))
        )
        divisor = 2 * stiffness * np.abs(curvature)
        return springs.pivot * springs.pivot / np.where(divisor > 0, divisor, np.nan)

    def _rates_at_constant_spread(self, samples: FloatArray) -> FloatArray:
        """Return motor velocities that leave the spread unchanged, (motors, samples)."""
        return np.stack((0 * samples - self._has_spring[1], 0 * samples + self._has_spring[0]))

    def _motor_velocities(self, springs: _DampedState, velocity: FloatArray, command: Command) -> FloatArray:
        rates_at_rest = self._coordinate_rates(command.dq, np.zeros((self._motor_count, 1)) * command.dq)
        rate = command.commanded[STIFFNESS.names[1]] - springs.state.stiffness_rate(rates_at_rest)
        return self._solve_motor_rows(springs, velocity + sum(self._has_spring) * command.dq, rate)

    def _motor_accelerations(
        self, springs: _DampedState, acceleration: FloatArray, rates: Components, command: Command
    ) -> FloatArray:
        acceleration_rates = self._coordinate_rates(
            command.ddq, np.zeros((self._motor_count, 1)) * command.ddq
        )
        state = springs.state
        bias = state.stiffness_curvature(rates) + state.stiffness_rate(acceleration_rates)
        remainder = command.commanded[STIFFNESS.names[2]] - bias
        return self._solve_motor_rows(springs, acceleration + sum(self._has_spring) * command.ddq, remainder)

    def _solve_motor_rows(
        self, springs: _DampedState, spread_row: FloatArray, stiffness_row: FloatArray
    ) -> FloatArray:
        """Return the solution of both rows; of the first alone if there is one motor."""
        if springs.spreading is None:
            return spread_row[None]
        return np.stack(springs.spreading.solve(spread_row, stiffness_row))

    def _stiffness_derivatives(
        self, springs: _DampedState, rates: Components, ddtheta: FloatArray, command: Command
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the commanded stiffness, or that of the springs, with its derivatives."""
        if self._stiffness_commanded:
            stiffness, rate, acceleration = (command.commanded[name] for name in STIFFNESS.names)
            return stiffness, rate, acceleration
        state, acceleration_rates = springs.state, self._coordinate_rates(command.ddq, ddtheta)
        acceleration = state.stiffness_curvature(rates) + state.stiffness_rate(acceleration_rates)
        return state.stiffness, state.stiffness_rate(rates), acceleration

    def springs_at(self, phi: FloatArray, q: FloatArray) -> _DampedState:
        """Return the state of the springs at deflections and joint positions."""
        state = self._elastic_state(phi, q)
        if not self._stiffness_commanded:
            return _DampedState(state, None)
        (spread_1, spread_2), decoupling_matrix = self._has_spring, state.matrix
        return _DampedState(
            state,
            MotorMatrix(spread_1, spread_2, decoupling_matrix.stiffness_1, decoupling_matrix.stiffness_2),
        )

    def _elastic_state(self, phi: FloatArray, q: FloatArray) -> ElasticState:
        theta = self._motor_positions(phi, q)
        return self._actuator.springs(self._actuator.unknowns(theta - q, theta), q)

    def _motor_positions(self, phi: FloatArray, q: FloatArray) -> FloatArray:
        return self._actuator.motor_positions(phi[: self._motor_count], q)

    def _coordinate_rates(self, dq: FloatArray, dtheta: FloatArray) -> Components:
        """Return the rates of the coordinates of the springs from velocities of joint and motors."""
        return *self._actuator.unknowns(dtheta - dq, dtheta), dq
