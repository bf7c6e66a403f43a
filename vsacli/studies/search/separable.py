"""Problems whose cost and bounds depend on a few rows at each instant, which are linear in the unknowns.

For example, the rows are the stiffness of a joint and its two derivatives, and the unknowns are coefficients
of a spline. So gradients and Hessians by the unknowns follow from small ones by the rows, instant by instant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.compute.duals import Dual, seeds, tangent_of, value_of
from vsacli.studies.search.interior_point import minimize
from vsacli.studies.search.nearest_profile import peaks

DIFFERENCE = 1e-6
"""Step for differencing exact gradients, relative to the scale of a row: half of the digits remain."""

MIN_CLEARANCE = 1e-5
"""Clearance of all bounds that a start should have, since the path out of a corner is long."""

MIN_RELIEF = 1e-3
"""Clearance at which relieving the bounds ends; the relief begins as much above the largest bound."""

INTERIOR_SHARES = (0.0, 1e-3, 1e-2, 0.1, 0.3, 0.6, 1.0)
"""Shares of the way to an interior point that are tried, until one leads inside."""

TETHER = 1e-3
"""Cost of moving rows by their scale while bounds are relieved; without it, free unknowns would drift."""


class Functions(Protocol):
    """Integrands of a cost and its bounds: functions of rows at instants, which may carry derivatives."""

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[Sequence[Dual | FloatArray], Sequence[Dual | FloatArray]]:
        """Return integrands of the cost, and bounds, which must not be positive; each (instants,).

        Args:
            rows: rows, each (instants,).
            instants: indices of the instants.
        """


class Sampled(NamedTuple):
    """Functions at instants, (functions, ..., instants), and gradients, (functions, rows, ..., instants)."""

    values: FloatArray
    gradients: FloatArray

    def shaped(self, shape: tuple[int, ...]) -> Sampled:
        """Return the same with the instants divided into several axes."""
        values, gradients = (each.reshape(*each.shape[:-1], *shape) for each in self)
        return Sampled(values, gradients)

    def part(self, part: int) -> Sampled:
        """Return the functions at a part of the instants, an index of the first of their axes."""
        return Sampled(self.values[:, part], self.gradients[:, :, part])


@dataclass(frozen=True, eq=False)
class Group:
    """A part of a problem: a cost and bounds that are functions of the same rows.

    Attributes:
        functions: integrands of the cost, and bounds.
        instants: indices of the instants for the functions, (instants,).
        basis: rows per unit of each unknown, (rows, instants, own unknowns).
        unknowns: indices of the group's unknowns among all, (own unknowns,).
        weights: weight of each integrand at each instant, (integrands, instants).
        bound_mask: mask of the bounds that exist, (bounds, instants).
        scales: sizes of the rows, (rows,).
        offsets: values of the rows if all unknowns are zero, (rows,); zero if None.
    """

    functions: Functions
    instants: IndexArray
    basis: FloatArray
    unknowns: IndexArray
    weights: FloatArray
    bound_mask: BoolArray
    scales: FloatArray
    offsets: FloatArray | None = None

    def rows(self, unknowns: FloatArray) -> FloatArray:
        """Return the rows, (rows, instants), from all unknowns of a problem."""
        rows: FloatArray = self.basis @ unknowns[self.unknowns]
        return rows if self.offsets is None else rows + self.offsets[:, None]

    @property
    def by_instant(self) -> FloatArray:
        """Basis with the axes (instants, rows, own unknowns)."""
        return np.ascontiguousarray(self.basis.transpose(1, 0, 2))

    def costs_and_bounds(self, points: Sequence[FloatArray]) -> list[tuple[float, FloatArray]]:
        """Return the cost and the existing bounds at each of several unknowns."""
        rows = np.concatenate([self.rows(unknowns) for unknowns in points], axis=1)
        integrands, bounds = self.functions(rows, np.tile(self.instants, len(points)))
        parts = (np.split(_stack_values(each, rows), len(points), axis=1) for each in (integrands, bounds))
        return [
            (float(np.sum(self.weights * costs)), bounds_at_point[self.bound_mask])
            for costs, bounds_at_point in zip(*parts, strict=True)
        ]

    def bounds(self, rows: FloatArray) -> FloatArray:
        """Return all bounds, (bounds, instants)."""
        return _stack_values(self.functions(rows, self.instants)[1], rows)

    def sampled(self, rows: FloatArray, instants: IndexArray) -> tuple[Sampled, Sampled]:
        """Return integrands and bounds with their gradients."""
        integrands, bounds = self.functions(seeds(list(rows)), instants)
        return _sample_functions(integrands, rows), _sample_functions(bounds, rows)


def _stack_values(functions: Sequence[Dual | FloatArray], rows: FloatArray) -> FloatArray:
    shape = rows.shape[1:]
    values = [np.broadcast_to(value_of(each), shape) for each in functions]
    return np.stack(values) if values else np.zeros((0, *shape))


def _sample_functions(functions: Sequence[Dual | FloatArray], rows: FloatArray) -> Sampled:
    gradients = [tangent_of(each, len(rows), rows.shape[1:]) for each in functions]
    stacked_gradients = np.stack(gradients) if gradients else np.zeros((0, *rows.shape))
    return Sampled(_stack_values(functions, rows), stacked_gradients)


class _ExpandedGroup:
    """A group at given unknowns: functions and gradients there, and with each row displaced a little."""

    def __init__(self, group: Group, integrands: Sampled, bounds: Sampled, steps: FloatArray) -> None:
        self.group, self._steps = group, steps
        self.integrands, *self._displaced_integrands = (
            integrands.part(each) for each in range(len(steps) + 1)
        )
        base_bounds, *self._displaced_bounds = (bounds.part(each) for each in range(len(steps) + 1))
        self.bounds = base_bounds._replace(
            gradients=np.where(group.bound_mask[:, None], base_bounds.gradients, 0.0)
        )

    @classmethod
    def each(cls, group: Group, points: Sequence[FloatArray]) -> list[_ExpandedGroup]:
        """Return the group at each of several unknowns.

        One call computes all of them, and all displacements, since a call costs more than many instants.
        """
        steps = DIFFERENCE * group.scales
        rows = np.stack([group.rows(unknowns) for unknowns in points], axis=1)
        displaced_rows = rows[:, :, None] + np.diag(steps)[:, None, :, None]
        all_rows = np.concatenate([rows[:, :, None], displaced_rows], axis=2)
        instants = np.tile(group.instants, len(points) * (len(steps) + 1))
        samples = group.sampled(all_rows.reshape(len(rows), -1), instants)
        integrands, bounds = (each.shaped(all_rows.shape[1:]) for each in samples)
        return [cls(group, integrands.part(index), bounds.part(index), steps) for index in range(len(points))]

    def gradient(self) -> FloatArray:
        """Return the gradient of the cost by the own unknowns."""
        return self._gradient_by_unknowns(_weighted_gradient(self.group.weights, self.integrands.gradients))

    def pull(self, weights: FloatArray) -> FloatArray:
        """Return the weighted sum of the bounds' gradients, (own unknowns,)."""
        return self._gradient_by_unknowns(
            _weighted_gradient(self._for_all_bounds(weights), self.bounds.gradients)
        )

    def changes(self, step: FloatArray) -> FloatArray:
        """Return the first-order changes of the existing bounds with a step."""
        row_changes = self.group.basis @ step[self.group.unknowns]
        return np.asarray(np.sum(self.bounds.gradients * row_changes, axis=1)[self.group.bound_mask])

    def newton_matrix(self, multipliers: FloatArray, stiffening: FloatArray, convex: bool) -> FloatArray:
        """See `Point.newton_matrix`; (own unknowns, own unknowns)."""
        curved = self._curvature(self._for_all_bounds(multipliers))
        if convex:
            values, vectors = np.linalg.eigh(curved)
            curved = np.einsum("iab,ib,icb->iac", vectors, np.maximum(values, 0.0), vectors)
        slopes = self.bounds.gradients.transpose(2, 1, 0)
        weighted = slopes * self._for_all_bounds(stiffening).T[:, None]
        joined = (curved + weighted @ slopes.swapaxes(1, 2)) @ self.group.by_instant
        size = joined.shape[2]
        return self.group.by_instant.reshape(-1, size).T @ joined.reshape(-1, size)

    def _curvature(self, multipliers: FloatArray) -> FloatArray:
        """Return the Hessian of the Lagrangian by rows, (instants, rows, rows), by finite differences."""
        displaced_gradients = [
            _weighted_gradient(self.group.weights, gradient.gradients)
            + _weighted_gradient(multipliers, displaced_bounds.gradients)
            for gradient, displaced_bounds in zip(
                self._displaced_integrands, self._displaced_bounds, strict=True
            )
        ]
        gradient = _weighted_gradient(self.group.weights, self.integrands.gradients)
        gradient = gradient + _weighted_gradient(multipliers, self.bounds.gradients)
        second_differences = (np.stack(displaced_gradients, axis=1) - gradient[:, None, :]) / self._steps[
            None, :, None
        ]
        return (second_differences + second_differences.swapaxes(0, 1)).transpose(2, 0, 1) / 2

    def _for_all_bounds(self, existing_values: FloatArray) -> FloatArray:
        """Return values of the existing bounds with zeros for the others, (bounds, instants)."""
        all_values = np.zeros(self.group.bound_mask.shape)
        all_values[self.group.bound_mask] = existing_values
        return all_values

    def _gradient_by_unknowns(self, row_gradient: FloatArray) -> FloatArray:
        return row_gradient.T.ravel() @ self.group.by_instant.reshape(row_gradient.size, -1)


