"""Explanations of residuals: possible causes, and the parameters that these make wrong.

Residuals of pure noise have no structure. `addition` tests each cause of `residual_causes`; the one that
explains most is chosen, then the remaining residual is tested again. A cause is reported if it matters: if it
would change a parameter by more than its standard error admits, if it explains most of the residual, or if
the residual is too large anyway.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray
from vsacli.robot.model import Robot
from vsacli.studies.identification.conditioning import ConditionedRecording
from vsacli.studies.identification.estimation import (
    SEPARABLE,
    Equations,
    System,
    freedom_of,
    least_squares,
    student_t_variance,
)
from vsacli.studies.identification.fitted_system import Solution
from vsacli.studies.identification.identification_text import CHANGED, rounded_by_error
from vsacli.studies.identification.independence import independence
from vsacli.studies.identification.residual_causes import Cause, residual_causes

FEWEST_ROWS = 3
"""Equations per unknown below which residuals do not determine missing columns."""


class Addition(NamedTuple):
    """The effect of further columns on a fit.

    Attributes:
        chance: probability of an effect of this size by chance.
        left: remaining share of the sum of squared residuals in units of the noise.
        sizes: coefficients of the columns, (columns,).
    """

    chance: float
    left: float
    sizes: FloatArray


def addition(
    equations: Sequence[Equations], columns: Sequence[FloatArray], noise: dict[str, float]
) -> Addition | None:
    """Add columns to equations and test them; return None if they depend on the others or rows are too few.

    Args:
        equations: equations of each recording at the values that fit best.
        columns: columns of each recording, (rows, columns).
        noise: noise of each group.
    """
    system = System.of([each._replace(noise=None) for each in equations])
    weight = np.array([1 / noise[name] for name in system.groups])[system.group]
    basis = independence(system.slopes * weight[:, None], SEPARABLE).q
    weighted_columns = np.concatenate(columns) * weight[:, None]
    new_basis, to_columns = _independent_basis(basis, weighted_columns)
    column_count, freedom = new_basis.shape[1], freedom_of(system)
    if (
        not column_count
        or freedom <= column_count
        or len(weight) < FEWEST_ROWS * (basis.shape[1] + column_count)
    ):
        return None
    extended_slopes = np.hstack((basis, new_basis)) / weight[:, None]
    row_offsets = np.cumsum([len(each.measured) for each in equations])[:-1]
    slopes_by_recording = np.split(extended_slopes, row_offsets)
    fit = least_squares(
        [
            each._replace(slopes=part, noise=None)
            for each, part in zip(equations, slopes_by_recording, strict=True)
        ],
        np.zeros(extended_slopes.shape[1]),
    )
    coefficients, covariance = fit.solution[-column_count:], fit.covariance[-column_count:, -column_count:]
    if not np.all(np.diagonal(covariance) > 0):
        return None
    remaining = system.residual - extended_slopes @ fit.solution
    return Addition(
        chance=_chance_probability(coefficients, covariance / student_t_variance(freedom), freedom),
        left=float(np.sum((remaining * weight) ** 2) / np.sum((system.residual * weight) ** 2)),
        sizes=to_columns @ coefficients,
    )


def _independent_basis(known: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an orthonormal basis of columns beyond known ones, and the map of its coefficients to theirs."""
    norms = np.linalg.norm(columns, axis=0)
    scale = 1 / np.where(norms > 0, norms, 1.0)
    remainder = columns * scale
    for _ in range(2):  # twice, since rounding of the first pass leaves a share of the known columns
        remainder = remainder - known @ (known.T @ remainder)
    new_basis, singular_values, right_vectors = np.linalg.svd(remainder, full_matrices=False)
    is_independent = singular_values > SEPARABLE
    return new_basis[:, is_independent], scale[:, None] * right_vectors[is_independent].T / singular_values[
        is_independent
    ]


def _chance_probability(coefficients: FloatArray, covariance: FloatArray, freedom: int) -> float:
    """Return the probability that Hotelling's statistic is as large if the true sizes are zero."""
    count = len(coefficients)
    statistic = float(coefficients @ np.linalg.solve(covariance, coefficients))
    denominator_freedom = freedom - count + 1
    return float(
        scipy.special.fdtrc(count, denominator_freedom, statistic * denominator_freedom / (freedom * count))
    )


MAX_CHANCE = 1e-4
"""Probability of accepting a cause by chance. About a hundred are tested for an arm with seven joints, so
that one identification in a hundred names a cause by accident."""

SIMILAR_RATIO = 1.25
"""Ratio of the remaining sums of squares of two causes below which the cause with fewer columns is preferred,
and above which a further cause is reported. Meaningless columns reduce the sum by a few percent."""

MAIN_SHARE = 0.75
"""Explained share of the sum of squares that counts as most: half of the rms remains."""

MAX_CAUSES = 3
"""Largest number of causes for one system; a cause common to both motors of a joint counts once."""


class Explanation(NamedTuple):
    """The explanation of the residuals of a system.

    Attributes:
        sentences: one sentence for each cause, and one on the parameters that are wrong if it is ignored.
        matters: whether there are such parameters, or most of the residual is explained.
    """

    sentences: tuple[str, ...]
    matters: bool


NO_EXPLANATION = Explanation((), matters=False)


