"""Smooth profiles within the admissible range of a stiffness, from which a search starts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.compute.duals import Dual
from vsacli.dynamics.losses import trapezoidal_weights
from vsacli.studies.search.acceptance import Range
from vsacli.studies.search.interior_point import minimize
from vsacli.studies.search.separable import Group, SeparableProblem, interior

INSIDE = 1e-3
"""Relative distance that a start keeps from the ends of the admissible range, if possible."""

DRAWN, LEVELS = 2, 6
"""Number of random targets, and of the random levels that each of them interpolates."""


class _Distance:
    """The `Functions` of the squared distance from a target stiffness, within bounds."""

    def __init__(self, target: FloatArray, within: Range, size: float) -> None:
        self._target, self._within, self._size = target, within, size

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Dual | FloatArray], list[Dual | FloatArray]]:
        """Return the square of the distance, and the excess over the bounds."""
        low, high = (row[instants] for row in self._within)
        missed = (rows[0] - self._target[instants]) / self._size
        return [missed * missed], [(low - rows[0]) / self._size, (rows[0] - high) / self._size]


def targets(asked: FloatArray, admissible: Range, time: FloatArray, seed: int) -> Iterator[FloatArray]:
    """Yield targets for starts: the command, the lower end of the range, constants, random profiles."""
    highest = float(admissible.low.max())
    generator = np.random.default_rng(seed)
    yield asked
    yield 1.05 * admissible.low
    yield np.full_like(time, 1.05 * highest)
    yield np.full_like(time, 2 * highest)
    places = np.linspace(time[0], time[-1], LEVELS)
    for _ in range(DRAWN):
        yield admissible.low * np.interp(time, places, generator.uniform(1.0, 2.0, LEVELS))


def nearest_profile(
    basis: FloatArray, time: FloatArray, target: FloatArray, admissible: Range
) -> FloatArray | None:
    """Return the coefficients of the admissible spline nearest to a target, (shapes,), or None.

    Args:
        basis: splines per unit of each coefficient, (instants, shapes).
        time: instants, (instants,) in s.
        target: target, (instants,).
        admissible: range in which the spline must lie at the instants.
    """
    size = float(np.median(admissible.low))
    clearance = np.minimum(INSIDE * size, (admissible.high - admissible.low) / 4)
    within = Range(admissible.low + clearance, admissible.high - clearance)
    wanted = np.minimum(np.maximum(target, within.low), within.high)
    fitted = np.asarray(np.linalg.lstsq(basis, wanted, rcond=None)[0], dtype=np.float64)
    near = basis @ fitted
    if np.all((within.low < near) & (near < within.high)):
        return fitted
    group = Group(
        functions=_Distance(target, within, size),
        instants=np.arange(len(time)),
        basis=basis[None],
        unknowns=np.arange(basis.shape[1]),
        weights=trapezoidal_weights(time)[None] / (time[-1] - time[0]),
        there=np.isfinite(np.stack(within)),
        scales=np.array([size]),
    )
    problem = SeparableProblem([group])
    start = interior(problem, fitted)
    return None if start is None else minimize(problem, start).unknowns
