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

WITHIN = 3.0
"""Largest deviation of consistent links from the result, in standard errors: one of forty parameters exceeds
two by chance."""

LEAST_MASS = 1e-3
"""Mass of the reference body for a link without mass, relative to the heaviest link."""

LEAST_RADIUS = 5e-3
"""Radius of gyration of the reference body for a link without inertia, m."""

SIGNED = 10.0
"""Shift of a parameter of any sign, such as an offset, relative to its size, that makes it a positive one."""

SHARP = 1e-6
"""Lower bound of standard errors, relative to the value or 1, so that exact recordings have a covariance."""

LIGHTER = 2.0
"""Ratio of successive weights that lead from the file's links to the identified ones, each minimum being the
next start. With 10, a quarter of random arms a thousand standard errors away did not converge; with 3, all
did."""

STEPS = 100
"""Limit on Newton steps per weight; one to ten suffice."""

ARRIVED = 1e-6
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
        errors = SHARP * np.maximum(np.abs(self.values), 1.0)
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
        return bool(np.all(np.abs(self.off) <= WITHIN))


def consistent_links(robot: Robot, estimate: LinkEstimate) -> ConsistentLinks:
    """Return the physically consistent links nearest to a robot's that have the identified values.

    Args:
        robot: robot as in its file.
        estimate: identified values.
    """
    if not len(estimate.values):
        return ConsistentLinks((), estimate.values)
    bodies = np.concatenate([_body_near(joint.link, robot) for joint in robot.joints])
    parts, shift = _parts_near(estimate, len(bodies))
    root = np.asarray(np.linalg.cholesky(estimate.spread), dtype=np.float64)
    problem = _ConsistencyProblem.of(estimate, root, bodies, parts, shift)
    of_links, of_parts = _nearest_parameters(problem, np.concatenate((bodies, parts)))
    found = np.concatenate((of_links.ravel(), of_parts))
    off = (estimate.shares @ found - estimate.values) / np.linalg.norm(root, axis=1)
    nearest = ConsistentLinks((), off)
    if not nearest.within:
        return nearest  # its links are almost inconsistent: with hardly any mass, or flat
    values = dict(zip(map(str, estimate.parts), map(float, of_parts), strict=True))
    changed = estimate.shares[:, : len(bodies)].any()
    return nearest._replace(links=tuple(map(link_of, of_links)) if changed else (), parts=values)


def pseudo_inertia(parameters: FloatArray) -> FloatArray:
    """Return the second moments of the mass, (..., 4, 4), from standard parameters, (..., 10)."""
    return np.asarray(np.tensordot(parameters, _BASIS, axes=1))


def _basis() -> FloatArray:
    """Return the pseudo-inertias of one unit of each parameter, (10, 4, 4)."""
    found = np.zeros((len(SYMBOLS), 4, 4))
    found[0, 3, 3] = 1.0
    for axis in range(3):
        found[1 + axis, axis, 3] = found[1 + axis, 3, axis] = 1.0
        found[4 + axis, :3, :3] = np.eye(3) / 2
        found[4 + axis, axis, axis] = -0.5
    for place, (row, column) in enumerate(((0, 1), (0, 2), (1, 2)), 7):
        found[place, row, column] = found[place, column, row] = -1.0
    return found


_BASIS = _basis()


def _body_near(link: Link, robot: Robot) -> FloatArray:
    """Return the parameters of a link, (10,), changed only as far as consistency requires."""
    heaviest = max(each.link.mass for each in robot.joints) or 1.0
    mass, com = max(link.mass, LEAST_MASS * heaviest), np.array(link.com)
    inertia = link.inertia.tensor
    spread, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    spread = np.maximum(spread, mass * LEAST_RADIUS**2)
    central = (axes * (spread.sum() - spread)) @ axes.T
    return about_origin(np.array([mass, *com, *tensor_entries(central)]))


