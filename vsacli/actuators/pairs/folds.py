"""Where the outermost fold of a pair of springs lies, over the elastic torque: a map made once for the pair.

Critical points of the joint stiffness are points (phi_1, phi_2) of equal relative hardening, rho_1 = rho_2.
That does not involve tau_e, so that they form fixed curves; rho has the sign of the torque, so that both
torques have one sign there. Between the peaks of rho_1 and of rho_2 a curve is the graph of a monotone
function, and along it tau_e turns around only where one hardening rises and the other falls: there two folds
are born.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from vsacli.actuators.bracketing import bracketed_root
from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.mirrored import Mirrored
from vsacli.actuators.pairs.balance import Balance
from vsacli.actuators.pairs.decoupling_matrix import Sides
from vsacli.actuators.pairs.hardening import Hardening, sample_hardening
from vsacli.actuators.pairs.state import PairState
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray

RESOLVED = 1e-11
"""Relative change of tau_e between neighbouring points of a curve that rounding next to a peak does not make.

Folds born closer together differ in stiffness by rounding only, which is of fourth order in their distance.
"""

MONOTONE = 3.0
"""Most by which the slopes at the ends of a cubic exceed the mean so that it is monotone for sure."""


class Folds(NamedTuple):
    """Cells of tau_e, in each of which the outermost fold moves from one corner of a box to the other.

    Attributes:
        edges: torques between the cells, (cells + 1,), ascending.
        tau_e: torques at which the fold is at the corners, (2, cells); NaN where there is no fold.
        phi_1: deflections of side 1 there, (2, cells).
        phi_2: deflections of side 2 there, (2, cells).
        way_1: coefficients of the cubic, from the constant on, that phi_1 follows over the share of the cell,
            (4, cells); a straight line where a cubic with the curve's slopes would turn around.
        way_2: the same of phi_2.
    """

    edges: FloatArray
    tau_e: FloatArray
    phi_1: FloatArray
    phi_2: FloatArray
    way_1: FloatArray
    way_2: FloatArray


def map_folds(first: SpringLaw, second: SpringLaw) -> Folds:
    """The outermost folds of a pair."""
    above = _positive_folds(first, second)
    turned = _positive_folds(Mirrored(law=second), Mirrored(law=first))
    edges = np.concatenate((-turned[0][:0:-1], above[0]))
    tau_e, phi_1, phi_2 = np.concatenate((-turned[1][(0, 2, 1), ::-1, ::-1], above[1]), axis=-1)
    return Folds(edges, tau_e, phi_1, phi_2, *_ways(first, second, tau_e, phi_1, phi_2))


def _ways(
    first: SpringLaw, second: SpringLaw, tau_e: FloatArray, phi_1: FloatArray, phi_2: FloatArray
) -> Iterator[FloatArray]:
    """By the derivatives over tau_e along curves of equal hardening."""
    with np.errstate(all="ignore"):  # vertical at a birth, unknown without stiffness, and far away
        state = Balance(first, second).state(phi_1, phi_2)
        slopes = along_equal_hardening(state, state.rho)
        for phi, slope in zip((phi_1, phi_2), slopes[:2], strict=True):
            rise = phi[1] - phi[0]
            shares = slope * (tau_e[1] - tau_e[0])
            monotone = np.all((shares / rise >= 0) & (shares / rise <= MONOTONE), axis=0)
            start, end = np.where(monotone, shares, rise)
            yield np.stack((phi[0], start, 3 * rise - 2 * start - end, start + end - 2 * rise))


def along_equal_hardening(state: PairState, rho: Sides) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of phi_1 and phi_2 over tau_e where rho_1 - rho_2 is kept, and their common divisor."""
    one, two = state.one, state.two
    rho_1, rho_2 = rho
    bend_1, bend_2 = one.eta / one.sigma - rho_1 * rho_1, two.eta / two.sigma - rho_2 * rho_2
    divisor = one.sigma * bend_2 + two.sigma * bend_1
    return bend_2 / divisor, bend_1 / divisor, divisor


def _positive_folds(first: SpringLaw, second: SpringLaw) -> tuple[FloatArray, FloatArray]:
    """Those of positive tau_e: edges, and tau_e, phi_1, phi_2 at the corners, (3, 2, cells)."""
    one, two = sample_hardening(first), sample_hardening(second)
    curves = list(_rising_curves(one, two)) if one and two else []
    knots = np.unique(np.concatenate([[0.0], *(curve.tau_e for curve in curves)]))
    middle = np.append((knots[:-1] + knots[1:]) / 2, np.inf)
    corners = np.full((3, 2, middle.size), np.nan)
    outermost = np.full(middle.size, -np.inf)
    for curve in curves:
        tau_e = curve.tau_e
        preload = np.interp(middle, tau_e, curve.preload, left=-np.inf, right=-np.inf)
        further = preload > outermost
        outermost[further] = preload[further]
        cell = np.clip(np.searchsorted(tau_e, middle[further]) - 1, 0, len(tau_e) - 2)
        for values, nodes in zip(corners, (tau_e, curve.phi_1, curve.phi_2), strict=True):
            values[:, further] = nodes[cell], nodes[cell + 1]
    changes = np.flatnonzero(_differ(corners[0, :, 1:], corners[0, :, :-1])) + 1
    cells = np.append(0, changes)
    return np.append(knots[cells], np.inf), corners[:, :, cells]


def _differ(cells: FloatArray, others: FloatArray) -> BoolArray:
    differ: BoolArray = ~np.all((cells == others) | (np.isnan(cells) & np.isnan(others)), axis=0)
    return differ


