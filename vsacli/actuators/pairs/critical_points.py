"""Critical points of the joint stiffness: at one elastic torque, and as curves of equal hardening."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.pairs.balance import Balance, PairState
from vsacli.actuators.pairs.bracketing import bracketed_root
from vsacli.actuators.pairs.joints import Sides
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.compute.control_flow import Values

SAMPLED_TORQUES = np.concatenate((np.geomspace(1e-14, 1e14, 281), np.geomspace(1e15, 1e120, 106)))
"""Torques, N m, at which a spring without an end is sampled: ten a decade where springs have features."""

SAMPLED_SHARES = np.concatenate(
    (
        np.geomspace(1e-12, 0.01, 100),
        np.linspace(0.01, 0.99, 400)[1:-1],
        1 - np.geomspace(0.01, 1e-9, 70),
        [1.0],
    )
)
"""Shares of the largest deflection at which one with an end is sampled; a measured curve has some dozen
features."""

PEAK_SHARES = np.geomspace(1e-4, 0.5, 16)
"""Shares of the way to the neighbouring nodes at which it is sampled next to a peak."""

PEAK_RTOL = 1e-13
"""Relative change of the hardening, over a doubling of the deflection, that may be rounding."""

CUSP_RTOL = 1e-11
"""Relative change of tau_e between neighbouring points of a curve that rounding next to a peak does not make.

Folds born closer together differ in stiffness by rounding only, which is of fourth order in their distance.
"""


@dataclass(frozen=True)
class Hardening:
    """Relative hardening rho = zeta/sigma of a spring over positive torques; arrays (nodes,), ascending.

    Attributes:
        law: the spring.
        phi: deflections, rad (m).
        rho: relative hardening.
        peaks: indices where rho turns around.
    """

    law: SpringLaw
    phi: FloatArray
    rho: FloatArray
    peaks: IndexArray

    def pieces(self) -> Iterator[slice]:
        """Nodes of each monotone piece; neighbours share the node at the peak."""
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

    def take(self, chosen: slice | IndexArray) -> CriticalCurve:
        """Return some of the points."""
        return CriticalCurve(*(values[chosen] for values in self))


class _Matches(NamedTuple):
    """Nodes of one spring, and deflections of the other between which it has the same hardening; (nodes,)."""

    phi: FloatArray
    rho: FloatArray
    low: FloatArray
    high: FloatArray


def sample_hardening(law: SpringLaw) -> Hardening | None:
    """Sample the hardening of a law; None if it carries no positive torque."""
    end = law.torque_range[1]
    if end <= 0:
        return None
    if math.isfinite(end):
        phi = law.deflection(np.array([end])) * SAMPLED_SHARES
    else:
        phi = law.deflection(SAMPLED_TORQUES)
    phi = np.concatenate(([0.0], phi))
    peaks = _peaks(law, phi)
    phi = np.unique(np.concatenate((phi, peaks, *(_around(peak, phi) for peak in peaks))))
    rho = law.hardening(phi)
    known = np.isfinite(rho)
    phi, rho = phi[known], rho[known]
    return Hardening(law, phi, rho, np.searchsorted(phi, peaks))


def _around(peak: float, phi: FloatArray) -> FloatArray:
    """Deflections on either side of a peak, denser towards it."""
    above = int(np.searchsorted(phi, peak, side="right"))
    below = int(np.searchsorted(phi, peak)) - 1
    return np.concatenate(
        (peak + (phi[above] - peak) * PEAK_SHARES, peak + (phi[below] - peak) * PEAK_SHARES)
    )


def _peaks(law: SpringLaw, phi: FloatArray) -> FloatArray:
    """Deflections strictly between nodes at which eta sigma - zeta^2 changes its sign."""

    def slope(phi: FloatArray) -> FloatArray:
        _, sigma, zeta, eta = law.derivatives(phi, 3)
        difference = eta * sigma - zeta * zeta
        rounding = PEAK_RTOL * (np.abs(eta * sigma) + zeta * zeta)
        return np.where(np.abs(difference) <= rounding, 0.0, difference)

    sign = np.sign(slope(phi))
    kept = np.flatnonzero(sign)
    turn = np.flatnonzero(sign[kept[:-1]] != sign[kept[1:]])
    peaks: FloatArray = np.unique(bracketed_root(slope, phi[kept[turn]], phi[kept[turn + 1]]))
    inner: FloatArray = peaks[(peaks > phi[0]) & (peaks < phi[-1])]  # rounding moves one onto an end
    return inner


def critical_curves(first: SpringLaw, second: SpringLaw) -> Iterator[CriticalCurve]:
    """Yield all critical points of positive torques, in curves over which tau_e increases."""
    one, two = sample_hardening(first), sample_hardening(second)
    curves = list(_curves(one, two)) if one and two else []
    if not curves:
        return
    brackets = [_cusp_brackets(curve.tau_e) for curve in curves]
    low, high = (
        CriticalCurve(*_joined(curve.take(ends[side]) for curve, ends in zip(curves, brackets, strict=True)))
        for side in (0, 1)
    )
    cusps = _cusps(first, second, low, high)
    counts = np.cumsum([0, *(len(low) for low, _ in brackets)])
    for curve, ends, before, after in zip(curves, brackets, counts[:-1], counts[1:], strict=True):
        yield from _split(curve, *ends, cusps.take(slice(before, after)))


def _curves(one: Hardening, two: Hardening) -> Iterator[CriticalCurve]:
    """Yield the curve of each pair of pieces of hardening, if there are two points on it.

    Along it both torques increase together if the pieces both rise or both fall, else one against the other.
    Where a hardening has become constant but for rounding, so has the torque of the other spring.
    """
    pieces = list(product(one.pieces(), two.pieces()))
    of_one = [_matches(one, first, two, second) for first, second in pieces]
    of_two = [_matches(two, second, one, first) for first, second in pieces]
    points = _points(one.law, two.law, _Matches(*_joined(of_one)), _Matches(*_joined(of_two)))
    alike = [one.rises(first) == two.rises(second) for first, second in pieces]
    piece = np.repeat([*range(len(pieces))] * 2, [len(nodes.phi) for nodes in (*of_one, *of_two)])
    with np.errstate(divide="ignore"):
        along = np.log(points.tau_1) + np.where(alike, 1.0, -1.0)[piece] * np.log(points.tau_2)
    order = np.lexsort((along, piece))
    bounds = np.searchsorted(piece[order], range(len(pieces) + 1))
    for first, last in pairwise(bounds.tolist()):
        if last - first > 1:
            yield points.take(order[first:last])


def _joined(parts: Iterable[tuple[FloatArray, ...]]) -> Iterator[FloatArray]:
    return map(np.concatenate, zip(*parts, strict=True))


def _matches(of: Hardening, piece: slice, among: Hardening, other: slice) -> _Matches:
    """Nodes of a piece whose hardening a piece of the other spring has too, between two of its nodes."""
    direction = 1 if among.rises(other) else -1
    ascending = np.maximum.accumulate(among.rho[other][::direction])
    phi, rho = of.phi[piece], of.rho[piece]
    shared = (rho >= ascending[0]) & (rho <= ascending[-1])
    cell = np.clip(np.searchsorted(ascending, rho[shared]), 1, len(ascending) - 1)
    ends = among.phi[other][::direction]
    return _Matches(phi[shared], rho[shared], ends[cell - 1], ends[cell])


def _points(first: SpringLaw, second: SpringLaw, of_one: _Matches, of_two: _Matches) -> CriticalCurve:
    """Nodes of each spring with the deflections of the other at the same hardening."""
    phi_1 = np.concatenate((of_one.phi, _equal_hardening(first, *of_two[1:])))
    phi_2 = np.concatenate((_equal_hardening(second, *of_one[1:]), of_two.phi))
    return CriticalCurve(phi_1, phi_2, first.torque(phi_1), second.torque(phi_2))


def _equal_hardening(law: SpringLaw, rho: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Deflections between two others at which a spring has a hardening."""
    return bracketed_root(lambda phi, wanted: law.hardening(phi) - wanted, low, high, (rho,))


