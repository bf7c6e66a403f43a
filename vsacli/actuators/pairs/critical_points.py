"""Critical points of the joint stiffness: how they move with the elastic torque, and steps towards one."""

from __future__ import annotations

import numpy as np

from vsacli.actuators.pairs.balance import Balance, PairState
from vsacli.actuators.pairs.bracketing import bracketed_root
from vsacli.actuators.pairs.decoupling_matrix import Sides
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values

SHORT_RTOL = 2e-5
"""Relative distance to a critical point of which one step leaves rounding only.

It squares the distance along the curve of equal tau_e, of which the stiffness has the square again; of the
torque balance it leaves the fourth power. The stiffness after the step lacks the third power, a hundredth or
so of it: with measured springs, the worst by trial, 1e-14 from this distance, 2e-13 from 5e-5.
"""


def along_critical_curve(state: PairState, rho: Sides) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of phi_1 and phi_2 over tau_e where rho_1 - rho_2 is kept, and their common divisor."""
    one, two = state.one, state.two
    rho_1, rho_2 = rho
    slope_1, slope_2 = one.eta / one.sigma - rho_1 * rho_1, two.eta / two.sigma - rho_2 * rho_2
    divisor = one.sigma * slope_2 + two.sigma * slope_1
    return slope_2 / divisor, slope_1 / divisor, divisor


def newton_step(state: PairState, rho: Sides, tau_e: FloatArray) -> Sides:
    """A Newton step on tau_1 + tau_2 = tau_e, rho_1 = rho_2, which keeps the first to the third order.

    Both sides alike make up for the bend of the springs, since next to a cusp the critical curve does not.
    """
    one, two = state.one, state.two
    (rho_1, rho_2), (along_1, along_2, divisor) = rho, along_critical_curve(state, rho)
    torque, apart = tau_e - state.torque, (rho_1 - rho_2) / divisor
    step_1, step_2 = torque * along_1 - apart * two.sigma, torque * along_2 + apart * one.sigma
    stiffness = state.stiffness + one.zeta * step_1 + two.zeta * step_2
    shift = state.linearization_error(step_1, step_2) / stiffness
    return step_1 - shift, step_2 - shift


def is_short(state: PairState, rho: Sides, steps: Sides) -> BoolArray:
    """Whether a step is so short that the next would be rounding."""
    (rho_1, rho_2), (size_1, size_2) = rho, map(np.abs, steps)
    hardened = np.abs(rho_1) * size_1 + np.abs(rho_2) * size_2
    short: BoolArray = (hardened <= SHORT_RTOL) & (
        size_1 + size_2 <= SHORT_RTOL * (np.abs(state.phi_1) + np.abs(state.phi_2))
    )
    return short


def bracketed_in_box(balance: Balance, tau_e: FloatArray, *box: FloatArray) -> Values:
    """The critical point within a box by bracketing the preload torque.

    Args:
        balance: the springs.
        tau_e: elastic torque.
        *box: smallest and largest phi_1, smallest and largest phi_2, between which there is one.
    """
    low_1, high_1, low_2, high_2 = box
    at_least, at_most = balance.state(low_1, high_2), balance.state(high_1, low_2)
    least = np.maximum(at_least.one.tau, tau_e - at_least.two.tau) - tau_e / 2
    largest = np.minimum(at_most.one.tau, tau_e - at_most.two.tau) - tau_e / 2

    def slope(t: FloatArray, tau_e: FloatArray) -> FloatArray:
        return balance.stiffness_slope(*balance.deflections_at(tau_e, t))

    t = bracketed_root(slope, least, largest, (tau_e,))
    return balance.deflections_at(tau_e, t)
