"""Least squares of the equations of recordings, with standard errors for residuals of any color.

`Equations` hold at the samples of one recording, a `System` stacks those of all. `least_squares` solves
linear ones, weighted by the noise of each group, and says which unknowns cannot be told; `gauss_newton`
repeats that for equations that are not linear. Covariances are the sandwich of `score_covariance`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import AnyArray, FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.studies.identification.independence import Independence, in_words, independence
from vsacli.studies.measured.line_fit import count_of_cosines, covariance_of_sum


class Equations(NamedTuple):
    """Equations of one record that are linear in the changes of some unknowns, rows in any order.

    Attributes:
        measured: measured values, (rows,).
        predicted: the same by the present numbers, (rows,).
        slopes: its derivatives by the unknowns, (rows, unknowns).
        group: names of the noise in each row, (rows,): rows of one name have noise of one size.
        sample: number of each row's sample on the even grid of the record, (rows,); a group has one row of a
            sample. Rows of one sample, whatever their groups, may have noise in common.
        errors: what independent errors of numbers that were found before change of `measured`, each by one
            standard error, (rows, errors); None if it does not depend on any.
        noise: gives what noise of the positions, once more, changes of `measured` less `predicted`, (rows,),
            and of `slopes`, (rows, unknowns); None if that is not known. See
            `SystemOfEquations.equations`.
    """

    measured: FloatArray
    predicted: FloatArray
    slopes: FloatArray
    group: AnyArray
    sample: IndexArray
    errors: FloatArray | None = None
    noise: Callable[[], tuple[FloatArray, FloatArray]] | None = None


class System(NamedTuple):
    """The equations of all records, one below the other.

    Attributes:
        measured: measured values, (rows,).
        residual: that less the prediction, (rows,).
        slopes: derivatives of the prediction, (rows, unknowns).
        groups: names of noise.
        group: of each row, index in `groups`, (rows,).
        record: of each row, (rows,).
        sample: of each row in its record, (rows,).
        errors: of the measurements, (rows, errors).
        noise: gives what noise of positions changes of the residual, (rows,), and of the slopes.
    """

    measured: FloatArray
    residual: FloatArray
    slopes: FloatArray
    groups: tuple[str, ...]
    group: IndexArray
    record: IndexArray
    sample: IndexArray
    errors: FloatArray
    noise: Callable[[], tuple[FloatArray, FloatArray]]

    @classmethod
    def of(cls, records: Sequence[Equations]) -> System:
        """Return the system of some records."""
        measured, predicted, slopes, group, sample = (
            np.concatenate([getattr(each, name) for each in records]) for name in Equations._fields[:5]
        )
        names, index = np.unique(group, return_inverse=True)
        rows = [len(each.measured) for each in records]
        errors = [
            np.zeros((len(each.measured), 0)) if each.errors is None else each.errors for each in records
        ]

        @cache
        def noise() -> tuple[FloatArray, FloatArray]:
            known = [each.noise() if each.noise else (0 * each.measured, 0 * each.slopes) for each in records]
            of_residual, of_slopes = map(np.concatenate, zip(*known, strict=True))
            return of_residual, of_slopes

        return cls(
            measured=measured,
            residual=measured - predicted,
            slopes=slopes,
            groups=tuple(map(str, names)),
            group=index,
            record=np.repeat(np.arange(len(records)), rows),
            sample=sample,
            errors=np.concatenate(errors),
            noise=noise,
        )

    def by_group(self, of_rows: FloatArray) -> FloatArray:
        """Sums of a number of each row over the groups, (groups,)."""
        sums: FloatArray = np.bincount(self.group, of_rows, len(self.groups)).astype(np.float64)
        return sums


LEAST_FREEDOM = 0.01
"""Share of a row's noise that its residual shows at least, 1 less its leverage; below, the row was not fitted
but interpolated, and its residual says nothing."""


def score_covariance(system: System, q: FloatArray, residual: FloatArray) -> FloatArray:
    """Covariance of q^T e, the meat of the sandwich, (columns, columns).

    Scores of one sample are added before anything else, so that noise that groups have in common counts.

    Args:
        system: whose equations they are.
        q: orthonormal columns, (rows, columns).
        residual: of each row, in units of its noise, (rows,).
    """
    freedom = np.maximum(1.0 - np.einsum("rc,rc->r", q, q), LEAST_FREEDOM)
    scores = q * (residual / np.sqrt(freedom))[:, None]
    parts = [
        covariance_of_sum(_by_sample(scores[here], system.group[here], system.sample[here]))[0]
        for here in (system.record == record for record in np.unique(system.record))
    ]
    return np.asarray(wider(freedom_of(system)) * sum(parts))


def freedom_of(system: System) -> int:
    """Return from how many cosines the covariance is taken: its degrees of freedom."""
    samples = [system.sample[system.record == record] for record in np.unique(system.record)]
    return sum(count_of_cosines(int(np.ptp(each)) + 1) for each in samples)


def wider(freedom: int) -> float:
    """Return the variance of Student's t: so few cosines tell the covariance but roughly."""
    return freedom / max(freedom - 2, 1)


