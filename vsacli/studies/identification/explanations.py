"""Structure of what equations leave: what would explain it, and which numbers it makes wrong.

What noise leaves has no structure. Each cause of `causes` is tested; the one that explains most is taken,
then what is left is tested again. What is found so is told if it matters: if a number would be another one,
by more than its standard error says, if most of what is left is no noise, or if that is too much anyway.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.model import Robot
from vsacli.studies.identification.causes import Cause, causes
from vsacli.studies.identification.estimation.additions import FEWEST_ROWS, Addition, addition
from vsacli.studies.identification.estimation.equations import Equations
from vsacli.studies.identification.estimation.least_squares import least_squares
from vsacli.studies.identification.estimation.solution import Solution
from vsacli.studies.identification.identification_report import CHANGED, significant
from vsacli.studies.identification.records.signals import Signals

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
    """What was found of the residuals of a system.

    Attributes:
        sentences: one for each cause, and one on the numbers that are wrong if it is not regarded.
        matters: whether there are such numbers, or most of the residuals is explained.
    """

    sentences: tuple[str, ...]
    matters: bool


NOTHING = Explanation((), matters=False)


def explanation(robot: Robot, found: Solution, records: Sequence[Signals], *, fails: bool) -> Explanation:
    """Explain what the equations of a joint's motors, or of all links, leave.

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
    """What would become of numbers that are told, if what is missing were in the equations."""
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
    """What remains of the sum of squares of residuals in equations that a cause changes."""
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
