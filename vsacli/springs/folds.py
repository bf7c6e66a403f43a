"""Where the outermost fold of a pair of springs lies, over the elastic torque: a map made once for the pair.

Critical points of the joint stiffness are points (phi_1, phi_2) of equal relative hardening, rho_1 = rho_2.
That does not involve tau_e, so that they form fixed curves; rho has the sign of the torque, so that both
torques have one sign there. Between the peaks of rho_1 and of rho_2 a curve is the graph of a monotone
function, and along it tau_e turns around only where one hardening rises and the other falls: there two folds
are born.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from vsacli.arrays import BoolArray, FloatArray, IndexArray
from vsacli.springs.bracketing import bracketed_root
from vsacli.springs.hardening import Hardening, sample_hardening
from vsacli.springs.law import SpringLaw
from vsacli.springs.mirrored import Mirrored

RESOLVED = 1e-11
"""Relative change of tau_e between neighbouring points of a curve that rounding next to a peak does not make.

Folds born closer together differ in stiffness by rounding only, which is of fourth order in their distance.
"""


class Folds(NamedTuple):
    """Cells of tau_e, in each of which the outermost fold moves from one corner of a box to the other.

    Attributes:
        edges: torques between the cells, (cells + 1,), ascending.
        tau_e: torques at which the fold is at the corners, (2, cells); NaN where there is no fold.
        phi_1: deflections of side 1 there, (2, cells).
        phi_2: deflections of side 2 there, (2, cells).
    """

    edges: FloatArray
    tau_e: FloatArray
    phi_1: FloatArray
    phi_2: FloatArray


def map_folds(first: SpringLaw, second: SpringLaw) -> Folds:
    """The outermost folds of a pair."""
    above = _positive_folds(first, second)
    turned = _positive_folds(Mirrored(law=second), Mirrored(law=first))
    return Folds(
        np.concatenate((-turned.edges[:0:-1], above.edges)),
        np.hstack((-turned.tau_e[::-1, ::-1], above.tau_e)),
        np.hstack((-turned.phi_2[::-1, ::-1], above.phi_1)),
        np.hstack((-turned.phi_1[::-1, ::-1], above.phi_2)),
    )


def _positive_folds(first: SpringLaw, second: SpringLaw) -> Folds:
    """Those of positive tau_e."""
    one, two = sample_hardening(first), sample_hardening(second)
    curves = list(_rising_curves(one, two)) if one and two else []
    knots = np.unique(np.concatenate([[0.0], *(curve.tau_e for curve in curves)]))
    middle = np.append((knots[:-1] + knots[1:]) / 2, np.inf)
    corners = np.full((3, 2, middle.size), np.nan)
    outermost = np.full(middle.size, -np.inf)
    for curve in curves:
        preload = np.interp(middle, curve.tau_e, curve.preload, left=-np.inf, right=-np.inf)
        further = preload > outermost
        outermost[further] = preload[further]
        cell = np.clip(np.searchsorted(curve.tau_e, middle[further]) - 1, 0, len(curve.tau_e) - 2)
        for values, nodes in zip(corners, curve[:3], strict=True):
            values[:, further] = nodes[cell], nodes[cell + 1]
    changes = np.flatnonzero(_differ(corners[0, :, 1:], corners[0, :, :-1])) + 1
    cells = np.append(0, changes)
    return Folds(np.append(knots[cells], np.inf), *corners[:, :, cells])


def _differ(cells: FloatArray, others: FloatArray) -> BoolArray:
    differ: BoolArray = ~np.all((cells == others) | (np.isnan(cells) & np.isnan(others)), axis=0)
    return differ


class _Curve(NamedTuple):
    """Points on a curve of critical points, in order; arrays (points,)."""

    tau_e: FloatArray
    phi_1: FloatArray
    phi_2: FloatArray
    preload: FloatArray

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
    pieces = list(product(one.pieces(), two.pieces()))
    of_one = [_nodes(one, first, two, second) for first, second in pieces]
    of_two = [_nodes(two, second, one, first) for first, second in pieces]
    points = zip(_with_partners(of_one, two.law), _with_partners(of_two, one.law), pieces, strict=True)
    for (phi_1, partner_of_1), (phi_2, partner_of_2), (first, second) in points:
        curve = _points(
            one.law,
            two.law,
            np.concatenate((phi_1, partner_of_2)),
            np.concatenate((partner_of_1, phi_2)),
            alike=one.rises(first) == two.rises(second),
        )
        if len(curve.tau_e) > 1:
            yield from _rising_parts(one.law, two.law, curve)


def _points(
    first: SpringLaw, second: SpringLaw, phi_1: FloatArray, phi_2: FloatArray, *, alike: bool
) -> _Curve:
    """In the order of both torques, which increase together if `alike`, else one against the other.

    Where a hardening has become constant but for rounding, so has the torque of the other spring.
    """
    tau_1, tau_2 = first.torque(phi_1), second.torque(phi_2)
    with np.errstate(divide="ignore"):
        order = np.argsort(np.log(tau_1) + (np.log(tau_2) if alike else -np.log(tau_2)), kind="stable")
    return _Curve(tau_1 + tau_2, phi_1, phi_2, (tau_1 - tau_2) / 2).at(order)


def _nodes(of: Hardening, piece: slice, among: Hardening, other: slice) -> _Nodes:
    """Nodes of a piece whose hardening a piece of the other spring has too, between two of its nodes."""
    direction = 1 if among.rises(other) else -1
    ascending = np.maximum.accumulate(among.rho[other][::direction])
    phi, rho = of.phi[piece], of.rho[piece]
    shared = (rho >= ascending[0]) & (rho <= ascending[-1])
    cell = np.clip(np.searchsorted(ascending, rho[shared]), 1, len(ascending) - 1)
    ends = among.phi[other][::direction]
    return _Nodes(phi[shared], rho[shared], ends[cell - 1], ends[cell])


def _with_partners(nodes: list[_Nodes], law: SpringLaw) -> Iterator[tuple[FloatArray, FloatArray]]:
    """The nodes of each piece with the deflections of the other spring there."""
    _, rho, low, high = (np.concatenate(values) for values in zip(*nodes, strict=True))
    ends = np.cumsum([len(part.phi) for part in nodes])[:-1]
    partners = np.split(_equal_hardening(law, rho, low, high), ends)
    return zip((part.phi for part in nodes), partners, strict=True)


def _equal_hardening(law: SpringLaw, rho: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Deflections between two others at which a spring has a hardening."""
    return bracketed_root(lambda phi, wanted: law.hardening(phi) - wanted, low, high, (rho,))