def _by_sample(scores: FloatArray, group: IndexArray, sample: IndexArray) -> FloatArray:
    """Sums over the rows of each sample of a record, (samples, columns); zero where there are none."""
    first = sample.min()
    summed = np.zeros((int(sample.max() - first) + 1, scores.shape[1]))
    for each in np.unique(group):
        rows = group == each
        summed[sample[rows] - first] += scores[rows]
    return summed


SEPARABLE = 1 / 300
"""Share of a column that no combination of the others explains, from which on its unknown can be told.

At a constant stiffness the shares that k and k_c of the paper's arm leave to each other are some 1e-3, no
more than filtered noise changes these columns by, and k_c came out off by its own size; a stiffness of two
sines leaves 0.1 and more."""

QUIET = 1e-9
"""Noise of a group over the measured values, below which it is the rounding of filters and not noise."""

PASSES = 20
"""Times the noise of the groups is estimated at most; three or four do unless a group has hardly any rows."""

SETTLED = 0.01
"""Relative change of the noise of a group that ends this."""


class Combination(NamedTuple):
    """An identifiable combination of indistinguishable unknowns: the sum of factor times unknown.

    Attributes:
        terms: index of each unknown with its factor; that of the first one is 1.
        value: of the sum.
        standard_error: of that.
    """

    terms: tuple[tuple[int, float], ...]
    value: float
    standard_error: float

    def words(self, names: Sequence[str]) -> str:
        """Return the sum in names of the unknowns, e.g. `k + 0.0123 k_c`."""
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
        inseparable: identifiable combinations of indistinguishable unknowns.
        unexcited: unknowns without effect on the prediction, (unexcited,).
        residual_rms: root mean square residual of each group, corrected for the unknowns.
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
    """Solve linear equations; rows of each group count by its noise, which is estimated from the residual.

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
    """Return the solution alone.

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
        leverage = np.einsum("rc,rc->r", step.split.q, step.split.q)
        before, noise = noise, np.maximum(_noise(system, left, leverage), floor)
        if np.all(np.abs(noise - before) <= SETTLED * before):
            break
    return step._replace(noise=noise)


def _weighted(system: System, noise: FloatArray, tolerance: float) -> Step:
    """Return the solution with the noise of each group known, (groups,)."""
    from scipy.linalg import solve_triangular

    weight = 1 / noise[system.group]
    split = independence(system.slopes * weight[:, None], tolerance, system.noise()[1] * weight[:, None])
    target = split.q.T @ (system.residual * weight)
    change = np.zeros(system.slopes.shape[1])
    change[split.kept] = solve_triangular(split.r, target) / split.scale[split.kept]
    return Step(change, split, weight, noise, float(np.linalg.norm(target)))


