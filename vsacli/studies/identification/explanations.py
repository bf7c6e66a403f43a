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
    wider,
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
    known = independence(system.slopes * weight[:, None], SEPARABLE).q
    further = np.concatenate(columns) * weight[:, None]
    new, to_columns = _beyond(known, further)
    count, freedom = new.shape[1], freedom_of(system)
    if not count or freedom <= count or len(weight) < FEWEST_ROWS * (known.shape[1] + count):
        return None
    together = np.hstack((known, new)) / weight[:, None]
    ends = np.cumsum([len(each.measured) for each in equations])[:-1]
    parts = np.split(together, ends)
    fit = least_squares(
        [each._replace(slopes=part, noise=None) for each, part in zip(equations, parts, strict=True)],
        np.zeros(together.shape[1]),
    )
    sizes, covariance = fit.solution[-count:], fit.covariance[-count:, -count:]
    if not np.all(np.diagonal(covariance) > 0):
        return None
    left = system.residual - together @ fit.solution
    return Addition(
        chance=_chance(sizes, covariance / wider(freedom), freedom),
        left=float(np.sum((left * weight) ** 2) / np.sum((system.residual * weight) ** 2)),
        sizes=to_columns @ sizes,
    )


def _beyond(known: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an orthonormal basis of columns beyond known ones, and the map of its coefficients to theirs."""
    norms = np.linalg.norm(columns, axis=0)
    scale = 1 / np.where(norms > 0, norms, 1.0)
    left = columns * scale
    for _ in range(2):  # twice, since rounding of the first pass leaves a share of the known columns
        left = left - known @ (known.T @ left)
    basis, sizes, turned = np.linalg.svd(left, full_matrices=False)
    there = sizes > SEPARABLE
    return basis[:, there], scale[:, None] * turned[there].T / sizes[there]


def _chance(sizes: FloatArray, covariance: FloatArray, freedom: int) -> float:
    """Return the probability that Hotelling's statistic is as large if the true sizes are zero."""
    count = len(sizes)
    statistic = float(sizes @ np.linalg.solve(covariance, sizes))
    second = freedom - count + 1
    return float(scipy.special.fdtrc(count, second, statistic * second / (freedom * count)))


CHANCE = 1e-4
"""Probability of accepting a cause by chance. About a hundred are tested for an arm with seven joints, so
that one identification in a hundred names a cause by accident."""

NEARLY = 1.25
"""Ratio of the remaining sums of squares of two causes below which the cause with fewer columns is preferred,
and above which a further cause is reported. Meaningless columns reduce the sum by a few percent."""

MOST = 0.75
"""Explained share of the sum of squares that counts as most: half of the rms remains."""

SEVERAL = 3
"""Largest number of causes for one system; a cause common to both motors of a joint counts once."""


class Explanation(NamedTuple):
    """The explanation of the residuals of a system.

    Attributes:
        sentences: one sentence for each cause, and one on the parameters that are wrong if it is ignored.
        matters: whether there are such parameters, or most of the residual is explained.
    """

    sentences: tuple[str, ...]
    matters: bool


NOTHING = Explanation((), matters=False)


def explanation(
    robot: Robot, found: Solution, records: Sequence[ConditionedRecording], *, fails: bool
) -> Explanation:
    """Explain the residuals of a joint's motors, or of all links.

    Args:
        robot: robot as in its file.
        found: solution of the equations.
        records: fitted recordings.
        fails: whether the residuals are too large; then causes are reported even if they change no parameter.
    """
    exact = [each._replace(noise=None) for each in records]
    equations = [found.equations(each)._replace(noise=None) for each in exact]
    of_free = [each._replace(slopes=each.slopes[:, found.free]) for each in equations]
    if sum(len(each.measured) for each in equations) < FEWEST_ROWS * (len(found.free) + 1):
        return NOTHING
    chosen = _explaining_causes(
        residual_causes(robot, found, exact, equations), of_free, found.fit.residual_rms
    )
    if not chosen:
        return NOTHING
    longer = _longer(of_free, chosen)
    fit = least_squares(longer, np.zeros(longer[0].slopes.shape[1]))
    count = len(found.free)
    moved = tuple(_changed_value_clauses(found, fit.values[:count], fit.standard_errors[:count]))
    left = [_share_left(cause, longer, fit.solution) for cause in chosen]
    matters = bool(moved) or min(left) <= 1 - MOST
    if not (matters or fails):
        return NOTHING
    sentences, at = [], count
    for cause, share in zip(chosen, left, strict=True):
        size, error = float(fit.values[at]), float(fit.standard_errors[at])
        sentences.append(_cause_sentence(cause, size, error, share))
        at += cause.width
    if moved:
        sentences.append(f"{found.system.title}: with that, {'; '.join(moved)}")
    return Explanation(tuple(dict.fromkeys(sentences)), matters)


def _changed_value_clauses(found: Solution, changes: FloatArray, errors: FloatArray) -> Iterator[str]:
    """Yield clauses on identified values that would change with the causes in the equations."""
    for at, number in enumerate(found.free):
        value, before = float(found.fit.values[at]), float(found.fit.standard_errors[at])
        name, unit, error = found.system.names[number], found.system.units[number], float(errors[at])
        there = f"{rounded_by_error(value, before)} +- {before:.2g} {unit}"
        if np.isfinite(before) and not np.isfinite(error):
            yield f"{name} would be unidentifiable, not {there}"
        elif abs(changes[at]) > CHANGED * before:
            now = f"{rounded_by_error(value + float(changes[at]), error)} +- {error:.2g}"
            yield f"{name} would be {now}, not {there}"


def _explaining_causes(
    possible: Sequence[Cause], equations: Sequence[Equations], noise: dict[str, float]
) -> list[Cause]:
    """Return the causes that explain something beyond chance, the one that explains most first."""
    chosen: list[tuple[Cause, Addition]] = []
    while len(chosen) < SEVERAL:
        present = _longer(equations, [cause for cause, _ in chosen])
        tested = ((cause, addition(present, cause.columns, noise)) for cause in possible)
        effects = [
            (cause, effect)
            for cause, effect in tested
            if effect and effect.chance < CHANCE and np.all(np.abs(effect.sizes) <= cause.largest)
        ]
        least = min((effect.left for _, effect in effects), default=np.inf)
        if not effects or (chosen and least > chosen[-1][1].left / NEARLY):
            break
        near = [each for each in effects if each[1].left <= NEARLY * least]
        chosen.append(min(near, key=lambda each: (each[0].width, each[1].left)))
    return [cause for cause, _ in chosen]


def _longer(equations: Sequence[Equations], chosen: Sequence[Cause]) -> list[Equations]:
    return [
        each._replace(slopes=np.hstack((each.slopes, *(cause.columns[record] for cause in chosen))))
        for record, each in enumerate(equations)
    ]


def _share_left(cause: Cause, longer: Sequence[Equations], solution: FloatArray) -> float:
    """Return the remaining share of squared residuals, over the rows that a cause changes."""
    rows = [np.any(columns != 0, axis=1) for columns in cause.columns]
    before = [(each.measured - each.predicted)[there] for each, there in zip(longer, rows, strict=True)]
    explained = [each.slopes[there] @ solution for each, there in zip(longer, rows, strict=True)]
    residual = np.concatenate(before)
    return float(np.sum((residual - np.concatenate(explained)) ** 2) / np.sum(residual**2))


def _cause_sentence(cause: Cause, size: float, error: float, left: float) -> str:
    total = cause.neutral + size
    rounded = rounded_by_error(total, error)
    signed = rounded if cause.neutral or total < 0 else f"+{rounded}"
    share = "most" if 1 - left >= MOST else "a part"
    return cause.words.format(
        name=cause.name,
        size=f"{signed} +- {error:.2g} {cause.unit}".rstrip(),
        would=f"would explain {share} of what is left",
    )