def _rising_parts(first: SpringLaw, second: SpringLaw, curve: _Curve) -> Iterator[_Curve]:
    """A curve split where tau_e turns around, at the birth of two folds."""
    change = np.diff(curve.tau_e)
    noticed = np.flatnonzero(np.abs(change) > RESOLVED * curve.tau_e[1:])
    turns = np.flatnonzero(np.diff(np.sign(change[noticed])))
    low, high = noticed[turns], noticed[turns + 1] + 1
    births = _births(first, second, curve.at(low), curve.at(high)) if turns.size else curve.at(low)
    starts, ends = [0, *high.tolist()], [*low.tolist(), len(curve.tau_e) - 1]
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        around = births.at(slice(max(index - 1, 0), index)), births.at(slice(index, index + 1))
        inside = curve.at(slice(start, end + 1))
        part = _Curve(*map(np.concatenate, zip(around[0], inside, around[1], strict=True)))
        yield part if part.tau_e[-1] > part.tau_e[0] else part.at(slice(None, None, -1))


def _births(first: SpringLaw, second: SpringLaw, low: _Curve, high: _Curve) -> _Curve:
    """The points between two others of a curve at which tau_e is stationary along it."""

    def partner(phi: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return _equal_hardening(second, first.hardening(phi), low, high)

    def turning(phi: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return _bend(first, phi) + _bend(second, partner(phi, low, high))

    ends = (low.phi_2, high.phi_2)
    phi_1 = bracketed_root(turning, low.phi_1, high.phi_1, ends)
    return _points(first, second, phi_1, partner(phi_1, *ends), alike=False)


def _bend(law: SpringLaw, phi: FloatArray) -> FloatArray:
    """Derivative of the hardening over the torque."""
    _, sigma, zeta, eta = law.derivatives(phi, 3)
    return (eta / sigma - (zeta / sigma) ** 2) / sigma
