"""Critical points of the joint stiffness over the preload, at which rho_1 = rho_2 and A is singular.

They lie on curves of equal relative hardening. `critical_curves` samples these for a pair of springs;
`newton_step` and `bracketed_in_box` find the point at one elastic torque.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.pairs.balance import Balance, PairState, Sides
from vsacli.actuators.pairs.bracketing import bracketed_root
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.compute.control_flow import Values

SAMPLED_TORQUES = np.concatenate((np.geomspace(1e-14, 1e14, 281), np.geomspace(1e15, 1e120, 106)))
"""Torques, N m, at which a spring with unbounded domain is sampled: ten per decade where it has features."""

SAMPLED_SHARES = np.concatenate(
    (
        np.geomspace(1e-12, 0.01, 100),
        np.linspace(0.01, 0.99, 400)[1:-1],
        1 - np.geomspace(0.01, 1e-9, 70),
        [1.0],
    )
)
"""Shares of the largest deflection at which a spring with bounded domain is sampled; a measured curve has
some dozen features."""

PEAK_SHARES = np.geomspace(1e-4, 0.5, 16)
"""Further samples next to a peak, as shares of the distance to the adjacent nodes."""

PEAK_RTOL = 1e-13
"""Largest relative change of the hardening, over a doubling of the deflection, that may be rounding."""

CUSP_RTOL = 1e-11
"""Smallest relative change of tau_e between adjacent points of a curve that is not rounding next to a peak.

