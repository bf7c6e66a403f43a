"""Least squares of the equations of recordings, with standard errors for residuals of any color.

`Equations` are those at the samples of one recording, a `System` stacks those of all recordings.
`least_squares` solves linear equations, weighted by the noise of each group, and finds the unidentifiable
unknowns; `gauss_newton` repeats that for nonlinear equations. Covariances are sandwich estimates with the
middle part from `score_covariance`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import AnyArray, FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.studies.identification.independence import Independence, in_words, independence
from vsacli.studies.measured.line_fit import count_of_cosines, covariance_of_sum


class Equations(NamedTuple):
    """Equations of one recording, linearized in the unknowns, with rows in any order.

    Attributes:
        measured: measured values, (rows,).
        predicted: predictions of these values, (rows,).
        slopes: derivatives of the predictions by the unknowns, (rows, unknowns).
        group: name of each row's group, (rows,); rows of a group have noise of equal size.
        sample: index of each row's sample on the uniform grid of the recording, (rows,); a group has one row
            per sample. Rows of one sample, also in different groups, may have common noise.
        errors: changes of `measured` by independent errors of parameters identified before, each of one
            standard error, (rows, errors); None if `measured` does not depend on such parameters.
        noise: function that returns the changes of `measured - predicted`, (rows,), and of `slopes`,
            (rows, unknowns), if the noise of the positions is added once more; None if that is unknown. See
            `SystemOfEquations.equations`.
    """

    measured: FloatArray
    predicted: FloatArray
    slopes: FloatArray
    group: AnyArray
    sample: IndexArray
    errors: FloatArray | None = None
    noise: Callable[[], tuple[FloatArray, FloatArray]] | None = None

    def restricted(self, free: Sequence[int]) -> Equations:
        """Return the equations with slopes by some of the unknowns, by index."""
        noise, columns = self.noise, list(free)
        free_noise = noise and (lambda: (noise()[0], noise()[1][:, columns]))
        return self._replace(slopes=self.slopes[:, columns], noise=free_noise)


class System(NamedTuple):
    """The stacked equations of all recordings; see `Equations`.

    Attributes:
        measured: measured values, (rows,).
        residual: measured minus predicted values, (rows,).
        slopes: derivatives of the predictions, (rows, unknowns).
        groups: names of the groups.
        group: index of each row's group in `groups`, (rows,).
        record: index of each row's recording, (rows,).
        sample: index of each row's sample in its recording, (rows,).
        errors: changes of the measured values by earlier errors, (rows, errors).
        noise: function that returns the changes of residual, (rows,), and slopes by noise of the positions.
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
    def of(cls, equations: Sequence[Equations]) -> System:
        """Stack the equations of several recordings."""
        measured, predicted, slopes, group, sample = (
            np.concatenate([getattr(each, name) for each in equations]) for name in Equations._fields[:5]
        )
        names, group_index = np.unique(group, return_inverse=True)
        row_counts = [len(each.measured) for each in equations]
        errors = [
            np.zeros((len(each.measured), 0)) if each.errors is None else each.errors for each in equations
        ]

        @cache
        def noise() -> tuple[FloatArray, FloatArray]:
            noise_changes = [
                each.noise() if each.noise else (0 * each.measured, 0 * each.slopes) for each in equations
            ]
            of_residual, of_slopes = map(np.concatenate, zip(*noise_changes, strict=True))
            return of_residual, of_slopes

        return cls(
            measured=measured,
            residual=measured - predicted,
            slopes=slopes,
            groups=tuple(map(str, names)),
            group=group_index,
            record=np.repeat(np.arange(len(equations)), row_counts),
            sample=sample,
            errors=np.concatenate(errors),
            noise=noise,
        )

    def by_group(self, row_values: FloatArray) -> FloatArray:
        """Return the sums of row values over each group, (groups,)."""
        return np.bincount(self.group, row_values, len(self.groups)).astype(np.float64)


MIN_FREEDOM = 0.01
"""Lower bound of 1 minus the leverage of a row; below it, the fit interpolates the row, whose residual is
then meaningless."""