def _parts_near(estimate: LinkEstimate, bodies: int) -> tuple[FloatArray, FloatArray]:
    """Return values near those of the further parameters, and what is added to make them positive, (parts,).

    Positive ones are at least a small share of their sums.
    """
    of_file = np.array([each.value for each in estimate.parts])
    with np.errstate(divide="ignore"):
        sizes = np.abs(estimate.values)[:, None] / np.abs(estimate.shares[:, bodies:])
    least = np.maximum(LEAST_MASS * np.min(sizes, axis=0, initial=1.0), SHARP)
    positive = ["positive" in each.requirement for each in estimate.parts]
    return np.where(positive, np.maximum(of_file, least), of_file), np.where(
        positive, 0.0, SIGNED * np.maximum(np.abs(of_file), least)
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
        root: FloatArray,
        bodies: FloatArray,
        parts: FloatArray,
        shift: FloatArray,
    ) -> _ConsistencyProblem:
        """Return the problem for an estimate; `root` is a square root of its covariance."""
        q, r = map(np.asarray, np.linalg.qr(estimate.shares.T, mode="complete"))
        count = len(estimate.values)
        to_estimate = q[:, :count]
        center = to_estimate @ scipy.linalg.solve_triangular(r[:count], estimate.values, trans="T")
        errors = to_estimate @ scipy.linalg.solve_triangular(r[:count], root, trans="T")
        inverse = np.asarray(
            np.linalg.inv(pseudo_inertia(bodies.reshape(-1, len(SYMBOLS)))), dtype=np.float64
        )
        return cls(center, np.hstack((errors, q[:, count:])), count, inverse, shift, parts + shift)

    def parameters(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the standard parameters at s, (links, 10), and the further ones, (parts,)."""
        x: FloatArray = self.center + self.directions @ s
        of_links, of_parts = np.split(x, [len(x) - len(self.shift)])
        return of_links.reshape(-1, len(SYMBOLS)), of_parts

    def value(self, s: FloatArray, weight: float) -> float:
        """Return relative entropy plus half the squared errors over the weight; infinite if inconsistent."""
        of_links, of_parts = self.parameters(s)
        matrices, ratio = pseudo_inertia(of_links), (of_parts + self.shift) / self.reference
        try:
            np.linalg.cholesky(matrices)
        except np.linalg.LinAlgError:
            return np.inf
        if np.any(ratio <= 0):
            return np.inf
        entropy = np.einsum("lij,lji->", self.inverse, matrices) - np.linalg.slogdet(matrices)[1].sum()
        errors = s[: self.errors] @ s[: self.errors] / (2 * weight)
        return float(entropy + errors + np.sum(ratio - np.log(ratio)))

    def slopes(self, s: FloatArray, weight: float) -> tuple[FloatArray, FloatArray]:
        """Return the gradient and the Hessian of the value."""
        of_links, of_parts = self.parameters(s)
        inverse, of_part = np.linalg.inv(pseudo_inertia(of_links)), 1 / (of_parts + self.shift)
        of_bodies = np.einsum("lij,pji->lp", self.inverse - inverse, _BASIS).ravel()
        gradient = np.concatenate((of_bodies, 1 / self.reference - of_part))
        moved = np.einsum("lij,pjk->lpik", inverse, _BASIS)
        blocks = np.einsum("lpik,lqki->lpq", moved, moved)
        hessian = np.diag(np.concatenate((0 * of_bodies, of_part**2)))
        for link, block in enumerate(blocks):
            place = slice(link * len(SYMBOLS), (link + 1) * len(SYMBOLS))
            hessian[place, place] = block
        of_errors = np.where(np.arange(len(s)) < self.errors, 1 / weight, 0.0)
        return (
            self.directions.T @ gradient + of_errors * s,
            self.directions.T @ hessian @ self.directions + np.diag(of_errors),
        )


def _nearest_parameters(problem: _ConsistencyProblem, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the parameters of links and the further ones with the least value, from a consistent start."""
    s = np.asarray(np.linalg.solve(problem.directions, start - problem.center), dtype=np.float64)
    off = float(s[: problem.errors] @ s[: problem.errors])
    lighter = int(np.ceil(np.log10(max(off, 1.0) / WEIGHT) / np.log10(LIGHTER)))
    for power in range(lighter, -1, -1):
        s = _minimum(problem, s, WEIGHT * LIGHTER**power)
    return problem.parameters(s)


def _minimum(problem: _ConsistencyProblem, s: FloatArray, weight: float) -> FloatArray:
    """Return the minimum by Newton steps, halved until the value decreases, at most to 1/(1 + decrement)."""
    for _ in range(STEPS):
        gradient, hessian = problem.slopes(s, weight)
        scale: FloatArray = 1 / np.sqrt(np.diagonal(hessian))
        try:
            step: FloatArray = -scale * np.linalg.solve(hessian * np.outer(scale, scale), scale * gradient)
        except np.linalg.LinAlgError:
            break  # almost inconsistent links, far from the identified values
        decrement = math.sqrt(max(-float(gradient @ step), 0.0))
        if decrement <= ARRIVED:
            break
        here, certain, part = problem.value(s, weight), 1 / (1 + decrement), 1.0
        while part > certain and not problem.value(s + part * step, weight) < here:
            part = max(part / 2, certain)
        s = np.asarray(s + part * step)
    return s


def found_links(robot: Robot, found: Solution) -> ConsistentLinks:
    """Return the physically consistent links for the solution of a system of links.

    A sum of dampings or of friction that is held at zero has no parts.
    """
    system = found.system
    assert isinstance(system, LinkSystem), "of links"
    estimate, among = _estimate(system, found)
    nearest = consistent_links(robot, estimate)
    own = system.base.shares[:, -len(system.parts) :] if system.parts else np.zeros((len(system.names), 0))
    held = {
        str(part): 0.0
        for number, each in found.bound.items()
        if system.sums[number] and each.value != system.before[number]
        for part, share in zip(system.parts, own[number], strict=True)
        if share
    }
    alone = (
        dict(_separate_estimates(system, found, estimate, among, nearest))
        if nearest.within and len(among)
        else {}
    )
    return nearest._replace(parts={**nearest.parts, **held, **alone})


def _separate_estimates(
    system: LinkSystem, found: Solution, estimate: LinkEstimate, among: IndexArray, nearest: ConsistentLinks
) -> Iterator[tuple[str, float]]:
    """Yield the likeliest values of parameters found alone, by path, where sums are those of the links.

    An offset, say, is hardly distinguished from gravity: with the links of the file, its likeliest value is
    another one, and the torques remain those found.
    """
    change = nearest.off * np.sqrt(np.diagonal(estimate.spread))
    weights = np.linalg.solve(estimate.spread, change)
    for at, number in enumerate(found.free):
        if number >= system.bodies and at not in among and np.isfinite(found.fit.standard_errors[at]):
            value = float(found.fit.values[at] + found.fit.covariance[at, among] @ weights)
            if system.admissible(number, value) == value:
                yield str(system.part(number)), value


def _estimate(system: LinkSystem, found: Solution) -> tuple[LinkEstimate, IndexArray]:
    """Return the identifiable sums and base parameters of links, and their indices among the free ones.

    A parameter of the file that was identified alone is none of them.
    """
    fit, base, free = found.fit, system.base, list(found.free)
    combined = {each.terms[0][0]: each.terms for each in fit.inseparable}
    first = [at for at in range(len(free)) if at in combined or np.isfinite(fit.standard_errors[at])]
    rows = np.zeros((len(first), len(base.kept)))
    for row, at in zip(rows, first, strict=True):
        for place, factor in combined.get(at, ((at, 1.0),)):
            row[free[place]] = factor
    shares = rows @ base.shares
    bodies = base.shares.shape[1] - len(system.parts)
    there = np.flatnonzero([row[:bodies].any() or np.count_nonzero(row) > 1 for row in shares])
    among = np.array(first, dtype=int)[there]
    inside = np.flatnonzero(shares[there, bodies:].any(axis=0))
    estimate = LinkEstimate(
        shares=np.hstack((shares[there, :bodies], shares[there, bodies:][:, inside])),
        values=(rows @ found.predicting)[there],
        covariance=fit.covariance[np.ix_(among, among)],
        parts=tuple(system.parts[at] for at in inside),
    )
    return estimate, among


def doubts_of(links: ConsistentLinks) -> Iterator[str]:
    """Yield a sentence if no consistent links agree with the result."""
    if not links.within:
        off = np.abs(links.off).max()
        yield (
            "no bodies near the links of the file have the base parameters found: "
            f"some are {off:.2g} standard errors off, more than {WITHIN:g}, so the links stay as they are; "
            "do forces act on the arm?"
        )