def _weighted_gradient(weights: FloatArray, gradients: FloatArray) -> FloatArray:
    """Return the weighted sum of gradients, (rows, instants); gradients with zero weight may be NaN."""
    finite_gradients = np.where(weights[:, None, :] != 0, gradients, 0.0)
    return np.asarray(np.sum(weights[:, None, :] * finite_gradients, axis=0))


class SeparablePoint:
    """Cost and bounds of a separable problem at unknowns, with their derivatives; a `Point`."""

    def __init__(self, parts: Sequence[_ExpandedGroup], unknown_count: int) -> None:
        self._parts, self._size = parts, unknown_count
        self.cost = sum(float(np.sum(part.group.weights * part.integrands.values)) for part in self._parts)
        bounds_of_parts = [part.bounds.values[part.group.bound_mask] for part in self._parts]
        self.bounds = np.concatenate(bounds_of_parts)
        self._ends = np.cumsum([len(bounds) for bounds in bounds_of_parts])[:-1]
        self.gradient = self._sum_over_parts([part.gradient() for part in self._parts])

    def changes(self, step: FloatArray) -> FloatArray:
        """See `Point`."""
        return np.concatenate([part.changes(step) for part in self._parts])

    def pull(self, weights: FloatArray) -> FloatArray:
        """See `Point`."""
        return self._sum_over_parts(
            [
                part.pull(part_weights)
                for part, part_weights in zip(self._parts, np.split(weights, self._ends), strict=True)
            ]
        )

    def newton_matrix(self, multipliers: FloatArray, stiffening: FloatArray, convex: bool) -> FloatArray:
        """See `Point`."""
        matrix = np.zeros((self._size, self._size))
        pairs = (np.split(each, self._ends) for each in (multipliers, stiffening))
        for part, *of_bounds in zip(self._parts, *pairs, strict=True):
            own = part.group.unknowns
            matrix[np.ix_(own, own)] += part.newton_matrix(*of_bounds, convex)
        return matrix

    def _sum_over_parts(self, part_gradients: Sequence[FloatArray]) -> FloatArray:
        total = np.zeros(self._size)
        for part, part_gradient in zip(self._parts, part_gradients, strict=True):
            total[part.group.unknowns] += part_gradient
        return total