class _Curve(NamedTuple):
    """Points on a curve of critical points, in order; arrays (points,)."""

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

    def at(self, chosen: slice | IndexArray) -> _Curve:
        """Some of the points."""
        return _Curve(*(values[chosen] for values in self))


class _Nodes(NamedTuple):
    """Nodes of one spring, and where the other has the same hardening; arrays (nodes,)."""

    phi: FloatArray
    rho: FloatArray
    low: FloatArray
    high: FloatArray


def _rising_curves(one: Hardening, two: Hardening) -> Iterator[_Curve]:
    """All curves in parts over which tau_e increases."""
    curves = list(_curves(one, two))
    if not curves:
        return
    turns = [_turns(curve.tau_e) for curve in curves]
    low, high = (
        _Curve(*_joined(curve.at(turn[end]) for curve, turn in zip(curves, turns, strict=True)))
        for end in (0, 1)
    )
    births = _births(one.law, two.law, low, high)
    before = np.cumsum([0, *(len(low) for low, _ in turns)])
    for curve, turn, first, last in zip(curves, turns, before[:-1], before[1:], strict=True):
        yield from _rising_parts(curve, *turn, births.at(slice(first, last)))


def _curves(one: Hardening, two: Hardening) -> Iterator[_Curve]:
    """The curve of each pair of pieces of hardening, if there are two points on it.

    Along it both torques increase together if the pieces both rise or both fall, else one against the other.
    Where a hardening has become constant but for rounding, so has the torque of the other spring.
    """
    pieces = list(product(one.pieces(), two.pieces()))
    of_one = [_nodes(one, first, two, second) for first, second in pieces]
    of_two = [_nodes(two, second, one, first) for first, second in pieces]
    points = _points(one.law, two.law, _Nodes(*_joined(of_one)), _Nodes(*_joined(of_two)))
    alike = [one.rises(first) == two.rises(second) for first, second in pieces]
    piece = np.repeat([*range(len(pieces))] * 2, [len(nodes.phi) for nodes in (*of_one, *of_two)])
    with np.errstate(divide="ignore"):
        along = np.log(points.tau_1) + np.where(alike, 1.0, -1.0)[piece] * np.log(points.tau_2)
    order = np.lexsort((along, piece))
    bounds = np.searchsorted(piece[order], range(len(pieces) + 1))
    for first, last in pairwise(bounds.tolist()):
        if last - first > 1:
            yield points.at(order[first:last])


def _joined(parts: Iterable[tuple[FloatArray, ...]]) -> Iterator[FloatArray]:
    return map(np.concatenate, zip(*parts, strict=True))


def _points(first: SpringLaw, second: SpringLaw, of_one: _Nodes, of_two: _Nodes) -> _Curve:
    """Nodes of each spring with the deflections of the other at the same hardening."""
    phi_1 = np.concatenate((of_one.phi, _equal_hardening(first, *of_two[1:])))
    phi_2 = np.concatenate((_equal_hardening(second, *of_one[1:]), of_two.phi))
    return _Curve(phi_1, phi_2, first.torque(phi_1), second.torque(phi_2))


def _nodes(of: Hardening, piece: slice, among: Hardening, other: slice) -> _Nodes:
    """Nodes of a piece whose hardening a piece of the other spring has too, between two of its nodes."""
    direction = 1 if among.rises(other) else -1
    ascending = np.maximum.accumulate(among.rho[other][::direction])
    phi, rho = of.phi[piece], of.rho[piece]
    shared = (rho >= ascending[0]) & (rho <= ascending[-1])
    cell = np.clip(np.searchsorted(ascending, rho[shared]), 1, len(ascending) - 1)
    ends = among.phi[other][::direction]
    return _Nodes(phi[shared], rho[shared], ends[cell - 1], ends[cell])


def _equal_hardening(law: SpringLaw, rho: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Deflections between two others at which a spring has a hardening."""
    return bracketed_root(lambda phi, wanted: law.hardening(phi) - wanted, low, high, (rho,))


def _turns(tau_e: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Points of a curve between which tau_e turns around, at the birth of two folds."""
    change = np.diff(tau_e)
    noticed = np.flatnonzero(np.abs(change) > RESOLVED * tau_e[1:])
    turns = np.flatnonzero(np.diff(np.sign(change[noticed])))
    return noticed[turns], noticed[turns + 1] + 1


def _rising_parts(curve: _Curve, low: IndexArray, high: IndexArray, births: _Curve) -> Iterator[_Curve]:
    """A curve split at the births between two points each."""
    starts, ends = [0, *high.tolist()], [*low.tolist(), len(curve.phi_1) - 1]
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        around = births.at(slice(max(index - 1, 0), index)), births.at(slice(index, index + 1))
        part = _Curve(*_joined((around[0], curve.at(slice(start, end + 1)), around[1])))
        tau_e = part.tau_e
        yield part if tau_e[-1] > tau_e[0] else part.at(slice(None, None, -1))


def _births(first: SpringLaw, second: SpringLaw, low: _Curve, high: _Curve) -> _Curve:
    """The points between two others of a curve at which tau_e is stationary along it."""

    def partner(phi: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return _equal_hardening(second, first.hardening(phi), low, high)

    def turning(phi: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return _bend(first, phi) + _bend(second, partner(phi, low, high))

    ends = (low.phi_2, high.phi_2)
    phi_1 = bracketed_root(turning, low.phi_1, high.phi_1, ends)
    phi_2 = partner(phi_1, *ends)
    return _Curve(phi_1, phi_2, first.torque(phi_1), second.torque(phi_2))


def _bend(law: SpringLaw, phi: FloatArray) -> FloatArray:
    """Derivative of the hardening over the torque."""
    _, sigma, zeta, eta = law.derivatives(phi, 3)
    return (eta / sigma - (zeta / sigma) ** 2) / sigma
