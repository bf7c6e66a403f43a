"""Layout of a kernel's input and output rows: arrays by name, one entry a row."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate, pairwise
from typing import Any, TypeVar

from vsacli.base.arrays import AnyArray

_Row = TypeVar("_Row")


class RowLayout:
    """Named arrays whose entries follow each other, a row each, in the input or output of a kernel.

    Attributes:
        shapes: Shape of each array at one instant, by name, in the order of the rows.
        size: Number of rows.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self.shapes = dict(shapes)
        bounds = list(accumulate(map(math.prod, self.shapes.values()), initial=0))
        self.size = bounds[-1]
        self._slices = dict(
            zip(self.shapes, (slice(*bound_pair) for bound_pair in pairwise(bounds)), strict=True)
        )

    def unpack(self, rows: Sequence[_Row]) -> dict[str, Sequence[_Row]]:
        """Return the rows of each array by name; further rows are ignored."""
        return {name: rows[row_slice] for name, row_slice in self._slices.items()}

    def arrays(self, rows: AnyArray) -> dict[str, AnyArray]:
        """Return each array in its shape, followed by the axes of a row."""
        return {
            name: rows[row_slice].reshape((*self.shapes[name], *rows.shape[1:]))
            for name, row_slice in self._slices.items()
        }

    def pack(self, rows: Mapping[str, Iterable[_Row]]) -> list[_Row]:
        """Return the rows of all arrays, in the order of `shapes`."""
        return [row for name in self.shapes for row in rows[name]]


class RowKernel(ABC):
    """A kernel for an engine, whose rows belong to named arrays."""

    @property
    @abstractmethod
    def arguments(self) -> RowLayout:
        """Layout of the input rows."""

    @property
    @abstractmethod
    def results(self) -> RowLayout:
        """Layout of the output rows."""

    @abstractmethod
    def __call__(self, rows: Sequence[Any]) -> Sequence[Any]:
        """Return the output rows."""

    @property
    def inputs(self) -> int:
        """Number of input rows."""
        return self.arguments.size

    @property
    def outputs(self) -> int:
        """Number of output rows."""
        return self.results.size