@dataclass(frozen=True, eq=False)
class SeparableProblem:
    """The sum of the costs of several groups, subject to the bounds of all; a `Problem`."""

    groups: Sequence[Group]

    def costs_and_bounds(self, points: Sequence[FloatArray]) -> list[tuple[float, FloatArray]]:
        """See `Problem.costs_and_bounds`."""
        by_group = [group.costs_and_bounds(points) for group in self.groups]
        return [
            (sum(cost for cost, _ in found), np.concatenate([bounds for _, bounds in found]))
            for found in zip(*by_group, strict=True)
        ]

    def at(self, points: Sequence[FloatArray]) -> list[SeparablePoint]:
        """See `Problem.at`."""
        by_group = [_ExpandedGroup.each(group, points) for group in self.groups]
        pairs = zip(zip(*by_group, strict=True), points, strict=True)
        return [SeparablePoint(parts, len(unknowns)) for parts, unknowns in pairs]


def interior(
    problem: SeparableProblem, target: FloatArray, interior_point: FloatArray | None = None
) -> FloatArray | None:
    """Return unknowns near the wanted ones that keep all bounds, or None.

    They lie on the way to an interior point, if one is known; otherwise the largest bound is minimized until
    it is negative.
    """
    feasible = None
    for share in INTERIOR_SHARES:
        shifted = target if interior_point is None else target + share * (interior_point - target)
        ((_, bounds),) = problem.costs_and_bounds([shifted])
        largest_bound = bounds.max(initial=-1.0) if np.isfinite(bounds).all() else np.inf
        feasible = shifted if largest_bound < 0 else feasible
        if largest_bound < -MIN_CLEARANCE:
            break
    if feasible is not None:
        return feasible
    if not np.isfinite(bounds).all():
        return None
    relieved = SeparableProblem([_relieved(group, shifted) for group in problem.groups])
    start = np.append(shifted, bounds.max() + MIN_RELIEF)
    minimum = minimize(relieved, start, enough=lambda unknowns: bool(unknowns[-1] < -MIN_RELIEF))
    return minimum.unknowns[:-1] if minimum.unknowns[-1] < 0 else None