Two folds that are closer than that differ in stiffness, to the fourth order of their distance, by rounding.
"""


@dataclass(frozen=True)
class Hardening:
    """Relative hardening rho = zeta/sigma of a spring over positive torques; arrays (nodes,), ascending.

    Attributes:
        law: Spring law.
        phi: Deflections, rad (m).
        rho: Relative hardening.
        peaks: Indices of the local extrema of rho.
    """

    law: SpringLaw
    phi: FloatArray
    rho: FloatArray
    peaks: IndexArray

    def pieces(self) -> Iterator[slice]:
        """Yield the nodes of each monotone piece; adjacent pieces share the node at the peak."""
        bounds = [0, *self.peaks.tolist(), len(self.phi) - 1]
        for first, last in pairwise(bounds):
            yield slice(first, last + 1)

    def rises(self, piece: slice) -> bool:
        """Return whether the hardening increases over a piece."""
        rho = self.rho[piece]
        return bool(rho[-1] >= rho[0])


class CriticalCurve(NamedTuple):
    """Critical points along a curve of equal hardening, in order; arrays (points,)."""

    phi_1: FloatArray
    phi_2: FloatArray
    tau_1: FloatArray
    tau_2: FloatArray

    @property
    def tau_e(self) -> FloatArray:
        """Elastic torque."""
        return self.tau_1 + self.tau_2

    @property
    def preload(self) -> FloatArray:
        """Preload torque."""
        return (self.tau_1 - self.tau_2) / 2

    def take(self, points: slice | IndexArray) -> CriticalCurve:
        """Return a selection of the points."""
        return CriticalCurve(*(values[points] for values in self))


class _Matches(NamedTuple):
    """Nodes of one spring, and deflections between which the other has the same hardening; (nodes,)."""

    phi: FloatArray
    rho: FloatArray
    low: FloatArray
    high: FloatArray


def sample_hardening(law: SpringLaw) -> Hardening | None:
    """Sample the hardening of a law; return None if it carries no positive torque."""
    end = law.torque_range[1]
    if end <= 0:
        return None
    if math.isfinite(end):
        phi = law.deflection(np.array([end])) * SAMPLED_SHARES
    else:
        phi = law.deflection(SAMPLED_TORQUES)
    phi = np.concatenate(([0.0], phi))
    peaks = _hardening_peaks(law, phi)
    phi = np.unique(np.concatenate((phi, peaks, *(_samples_near_peak(peak, phi) for peak in peaks))))
    rho = law.hardening(phi)
    finite = np.isfinite(rho)
    phi, rho = phi[finite], rho[finite]
    return Hardening(law, phi, rho, np.searchsorted(phi, peaks))


def _samples_near_peak(peak: float, phi: FloatArray) -> FloatArray:
    """Return deflections on either side of a peak, denser towards it."""
    above = int(np.searchsorted(phi, peak, side="right"))
    below = int(np.searchsorted(phi, peak)) - 1
    return np.concatenate(
        (peak + (phi[above] - peak) * PEAK_SHARES, peak + (phi[below] - peak) * PEAK_SHARES)
    )


def _hardening_peaks(law: SpringLaw, phi: FloatArray) -> FloatArray:
    """Return deflections at which the slope of rho, eta sigma - zeta^2 over sigma^2, changes its sign."""

    def slope(phi: FloatArray) -> FloatArray:
        _, sigma, zeta, eta = law.derivatives(phi, 3)
        difference = eta * sigma - zeta * zeta
        rounding = PEAK_RTOL * (np.abs(eta * sigma) + zeta * zeta)
        return np.where(np.abs(difference) <= rounding, 0.0, difference)

    sign = np.sign(slope(phi))
    nonzero = np.flatnonzero(sign)
    sign_changes = np.flatnonzero(sign[nonzero[:-1]] != sign[nonzero[1:]])
    peaks: FloatArray = np.unique(
        bracketed_root(slope, phi[nonzero[sign_changes]], phi[nonzero[sign_changes + 1]])
    )
    inner: FloatArray = peaks[(peaks > phi[0]) & (peaks < phi[-1])]  # rounding moves one onto an end
    return inner


def critical_curves(first: SpringLaw, second: SpringLaw) -> Iterator[CriticalCurve]:
    """Yield all critical points of positive torques, in curves over which tau_e increases."""
    hardening_1, hardening_2 = sample_hardening(first), sample_hardening(second)
    curves = list(_monotone_curves(hardening_1, hardening_2)) if hardening_1 and hardening_2 else []
    if not curves:
        return
    brackets = [_cusp_brackets(curve.tau_e) for curve in curves]
    low, high = (
        CriticalCurve(
            *_concatenate_parts(curve.take(ends[side]) for curve, ends in zip(curves, brackets, strict=True))
        )
        for side in (0, 1)
    )
    cusps = _cusp_points(first, second, low, high)
    counts = np.cumsum([0, *(len(low) for low, _ in brackets)])
    for curve, ends, first_cusp, last_cusp in zip(curves, brackets, counts[:-1], counts[1:], strict=True):
        yield from _split_at_cusps(curve, *ends, cusps.take(slice(first_cusp, last_cusp)))


def _monotone_curves(one: Hardening, two: Hardening) -> Iterator[CriticalCurve]:
    """Yield the curve of each pair of monotone pieces of hardening, if it has at least two points.

    Along it both torques increase if both pieces rise or both fall; otherwise one increases while the other
    decreases. Where one hardening is constant to rounding, so is the torque of the other spring.
    """
    pieces = list(product(one.pieces(), two.pieces()))
    matches_1 = [_matching_nodes(one, first, two, second) for first, second in pieces]
    matches_2 = [_matching_nodes(two, second, one, first) for first, second in pieces]
    points = _matched_points(
        one.law, two.law, _Matches(*_concatenate_parts(matches_1)), _Matches(*_concatenate_parts(matches_2))
    )
    same_direction = [one.rises(first) == two.rises(second) for first, second in pieces]
    piece_of_point = np.repeat(
        [*range(len(pieces))] * 2, [len(nodes.phi) for nodes in (*matches_1, *matches_2)]
    )
    with np.errstate(divide="ignore"):
        curve_order = np.log(points.tau_1) + np.where(same_direction, 1.0, -1.0)[piece_of_point] * np.log(
            points.tau_2
        )
    order = np.lexsort((curve_order, piece_of_point))
    bounds = np.searchsorted(piece_of_point[order], range(len(pieces) + 1))
    for first, last in pairwise(bounds.tolist()):
        if last - first > 1:
            yield points.take(order[first:last])


def _concatenate_parts(parts: Iterable[tuple[FloatArray, ...]]) -> Iterator[FloatArray]:
    return map(np.concatenate, zip(*parts, strict=True))


def _matching_nodes(spring: Hardening, piece: slice, other_spring: Hardening, other_piece: slice) -> _Matches:
    """Return the nodes of a piece whose hardening occurs in a piece of the other spring, and where."""
    direction = 1 if other_spring.rises(other_piece) else -1
    ascending = np.maximum.accumulate(other_spring.rho[other_piece][::direction])
    phi, rho = spring.phi[piece], spring.rho[piece]
    in_both = (rho >= ascending[0]) & (rho <= ascending[-1])
    cell = np.clip(np.searchsorted(ascending, rho[in_both]), 1, len(ascending) - 1)
    ends = other_spring.phi[other_piece][::direction]
    return _Matches(phi[in_both], rho[in_both], ends[cell - 1], ends[cell])


def _matched_points(
    first: SpringLaw, second: SpringLaw, matches_1: _Matches, matches_2: _Matches
) -> CriticalCurve:
    """Return critical points at the nodes of each spring, with the other at the same hardening."""
    phi_1 = np.concatenate((matches_1.phi, _equal_hardening(first, *matches_2[1:])))
    phi_2 = np.concatenate((_equal_hardening(second, *matches_1[1:]), matches_2.phi))
    return CriticalCurve(phi_1, phi_2, first.torque(phi_1), second.torque(phi_2))


def _equal_hardening(law: SpringLaw, rho: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return deflections between `low` and `high` at which a spring has the hardening rho."""
    return bracketed_root(lambda phi, wanted: law.hardening(phi) - wanted, low, high, (rho,))


