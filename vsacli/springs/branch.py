"""The branch of (14): the outermost monotone piece of the joint stiffness over the preload.

Where the two torques have opposite signs, rho_1 > 0 > rho_2 (the springs harden away from zero), so that
critical points lie in |t| <= |tau_e|/2 only. Towards larger preload from the outermost of them, the piece is
monotone to the end of the laws' domain.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vsacli.arrays import BoolArray, FloatArray
from vsacli.springs.balance import Balance
from vsacli.springs.bracketing import bracketed_minimum, bracketed_root

_DEPTH = np.linspace(-6, 6, 121) * np.log(10)
COARSE_CELLS = np.concatenate(([0.0], 1 / (1 + np.exp(-_DEPTH)), [1.0]))
"""Shares of the interval at which dG/dt is scanned: ten cells a decade, down to 10^-6 of either end.

rho varies over about a decade of torque, so that a cell holds at most one of its features.
"""

FINE_CELLS = np.linspace(0, 1, 33)
"""Shares of a cell in a second and third scan.

Where three critical points are born from one, they are told apart down to 10^-4 of tau_e, which is 10^-16 in
the stiffness (of fourth order there).
"""


class Piece(NamedTuple):
    """Monotone piece of G between two preload torques; arrays (samples,).

    Attributes:
        inner: preload torque at the inner end.
        outer: preload torque at the outer end, +inf where the laws have none; below `inner` where tau_e
            cannot be carried.
        rising: whether G increases with the preload.
        critical: whether the inner end is a critical point (else the end of a law's domain).
    """

    inner: FloatArray
    outer: FloatArray
    rising: BoolArray
    critical: BoolArray


def outermost_piece(balance: Balance, tau_e: FloatArray) -> Piece:
    """The piece of G that reaches the largest preload, for each tau_e (samples,)."""
    inner, outer = balance.domain(tau_e)
    half = np.abs(tau_e) / 2
    near, far = np.maximum(inner, -half), np.minimum(outer, half)
    rising = outer > half
    ending = ~rising & (near <= far)
    rising[ending] = balance.slope(far[ending], tau_e[ending]) >= 0

    critical = (half == 0) & (inner < 0) & (outer > 0)
    inner = np.where(critical, 0.0, inner)

    searched = np.flatnonzero(near < far)
    if searched.size:
        bracket = _outermost_sign_change(
            balance, tau_e[searched], near[searched], far[searched], rising[searched]
        )
        found = searched[bracket.found]
        ends = bracket.inside[bracket.found], bracket.outside[bracket.found]
        inner[found] = bracketed_root(balance.slope, *ends, tau_e[found])
        critical[found] = True
    return Piece(inner, outer, rising, critical)


class _Bracket(NamedTuple):
    """Preload torques inside and outside of a sign change of dG/dt, where one was found."""

    inside: FloatArray
    outside: FloatArray
    found: BoolArray


def _outermost_sign_change(
    balance: Balance, tau_e: FloatArray, near: FloatArray, far: FloatArray, rising: BoolArray
) -> _Bracket:
    """Bracket the sign change of dG/dt closest to `far`: by its ends where monotone, else by scans."""
    sign = np.where(rising, 1.0, -1.0)
    bracket = _Bracket(near.copy(), far.copy(), sign * balance.slope(near, tau_e) <= 0)
    scanned = np.flatnonzero(~(balance.slope_is_monotone(tau_e) & rising))
    for cells in (COARSE_CELLS, FINE_CELLS, FINE_CELLS):
        if scanned.size:
            inside, outside = bracket.inside[scanned], bracket.outside[scanned]
            part = _scan(
                balance, tau_e[scanned], sign[scanned], outside - cells[:, None] * (outside - inside)
            )
            for whole, piece in zip(bracket, part, strict=True):
                whole[scanned] = piece
            scanned = scanned[part.found]
    return bracket


def _scan(balance: Balance, tau_e: FloatArray, sign: FloatArray, nodes: FloatArray) -> _Bracket:
    """The outermost sign change among nodes (nodes, samples) that go from outside to inside.

    The bracket reaches one cell further out than the change, for a finer scan to look there too.
    """
    slope = sign * balance.slope(nodes, np.broadcast_to(tau_e, nodes.shape))
    crossed = slope < 0
    crossed[-1] |= slope[-1] <= 0
    found: BoolArray = np.any(crossed, axis=0)
    first = np.where(found, crossed.argmax(axis=0), len(nodes) - 1)
    samples = np.arange(tau_e.size)
    bracket = _Bracket(nodes[first, samples], nodes[np.maximum(first - 2, 0), samples], found)

    for sample, inside, outside in _dips_below_zero(balance, tau_e, sign, nodes, slope, first):
        for array, entry in zip(bracket, (inside, outside, True), strict=True):
            array[sample] = entry
    return bracket


def _dips_below_zero(
    balance: Balance,
    tau_e: FloatArray,
    sign: FloatArray,
    nodes: FloatArray,
    slope: FloatArray,
    first: npt.NDArray[np.intp],
) -> Iterator[tuple[int, float, float]]:
    """Where the slope crosses zero twice between nodes: (sample, bottom of the dip, node outside of it).

    Only dips outside the first crossing count; those of one sample come from the inside out.
    """
    dip = (slope[1:-1] >= 0) & (slope[1:-1] < slope[:-2]) & (slope[1:-1] <= slope[2:])
    dip &= np.arange(1, len(nodes) - 1)[:, None] < first
    node, sample = np.nonzero(dip)
    if not node.size:
        return
    node += 1
    triple = nodes[node + 1, sample], nodes[node, sample], nodes[node - 1, sample]
    position, lowest = bracketed_minimum(
        lambda t, torque, direction: direction * balance.slope(t, torque),
        *triple,
        tau_e[sample],
        sign[sample],
    )
    for index in np.flatnonzero(lowest < 0)[::-1]:
        yield int(sample[index]), float(position[index]), float(triple[2][index])
