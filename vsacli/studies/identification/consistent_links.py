"""Physically consistent links near those of the file that have the identified base parameters.

A link is physically consistent if its pseudo-inertia P, the second moments of its mass in homogeneous
coordinates, is positive definite: mass and inertia are positive and the triangle inequality holds (P. M.
Wensing, S. Kim, J.-J. E. Slotine, IEEE Robotics and Automation Letters 3 (2018)). The nearest links minimize
the relative entropy tr(P_0^-1 P) - ln det(P_0^-1 P) - 4, which does not depend on frames and units (T. Lee,
P. M. Wensing, F. C. Park, IEEE Transactions on Robotics 36 (2020)). It is convex in the parameters, and
infinite where P is singular, so that Newton's method finds the unique minimum without a semidefinite solver.

A rigid joint has motor and link in one equation, which determines the sum of their inertias, say. So further
parameters of joints and motors in such sums are sought with the links: a positive one is a 1 x 1 matrix P.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.robot.joint import Link
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.studies.identification.fitted_system import Solution
from vsacli.studies.identification.link_equations import LinkSystem
from vsacli.studies.identification.regressor import SYMBOLS, about_origin, link_of, tensor_entries

WEIGHT = 1.0
"""Weight of the relative entropy against half the squared deviation in standard errors: where a recording
determines little, links should deviate by a standard error rather than be far from the file. With 0.01, a
link came out with 141 kg."""

MAX_LINK_DEVIATION = 3.0
"""Largest deviation of consistent links from the result, in standard errors: one of forty parameters exceeds
two by chance."""

MIN_MASS_SHARE = 1e-3
"""Mass of the reference body for a link without mass, relative to the heaviest link."""

MIN_GYRATION_RADIUS = 5e-3
"""Radius of gyration of the reference body for a link without inertia, m."""

SIGNED_SHIFT = 10.0
"""Shift of a parameter of any sign, such as an offset, relative to its size, that makes it a positive one."""

MIN_STANDARD_ERROR = 1e-6
"""Lower bound of standard errors, relative to the value or 1, so that exact recordings have a covariance."""

WEIGHT_RATIO = 2.0
"""Ratio of successive weights that lead from the file's links to the identified ones, each minimum being the
next start. With 10, a quarter of random arms a thousand standard errors away did not converge; with 3, all
did."""

MAX_NEWTON_STEPS = 100
"""Limit on Newton steps per weight; one to ten suffice."""

DECREMENT_TOLERANCE = 1e-6
"""Newton decrement at a minimum: half its square is the remaining gain. Steps by 1/(1 + decrement) keep links
consistent (S. Boyd, L. Vandenberghe, Convex Optimization, 2004, section 9.6)."""


class LinkEstimate(NamedTuple):
    """The identified combinations of standard parameters, with values and covariance.

    Attributes:
        shares: factors of the parameters of all links, then of further ones, in each combination,
            (combinations, parameters).
        values: values of the combinations, (combinations,).
        covariance: covariance of the values, (combinations, combinations).
        parts: further parameters of the robot file, of joints and rigid drives.
    """

    shares: FloatArray
    values: FloatArray
    covariance: FloatArray
    parts: tuple[Parameter, ...] = ()

    @property
    def spread(self) -> FloatArray:
        """Covariance that is not singular for recordings without noise."""
        errors = MIN_STANDARD_ERROR * np.maximum(np.abs(self.values), 1.0)
        return np.asarray(self.covariance + np.diag(errors**2))


class ConsistentLinks(NamedTuple):
    """Physically consistent links.

    Attributes:
        links: links of all joints; empty if nothing was identified, or if no consistent links
            agree with the result.
        off: deviation of the links from each identified value, in standard errors, (combinations,).
        parts: values of further parameters of the file by path, which have the identified sums.
    """

    links: tuple[Link, ...]
    off: FloatArray
    parts: Mapping[str, float] = MappingProxyType({})

    @property
    def within(self) -> bool:
        """Whether consistent links agree with the result within its errors."""
        return bool(np.all(np.abs(self.off) <= MAX_LINK_DEVIATION))


def consistent_links(robot: Robot, estimate: LinkEstimate) -> ConsistentLinks:
    """Return the physically consistent links nearest to a robot's that have the identified values.

    Args:
        robot: robot as in its file.
        estimate: identified values.
    """
    if not len(estimate.values):
        return ConsistentLinks((), estimate.values)
    bodies = np.concatenate([_body_near(joint.link, robot) for joint in robot.joints])
    parts, shift = _positive_parts_near(estimate, len(bodies))
    covariance_root = np.asarray(np.linalg.cholesky(estimate.spread), dtype=np.float64)
    problem = _ConsistencyProblem.of(estimate, covariance_root, bodies, parts, shift)
    link_parameters, part_values = _nearest_parameters(problem, np.concatenate((bodies, parts)))
    parameters = np.concatenate((link_parameters.ravel(), part_values))
    deviations = (estimate.shares @ parameters - estimate.values) / np.linalg.norm(covariance_root, axis=1)
    nearest = ConsistentLinks((), deviations)
    if not nearest.within:
        return nearest  # its links are almost inconsistent: with hardly any mass, or flat
    values = dict(zip(map(str, estimate.parts), map(float, part_values), strict=True))
    determines_links = estimate.shares[:, : len(bodies)].any()
    return nearest._replace(
        links=tuple(map(link_of, link_parameters)) if determines_links else (), parts=values
    )


def pseudo_inertia(parameters: FloatArray) -> FloatArray:
    """Return the second moments of the mass, (..., 4, 4), from standard parameters, (..., 10)."""
    return np.asarray(np.tensordot(parameters, _BASIS, axes=1))


def _inertia_basis() -> FloatArray:
    """Return the pseudo-inertias of one unit of each parameter, (10, 4, 4)."""
    basis = np.zeros((len(SYMBOLS), 4, 4))
    basis[0, 3, 3] = 1.0
    for axis in range(3):
        basis[1 + axis, axis, 3] = basis[1 + axis, 3, axis] = 1.0
        basis[4 + axis, :3, :3] = np.eye(3) / 2
        basis[4 + axis, axis, axis] = -0.5
    for index, (row, column) in enumerate(((0, 1), (0, 2), (1, 2)), 7):
        basis[index, row, column] = basis[index, column, row] = -1.0
    return basis


_BASIS = _inertia_basis()


def _body_near(link: Link, robot: Robot) -> FloatArray:
    """Return the parameters of a link, (10,), changed only as far as consistency requires."""
    max_mass = max(each.link.mass for each in robot.joints) or 1.0
    mass, com = max(link.mass, MIN_MASS_SHARE * max_mass), np.array(link.com)
    inertia = link.inertia.tensor
    second_moments, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    second_moments = np.maximum(second_moments, mass * MIN_GYRATION_RADIUS**2)
    central_inertia = (axes * (second_moments.sum() - second_moments)) @ axes.T
    return about_origin(np.array([mass, *com, *tensor_entries(central_inertia)]))


def _positive_parts_near(estimate: LinkEstimate, bodies: int) -> tuple[FloatArray, FloatArray]:
    """Return values near those of the further parameters, and what is added to make them positive, (parts,).

    Positive ones are at least a small share of their sums.
    """
    file_values = np.array([each.value for each in estimate.parts])
    with np.errstate(divide="ignore"):
        sum_bounds = np.abs(estimate.values)[:, None] / np.abs(estimate.shares[:, bodies:])
    min_values = np.maximum(MIN_MASS_SHARE * np.min(sum_bounds, axis=0, initial=1.0), MIN_STANDARD_ERROR)
    is_positive = ["positive" in each.requirement for each in estimate.parts]
    return np.where(is_positive, np.maximum(file_values, min_values), file_values), np.where(
        is_positive, 0.0, SIGNED_SHIFT * np.maximum(np.abs(file_values), min_values)
    )


class _ConsistencyProblem(NamedTuple):
    """Coordinates s of the parameters x = center + directions @ s; the first s are errors of the result.

    Attributes:
        center: parameters with the identified values, (parameters,).
        directions: directions, (parameters, parameters); the first ones change the identified values by
            standard errors, the others keep them.
        errors: number of the first directions.
        inverse: inverses of the pseudo-inertias of the reference links, (links, 4, 4).
        shift: values added to the further parameters, which make them positive, (parts,).
        reference: values that these sums should be near, (parts,).
    """

    center: FloatArray
    directions: FloatArray
    errors: int
    inverse: FloatArray
    shift: FloatArray
    reference: FloatArray

    @classmethod
    def of(
        cls,
        estimate: LinkEstimate,
        covariance_root: FloatArray,
        bodies: FloatArray,
        parts: FloatArray,
        shift: FloatArray,
    ) -> _ConsistencyProblem:
        """Return the problem for an estimate; `covariance_root` is a square root of its covariance."""
        q, r = map(np.asarray, np.linalg.qr(estimate.shares.T, mode="complete"))
        value_count = len(estimate.values)
        estimate_basis = q[:, :value_count]
        center = estimate_basis @ scipy.linalg.solve_triangular(r[:value_count], estimate.values, trans="T")
        error_directions = estimate_basis @ scipy.linalg.solve_triangular(
            r[:value_count], covariance_root, trans="T"
        )
        inverse = np.asarray(
            np.linalg.inv(pseudo_inertia(bodies.reshape(-1, len(SYMBOLS)))), dtype=np.float64
        )
        return cls(
            center,
            np.hstack((error_directions, q[:, value_count:])),
            value_count,
            inverse,
            shift,
            parts + shift,
        )

    def parameters(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the standard parameters at s, (links, 10), and the further ones, (parts,)."""
        x: FloatArray = self.center + self.directions @ s
        link_parameters, part_values = np.split(x, [len(x) - len(self.shift)])
        return link_parameters.reshape(-1, len(SYMBOLS)), part_values

    def value(self, s: FloatArray, weight: float) -> float:
        """Return relative entropy plus half the squared errors over the weight; infinite if inconsistent."""
        link_parameters, part_values = self.parameters(s)
        matrices, part_ratios = pseudo_inertia(link_parameters), (part_values + self.shift) / self.reference
        try:
            np.linalg.cholesky(matrices)
        except np.linalg.LinAlgError:
            return np.inf
        if np.any(part_ratios <= 0):
            return np.inf
        entropy = np.einsum("lij,lji->", self.inverse, matrices) - np.linalg.slogdet(matrices)[1].sum()
        error_cost = s[: self.errors] @ s[: self.errors] / (2 * weight)
        return float(entropy + error_cost + np.sum(part_ratios - np.log(part_ratios)))

    def slopes(self, s: FloatArray, weight: float) -> tuple[FloatArray, FloatArray]:
        """Return the gradient and the Hessian of the value."""
        link_parameters, part_values = self.parameters(s)
        inverse_inertias, inverse_parts = (
            np.linalg.inv(pseudo_inertia(link_parameters)),
            1 / (part_values + self.shift),
        )
        link_gradient = np.einsum("lij,pji->lp", self.inverse - inverse_inertias, _BASIS).ravel()
        gradient = np.concatenate((link_gradient, 1 / self.reference - inverse_parts))
        basis_products = np.einsum("lij,pjk->lpik", inverse_inertias, _BASIS)
        blocks = np.einsum("lpik,lqki->lpq", basis_products, basis_products)
        hessian = np.diag(np.concatenate((0 * link_gradient, inverse_parts**2)))
        for link, block in enumerate(blocks):
            link_slice = slice(link * len(SYMBOLS), (link + 1) * len(SYMBOLS))
            hessian[link_slice, link_slice] = block
        error_weights = np.where(np.arange(len(s)) < self.errors, 1 / weight, 0.0)
        return (
            self.directions.T @ gradient + error_weights * s,
            self.directions.T @ hessian @ self.directions + np.diag(error_weights),
        )


