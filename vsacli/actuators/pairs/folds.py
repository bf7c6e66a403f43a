"""The outermost fold of a pair of springs: the critical point of the joint stiffness at the largest preload.

`map_folds` maps it over the elastic torque once per pair: nodes, between which Hermite cubics are a guess
that one Newton step corrects. `outermost_fold` evaluates the map at the elastic torques of samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.inversion import evaluate_hermite_cubic, round_to_single
from vsacli.actuators.laws.law import SpringLaw, SpringState
from vsacli.actuators.laws.tendons import Mirrored
from vsacli.actuators.pairs.balance import Balance, PairState
from vsacli.actuators.pairs.critical_points import (
    SHORT_RTOL,
    along_critical_curve,
    bracketed_in_box,
    critical_curves,
    is_short,
    newton_step,
)
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.compute.control_flow import Values, look_up, repeat, where_needed
from vsacli.compute.rounding import OfRounding

CUSP_SLOPE_RATIO = 30.0
"""Ratio of the slope at the end of a stretch to its mean slope, above which the end is a cusp.

At cusps the ratio is a billion or more, or some thousand where rounding hides the beginning of the curve."""

NO_CURVE = -1
"""Number of the curve where there is no fold."""


class FoldPoints(NamedTuple):
    """Critical points of the outermost curves; arrays (points,).

    Attributes:
        tau_e: Elastic torque.
        phi: Deflections, (2, points).
        slope: Derivatives of the deflections over tau_e, (2, points).
        rho: Relative hardening, (2, points).
        last: Index of the last point in the same stretch of a curve.
        cusp: 1 at the ends of a stretch at which the curve has a cusp, else 0.
    """

    tau_e: FloatArray
    phi: FloatArray
    slope: FloatArray
    rho: FloatArray
    last: IndexArray
    cusp: FloatArray


class _FoldCells(NamedTuple):
    """Cells of tau_e, each between adjacent critical points of the curve that is outermost there.

    Attributes:
        edges: Torques between the cells, (cells + 1,), ascending.
        corners: tau_e, phi_1 and phi_2 at either end, (3, 2, cells).
        curve: Number of the curve, (cells,), or `NO_CURVE`.
    """

    edges: FloatArray
    corners: FloatArray
    curve: IndexArray


def outermost_folds(balance: Balance) -> FoldPoints:
    """Return the outermost critical points over all elastic torques, dense enough for all spring features."""
    return _fold_points(balance, _cut_at_edges(balance, _cells_of_both_signs(balance.first, balance.second)))


def _cells_of_both_signs(first: SpringLaw, second: SpringLaw) -> _FoldCells:
    """Return the cells of negative torques, from the mirrored pair, followed by those of positive ones."""
    positive = _positive_cells(first, second)
    mirrored = _positive_cells(Mirrored(law=second), Mirrored(law=first))
    mirrored_curve = np.where(mirrored.curve == NO_CURVE, NO_CURVE, mirrored.curve + positive.curve.max() + 1)
    return _FoldCells(
        np.concatenate((-mirrored.edges[:0:-1], positive.edges)),
        np.concatenate((-mirrored.corners[(0, 2, 1), ::-1, ::-1], positive.corners), axis=-1),
        np.concatenate((mirrored_curve[::-1], positive.curve)),
    )


def _positive_cells(first: SpringLaw, second: SpringLaw) -> _FoldCells:
    """Return the cells of positive tau_e."""
    curves = list(critical_curves(first, second))
    knots = np.unique(np.concatenate([[0.0], *(curve.tau_e for curve in curves)]))
    middle = np.append((knots[:-1] + knots[1:]) / 2, np.inf)
    corners = np.full((3, 2, middle.size), np.nan)
    outermost, curve_number = np.full(middle.size, -np.inf), np.full(middle.size, NO_CURVE)
    for index, curve in enumerate(curves):
        tau_e = curve.tau_e
        preload = np.interp(middle, tau_e, curve.preload, left=-np.inf, right=-np.inf)
        is_outer = preload > outermost
        outermost[is_outer], curve_number[is_outer] = preload[is_outer], index
        cell = np.clip(np.searchsorted(tau_e, middle[is_outer]) - 1, 0, len(tau_e) - 2)
        for values, nodes in zip(corners, (tau_e, curve.phi_1, curve.phi_2), strict=True):
            values[:, is_outer] = nodes[cell], nodes[cell + 1]
    changes = np.flatnonzero(_corners_differ(corners[0, :, 1:], corners[0, :, :-1])) + 1
    cells = np.append(0, changes)
    return _FoldCells(np.append(knots[cells], np.inf), corners[:, :, cells], curve_number[cells])


def _corners_differ(cells: FloatArray, next_cells: FloatArray) -> BoolArray:
    differ: BoolArray = ~np.all((cells == next_cells) | (np.isnan(cells) & np.isnan(next_cells)), axis=0)
    return differ


def _cut_at_edges(balance: Balance, cells: _FoldCells) -> _FoldCells:
    """Return the cells with corners moved to their edges, where another curve becomes the outermost."""
    corners = cells.corners.copy()
    low, high = np.sort(cells.corners, axis=1).swapaxes(0, 1)
    for side, edges in enumerate((cells.edges[:-1], cells.edges[1:])):
        displaced = np.flatnonzero((cells.curve != NO_CURVE) & (corners[0, side] != edges))
        box = (low[1, displaced], high[1, displaced], low[2, displaced], high[2, displaced])
        corners[:, side, displaced] = edges[displaced], *bracketed_in_box(balance, edges[displaced], *box)
    return cells._replace(corners=corners)


def _fold_points(balance: Balance, cells: _FoldCells) -> FoldPoints:
    """Return the corners of all cells as points, one for cells without a fold, and one at infinity."""
    ends = np.append(np.flatnonzero(np.diff(cells.curve)) + 1, cells.curve.size)
    corner_blocks: list[FloatArray] = []
    last: list[int] = []
    for start, end in zip(np.append(0, ends), ends, strict=False):
        corner_block = cells.corners[:, 0, start:end]
        if cells.curve[start] == NO_CURVE:
            corner_block = np.array([[cells.edges[start]], [np.nan], [np.nan]])
        else:
            corner_block = np.column_stack((corner_block, cells.corners[:, 1, end - 1]))
        corner_blocks.append(corner_block)
        last += [len(last) + corner_block.shape[1] - 1] * corner_block.shape[1]
    corner_blocks.append(np.array([[np.inf], [np.nan], [np.nan]]))
    tau_e, *phi = np.concatenate(corner_blocks, axis=1)
    state = balance.state(*phi)
    slope = np.stack(along_critical_curve(state, state.rho)[:2])
    last_indices = np.array([*last, len(last)])
    cusp = _mark_cusps(tau_e, np.stack(phi), slope, last_indices)
    return FoldPoints(tau_e, np.stack(phi), slope, np.stack(state.rho), last_indices, cusp)


def _mark_cusps(tau_e: FloatArray, phi: FloatArray, slope: FloatArray, last: IndexArray) -> FloatArray:
    """Return 1 at the ends of stretches whose slope is far above the mean slope, else 0."""
    ends = np.unique(last)
    begins = np.append(0, ends[:-1] + 1)
    chord_slope = (phi[:, ends] - phi[:, begins]) / (tau_e[ends] - tau_e[begins])
    cusp = np.zeros(tau_e.size)
    for nodes in (begins, ends):
        is_flat = np.abs(slope[:, nodes]) <= CUSP_SLOPE_RATIO * np.abs(chord_slope)
        cusp[nodes] = np.where(is_flat.all(axis=0), 0.0, 1.0)
    return cusp


MONOTONE_SLOPE_RATIO = 3.0
"""Largest ratio of the slopes at the ends of a cubic to its mean slope that ensures that it is monotone."""

GUESS_RTOL = 0.9 * SHORT_RTOL
"""Largest relative distance of a cubic between nodes from the fold, so that one Newton step is enough.

