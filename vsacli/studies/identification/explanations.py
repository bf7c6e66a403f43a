"""Structure of residuals: its possible causes, and the parameters that it makes wrong.

Residuals of noise have no structure. Each cause of `causes` is tested by `addition`; the one that explains
most is taken, then what is left is tested again. What is found so is told if it matters: if a number would be
another one, by more than its standard error says, if most of what is left is no noise, or if that is too much
anyway.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.model import Robot
from vsacli.studies.identification.conditioning import Signals
from vsacli.studies.identification.estimation import (
    SEPARABLE,
    Equations,
    System,
    freedom_of,
    least_squares,
    wider,
)
from vsacli.studies.identification.fitted_system import Solution
from vsacli.studies.identification.identification_report import CHANGED, significant
from vsacli.studies.identification.independence import independence
from vsacli.studies.identification.residual_causes import Cause, causes

FEWEST_ROWS = 3
"""Equations to an unknown below which residuals say too little about missing columns."""


class Addition(NamedTuple):
    """Effect of some further columns on a fit.

    Attributes:
        chance: probability of an effect as large if the columns had none.
        left: share that they leave of the sum of squares of the residuals, in units of the noise.
        sizes: coefficients of the columns, (columns,).
    """

    chance: float
    left: float
    sizes: FloatArray


def addition(
    equations: Sequence[Equations], columns: Sequence[FloatArray], noise: dict[str, float]
) -> Addition | None:
    """Add columns to equations and test them; None if the unknowns explain them all, or rows are too few.

    Args:
        equations: of each record, at the values that fit best.
        columns: of each record, (rows, columns).
        noise: of each group.
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
    """Orthonormal basis of what known ones leave of columns, and the columns' coefficients by the basis's."""
    norms = np.linalg.norm(columns, axis=0)
    scale = 1 / np.where(norms > 0, norms, 1.0)
    left = columns * scale
    for _ in range(2):  # twice: rounding of the first leaves a trace of the known ones
        left = left - known @ (known.T @ left)
    basis, sizes, turned = np.linalg.svd(left, full_matrices=False)
    there = sizes > SEPARABLE
    return basis[:, there], scale[:, None] * turned[there].T / sizes[there]


def _chance(sizes: FloatArray, covariance: FloatArray, freedom: int) -> float:
    """Probability that Hotelling's statistic of numbers that are zero is as large."""
    from scipy.special import fdtrc

    count = len(sizes)
    statistic = float(sizes @ np.linalg.solve(covariance, sizes))
    second = freedom - count + 1
    return float(fdtrc(count, second, statistic * second / (freedom * count)))


CHANCE = 1e-4
"""Probability that a cause that is none is taken for one. Of an arm with seven joints some hundred are
tested, so that one identification in a hundred names one by accident."""

NEARLY = 1.25
"""Ratio of what two causes leave, sums of squares, below which the one with fewer columns is preferred, and
above which a further cause is worth a word. Columns that mean nothing take a few percent of it."""

MOST = 0.75
"""Share of the sum of squares from which on most is explained: half of the root mean square is left."""

SEVERAL = 3
"""Causes of one system at most; those of all motors of a joint are one."""


class Explanation(NamedTuple):
    """The explanation of the residuals of a system.

    Attributes:
        sentences: one for each cause, and one on the numbers that are wrong if it is not regarded.
        matters: whether there are such numbers, or most of the residuals is explained.
    """

    sentences: tuple[str, ...]
    matters: bool


NOTHING = Explanation((), matters=False)


def explanation(robot: Robot, found: Solution, records: Sequence[Signals], *, fails: bool) -> Explanation:
    """Explain the residuals of a joint's motors, or of all links.

    Args:
        robot: the robot.
        found: solution of the equations.
        records: to which they were fitted.
        fails: whether they leave too much; then causes are told that change no number, too.
    """
    exact = [each._replace(noise=None) for each in records]
    equations = [found.equations(each)._replace(noise=None) for each in exact]
    of_free = [each._replace(slopes=each.slopes[:, found.free]) for each in equations]
    if sum(len(each.measured) for each in equations) < FEWEST_ROWS * (len(found.free) + 1):
        return NOTHING
    chosen = _chosen(causes(robot, found, exact, equations), of_free, found.fit.residual_rms)
    if not chosen:
        return NOTHING
    longer = _longer(of_free, chosen)
    fit = least_squares(longer, np.zeros(longer[0].slopes.shape[1]))
    count = len(found.free)
    moved = tuple(_moved(found, fit.values[:count], fit.standard_errors[:count]))
    left = [_share_left(cause, longer, fit.solution) for cause in chosen]
    matters = bool(moved) or min(left) <= 1 - MOST
    if not (matters or fails):
        return NOTHING
    sentences, at = [], count
    for cause, share in zip(chosen, left, strict=True):
        size, error = float(fit.values[at]), float(fit.standard_errors[at])
        sentences.append(_sentence(cause, size, error, share))
        at += cause.width
    if moved:
        sentences.append(f"{found.system.title}: with that, {'; '.join(moved)}")
    return Explanation(tuple(dict.fromkeys(sentences)), matters)


def _moved(found: Solution, changes: FloatArray, errors: FloatArray) -> Iterator[str]:
    """Yield the change of identified values if a missing cause were in the equations."""
    for at, number in enumerate(found.free):
        value, before = float(found.fit.values[at]), float(found.fit.standard_errors[at])
        name, unit, error = found.system.names[number], found.system.units[number], float(errors[at])
        there = f"{significant(value, before)} +- {before:.2g} {unit}"
        if np.isfinite(before) and not np.isfinite(error):
            yield f"{name} cannot be told, found as {there}"
        elif abs(changes[at]) > CHANGED * before:
            now = f"{significant(value + float(changes[at]), error)} +- {error:.2g}"
            yield f"{name} would be {now}, not {there}"


def _chosen(
    possible: Sequence[Cause], equations: Sequence[Equations], noise: dict[str, float]
) -> list[Cause]:
    """Causes that explain something beyond chance, the one that explains most first."""
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
    """Return the remaining share of squared residuals in equations with a cause."""
    rows = [np.any(columns != 0, axis=1) for columns in cause.columns]
    before = [(each.measured - each.predicted)[there] for each, there in zip(longer, rows, strict=True)]
    explained = [each.slopes[there] @ solution for each, there in zip(longer, rows, strict=True)]
    residual = np.concatenate(before)
    return float(np.sum((residual - np.concatenate(explained)) ** 2) / np.sum(residual**2))


def _sentence(cause: Cause, size: float, error: float, left: float) -> str:
    total = cause.neutral + size
    rounded = significant(total, error)
    signed = rounded if cause.neutral or total < 0 else f"+{rounded}"
    share = "most" if 1 - left >= MOST else "a part"
    return cause.words.format(
        name=cause.name,
        size=f"{signed} +- {error:.2g} {cause.unit}".rstrip(),
        would=f"would explain {share} of what is left",
    )