def explanation(
    robot: Robot, solution: Solution, recordings: Sequence[ConditionedRecording], *, fails: bool
) -> Explanation:
    """Explain the residuals of a joint's motors, or of all links.

    Args:
        robot: robot as in its file.
        solution: solution of the equations.
        recordings: fitted recordings.
        fails: whether the residuals are too large; then causes are reported even if they change no parameter.
    """
    recordings_without_noise = [each._replace(noise=None) for each in recordings]
    equations = [solution.equations(each)._replace(noise=None) for each in recordings_without_noise]
    free_equations = [each._replace(slopes=each.slopes[:, solution.free]) for each in equations]
    if sum(len(each.measured) for each in equations) < FEWEST_ROWS * (len(solution.free) + 1):
        return NO_EXPLANATION
    causes = _explaining_causes(
        residual_causes(robot, solution, recordings_without_noise, equations),
        free_equations,
        solution.fit.residual_rms,
    )
    if not causes:
        return NO_EXPLANATION
    extended_equations = _extended_equations(free_equations, causes)
    fit = least_squares(extended_equations, np.zeros(extended_equations[0].slopes.shape[1]))
    free_count = len(solution.free)
    changed_values = tuple(
        _changed_value_clauses(solution, fit.values[:free_count], fit.standard_errors[:free_count])
    )
    remaining_shares = [_remaining_share(cause, extended_equations, fit.solution) for cause in causes]
    matters = bool(changed_values) or min(remaining_shares) <= 1 - MAIN_SHARE
    if not (matters or fails):
        return NO_EXPLANATION
    sentences, column_index = [], free_count
    for cause, share in zip(causes, remaining_shares, strict=True):
        coefficient, error = float(fit.values[column_index]), float(fit.standard_errors[column_index])
        sentences.append(_cause_sentence(cause, coefficient, error, share))
        column_index += cause.width
    if changed_values:
        sentences.append(f"{solution.system.title}: with that, {'; '.join(changed_values)}")
    return Explanation(tuple(dict.fromkeys(sentences)), matters)


def _changed_value_clauses(solution: Solution, changes: FloatArray, errors: FloatArray) -> Iterator[str]:
    """Yield clauses on identified values that would change with the causes in the equations."""
    for free_index, index in enumerate(solution.free):
        value, standard_error = (
            float(solution.fit.values[free_index]),
            float(solution.fit.standard_errors[free_index]),
        )
        name, unit, error = (
            solution.system.names[index],
            solution.system.units[index],
            float(errors[free_index]),
        )
        value_text = f"{rounded_by_error(value, standard_error)} +- {standard_error:.2g} {unit}"
        if np.isfinite(standard_error) and not np.isfinite(error):
            yield f"{name} would be unidentifiable, not {value_text}"
        elif abs(changes[free_index]) > CHANGED * standard_error:
            new_value_text = f"{rounded_by_error(value + float(changes[free_index]), error)} +- {error:.2g}"
            yield f"{name} would be {new_value_text}, not {value_text}"


def _explaining_causes(
    possible_causes: Sequence[Cause], equations: Sequence[Equations], noise: dict[str, float]
) -> list[Cause]:
    """Return the causes that explain something beyond chance, the one that explains most first."""
    chosen_effects: list[tuple[Cause, Addition]] = []
    while len(chosen_effects) < MAX_CAUSES:
        extended_equations = _extended_equations(equations, [cause for cause, _ in chosen_effects])
        cause_effects = (
            (cause, addition(extended_equations, cause.columns, noise)) for cause in possible_causes
        )
        effects = [
            (cause, effect)
            for cause, effect in cause_effects
            if effect and effect.chance < MAX_CHANCE and np.all(np.abs(effect.sizes) <= cause.largest)
        ]
        min_remaining = min((effect.left for _, effect in effects), default=np.inf)
        if not effects or (chosen_effects and min_remaining > chosen_effects[-1][1].left / SIMILAR_RATIO):
            break
        close_effects = [each for each in effects if each[1].left <= SIMILAR_RATIO * min_remaining]
        chosen_effects.append(min(close_effects, key=lambda each: (each[0].width, each[1].left)))
    return [cause for cause, _ in chosen_effects]


def _extended_equations(equations: Sequence[Equations], causes: Sequence[Cause]) -> list[Equations]:
    return [
        each._replace(slopes=np.hstack((each.slopes, *(cause.columns[recording_index] for cause in causes))))
        for recording_index, each in enumerate(equations)
    ]


def _remaining_share(cause: Cause, extended_equations: Sequence[Equations], solution: FloatArray) -> float:
    """Return the remaining share of squared residuals, over the rows that a cause changes."""
    row_masks = [np.any(columns != 0, axis=1) for columns in cause.columns]
    residuals = [
        (each.measured - each.predicted)[there]
        for each, there in zip(extended_equations, row_masks, strict=True)
    ]
    explained = [
        each.slopes[there] @ solution for each, there in zip(extended_equations, row_masks, strict=True)
    ]
    residual = np.concatenate(residuals)
    return float(np.sum((residual - np.concatenate(explained)) ** 2) / np.sum(residual**2))


def _cause_sentence(cause: Cause, coefficient: float, error: float, remaining_share: float) -> str:
    value = cause.neutral + coefficient
    rounded = rounded_by_error(value, error)
    signed_value = rounded if cause.neutral or value < 0 else f"+{rounded}"
    share = "most" if 1 - remaining_share >= MAIN_SHARE else "a part"
    return cause.words.format(
        name=cause.name,
        size=f"{signed_value} +- {error:.2g} {cause.unit}".rstrip(),
        would=f"would explain {share} of what is left",
    )
