"""Equations that hold at the samples of a record, and several records as one system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import AnyArray, FloatArray, IndexArray


class Equations(NamedTuple):
    """Equations of one record that are linear in the changes of some unknowns, rows in any order.

    Attributes:
        measured: what was measured, (rows,).
        predicted: the same by the present numbers, (rows,).
        slopes: its derivatives by the unknowns, (rows, unknowns).
        group: names of the noise in each row, (rows,): rows of one name have noise of one size.
        sample: number of each row's sample on the even grid of the record, (rows,); a group has one row of a
            sample. Rows of one sample, whatever their groups, may have noise in common.
        of_given: derivatives of `measured` by numbers that were found before, (rows, numbers); None if
            it does not depend on any.
    """

    measured: FloatArray
    predicted: FloatArray
    slopes: FloatArray
    group: AnyArray
    sample: IndexArray
    of_given: FloatArray | None = None


class System(NamedTuple):
    """The equations of all records, one below the other.

    Attributes:
        measured: what was measured, (rows,).
        residual: that less what is predicted, (rows,).
        slopes: derivatives of what is predicted, (rows, unknowns).
        groups: names of noise.
        group: of each row, index in `groups`, (rows,).
        record: of each row, (rows,).
        sample: of each row in its record, (rows,).
        of_given: derivatives of what is measured, (rows, numbers).
    """

    measured: FloatArray
    residual: FloatArray
    slopes: FloatArray
    groups: tuple[str, ...]
    group: IndexArray
    record: IndexArray
    sample: IndexArray
    of_given: FloatArray

    @classmethod
    def of(cls, records: Sequence[Equations]) -> System:
        """The system of some records."""
        measured, predicted, slopes, group, sample = (
            np.concatenate([getattr(each, name) for each in records]) for name in Equations._fields[:5]
        )
        names, index = np.unique(group, return_inverse=True)
        rows = [len(each.measured) for each in records]
        given = [
            np.zeros((count, 0)) if each.of_given is None else each.of_given
            for count, each in zip(rows, records, strict=True)
        ]
        return cls(
            measured=measured,
            residual=measured - predicted,
            slopes=slopes,
            groups=tuple(map(str, names)),
            group=index,
            record=np.repeat(np.arange(len(records)), rows),
            sample=sample,
            of_given=np.concatenate(given),
        )

    def by_group(self, of_rows: FloatArray) -> FloatArray:
        """Sums of a number of each row over the groups, (groups,)."""
        sums: FloatArray = np.bincount(self.group, of_rows, len(self.groups)).astype(np.float64)
        return sums
