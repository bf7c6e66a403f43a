"""Where the values of a run stand in a row of numbers: those of one column after those of another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from vsacli.base.arrays import FloatArray


class Values(Protocol):
    """What has a name, and a shape by the number of joints."""

    @property
    def name(self) -> str:
        """In the table."""

    def shape(self, joints: int) -> tuple[int, ...]:
        """Of its values in one row."""


def width(kept: Sequence[Values], joints: int) -> int:
    """How many numbers a row has."""
    return sum(math.prod(each.shape(joints)) for each in kept)


def arrays_of(kept: Sequence[Values], rows: FloatArray, joints: int) -> dict[str, FloatArray]:
    """Rows (..., width) as arrays (..., joints[, 2]) by name."""
    arrays, start = {}, 0
    for each in kept:
        shape = each.shape(joints)
        stop = start + math.prod(shape)
        arrays[each.name] = rows[..., start:stop].reshape(*rows.shape[:-1], *shape)
        start = stop
    return arrays
