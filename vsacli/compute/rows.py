"""Rows of numbers by the name of the array that they belong to, instead of by their place."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate, pairwise
from typing import TypeVar

from vsacli.base.arrays import AnyArray

_Row = TypeVar("_Row")


class RowLayout:
    """Arrays whose entries lie one after the other, a row each, as a kernel takes and gives them.

    Attributes:
        shapes: Shape of each array at one instant, by name, in the order of the rows.
        size: Number of rows.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self.shapes = dict(shapes)
        ends = list(accumulate(map(math.prod, self.shapes.values()), initial=0))
        self.size = ends[-1]
        self._places = dict(zip(self.shapes, (slice(*place) for place in pairwise(ends)), strict=True))

    def unpack(self, rows: Sequence[_Row]) -> dict[str, Sequence[_Row]]:
        """Return the rows of each array; further ones are ignored."""
        return {name: rows[place] for name, place in self._places.items()}

    def arrays(self, rows: AnyArray) -> dict[str, AnyArray]:
        """Return each array in its shape, followed by what axes a row has."""
        return {
            name: rows[place].reshape((*self.shapes[name], *rows.shape[1:]))
            for name, place in self._places.items()
        }

    def pack(self, rows: Mapping[str, Iterable[_Row]]) -> list[_Row]:
        """Return the rows of all arrays."""
        return [row for name in self.shapes for row in rows[name]]


class RowKernel(ABC):
    """A kernel, as engines carry out, whose rows are arrays by name."""

    @property
    @abstractmethod
    def arguments(self) -> RowLayout:
        """Rows that it takes."""

    @property
    @abstractmethod
    def results(self) -> RowLayout:
        """Rows that it gives."""

    @property
    def inputs(self) -> int:
        """Number of rows taken."""
        return self.arguments.size

    @property
    def outputs(self) -> int:
        """Number of rows given."""
        return self.results.size
