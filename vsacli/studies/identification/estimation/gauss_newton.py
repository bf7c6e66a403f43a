"""Least squares of equations that are not linear in their unknowns: Gauss-Newton with step control."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.identification.estimation.equations import Equations, System
from vsacli.studies.identification.estimation.least_squares import SEPARABLE, Fit, Step, fit_of, solved

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

    A step is halved until it leaves less, in units of the noise, than there was before.

    Args:
        equations: those of all records at some values of the unknowns; predicted values that are not finite
            say that there is no such robot, and a shorter step is tried.
        start: values of the unknowns at first, (unknowns,).
        tolerance: as of `least_squares`.

    Returns:
        What was found last; `converged` is false if the steps did not come to an end.

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
    """Sum of the squares of what is left, in units of the noise; infinite where nothing is predicted."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = float(np.sum((system.residual * step.weight) ** 2))
    return left if np.isfinite(left) else np.inf
