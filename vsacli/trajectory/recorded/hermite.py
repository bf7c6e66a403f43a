"""Hermite interpolation of samples with all derivatives given, and a check whether these are consistent.

Between two samples the third highest function is the polynomial of degree 5 with the given values and two
derivatives at both; lower functions are its integrals from the earlier sample on. Interpolating a position
with all five numbers at both ends would multiply the rounding of stored values by 2500/h^4 in the fourth
derivative, which is as large as that of a slow motion at 1 kHz. Here the factor is 60/h^2 of the second
derivative, and the integrals miss the next sample by h^7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import Signal

MATCHED = 3
"""Number of highest functions that are matched at both ends of a piece."""

FROM_ENDS = np.array([[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]])
"""Value, slope and second derivative at x = 1 of x^3, x^4, x^5."""

AGREEING = 0.05
"""Largest difference of the highest derivative within a piece from the line between its ends, relative to its
peak; and of a lower function at the end of a piece, relative to its largest change over a piece. Smooth
motions of 0.25 s have 1e-3 at 500 Hz and 0.03 at 100 Hz; second derivatives of six digits 0.2 at 1 kHz."""

MIN_CHECK_INSTANTS = 0.25
"""Place in a piece, as a share, at which the highest derivative is compared: there a wrong change of the
function from end to end has the largest effect, while half-way it has none."""

TOGETHER = 2**14
"""Number of pieces that are checked together."""

ROUNDINGS = 16
"""Allowed rounding of given values, in units in the last place."""


@dataclass(frozen=True, eq=False, kw_only=True)
class HermiteSpline:
    """A profile through samples with all their derivatives, which are consistent.

    Attributes:
        signal: described signal.
        time: times of the samples, ascending from zero, (samples,), s.
        rows: value and all derivatives, (orders, components, samples).
    """

    signal: Signal
    time: FloatArray
    rows: FloatArray

    warnings: ClassVar[tuple[str, ...]] = ()
    notes: ClassVar[tuple[str, ...]] = ()
    known_between: ClassVar[bool] = True
    estimate: ClassVar[None] = None

    @property
    def components(self) -> int:
        """Number of components: one per joint, or six of a wrench."""
        return int(self.rows.shape[1])

    @property
    def breakpoints(self) -> FloatArray:
        """Times of the samples."""
        return self.time

    def at(self, time: FloatArray) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples)."""
        return interpolate_hermite(self.time, self.rows, time)

    def samples(self, start: int, stop: int, _time: FloatArray, /) -> FloatArray:
        """Return the given values at samples start..stop-1."""
        return self.rows[:, :, start:stop]

    def stretched(self, factor: float) -> HermiteSpline:
        """Return the profile slowed down by a factor."""
        scale = factor ** np.arange(len(self.rows))[:, None, None]
        return replace(self, time=factor * self.time, rows=self.rows / scale)


def interpolate_hermite(time: FloatArray, rows: FloatArray, at: FloatArray) -> FloatArray:
    """Return value and derivatives at any times, (orders, components, times).

    Args:
        time: times of the samples, ascending, (samples,), s.
        rows: value and all derivatives at the samples, (orders, components, samples).
        at: times of the span, (times,), s.
    """
    piece = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    width = time[piece + 1] - time[piece]
    coefficients = _hermite_coefficients(rows[:, :, piece], rows[:, :, piece + 1], width)
    share = (at - time[piece]) / width
    return np.stack(
        [_evaluate_derivative(coefficients, order, share) / width**order for order in range(len(rows))]
    )


def derivatives_are_consistent(time: FloatArray, rows: FloatArray) -> bool:
    """Return whether samples and all their derivatives are consistent, i.e. of one smooth function.

    Derivatives that were measured, or rounded to few digits, are not: polynomials between them oscillate.

    Args:
        time: see `interpolate_hermite`.
        rows: see `interpolate_hermite`; components that are all NaN are ignored.
    """
    present = rows[:, ~np.isnan(rows[0]).all(axis=1)]
    peaks = np.abs(present).max(axis=2)
    changes = np.abs(np.diff(present[:-MATCHED])).max(axis=2)
    rounding = ROUNDINGS * np.spacing(peaks)
    lower = AGREEING * changes + rounding[:-MATCHED]
    highest = AGREEING * peaks[-1:] + rounding[[-MATCHED]] / np.diff(time).min() ** (MATCHED - 1)
    allowed = np.concatenate([lower, highest])
    parts = (slice(first, first + TOGETHER + 1) for first in range(0, len(time) - 1, TOGETHER))
    with np.errstate(all="ignore"):  # NaN after overflow counts as inconsistent
        return all(np.all(_integration_errors(time[part], present[:, :, part]) <= allowed) for part in parts)


def _integration_errors(time: FloatArray, rows: FloatArray) -> FloatArray:
    """Return errors of integrals at the next samples, and of the highest derivative between samples."""
    width = np.diff(time)
    coefficients = _hermite_coefficients(rows[:, :, :-1], rows[:, :, 1:], width)
    one, highest = np.ones_like(width), rows[-1]
    ends = [
        _evaluate_derivative(coefficients, order, one) / width**order - row[:, 1:]
        for order, row in enumerate(rows[:-MATCHED])
    ]
    inside = _evaluate_derivative(coefficients, len(rows) - 1, MIN_CHECK_INSTANTS * one) / width ** (
        len(rows) - 1
    )
    between = inside - (highest[:, :-1] + MIN_CHECK_INSTANTS * np.diff(highest))
    return np.asarray(np.abs(np.stack([*ends, between])).max(axis=2))


def _hermite_coefficients(left: FloatArray, right: FloatArray, width: FloatArray) -> FloatArray:
    """Return coefficients of powers of the place in a piece, (powers, components, pieces), from its ends."""
    orders = len(left)
    scaled = left * width ** np.arange(orders)[:, None, None]
    lowest = orders - MATCHED
    # Errors of the expansion about the left end at the right one, which three more powers remove.
    value, slope, bend = scaled[lowest:]
    end = right[lowest:] * width ** np.arange(lowest, orders)[:, None, None]
    missed = np.stack([end[0] - value - slope - bend / 2, end[1] - slope - bend, end[2] - bend])
    higher = np.tensordot(np.linalg.inv(FROM_ENDS), missed, axes=1)
    powers = [row / math.factorial(order) for order, row in enumerate(scaled)]
    # These powers are integrated once for each lower row.
    powers += [row / math.perm(power + lowest, lowest) for power, row in enumerate(higher, MATCHED)]
    return np.stack(powers)


def _evaluate_derivative(coefficients: FloatArray, order: int, share: FloatArray) -> FloatArray:
    """Return a derivative of polynomials with coefficients, (powers, components, times), by Horner's rule."""
    total: FloatArray = np.zeros_like(coefficients[0])
    for power in range(len(coefficients) - 1, order - 1, -1):
        total = total * share + math.perm(power, order) * coefficients[power]
    return total