def _nearest_parameters(problem: _ConsistencyProblem, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the parameters of links and the further ones with the least value, from a consistent start."""
    s = np.asarray(np.linalg.solve(problem.directions, start - problem.center), dtype=np.float64)
    squared_errors = float(s[: problem.errors] @ s[: problem.errors])
    last_power = int(np.ceil(np.log10(max(squared_errors, 1.0) / WEIGHT) / np.log10(WEIGHT_RATIO)))
    for power in range(last_power, -1, -1):
        s = _newton_minimum(problem, s, WEIGHT * WEIGHT_RATIO**power)
    return problem.parameters(s)


def _newton_minimum(problem: _ConsistencyProblem, s: FloatArray, weight: float) -> FloatArray:
    """Return the minimum by Newton steps, halved until the value decreases, at most to 1/(1 + decrement)."""
    for _ in range(MAX_NEWTON_STEPS):
        gradient, hessian = problem.slopes(s, weight)
        scale: FloatArray = 1 / np.sqrt(np.diagonal(hessian))
        try:
            step: FloatArray = -scale * np.linalg.solve(hessian * np.outer(scale, scale), scale * gradient)
        except np.linalg.LinAlgError:
            break  # almost inconsistent links, far from the identified values
        decrement = math.sqrt(max(-float(gradient @ step), 0.0))
        if decrement <= DECREMENT_TOLERANCE:
            break
        value, certain_share, step_share = problem.value(s, weight), 1 / (1 + decrement), 1.0
        while step_share > certain_share and not problem.value(s + step_share * step, weight) < value:
            step_share = max(step_share / 2, certain_share)
        s = np.asarray(s + step_share * step)
    return s


def found_links(robot: Robot, solution: Solution) -> ConsistentLinks:
    """Return the physically consistent links for the solution of a system of links.

    A sum of dampings or of friction that is held at zero has no parts.
    """
    system = solution.system
    assert isinstance(system, LinkSystem), "of links"
    estimate, covariance_indices = _link_estimate(system, solution)
    nearest_links = consistent_links(robot, estimate)
    part_shares = (
        system.base.shares[:, -len(system.parts) :] if system.parts else np.zeros((len(system.names), 0))
    )
    held_parts = {
        str(part): 0.0
        for index, each in solution.bound.items()
        if system.sums[index] and each.value != system.before[index]
        for part, share in zip(system.parts, part_shares[index], strict=True)
        if share
    }
    separate_parts = (
        dict(_separate_estimates(system, solution, estimate, covariance_indices, nearest_links))
        if nearest_links.within and len(covariance_indices)
        else {}
    )
    return nearest_links._replace(parts={**nearest_links.parts, **held_parts, **separate_parts})


def _separate_estimates(
    system: LinkSystem,
    solution: Solution,
    estimate: LinkEstimate,
    covariance_indices: IndexArray,
    nearest_links: ConsistentLinks,
) -> Iterator[tuple[str, float]]:
    """Yield the likeliest values of parameters found alone, by path, where sums are those of the links.

    An offset, say, is hardly distinguished from gravity: with the links of the file, its likeliest value is
    another one, and the torques remain those found.
    """
    value_changes = nearest_links.off * np.sqrt(np.diagonal(estimate.spread))
    weights = np.linalg.solve(estimate.spread, value_changes)
    for free_index, number in enumerate(solution.free):
        if (
            number >= system.bodies
            and free_index not in covariance_indices
            and np.isfinite(solution.fit.standard_errors[free_index])
        ):
            value = float(
                solution.fit.values[free_index]
                + solution.fit.covariance[free_index, covariance_indices] @ weights
            )
            if system.admissible(number, value) == value:
                yield str(system.part(number)), value


def _link_estimate(system: LinkSystem, solution: Solution) -> tuple[LinkEstimate, IndexArray]:
    """Return the identifiable sums and base parameters of links, and their indices among the free ones.

    A parameter of the file that was identified alone is none of them.
    """
    fit, base, free = solution.fit, system.base, list(solution.free)
    sum_terms = {each.terms[0][0]: each.terms for each in fit.inseparable}
    identifiable_indices = [
        at for at in range(len(free)) if at in sum_terms or np.isfinite(fit.standard_errors[at])
    ]
    rows = np.zeros((len(identifiable_indices), len(base.kept)))
    for row, at in zip(rows, identifiable_indices, strict=True):
        for free_index, factor in sum_terms.get(at, ((at, 1.0),)):
            row[free[free_index]] = factor
    shares = rows @ base.shares
    link_columns = base.shares.shape[1] - len(system.parts)
    row_indices = np.flatnonzero([row[:link_columns].any() or np.count_nonzero(row) > 1 for row in shares])
    covariance_indices = np.array(identifiable_indices, dtype=int)[row_indices]
    part_indices = np.flatnonzero(shares[row_indices, link_columns:].any(axis=0))
    estimate = LinkEstimate(
        shares=np.hstack(
            (shares[row_indices, :link_columns], shares[row_indices, link_columns:][:, part_indices])
        ),
        values=(rows @ solution.predicting)[row_indices],
        covariance=fit.covariance[np.ix_(covariance_indices, covariance_indices)],
        parts=tuple(system.parts[at] for at in part_indices),
    )
    return estimate, covariance_indices


def doubts_of(links: ConsistentLinks) -> Iterator[str]:
    """Yield a sentence if no consistent links agree with the result."""
    if not links.within:
        deviations = np.abs(links.off).max()
        yield (
            "no bodies near the links of the file have the base parameters found: "
            f"some are {deviations:.2g} standard errors off, more than {MAX_LINK_DEVIATION:g}, so the links "
            "stay as they are; do forces act on the arm?"
        )