def _cusp_brackets(tau_e: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Points of a curve between which tau_e turns around."""
    change = np.diff(tau_e)
    noticed = np.flatnonzero(np.abs(change) > CUSP_RTOL * tau_e[1:])
    turns = np.flatnonzero(np.diff(np.sign(change[noticed])))
    return noticed[turns], noticed[turns + 1] + 1


def _cusps(first: SpringLaw, second: SpringLaw, low: CriticalCurve, high: CriticalCurve) -> CriticalCurve:
    """Return the points between two others of a curve at which tau_e is stationary along it."""

    def partner(phi: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return _equal_hardening(second, first.hardening(phi), low, high)

    def turning(phi: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return _hardening_slope(first, phi) + _hardening_slope(second, partner(phi, low, high))

    ends = (low.phi_2, high.phi_2)
    phi_1 = bracketed_root(turning, low.phi_1, high.phi_1, ends)
    phi_2 = partner(phi_1, *ends)
    return CriticalCurve(phi_1, phi_2, first.torque(phi_1), second.torque(phi_2))


def _hardening_slope(law: SpringLaw, phi: FloatArray) -> FloatArray:
    """Derivative of the hardening over the torque."""
    _, sigma, zeta, eta = law.derivatives(phi, 3)
    return (eta / sigma - (zeta / sigma) ** 2) / sigma


def _split(
    curve: CriticalCurve, low: IndexArray, high: IndexArray, cusps: CriticalCurve
) -> Iterator[CriticalCurve]:
    """Yield a curve split at its cusps, each between two of its points, in parts of ascending tau_e."""
    starts, ends = [0, *high.tolist()], [*low.tolist(), len(curve.phi_1) - 1]
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        around = cusps.take(slice(max(index - 1, 0), index)), cusps.take(slice(index, index + 1))
        part = CriticalCurve(*_joined((around[0], curve.take(slice(start, end + 1)), around[1])))
        tau_e = part.tau_e
        yield part if tau_e[-1] > tau_e[0] else part.take(slice(None, None, -1))


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
    """Return a Newton step on tau_1 + tau_2 = tau_e, rho_1 = rho_2, which keeps the first to the third order.

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
    """Return whether a step is so short that the next would be rounding."""
    (rho_1, rho_2), (size_1, size_2) = rho, map(np.abs, steps)
    hardened = np.abs(rho_1) * size_1 + np.abs(rho_2) * size_2
    short: BoolArray = (hardened <= SHORT_RTOL) & (
        size_1 + size_2 <= SHORT_RTOL * (np.abs(state.phi_1) + np.abs(state.phi_2))
    )
    return short


def bracketed_in_box(balance: Balance, tau_e: FloatArray, *box: FloatArray) -> Values:
    """Return the critical point within a box by bracketing the preload torque.

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