def score_covariance(system: System, q: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the covariance of q^T e, the middle part of the sandwich, (columns, columns).

    Scores of one sample are added first, so that noise common to several groups is taken into account.

    Args:
        system: system of the equations.
        q: orthonormal columns, (rows, columns).
        residual: residual of each row in units of its noise, (rows,).
    """
    freedom = np.maximum(1.0 - np.einsum("rc,rc->r", q, q), MIN_FREEDOM)
    scores = q * (residual / np.sqrt(freedom))[:, None]
    record_covariances = [
        covariance_of_sum(
            _scores_by_sample(scores[record_mask], system.group[record_mask], system.sample[record_mask])
        )[0]
        for record_mask in (system.record == record for record in np.unique(system.record))
    ]
    return np.asarray(student_t_variance(freedom_of(system)) * sum(record_covariances))


def freedom_of(system: System) -> int:
    """Return the degrees of freedom of the covariance: the number of cosines that estimate it."""
    samples = [system.sample[system.record == record] for record in np.unique(system.record)]
    return sum(count_of_cosines(int(np.ptp(each)) + 1) for each in samples)


def student_t_variance(freedom: int) -> float:
    """Return the variance of Student's t: few cosines determine the covariance only roughly."""
    return freedom / max(freedom - 2, 1)


def _scores_by_sample(scores: FloatArray, group: IndexArray, sample: IndexArray) -> FloatArray:
    """Return the sums of scores over the rows of each sample, (samples, columns); zero without rows."""
    first_sample = sample.min()
    sample_scores = np.zeros((int(sample.max() - first_sample) + 1, scores.shape[1]))
    for each in np.unique(group):
        row_mask = group == each
        sample_scores[sample[row_mask] - first_sample] += scores[row_mask]
    return sample_scores


SEPARABLE = 1 / 300
"""Relative distance of a column from the span of the others above which its unknown is identifiable.

At constant stiffness, this distance is about 1e-3 for k and k_c of the paper's arm, no more than filtered
noise changes these columns, and the error of k_c was as large as k_c; with a stiffness of two sines it is 0.1
or more."""

MIN_NOISE_RATIO = 1e-9
"""Ratio of a group's noise to its measured values below which it is rounding of the filters."""

MAX_NOISE_ESTIMATES = 20
"""Limit on estimates of the groups' noise; three or four suffice unless a group has hardly any rows."""

NOISE_TOLERANCE = 0.01
"""Relative change of the noise of every group below which the estimates have converged."""


class IdentifiableSum(NamedTuple):
    """An identifiable combination of indistinguishable unknowns: the sum of factor times unknown.

    Attributes:
        terms: index and factor of each unknown; the first factor is 1.
        value: value of the sum.
        standard_error: standard error of the value.
    """

    terms: tuple[tuple[int, float], ...]
    value: float
    standard_error: float

    def words(self, names: Sequence[str]) -> str:
        """Return the sum in names of the unknowns, e.g. `k + 0.0123 k_c`."""
        return in_words(self.terms, names)


class LeastSquaresFit(NamedTuple):
    """Unknowns estimated by least squares.

    Attributes:
        values: values of the unknowns, (unknowns,); unidentifiable ones keep their previous value.
        standard_errors: standard errors of the values, (unknowns,); NaN for unidentifiable ones.
        solution: unknowns that predict best, (unknowns,); of indistinguishable ones some keep their previous
            value, and the others compensate for it.
        covariance: covariance of the solution, (unknowns, unknowns); zero for unknowns that were kept.
        condition: condition number of the columns, each divided by its norm.
        inseparable: identifiable combinations of indistinguishable unknowns.
        unexcited: indices of the unknowns without effect on the prediction, (unexcited,).
        residual_rms: rms residual of each group, corrected for the number of unknowns.
        converged: whether the iteration converged; see `gauss_newton`.
    """

    values: FloatArray
    standard_errors: FloatArray
    solution: FloatArray
    covariance: FloatArray
    condition: float
    inseparable: tuple[IdentifiableSum, ...]
    unexcited: IndexArray
    residual_rms: dict[str, float]
    converged: bool = True


class LinearSolution(NamedTuple):
    """A solution of the linear equations.

    Attributes:
        change: change of the unknowns, (unknowns,).
        split: independent and dependent weighted columns.
        weight: weight of each row, 1 over its noise, (rows,).
        noise: noise of each group, (groups,).
        length: length of the change, in units in which the standard errors for white residuals are 1.
    """

    change: FloatArray
    split: Independence
    weight: FloatArray
    noise: FloatArray
    length: float


def least_squares(
    equations: Sequence[Equations],
    present: FloatArray,
    tolerance: float = SEPARABLE,
) -> LeastSquaresFit:
    """Solve linear equations, weighted by the noise of each group, which is estimated from the residuals.

    Standard errors hold for residuals of any color, also common to groups; see `score_covariance`.

    Args:
        equations: equations of each recording.
        present: values of the unknowns at which the equations predict, (unknowns,).
        tolerance: relative distance of an identifiable unknown's column from the span of the others.

    Raises:
        InputError: there are not more equations than unknowns.
    """
    system = System.of(equations)
    return fit_of(system, present, solve_system(system, tolerance), present)


def solve_system(system: System, tolerance: float = SEPARABLE) -> LinearSolution:
    """Return the solution of linear equations, without standard errors.

    Raises:
        InputError: there are not more equations than unknowns.
    """
    rows, unknowns = system.slopes.shape
    if rows <= unknowns:
        raise InputError.one(f"{rows} equations do not tell {unknowns} unknowns; record for longer")
    floor = MIN_NOISE_RATIO * _group_noises(system, system.measured, np.zeros(rows))
    noise = np.maximum(_group_noises(system, system.residual, np.zeros(rows)), floor)
    for _ in range(MAX_NOISE_ESTIMATES):
        linear_solution = _solve_weighted(system, np.where(noise > 0, noise, 1.0), tolerance)
        remaining = system.residual - system.slopes @ linear_solution.change
        leverage = np.einsum("rc,rc->r", linear_solution.split.q, linear_solution.split.q)
        previous_noise, noise = noise, np.maximum(_group_noises(system, remaining, leverage), floor)
        if np.all(np.abs(noise - previous_noise) <= NOISE_TOLERANCE * previous_noise):
            break
    return linear_solution._replace(noise=noise)


def _solve_weighted(system: System, noise: FloatArray, tolerance: float) -> LinearSolution:
    """Return the solution for a given noise of each group, (groups,)."""
    weight = 1 / noise[system.group]
    split = independence(system.slopes * weight[:, None], tolerance, system.noise()[1] * weight[:, None])
    target = split.q.T @ (system.residual * weight)
    change = np.zeros(system.slopes.shape[1])
    change[split.kept] = scipy.linalg.solve_triangular(split.r, target) / split.scale[split.kept]
    return LinearSolution(change, split, weight, noise, float(np.linalg.norm(target)))


def _group_noises(system: System, residual: FloatArray, leverage: FloatArray) -> FloatArray:
    """Return the rms residual of each group, (groups,), per row minus fitted unknowns."""
    freedom = np.maximum(system.by_group(1 - leverage), 1.0)
    return np.sqrt(system.by_group(residual**2) / freedom)


def fit_of(
    system: System,
    values_before_step: FloatArray,
    linear_solution: LinearSolution,
    kept_values: FloatArray,
) -> LeastSquaresFit:
    """Return the fit of a solution, with standard errors.

    Args:
        system: equations at the present values.
        values_before_step: present values of the unknowns, (unknowns,).
        linear_solution: solution of the equations.
        kept_values: values that unidentifiable unknowns keep, (unknowns,).
    """
    split, remaining = linear_solution.split, system.residual - system.slopes @ linear_solution.change
    solution = values_before_step + linear_solution.change
    covariance = _solution_covariance(system, linear_solution, remaining)
    errors = np.sqrt(np.diagonal(covariance))
    combinations = tuple(_identifiable_sums(split, solution, errors))
    identifiable = np.zeros(len(values_before_step), dtype=bool)
    identifiable[split.kept] = True
    identifiable[[at for each in combinations for at, _ in each.terms]] = False
    return LeastSquaresFit(
        values=np.where(identifiable, solution, kept_values),
        standard_errors=np.where(identifiable, errors, np.nan),
        solution=solution,
        covariance=covariance,
        condition=split.condition,
        inseparable=combinations,
        unexcited=split.nothing,
        residual_rms=dict(zip(system.groups, map(float, linear_solution.noise), strict=True)),
    )


def _solution_covariance(system: System, linear_solution: LinearSolution, residual: FloatArray) -> FloatArray:
    """Return the covariance of the solution due to noise, errors of earlier parameters, and bias.

    Noise in the columns makes unknowns too small (W. A. Fuller, Measurement Error Models, 1987, section 1.1).
    This bias is known roughly, and is counted as an error.
    """
    split, weight = linear_solution.split, linear_solution.weight[:, None]
    score_covariances = score_covariance(system, split.q, residual * linear_solution.weight)
    error_scores = split.q.T @ (system.errors * weight)
    residual_noise, slope_noise = system.noise()
    residual_noise = residual_noise - slope_noise @ linear_solution.change
    slope_noise = slope_noise[:, split.kept] / split.scale[split.kept] * weight
    bias = scipy.linalg.solve_triangular(
        split.r, slope_noise.T @ (residual_noise * linear_solution.weight), trans="T"
    )
    score_covariances = score_covariances + error_scores @ error_scores.T + np.outer(bias, bias)
    half_solved = scipy.linalg.solve_triangular(split.r, score_covariances)
    scale = split.scale[split.kept]
    kept_covariance = scipy.linalg.solve_triangular(split.r, half_solved.T) / np.outer(scale, scale)
    covariance = np.zeros((system.slopes.shape[1],) * 2)
    covariance[np.ix_(split.kept, split.kept)] = kept_covariance
    return covariance


def _identifiable_sums(
    split: Independence, solution: FloatArray, errors: FloatArray
) -> list[IdentifiableSum]:
    """Return the combination of each kept column on which dropped columns depend."""
    sums = []
    for kept_index, unknown in enumerate(split.kept):
        shares = split.shares[kept_index]
        dependent_terms = [
            (int(split.dropped[index]), float(shares[index])) for index in np.flatnonzero(shares)
        ]
        if dependent_terms:
            terms = ((int(unknown), 1.0), *dependent_terms)
            value = sum(factor * solution[index] for index, factor in terms)
            sums.append(IdentifiableSum(terms, float(value), float(errors[unknown])))
    return sums


MAX_STEPS = 50
"""Limit on steps. Springs with exponents wrong by a third required 6 to 10."""

MAX_HALVINGS = 20
"""Limit on halvings of a step, to a millionth: if that reduces nothing, no step will."""

STEP_TOLERANCE = 0.1
"""Step length, in standard errors, at which the iteration has converged: a hundredth of their square. With
0.01, poorly identifiable widths of friction required twice the steps."""


def gauss_newton(
    equations: Callable[[FloatArray], Sequence[Equations]], start: FloatArray, tolerance: float = SEPARABLE
) -> LeastSquaresFit:
    """Solve nonlinear equations by the Gauss-Newton method; of indistinguishable unknowns some are kept.

    A step is halved until it reduces the residuals in units of the noise. `scipy.optimize.least_squares`,
    called again for each estimate of the noise, gave the same result for 22 systems to 1e-10 standard errors,
    with twice the evaluations; it has no rule for unidentifiable unknowns.

    Args:
        equations: function that returns the equations of all recordings at given values of the unknowns;
            predictions that are not finite mean that no such robot exists, and a shorter step is tried.
        start: initial values of the unknowns, (unknowns,).
        tolerance: see `least_squares`.

    Returns:
        Last result; `converged` is false if the steps did not converge.

    Raises:
        InputError: there are not more equations than unknowns.
    """
    values, system = start, System.of(equations(start))
    for _ in range(MAX_STEPS):
        step = solve_system(system, tolerance)
        if step.length <= STEP_TOLERANCE * np.sqrt(len(step.split.kept)):
            return fit_of(system, values, step, start)
        shorter_step = _halved_step(equations, values, system, step)
        if shorter_step is None:
            break
        values, system = shorter_step
    zero_step = step._replace(change=np.zeros_like(start))
    return fit_of(system, values, zero_step, start)._replace(converged=False)


def _halved_step(
    equations: Callable[[FloatArray], Sequence[Equations]],
    values: FloatArray,
    system: System,
    step: LinearSolution,
) -> tuple[FloatArray, System] | None:
    """Return unknowns and equations after the longest halved step that reduces the residuals, or None."""
    previous_cost = _squared_residuals(system, step)
    for halving in range(MAX_HALVINGS):
        next_values = values + step.change / 2**halving
        next_system = System.of(equations(next_values))
        if _squared_residuals(next_system, step) < previous_cost:
            return next_values, next_system
    return None


def _squared_residuals(system: System, step: LinearSolution) -> float:
    """Return the sum of squared residuals in units of the noise; infinite if a prediction is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        cost = float(np.sum((system.residual * step.weight) ** 2))
    return cost if np.isfinite(cost) else np.inf
