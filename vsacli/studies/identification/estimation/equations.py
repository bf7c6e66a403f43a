"""Equations that hold at the samples of a record, and several records as one system."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import AnyArray, FloatArray, IndexArray
from vsacli.studies.identification.records.signals import Signals, disturbed


class Equations(NamedTuple):
    """Equations of one record that are linear in the changes of some unknowns, rows in any order.

    Attributes:
        measured: what was measured, (rows,).
        predicted: the same by the present numbers, (rows,).
        slopes: its derivatives by the unknowns, (rows, unknowns).
        group: names of the noise in each row, (rows,): rows of one name have noise of one size.
        sample: number of each row's sample on the even grid of the record, (rows,); a group has one row of a
            sample. Rows of one sample, whatever their groups, may have noise in common.
        errors: what independent errors of numbers that were found before change of `measured`, each by one
            standard error, (rows, errors); None if it does not depend on any.
        noise: gives what noise of the positions, once more, changes of `measured` less `predicted`, (rows,),
            and of `slopes`, (rows, unknowns); None if that is not known. See `with_noise`.
    """

    measured: FloatArray
    predicted: FloatArray
    slopes: FloatArray
    group: AnyArray
    sample: IndexArray
    errors: FloatArray | None = None
    noise: Callable[[], tuple[FloatArray, FloatArray]] | None = None


def with_noise(equations: Callable[[Signals], Equations], signals: Signals) -> Equations:
    """Equations of a record, with what noise like that of its positions changes of them.

    Args:
        equations: those of a record.
        signals: the record; of one whose noise is not known, nothing is added.
    """
    found = equations(signals)
    if signals.noise is None:
        return found

    @cache
    def noise() -> tuple[FloatArray, FloatArray]:
        again = equations(disturbed(signals))
        residuals = (each.measured - each.predicted for each in (again, found))
        return next(residuals) - next(residuals), again.slopes - found.slopes

    return found._replace(noise=noise)


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
        errors: of what is measured, (rows, errors).
        noise: gives what noise of positions changes of the residual, (rows,), and of the slopes.
    """

    measured: FloatArray
    residual: FloatArray
    slopes: FloatArray
    groups: tuple[str, ...]
    group: IndexArray
    record: IndexArray
    sample: IndexArray
    errors: FloatArray
    noise: Callable[[], tuple[FloatArray, FloatArray]]

    @classmethod
    def of(cls, records: Sequence[Equations]) -> System:
        """The system of some records."""
        measured, predicted, slopes, group, sample = (
            np.concatenate([getattr(each, name) for each in records]) for name in Equations._fields[:5]
        )
        names, index = np.unique(group, return_inverse=True)
        rows = [len(each.measured) for each in records]
        errors = [
            np.zeros((len(each.measured), 0)) if each.errors is None else each.errors for each in records
        ]

        @cache
        def noise() -> tuple[FloatArray, FloatArray]:
            known = [each.noise() if each.noise else (0 * each.measured, 0 * each.slopes) for each in records]
            of_residual, of_slopes = map(np.concatenate, zip(*known, strict=True))
            return of_residual, of_slopes

        return cls(
            measured=measured,
            residual=measured - predicted,
            slopes=slopes,
            groups=tuple(map(str, names)),
            group=index,
            record=np.repeat(np.arange(len(records)), rows),
            sample=sample,
            errors=np.concatenate(errors),
            noise=noise,
        )

    def by_group(self, of_rows: FloatArray) -> FloatArray:
        """Sums of a number of each row over the groups, (groups,)."""
        sums: FloatArray = np.bincount(self.group, of_rows, len(self.groups)).astype(np.float64)
        return sums
