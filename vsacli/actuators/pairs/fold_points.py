"""Critical points of the joint stiffness that are the outermost at their elastic torque, in a row."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.tendon import Mirrored
from vsacli.actuators.pairs.balance import Balance
from vsacli.actuators.pairs.critical_curves import critical_curves
from vsacli.actuators.pairs.critical_points import along_critical_curve, bracketed_in_box
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray

CUSP_SLOPE_RATIO = 30.0
"""By how much the slope at the end of a stretch exceeds the mean if that end is a cusp.

It does a billion times or more, or some thousand times where rounding hides how the curve begins."""

NONE = -1
"""Stands for the number of a curve where there is no fold."""


class FoldPoints(NamedTuple):
    """Critical points of the outermost curves; arrays (points,).

    Attributes:
        tau_e: elastic torque.
        phi: deflections, (2, points).
        slope: their derivatives along the curve, (2, points).
        rho: relative hardening there, (2, points).
        last: index of the last point in the same stretch of a curve.
        cusp: 1 at the ends of a stretch where the curve turns around, else 0.
    """

    tau_e: FloatArray
    phi: FloatArray
    slope: FloatArray
    rho: FloatArray
    last: IndexArray
    cusp: FloatArray


class _Cells(NamedTuple):
    """Between neighbouring critical points of the curve that is the outermost there.

    Attributes:
        edges: torques between the cells, (cells + 1,), ascending.
        corners: tau_e, phi_1 and phi_2 at either end, (3, 2, cells).
        curve: number of the curve, (cells,), or `NONE`.
    """

    edges: FloatArray
    corners: FloatArray
    curve: IndexArray


def outermost_folds(balance: Balance) -> FoldPoints:
    """The points of a pair over all elastic torques, so dense that each feature of the springs has some."""
    return _row(balance, _cut(balance, _cells(balance.first, balance.second)))


def _cells(first: SpringLaw, second: SpringLaw) -> _Cells:
    """Those of negative torques, from the pair turned around, and of positive ones."""
    above = _positive_cells(first, second)
    below = _positive_cells(Mirrored(law=second), Mirrored(law=first))
    turned = np.where(below.curve == NONE, NONE, below.curve + above.curve.max() + 1)
    return _Cells(
        np.concatenate((-below.edges[:0:-1], above.edges)),
        np.concatenate((-below.corners[(0, 2, 1), ::-1, ::-1], above.corners), axis=-1),
        np.concatenate((turned[::-1], above.curve)),
    )


def _positive_cells(first: SpringLaw, second: SpringLaw) -> _Cells:
    """Those of positive tau_e."""
    curves = list(critical_curves(first, second))
    knots = np.unique(np.concatenate([[0.0], *(curve.tau_e for curve in curves)]))
    middle = np.append((knots[:-1] + knots[1:]) / 2, np.inf)
    corners = np.full((3, 2, middle.size), np.nan)
    outermost, number = np.full(middle.size, -np.inf), np.full(middle.size, NONE)
    for each, curve in enumerate(curves):
        tau_e = curve.tau_e
        preload = np.interp(middle, tau_e, curve.preload, left=-np.inf, right=-np.inf)
        further = preload > outermost
        outermost[further], number[further] = preload[further], each
        cell = np.clip(np.searchsorted(tau_e, middle[further]) - 1, 0, len(tau_e) - 2)
        for values, nodes in zip(corners, (tau_e, curve.phi_1, curve.phi_2), strict=True):
            values[:, further] = nodes[cell], nodes[cell + 1]
    changes = np.flatnonzero(_differ(corners[0, :, 1:], corners[0, :, :-1])) + 1
    cells = np.append(0, changes)
    return _Cells(np.append(knots[cells], np.inf), corners[:, :, cells], number[cells])


def _differ(cells: FloatArray, others: FloatArray) -> BoolArray:
    differ: BoolArray = ~np.all((cells == others) | (np.isnan(cells) & np.isnan(others)), axis=0)
    return differ


def _cut(balance: Balance, cells: _Cells) -> _Cells:
    """The same with corners on the edges, also where another curve takes over between two points of one."""
    corners = cells.corners.copy()
    low, high = np.sort(cells.corners, axis=1).swapaxes(0, 1)
    for side, edges in enumerate((cells.edges[:-1], cells.edges[1:])):
        beyond = np.flatnonzero((cells.curve != NONE) & (corners[0, side] != edges))
        box = (low[1, beyond], high[1, beyond], low[2, beyond], high[2, beyond])
        corners[:, side, beyond] = edges[beyond], *bracketed_in_box(balance, edges[beyond], *box)
    return cells._replace(corners=corners)


def _row(balance: Balance, cells: _Cells) -> FoldPoints:
    """The corners in a row, one where there is no fold, and one at infinity."""
    ends = np.append(np.flatnonzero(np.diff(cells.curve)) + 1, cells.curve.size)
    rows: list[FloatArray] = []
    last: list[int] = []
    for start, end in zip(np.append(0, ends), ends, strict=False):
        row = cells.corners[:, 0, start:end]
        if cells.curve[start] == NONE:
            row = np.array([[cells.edges[start]], [np.nan], [np.nan]])
        else:
            row = np.column_stack((row, cells.corners[:, 1, end - 1]))
        rows.append(row)
        last += [len(last) + row.shape[1] - 1] * row.shape[1]
    rows.append(np.array([[np.inf], [np.nan], [np.nan]]))
    tau_e, *phi = np.concatenate(rows, axis=1)
    state = balance.state(*phi)
    slope = np.stack(along_critical_curve(state, state.rho)[:2])
    numbers = np.array([*last, len(last)])
    cusp = _cusps(tau_e, np.stack(phi), slope, numbers)
    return FoldPoints(tau_e, np.stack(phi), slope, np.stack(state.rho), numbers, cusp)


def _cusps(tau_e: FloatArray, phi: FloatArray, slope: FloatArray, last: IndexArray) -> FloatArray:
    """1 where a stretch begins or ends with a slope that is vertical beside its mean, else 0."""
    ends = np.unique(last)
    begins = np.append(0, ends[:-1] + 1)
    chord = (phi[:, ends] - phi[:, begins]) / (tau_e[ends] - tau_e[begins])
    cusp = np.zeros(tau_e.size)
    for nodes in (begins, ends):
        flat = np.abs(slope[:, nodes]) <= CUSP_SLOPE_RATIO * np.abs(chord)
        cusp[nodes] = np.where(flat.all(axis=0), 0.0, 1.0)
    return cusp
