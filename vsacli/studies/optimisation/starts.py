"""Profiles with which a search begins: smooth ones within what is admissible, near to some targets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.compute.duals import Dual
from vsacli.studies.optimisation.criteria import trapezoidal
from vsacli.studies.optimisation.interior_point import minimise
from vsacli.studies.optimisation.separable import Group, SeparableProblem, interior
from vsacli.studies.optimisation.spline_space import SplineSpace
from vsacli.studies.remedies.admissible_stiffness import Range

INSIDE = 1e-3
"""Share of its stiffness by which a start keeps clear of the ends of what is admissible, if there is room."""

DRAWN, LEVELS = 2, 6
"""Targets that are drawn, and the levels between which each of them is interpolated."""


class _Distance:
    """The `Functions` of a stiffness that shall be near a target, within bounds."""

    def __init__(self, target: FloatArray, within: Range, size: float) -> None:
        self._target, self._within, self._size = target, within, size

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Dual | FloatArray], list[Dual | FloatArray]]:
        """The square of the distance, and what the bounds are exceeded by."""
        low, high = (row[instants] for row in self._within)
        missed = (rows[0] - self._target[instants]) / self._size
        return [missed * missed], [(low - rows[0]) / self._size, (rows[0] - high) / self._size]


def targets(asked: FloatArray, admissible: Range, time: FloatArray, seed: int) -> Iterator[FloatArray]:
    """What to begin near: the profile that is asked for, the lower end, constants, some that are drawn."""
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
    space: SplineSpace, time: FloatArray, target: FloatArray, admissible: Range
) -> FloatArray | None:
    """The amounts of a space's shapes that come nearest to a target, within what is admissible, if any do."""
    size = float(np.median(admissible.low))
    clearance = np.minimum(INSIDE * size, (admissible.high - admissible.low) / 4)
    within = Range(admissible.low + clearance, admissible.high - clearance)
    group = Group(
        functions=_Distance(target, within, size),
        instants=np.arange(len(time)),
        basis=space.basis(time, 1),
        unknowns=np.arange(space.size),
        weights=trapezoidal(time)[None] / (time[-1] - time[0]),
        there=np.isfinite(np.stack(within)),
        scales=np.array([size]),
    )
    problem = SeparableProblem([group])
    start = interior(problem, space.fitted(time, np.clip(target, *within)))
    return None if start is None else minimise(problem, start).unknowns
