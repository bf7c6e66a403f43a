"""Variables that a study keeps over time, at each so-manieth step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.units import Quantity
from vsacli.base.variables import MOTORS, UNCERTAIN, VARIABLES, Block, deviation
from vsacli.studies.sweeps.row_values import arrays_of, width

STEP = "step"
TIME = "time"


class OverTime(NamedTuple):
    """A variable of results as a column of a table: name, dimensions after `run`, unit, a few words."""

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str

    def shape(self, joints: int) -> tuple[int, ...]:
        """Of its values at one step."""
        return (joints, len(MOTORS))[: len(self.dims) - 1]


_DEVIATIONS = {deviation(name) for name in UNCERTAIN}

OVER_TIME = {
    name: OverTime(name, (STEP, *variable.dims), variable.quantity, variable.long_name)
    for name, variable in VARIABLES.items()
    if variable.dims in ((), ("joint",), ("joint", "motor")) and name not in _DEVIATIONS | {"flags"}
}
"""Those that may be kept, by name; `time` is kept with them."""


def over_time(names: Sequence[str]) -> tuple[OverTime, ...]:
    """The variables of these names, after the time; none if there are no names."""
    return tuple(OVER_TIME[name] for name in dict.fromkeys((TIME, *names))) if names else ()


class Recorder:
    """Gathers variables from the blocks of a run, in order.

    Args:
        kept: the variables.
        every: of so many steps one is kept, from the first on.
    """

    def __init__(self, kept: Sequence[OverTime], every: int) -> None:
        self._kept, self._every = kept, every
        self._step = 0
        self._rows: list[FloatArray] = []

    def add(self, block: Block) -> None:
        """Gather what is kept of the next steps."""
        if self._kept:
            first, count = -self._step % self._every, len(block.time)
            columns = [
                np.reshape(getattr(block, each.name), (count, -1))[first :: self._every]
                for each in self._kept
            ]
            self._rows.append(np.concatenate(columns, axis=1))
            self._step += count

    @property
    def curves(self) -> FloatArray:
        """What was gathered, one step after the other, all variables of each; flat."""
        return np.concatenate(self._rows).ravel() if self._rows else np.empty(0)


def steps_of(curves: FloatArray, kept: Sequence[OverTime], joints: int) -> int:
    """How many steps were gathered."""
    return len(curves) // width(kept, joints) if kept else 0


def filled(
    rows: Sequence[FloatArray], kept: Sequence[OverTime], steps: int, joints: int
) -> dict[str, FloatArray]:
    """Curves of several runs as arrays (runs, steps, ...) by name, NaN after the end of a run."""
    table = np.full((len(rows), steps, width(kept, joints)), np.nan)
    for place, curves in enumerate(rows):
        count = steps_of(curves, kept, joints)
        table[place, :count] = curves.reshape(count, -1) if count else np.nan
    return arrays_of(kept, table, joints)
