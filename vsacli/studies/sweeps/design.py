"""Which values each run of a study has: all combinations, or points that are drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.studies.sweeps.dimensions import Dimension
from vsacli.studies.sweeps.study_file import GRID, StudyFile

MOST_RUNS = 1_000_000
"""At some 10 ms each that is three hours; the table has 300 MB."""


class Design:
    """The points of a study, the same for each trajectory.

    Attributes:
        points: how many there are.
    """

    def __init__(self, file: StudyFile, dimensions: Sequence[Dimension], trajectories: int) -> None:
        """Find the points.

        Raises:
            InputError: they are more than can be computed.
        """
        self._dimensions = dimensions
        self._own = [each for each in dimensions if not each.linked]
        self._sizes = [len(each.values) for each in self._own]
        self.points = math.prod(self._sizes) if file.method == GRID else file.samples or 0
        if self.points * trajectories > MOST_RUNS:
            advice = "take fewer values, or draw some points by `method: latin_hypercube` and `samples:`"
            total = f"{self.points * trajectories:,} runs"
            if file.method == GRID:
                total += f" ({' x '.join(f'{size:,}' for size in (trajectories, *self._sizes))})"
            raise InputError.one(f"{total} are more than {MOST_RUNS:,}; {advice}")
        self._shares = None if file.method == GRID else _shares(file, self.points, len(self._own))

    def different(self, dimensions: Sequence[Dimension]) -> int:
        """How many different values some dimensions have together."""
        own = [each for each in dimensions if not each.linked]
        if self._shares is not None and own:
            return self.points
        return math.prod(len(each.values) for each in own)

    def values(self, point: int) -> dict[str, Any]:
        """The value of each dimension at a point, by path."""
        if self._shares is None:
            places = np.unravel_index(point, self._sizes) if self._sizes else ()
            found = {each.path: each.values[place] for each, place in zip(self._own, places, strict=True)}
        else:
            found = {
                each.path: each.drawn(share)
                for each, share in zip(self._own, self._shares[point], strict=True)
            }
        return {each.path: self._value(each, found) for each in self._dimensions}

    def _value(self, dimension: Dimension, found: dict[str, Any]) -> Any:
        if not dimension.linked:
            return found[dimension.path]
        origin = next(each for each in self._own if each.path == dimension.linked)
        value, number = found[origin.path], origin.number(found[origin.path])
        return value if number is None else number * dimension.factor


def _shares(file: StudyFile, points: int, dimensions: int) -> FloatArray:
    """Shares from 0 to 1, (points, dimensions): of each dimension's values those below the one to take.

    A Latin hypercube has one point in each of as many layers of a dimension as there are points (McKay,
    Beckman and Conover 1979).
    """
    random = np.random.default_rng(file.seed)
    shares: FloatArray = random.random((points, dimensions))
    if file.method == "latin_hypercube":
        shares += np.column_stack([random.permutation(points) for _ in range(dimensions)])
        shares /= points
    return np.clip(shares, 2.0**-54, 1 - 2.0**-53)  # at 0 and 1 a normal distribution is infinite