def _relieved(group: Group, start: FloatArray) -> Group:
    """Return the bounds of a group minus a further unknown, the relief, whose mean is the cost."""
    rows, instants, own_unknowns = group.basis.shape
    basis = np.zeros((rows + 1, instants, own_unknowns + 1))
    basis[:-1, :, :-1], basis[-1, :, -1] = group.basis, 1.0
    return Group(
        functions=_Relieved(group, group.rows(start)),
        instants=np.arange(instants),
        basis=basis,
        unknowns=np.append(group.unknowns, len(start)),
        weights=np.full((1, instants), 1 / instants),
        bound_mask=group.bound_mask,
        scales=np.append(group.scales, 1.0),
        offsets=None if group.offsets is None else np.append(group.offsets, 0.0),
    )


class _Relieved:
    """The `Functions` whose cost is a relief and a small cost of moving; the relief lowers all bounds."""

    def __init__(self, group: Group, start: FloatArray) -> None:
        self._group, self._start = group, start

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Return the cost, and the bounds minus the relief; see `Functions`."""
        *own_rows, relief = rows
        _, bounds = self._group.functions(own_rows, self._group.instants[instants])
        row_scales = zip(own_rows, self._start[:, instants], self._group.scales, strict=True)
        displacements = [(row - start_row) / scale for row, start_row, scale in row_scales]
        return [relief + TETHER * sum(displacement * displacement for displacement in displacements)], [
            bound - relief for bound in bounds
        ]


def violated_instants(violations: FloatArray) -> IndexArray:
    """Return the instants to add where bounds, (bounds, instants), are positive and so violated.

    They are the worst instant of each violated stretch and its neighbors: with the worst alone, the next
    minimum would violate the bound at a neighbor, and the search would follow it from instant to instant.
    """
    peak_instants = np.concatenate([peaks(row) for row in violations])
    around = peak_instants[:, None] + np.array([-1, 0, 1])
    return np.unique(np.clip(around, 0, violations.shape[1] - 1))
