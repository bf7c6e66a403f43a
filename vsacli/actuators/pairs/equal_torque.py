"""The joint stiffness along the curve of equal tau_e, taken for quadratic: first guess and step of (14)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.pairs.balance import PairState
from vsacli.actuators.pairs.decoupling_matrix import Sides
from vsacli.base.arrays import FloatArray

MAX_CORRECTION_SHARE = 0.25
"""Largest share of the spread by which the curve of equal tau_e is taken to leave its tangent.

By trial with pairs of every law: between a tenth and a half the number of steps is about the same, and with
more of it more samples end in bracketing."""

QUARTIC_COEFFICIENT, MAX_SQUARED_ARGUMENT = 0.025, 3.0
"""How much faster than as cosh springs stiffen, and up to which square of its argument.

By trial with pairs of every law: without it, more steps are taken and more samples end in bracketing."""

MIN_SCALE_SHARE = 1e-4
"""Share of the demand below which the stiffness at the inner end is no scale for it."""


class StiffnessParabola(NamedTuple):
    """The stiffness along the curve of equal tau_e, over the spread phi_1 - phi_2; arrays (samples,).

    Attributes:
        stiffness: the stiffness itself.
        shift_slope: its relative slope where both sides move up alike.
        share_1: of the spread, what side 1 moves up.
        share_2: what side 2 moves down.
        slope: first derivative of the stiffness.
        curvature: second derivative.
    """

    stiffness: FloatArray
    shift_slope: FloatArray
    share_1: FloatArray
    share_2: FloatArray
    slope: FloatArray
    curvature: FloatArray

    @classmethod
    def of(cls, state: PairState) -> StiffnessParabola:
        """The parabola that touches the stiffness at deflections."""
        one, two = state.one, state.two
        stiffness = state.stiffness
        share_1, share_2 = two.sigma / stiffness, one.sigma / stiffness
        shift_slope = (one.zeta + two.zeta) / stiffness
        return cls(
            stiffness,
            shift_slope,
            share_1,
            share_2,
            slope=one.zeta * share_1 - two.zeta * share_2,
            curvature=(one.eta - shift_slope * one.zeta) * share_1 * share_1
            + (two.eta - shift_slope * two.zeta) * share_2 * share_2,
        )

    def slope_sum(self, growth: FloatArray, sign: FloatArray) -> FloatArray:
        """Sum of the slopes before and after a growth of the stiffness, which is half of it times the spread.

        The sign is that of the slopes.
        """
        squared = self.slope * self.slope + 2 * self.curvature * growth
        return self.slope + sign * np.sqrt(np.maximum(squared, 0))


def first_guess(inner: PairState, inner_stiffness: FloatArray, demand: FloatArray, sign: FloatArray) -> Sides:
    """Deflections for a demand, as the stiffness grows from the inner end on.

    Args:
        inner: springs at the inner end.
        inner_stiffness: joint stiffness there, NaN where tau_e cannot be carried.
        demand: joint stiffness demanded.
        sign: 1 where the stiffness increases with the preload, else -1.
    """
    inner = inner.regularized()
    scale = np.maximum(inner_stiffness, MIN_SCALE_SHARE * demand)
    excess = scale * _quadratic_part(sign * (demand - inner_stiffness) / scale)
    parabola = StiffnessParabola.of(inner)
    spread = np.where(excess > 0, 2 * sign * excess / parabola.slope_sum(sign * excess, sign), 0.0)
    step_1, step_2 = parabola.share_1 * spread, -parabola.share_2 * spread
    correction = _correction(inner, step_1, step_2, spread, demand)
    return inner.phi_1 + step_1 + correction, inner.phi_2 + step_2 + correction


def _quadratic_part(excess: FloatArray) -> FloatArray:
    """The part of an excess of stiffness, relative to the inner end, that the curvature there makes.

    If the stiffness grows as cosh it is acosh(1 + excess)^2/2; many springs stiffen still faster.
    """
    excess = np.maximum(excess, 0)
    argument = np.log1p(excess + np.sqrt(excess * (excess + 2)))
    squared = argument * argument
    part: FloatArray = squared * (0.5 - QUARTIC_COEFFICIENT * np.minimum(squared, MAX_SQUARED_ARGUMENT))
    return part


def third_order_step(
    state: PairState, tau_e: FloatArray, demand: FloatArray, sign: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Steps of phi_1 and phi_2 to tau_e and to the demand, and the relative error that they leave."""
    parabola = StiffnessParabola.of(state)
    missing, unbalanced = demand - parabola.stiffness, tau_e - state.torque
    shift, growth = unbalanced / parabola.stiffness, missing - parabola.shift_slope * unbalanced
    slope_sum = parabola.slope_sum(growth, sign)
    spread = 2 * growth / slope_sum
    step_1, step_2 = shift + parabola.share_1 * spread, shift - parabola.share_2 * spread
    correction = _correction(state, step_1, step_2, spread, demand)
    shift_size, missing_share = np.abs(shift), np.abs(missing) / demand
    shift_share = shift_size / (np.abs(state.phi_1) + np.abs(state.phi_2))
    change = (
        np.abs(parabola.curvature / slope_sum) * (np.abs(spread) + shift_size) + missing_share + shift_share
    )
    error = change * (change * missing_share + shift_share)
    return step_1 + correction, step_2 + correction, error


def _correction(
    state: PairState, step_1: FloatArray, step_2: FloatArray, spread: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """A further step of both sides alike, from the tangent to the curve of equal tau_e."""
    most = MAX_CORRECTION_SHARE * np.abs(spread)
    return np.minimum(np.maximum(-state.linearization_error(step_1, step_2) / stiffness, -most), most)