def _noise(system: System, left: FloatArray, leverage: FloatArray) -> FloatArray:
    """Root mean square residual of each group, (groups,), over the rows less the fitted unknowns."""
    freedom = np.maximum(system.by_group(1 - leverage), 1.0)
    return np.sqrt(system.by_group(left**2) / freedom)


def fit_of(
    system: System,
    present: FloatArray,
    step: Step,
    before: FloatArray,
) -> Fit:
    """Return the fit of a solution, with standard errors.

    Args:
        system: the equations at the present numbers.
        present: those, (unknowns,).
        step: the solution.
        before: values of unidentifiable unknowns, (unknowns,).
    """
    split, left = step.split, system.residual - system.slopes @ step.change
    solution = present + step.change
    covariance = _covariance(system, step, left)
    errors = np.sqrt(np.diagonal(covariance))
    combinations = tuple(_combinations(split, solution, errors))
    identifiable = np.zeros(len(present), dtype=bool)
    identifiable[split.kept] = True
    identifiable[[at for each in combinations for at, _ in each.terms]] = False
    return Fit(
        values=np.where(identifiable, solution, before),
        standard_errors=np.where(identifiable, errors, np.nan),
        solution=solution,
        covariance=covariance,
        condition=split.condition,
        inseparable=combinations,
        unexcited=split.nothing,
        residual_rms=dict(zip(system.groups, map(float, step.noise), strict=True)),
    )


def _covariance(system: System, step: Step, left: FloatArray) -> FloatArray:
    """Return the covariance of the changed unknowns: of noise, of earlier values, and of bias.

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


STEPS = 50
"""Steps at most. Springs whose exponents were a third off took 6 to 10."""

HALVINGS = 20
"""Times a step is halved at most, to a millionth: if even that gains nothing, none will."""

ARRIVED = 0.1
"""Length of a step, in standard errors, that is no longer worth going on: a hundredth of their square. With
0.01, widths of friction that are hardly told took twice the steps."""


def gauss_newton(
    equations: Callable[[FloatArray], Sequence[Equations]], start: FloatArray, tolerance: float = SEPARABLE
) -> Fit:
    """Solve equations by repeated linear ones; where unknowns cannot be told apart, some stay as they were.

    A step is halved until it leaves less, in units of the noise, than there was before. With
    `scipy.optimize.least_squares`, called again for each estimate of the noise, 22 systems came out the same
    to 1e-10 standard errors, with twice the evaluations; it has no rule for unknowns that cannot be told.

    Args:
        equations: those of all records at some values of the unknowns; predicted values that are not finite
            say that there is no such robot, and a shorter step is tried.
        start: values of the unknowns at first, (unknowns,).
        tolerance: as of `least_squares`.

    Returns:
        The last result; `converged` is false if the steps did not come to an end.

    Raises:
        InputError: there are no more equations than unknowns.
    """
    present, system = start, System.of(equations(start))
    for _ in range(STEPS):
        step = solved(system, tolerance)
        if step.length <= ARRIVED * np.sqrt(len(step.split.kept)):
            return fit_of(system, present, step, start)
        found = _shorter(equations, present, system, step)
        if found is None:
            break
        present, system = found
    stopped = step._replace(change=np.zeros_like(start))
    return fit_of(system, present, stopped, start)._replace(converged=False)


def _shorter(
    equations: Callable[[FloatArray], Sequence[Equations]], present: FloatArray, system: System, step: Step
) -> tuple[FloatArray, System] | None:
    """Unknowns after the longest part of a step that gains, with their equations; None if none does."""
    before = _left(system, step)
    for halving in range(HALVINGS):
        there = present + step.change / 2**halving
        moved = System.of(equations(there))
        if _left(moved, step) < before:
            return there, moved
    return None


def _left(system: System, step: Step) -> float:
    """Sum of squared residuals in units of the noise; infinite where nothing is predicted."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = float(np.sum((system.residual * step.weight) ** 2))
    return left if np.isfinite(left) else np.inf