def _cusp_brackets(tau_e: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return pairs of points of a curve between which tau_e has a local extremum, by index."""
    change = np.diff(tau_e)
    significant = np.flatnonzero(np.abs(change) > CUSP_RTOL * tau_e[1:])
    turns = np.flatnonzero(np.diff(np.sign(change[significant])))
    return significant[turns], significant[turns + 1] + 1


def _cusp_points(
    first: SpringLaw, second: SpringLaw, low: CriticalCurve, high: CriticalCurve
) -> CriticalCurve:
    """Return the points between `low` and `high` at which tau_e is stationary along the curve."""

    def partner(phi: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return _equal_hardening(second, first.hardening(phi), low, high)

    def tau_e_slope(phi: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return _hardening_slope(first, phi) + _hardening_slope(second, partner(phi, low, high))

    ends = (low.phi_2, high.phi_2)
    phi_1 = bracketed_root(tau_e_slope, low.phi_1, high.phi_1, ends)
    phi_2 = partner(phi_1, *ends)
    return CriticalCurve(phi_1, phi_2, first.torque(phi_1), second.torque(phi_2))


def _hardening_slope(law: SpringLaw, phi: FloatArray) -> FloatArray:
    """Return the derivative of the hardening over the torque."""
    _, sigma, zeta, eta = law.derivatives(phi, 3)
    return (eta / sigma - (zeta / sigma) ** 2) / sigma


def _split_at_cusps(
    curve: CriticalCurve, low: IndexArray, high: IndexArray, cusps: CriticalCurve
) -> Iterator[CriticalCurve]:
    """Yield a curve in parts of ascending tau_e, split at its cusps, each of which is between two points."""
    starts, ends = [0, *high.tolist()], [*low.tolist(), len(curve.phi_1) - 1]
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        adjacent_cusps = cusps.take(slice(max(index - 1, 0), index)), cusps.take(slice(index, index + 1))
        part = CriticalCurve(
            *_concatenate_parts((adjacent_cusps[0], curve.take(slice(start, end + 1)), adjacent_cusps[1]))
        )
        tau_e = part.tau_e
        yield part if tau_e[-1] > tau_e[0] else part.take(slice(None, None, -1))


SHORT_RTOL = 2e-5
"""Relative distance to a critical point from which one Newton step is exact to rounding.

The step squares the distance along the curve of equal tau_e. The stiffness is stationary there, so its error
is of fourth order, and so is that of the torque. The stiffness extrapolated to the end of the step lacks
about a hundredth of the third power: for measured springs, the worst by trial, 1e-14 from this distance,
2e-13 from 5e-5.
"""


def along_critical_curve(state: PairState, rho: Sides) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the derivatives of phi_1 and phi_2 over tau_e at constant rho_1 - rho_2, and their divisor."""
    one, two = state.one, state.two
    rho_1, rho_2 = rho
    slope_1, slope_2 = one.eta / one.sigma - rho_1 * rho_1, two.eta / two.sigma - rho_2 * rho_2
    divisor = one.sigma * slope_2 + two.sigma * slope_1
    return slope_2 / divisor, slope_1 / divisor, divisor


def newton_step(state: PairState, rho: Sides, tau_e: FloatArray) -> Sides:
    """Return a Newton step on tau_1 + tau_2 = tau_e, rho_1 = rho_2; the torque is kept to third order.

    The curvature of the springs is compensated by a shift of both sides: next to a cusp, a step along the
    critical curve cannot do it.
    """
    one, two = state.one, state.two
    (rho_1, rho_2), (along_1, along_2, divisor) = rho, along_critical_curve(state, rho)
    torque, hardening_step = tau_e - state.torque, (rho_1 - rho_2) / divisor
    step_1, step_2 = (
        torque * along_1 - hardening_step * two.sigma,
        torque * along_2 + hardening_step * one.sigma,
    )
    stiffness = state.stiffness + one.zeta * step_1 + two.zeta * step_2
    shift = state.linearization_error(step_1, step_2) / stiffness
    return step_1 - shift, step_2 - shift


def is_short(state: PairState, rho: Sides, steps: Sides) -> BoolArray:
    """Return whether a step is so short that the next would be rounding; see `SHORT_RTOL`."""
    (rho_1, rho_2), (magnitude_1, magnitude_2) = rho, map(np.abs, steps)
    hardening_change = np.abs(rho_1) * magnitude_1 + np.abs(rho_2) * magnitude_2
    short: BoolArray = (hardening_change <= SHORT_RTOL) & (
        magnitude_1 + magnitude_2 <= SHORT_RTOL * (np.abs(state.phi_1) + np.abs(state.phi_2))
    )
    return short


def bracketed_in_box(balance: Balance, tau_e: FloatArray, *box: FloatArray) -> Values:
    """Return the critical point within a box by bracketing the preload torque.

    Args:
        balance: Springs.
        tau_e: Elastic torque.
        *box: Smallest and largest phi_1, smallest and largest phi_2; the box contains one critical point.
    """
    low_1, high_1, low_2, high_2 = box
    smallest_state, largest_state = balance.state(low_1, high_2), balance.state(high_1, low_2)
    smallest = np.maximum(smallest_state.one.tau, tau_e - smallest_state.two.tau) - tau_e / 2
    largest = np.minimum(largest_state.one.tau, tau_e - largest_state.two.tau) - tau_e / 2

    def slope(t: FloatArray, tau_e: FloatArray) -> FloatArray:
        return balance.stiffness_slope(*balance.deflections_at(tau_e, t))

    t = bracketed_root(slope, smallest, largest, (tau_e,))
    return balance.deflections_at(tau_e, t)