Below `SHORT_RTOL`, since it is checked at the points `TESTED_SHARES` only; it may be larger elsewhere."""

TESTED_SHARES = np.linspace(0, 1, 10)[1:-1]
"""Shares of the critical points between two nodes at which the cubic is compared with them."""

SAME_SLOPE_RTOL = 1e-6
"""Relative change of the slopes below which a curve and its successor share one node."""

MIDDLE_ROOT = 0.5
"""Square root of the share of a cell, counted from a cusp, at which the cubic passes through the curve."""


class FoldMap(NamedTuple):
    """Nodes of the outermost fold; two nodes of the same torque are a jump; arrays (nodes,).

    Between two nodes the fold moves from one corner of a box to the other; there is none if either node has
    no deflections.

    Attributes:
        tau_e: Elastic torques, ascending from minus infinity to infinity.
        phi_1: Deflections of side 1, NaN beyond the ends and at the beginning of a gap.
        phi_2: Deflections of side 2, as above.
        slope_1: Derivatives of phi_1 over tau_e, to single precision; at a cusp over the square root of the
            share of the cell, divided by its width.
        slope_2: Derivatives of phi_2, as above.
        cusp: 1 at a cusp of the curve, where the fold varies as the square root of tau_e, else 0.
    """

    tau_e: FloatArray
    phi_1: FloatArray
    phi_2: FloatArray
    slope_1: FloatArray
    slope_2: FloatArray
    cusp: FloatArray

    def guess(self, tau_e: FloatArray) -> tuple[BoolArray, Values, Values]:
        """Return whether there is a fold, approximate phi_1 and phi_2, and those of the adjacent nodes."""
        cell = np.searchsorted(self.tau_e[1:-1], tau_e, side="right")
        low, low_1, low_2, *low_slopes = look_up(self, cell)
        high, high_1, high_2, *high_slopes = look_up(self, cell + 1)
        width = high - low
        cubic = _CubicArguments.of((tau_e - low) / width, width, (low_slopes[-1], high_slopes[-1]))
        approximate = (
            cubic(low_1, high_1, low_slopes[0], high_slopes[0]),
            cubic(low_2, high_2, low_slopes[1], high_slopes[1]),
        )
        return ~np.isnan(low_1 + high_1), approximate, (low_1, high_1, low_2, high_2)


class _CubicArguments(NamedTuple):
    """Arguments of Hermite cubics in a cell.

    Attributes:
        x: Share of the cell, or its square root, counted from the cusp, if an end is a cusp.
        start: Derivative of the share over x at the beginning of the cell, times its width.
        end: Derivative at its end, as above; at a cusp itself the width, by which slopes there are divided.
    """

    x: FloatArray
    start: FloatArray
    end: FloatArray

    @classmethod
    def of(cls, share: FloatArray, width: FloatArray, cusps: Values) -> _CubicArguments:
        """Return the arguments for a share of a cell, at most one end of which is a cusp."""
        first, last = cusps
        root = np.sqrt(np.where(last > 0, 1 - share, share))
        x = np.where(first > 0, root, np.where(last > 0, 1 - root, share))
        return cls(x, width * (1 + last), width * (1 + first))

    def __call__(self, low: FloatArray, high: FloatArray, first: FloatArray, last: FloatArray) -> FloatArray:
        """Evaluate the cubic from values and slopes at both ends."""
        return evaluate_hermite_cubic(self.x, low, high, first * self.start, last * self.end)


def map_folds(first: SpringLaw, second: SpringLaw) -> FoldMap:
    """Return the outermost folds of a pair over all elastic torques."""
    balance = Balance(first, second)
    with np.errstate(all="ignore"):  # infinite slopes at cusps, 0/0 without stiffness, overflow far away
        points = outermost_folds(balance)
        return _map_with_nodes(points, _choose_nodes(points))


def _choose_nodes(points: FoldPoints) -> IndexArray:
    """Return the fewest points between which cubics are close to all other points, greedily, by index."""
    farthest = _farthest_points(points).tolist()
    nodes = [0]
    while nodes[-1] + 1 < len(farthest):
        nodes.append(max(farthest[nodes[-1]], nodes[-1] + 1))
    return np.array(nodes)


def _farthest_points(points: FoldPoints) -> IndexArray:
    """Return the farthest point to which a cubic from each point may extend, by bisection for all at once."""
    start = np.arange(points.tau_e.size)
    farthest = np.minimum(start + 1, points.last)
    stride = 1 << int((points.last - start).max()).bit_length()
    while stride := stride // 2:
        candidates = farthest + stride
        possible_points = np.flatnonzero(candidates <= points.last)
        accepted = possible_points[
            _cubic_is_close(points, start[possible_points], candidates[possible_points])
        ]
        farthest[accepted] = candidates[accepted]
    unfinished = np.flatnonzero(points.last > start)
    # The end of a stretch, if a cusp, may be attainable from points at which shorter cubics fail.
    to_end = unfinished[_cubic_is_close(points, unfinished, points.last[unfinished])]
    farthest[to_end] = points.last[to_end]
    return farthest


def _cubic_is_close(points: FoldPoints, start: IndexArray, end: IndexArray) -> BoolArray:
    """Return whether the cubics from points `start` to points `end` are close to all points between."""
    tested_points = start + np.rint(TESTED_SHARES[:, None] * (end - start)).astype(int)
    cubic = _cubic_arguments(points, start, end, tested_points)
    error, hardening_error, magnitude = (np.zeros(tested_points.shape) for _ in range(3))
    for side, (phi, rho) in enumerate(zip(points.phi, points.rho, strict=True)):
        slopes = _slopes(points, side, start, end)
        side_error = np.abs(cubic(phi[start], phi[end], *slopes) - phi[tested_points])
        error, hardening_error = error + side_error, hardening_error + np.abs(rho[tested_points]) * side_error
        magnitude = magnitude + np.abs(phi[tested_points])
    is_within = np.all((error <= GUESS_RTOL * magnitude) & (hardening_error <= GUESS_RTOL), axis=0)
    usable: BoolArray = is_within & (points.cusp[start] * points.cusp[end] == 0)
    return usable


def _slopes(points: FoldPoints, side: int, start: IndexArray, end: IndexArray) -> Values:
    """Return the slopes of one deflection at both ends of cells.

    At a cusp, it is the slope with which the cubic passes through a point near the middle.
    """
    tau_e, phi = points.tau_e, points.phi[side]
    first_cusp, last_cusp = points.cusp[start] > 0, points.cusp[end] > 0
    chord = (phi[end] - phi[start]) / (tau_e[end] - tau_e[start])
    first, last = (_limit_slope(points.slope[side, nodes], chord) for nodes in (start, end))
    share = np.where(first_cusp, MIDDLE_ROOT**2, 1 - MIDDLE_ROOT**2)
    middle = np.searchsorted(tau_e, tau_e[start] + share * (tau_e[end] - tau_e[start]))
    middle = np.clip(middle, start + 1, np.maximum(end - 1, start + 1))
    cubic = _cubic_arguments(points, start, end, middle)
    middle_error = phi[middle] - cubic(
        phi[start], phi[end], np.where(first_cusp, 0.0, first), np.where(last_cusp, 0.0, last)
    )
    x = cubic.x
    start_slope, end_slope = (
        middle_error / (cubic.start * x * (1 - x) ** 2),
        -middle_error / (cubic.end * x**2 * (1 - x)),
    )
    has_middle = end > start + 1
    return (
        np.where(first_cusp, np.where(has_middle, start_slope, chord), first),
        np.where(last_cusp, np.where(has_middle, end_slope, chord), last),
    )


def _cubic_arguments(
    points: FoldPoints, start: IndexArray, end: IndexArray, indices: IndexArray
) -> _CubicArguments:
    """Return the arguments of the cubics at the points `indices` in cells from `start` to `end`."""
    width = points.tau_e[end] - points.tau_e[start]
    share = (points.tau_e[indices] - points.tau_e[start]) / width
    return _CubicArguments.of(share, width, (points.cusp[start], points.cusp[end]))


def _limit_slope(slope: FloatArray, chord: FloatArray) -> FloatArray:
    """Return the slope, limited so that a cubic with that chord is monotone."""
    ratio = np.nan_to_num(slope / chord, nan=1.0, posinf=MONOTONE_SLOPE_RATIO, neginf=0.0)
    return chord * np.clip(ratio, 0, MONOTONE_SLOPE_RATIO)


def _map_with_nodes(points: FoldPoints, node_indices: IndexArray) -> FoldMap:
    """Return the map with nodes at some of the points."""
    connected = np.flatnonzero(points.last[node_indices[1:]] == points.last[node_indices[:-1]])
    slope_before, slope_after = np.full((2, 2, node_indices.size), np.nan)
    for side in range(2):
        cells = node_indices[connected], node_indices[connected + 1]
        slope_after[side, connected], slope_before[side, connected + 1] = _slopes(points, side, *cells)
    slope = np.where(
        np.isnan(slope_before) | (np.abs(slope_after) < np.abs(slope_before)), slope_after, slope_before
    )
    single_slope = round_to_single(slope)
    nodes = np.stack(
        (points.tau_e[node_indices], *points.phi[:, node_indices], *single_slope, points.cusp[node_indices])
    )
    bend = np.abs(slope_after[:, 1:] - slope_before[:, :-1]).sum(axis=0) / np.abs(slope_after[:, 1:]).sum(
        axis=0
    )
    is_repeated = (nodes[:3, 1:] == nodes[:3, :-1]).all(axis=0) & (bend <= SAME_SLOPE_RTOL)
    return FoldMap(*np.delete(nodes, np.flatnonzero(is_repeated), axis=1))


MAX_NEWTON_STEPS = 12
"""Largest number of Newton steps to a fold where the map is not close enough; three or four suffice."""

NEWTON_RTOL = OfRounding(1e-9, power=0.5)
"""Relative size of a Newton step below which the next would be rounding."""


def outermost_fold(balance: Balance, folds: FoldMap, tau_e: FloatArray) -> tuple[BoolArray, PairState]:
    """Return whether there is a fold, and the state of the springs at the outermost; arrays (samples,)."""
    if np.isnan(folds.phi_1).all():
        undefined = np.full_like(tau_e, np.nan)
        spring = SpringState(*[undefined] * len(SpringState._fields))
        return np.zeros_like(tau_e, dtype=bool), PairState(undefined, undefined, spring, spring)
    exists, approximate, corners = folds.guess(tau_e)
    box = (*_ordered_pair(*corners[:2]), *_ordered_pair(*corners[2:]))
    guess = balance.state(*approximate)
    rho = guess.rho
    steps = newton_step(guess, rho, tau_e)
    fold = where_needed(
        exists & ~is_short(guess, rho, steps),
        lambda *unsolved: _fold_in_box(balance, *unsolved),
        (tau_e, *approximate, *box),
        guess.after(*_clip_to_box(box, approximate, steps)).values,
    )
    return exists, PairState.of(fold)


def _clip_to_box(box: Values, approximate: Values, steps: Values) -> Values:
    """Return the steps, clipped to the box.

    By rounding of the elastic torque they would leave it if one spring were stretched 1e16 times farther than
    the other.
    """
    low_1, high_1, low_2, high_2 = box
    (approximate_1, approximate_2), (step_1, step_2) = approximate, steps
    return np.clip(step_1, low_1 - approximate_1, high_1 - approximate_1), np.clip(
        step_2, low_2 - approximate_2, high_2 - approximate_2
    )


def _fold_in_box(
    balance: Balance, tau_e: FloatArray, guess_1: FloatArray, guess_2: FloatArray, *box: FloatArray
) -> Values:
    """Return the fold between two corners of a box: by Newton's method from a guess, else by bracketing."""

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (phi_1, phi_2, _), (tau_e, low_1, high_1, low_2, high_2) = state, constants
        springs = balance.state(phi_1, phi_2)
        step_1, step_2 = newton_step(springs, springs.rho, tau_e)
        change = (np.abs(step_1) + np.abs(step_2)) / (np.abs(phi_1) + np.abs(phi_2))
        next_point = np.clip(phi_1 + step_1, low_1, high_1), np.clip(phi_2 + step_2, low_2, high_2)
        return (*next_point, change), ~(change > NEWTON_RTOL)

    low_1, high_1, low_2, high_2 = box
    start = np.clip(guess_1, low_1, high_1), np.clip(guess_2, low_2, high_2)
    *phi, change = repeat(step, (*start, np.zeros_like(tau_e)), (tau_e, *box), MAX_NEWTON_STEPS)
    phi_1, phi_2 = where_needed(
        ~(change <= NEWTON_RTOL),
        lambda *unsolved: bracketed_in_box(balance, *unsolved),
        (tau_e, *box),
        tuple(phi),
    )
    return balance.state(phi_1, phi_2).values


def _ordered_pair(first: FloatArray, second: FloatArray) -> Values:
    return np.minimum(first, second), np.maximum(first, second)
