"""Weighted linear least squares that says how far off its numbers may be, and which cannot be told."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.studies.identification.estimation.equations import Equations, System
from vsacli.studies.identification.estimation.independence import Independence, in_words, independence
from vsacli.studies.identification.estimation.score_covariance import score_covariance

SEPARABLE = 1 / 300
"""Share of a column that no combination of the others explains, from which on its unknown can be told.

At a constant stiffness the shares that k and k_c of the paper's arm leave to each other are some 1e-3, no
more than filtered noise changes these columns by, and k_c came out off by its own size; a stiffness of two
sines leaves 0.1 and more."""

QUIET = 1e-9
"""Noise of a group, over what was measured, below which it is the rounding of filters and not noise."""

PASSES = 20
"""Times the noise of the groups is estimated at most; three or four do unless a group has hardly any rows."""

SETTLED = 0.01
"""Relative change of the noise of a group that ends this."""


class Combination(NamedTuple):
    """What can be told of unknowns that cannot be told apart: the sum of factor times unknown.

    Attributes:
        terms: index of each unknown with its factor; that of the first one is 1.
        value: of the sum.
        standard_error: of that.
    """

    terms: tuple[tuple[int, float], ...]
    value: float
    standard_error: float

    def words(self, names: Sequence[str]) -> str:
        """The sum in names of the unknowns, e.g. `k + 0.0123 k_c`."""
        return in_words(self.terms, names)


class Fit(NamedTuple):
    """Unknowns by least squares.

    Attributes:
        values: of the unknowns, (unknowns,); those that cannot be told are as they were before.
        standard_errors: of these, (unknowns,), NaN for those that cannot be told.
        solution: unknowns that predict best, (unknowns,): of those that cannot be told apart some are as
            before, and the others make up for it.
        covariance: of that, (unknowns, unknowns), zero for those that are as before.
        condition: of the columns, each divided by its norm.
        inseparable: what can be told of unknowns that cannot be told apart.
        unexcited: unknowns that change nothing of what is predicted, (unexcited,).
        residual_rms: root mean square of what is left in each group, corrected for the unknowns.
        converged: whether an iteration came to its end; see `gauss_newton`.
    """

    values: FloatArray
    standard_errors: FloatArray
    solution: FloatArray
    covariance: FloatArray
    condition: float
    inseparable: tuple[Combination, ...]
    unexcited: IndexArray
    residual_rms: dict[str, float]
    converged: bool = True


class Step(NamedTuple):
    """A solution of the linear equations.

    Attributes:
        change: of the unknowns, (unknowns,).
        split: of the weighted columns.
        weight: of each row, 1 over its noise, (rows,).
        noise: of each group, (groups,).
        length: of the change, in units in which the standard errors of white residuals are 1.
    """

    change: FloatArray
    split: Independence
    weight: FloatArray
    noise: FloatArray
    length: float


def least_squares(
    records: Sequence[Equations],
    present: FloatArray,
    tolerance: float = SEPARABLE,
) -> Fit:
    """Solve linear equations; rows of each group count by its noise, which is estimated from what is left.

    Standard errors hold for residuals of any colour, which groups may have in common; see `score_covariance`.

    Args:
        records: equations of each record.
        present: numbers at which they predict, (unknowns,).
        tolerance: share of a column that no combination of the others may explain.

    Raises:
        InputError: there are no more equations than unknowns.
    """
    system = System.of(records)
    return fit_of(system, present, solved(system, tolerance), present)


def solved(system: System, tolerance: float = SEPARABLE) -> Step:
    """The solution alone.

    Raises:
        InputError: there are no more equations than unknowns.
    """
    rows, unknowns = system.slopes.shape
    if rows <= unknowns:
        raise InputError.one(f"{rows} equations do not tell {unknowns} unknowns; record for longer")
    floor = QUIET * _noise(system, system.measured, np.zeros(rows))
    noise = np.maximum(_noise(system, system.residual, np.zeros(rows)), floor)
    for _ in range(PASSES):
        step = _weighted(system, np.where(noise > 0, noise, 1.0), tolerance)
        left = system.residual - system.slopes @ step.change
        before, noise = noise, np.maximum(_noise(system, left, _leverage(step.split.q)), floor)
        if np.all(np.abs(noise - before) <= SETTLED * before):
            break
    return step._replace(noise=noise)


def _weighted(system: System, noise: FloatArray, tolerance: float) -> Step:
    """The solution with the noise of each group known, (groups,)."""
    from scipy.linalg import solve_triangular

    weight = 1 / noise[system.group]
    split = independence(system.slopes * weight[:, None], tolerance, system.noise()[1] * weight[:, None])
    target = split.q.T @ (system.residual * weight)
    change = np.zeros(system.slopes.shape[1])
    change[split.kept] = solve_triangular(split.r, target) / split.scale[split.kept]
    return Step(change, split, weight, noise, float(np.linalg.norm(target)))


def _leverage(q: FloatArray) -> FloatArray:
    leverage: FloatArray = np.einsum("rc,rc->r", q, q)
    return leverage


def _noise(system: System, left: FloatArray, leverage: FloatArray) -> FloatArray:
    """Root mean square of what is left in each group, (groups,), over the rows less what the fit took."""
    freedom = np.maximum(system.by_group(1 - leverage), 1.0)
    return np.sqrt(system.by_group(left**2) / freedom)


def fit_of(
    system: System,
    present: FloatArray,
    step: Step,
    before: FloatArray,
) -> Fit:
    """What a solution says, with its standard errors.

    Args:
        system: the equations at the present numbers.
        present: those, (unknowns,).
        step: the solution.
        before: what unknowns that cannot be told remain, (unknowns,).
    """
    split, left = step.split, system.residual - system.slopes @ step.change
    solution = present + step.change
    covariance = _covariance(system, step, left)
    errors = np.sqrt(np.diagonal(covariance))
    combinations = tuple(_combinations(split, solution, errors))
    told = np.zeros(len(present), dtype=bool)
    told[split.kept] = True
    told[[at for each in combinations for at, _ in each.terms]] = False
    return Fit(
        values=np.where(told, solution, before),
        standard_errors=np.where(told, errors, np.nan),
        solution=solution,
        covariance=covariance,
        condition=split.condition,
        inseparable=combinations,
        unexcited=split.nothing,
        residual_rms=dict(zip(system.groups, map(float, step.noise), strict=True)),
    )


def _covariance(system: System, step: Step, left: FloatArray) -> FloatArray:
    """Of the changed unknowns, (unknowns, unknowns): of the noise, of numbers found before, and of bias.

    Noise in the columns makes unknowns too small (W. A. Fuller, Measurement Error Models, 1987, section 1.1).
    How much is known roughly, and counts as an error.
    """
    from scipy.linalg import solve_triangular

    split, weight = step.split, step.weight[:, None]
    of_scores = score_covariance(system, split.q, left * step.weight)
    of_errors = split.q.T @ (system.errors * weight)
    of_residual, of_slopes = system.noise()
    of_residual = of_residual - of_slopes @ step.change
    of_slopes = of_slopes[:, split.kept] / split.scale[split.kept] * weight
    bias = solve_triangular(split.r, of_slopes.T @ (of_residual * step.weight), trans="T")
    of_scores = of_scores + of_errors @ of_errors.T + np.outer(bias, bias)
    half = solve_triangular(split.r, of_scores)
    inner = solve_triangular(split.r, half.T) / np.outer(split.scale[split.kept], split.scale[split.kept])
    covariance = np.zeros((system.slopes.shape[1],) * 2)
    covariance[np.ix_(split.kept, split.kept)] = inner
    return covariance


def _combinations(split: Independence, solution: FloatArray, errors: FloatArray) -> list[Combination]:
    """One for each kept column of which others have a share."""
    found = []
    for place, kept in enumerate(split.kept):
        shares = split.shares[place]
        others = [(int(split.dropped[at]), float(shares[at])) for at in np.flatnonzero(shares)]
        if others:
            terms = ((int(kept), 1.0), *others)
            value = sum(factor * solution[at] for at, factor in terms)
            found.append(Combination(terms, float(value), float(errors[kept])))
    return found
