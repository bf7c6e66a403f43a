"""How unlike measured values are to computed ones, at one shift in time or at many.

Measured values may equal computed ones, or be a straight line of them: wrong offsets, units and gains make
one, and a sensor mounted the other way round a falling one. A line fits many a piece of a smooth motion, so
it has to explain ten times more than equality does, and a falling one ten times more than a rising one. The
logarithm of what stays unexplained bounds what a single column can say, so that a minority of wrong columns
does not decide.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.measured.pairing import noise

PRICE = math.log(10.0)
"""Of a line, and once more of a falling one, in logarithms of what is unexplained."""

EXACT = 1e-5
"""Share of the variance below which nothing counts as unexplained: the filter of a sensor may do that."""

FLAT = 1e-9
"""Share of the variance of a recording below which sums of transforms are only rounding."""

NOISIEST = 0.1
"""Largest such share. Where samples are few, motion looks like noise."""


class Moments(NamedTuple):
    """Sums over the samples that computed and measured values have in common; arrays for many shifts.

    Attributes:
        samples: how many.
        computed, measured: sums of the values, each less a constant.
        computed2, measured2, product: sums of their squares and products.
        apart: constant of the measured values less that of the computed ones.
        measured_variance: of all measured values.
    """

    samples: FloatArray
    computed: FloatArray
    measured: FloatArray
    computed2: FloatArray
    measured2: FloatArray
    product: FloatArray
    apart: float
    measured_variance: float

    def spreads(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Sums of squares of both about their means, and of their products."""
        return (
            self.computed2 - self.computed**2 / self.samples,
            self.measured2 - self.measured**2 / self.samples,
            self.product - self.computed * self.measured / self.samples,
        )

    def squared_error(self) -> FloatArray:
        """Sum of squares of measured minus computed values."""
        errors = self.computed2 - 2 * self.product + self.measured2
        return errors + 2 * self.apart * (self.measured - self.computed) + self.samples * self.apart**2


def moments_of(computed: FloatArray, tamed: FloatArray) -> Moments:
    """Sums of computed values, NaN where there are none, and of measured ones at the same times."""
    there = np.isfinite(computed)
    middle = float(np.mean(computed[there])) if there.any() else 0.0
    center = float(np.mean(tamed)) if tamed.size else 0.0
    first, second = computed[there] - middle, tamed[there] - center
    return Moments(
        samples=np.array(max(float(there.sum()), 1.0)),
        computed=np.array(first.sum()),
        measured=np.array(second.sum()),
        computed2=np.array(first @ first),
        measured2=np.array(second @ second),
        product=np.array(first @ second),
        apart=center - middle,
        measured_variance=float(np.var(tamed)),
    )


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def unlikeness(moments: Moments, exact: float, scale: FloatArray | float | None = None) -> FloatArray:
    """Logarithm of the unexplained share, with the price of a line; 0 where nothing is explained.

    Args:
        moments: of both signals.
        exact: share below which nothing counts as unexplained.
        scale: sum of squares of which errors are shares; of the computed values if None.
    """
    computed, measured, product = moments.spreads()
    moving = (measured > FLAT * moments.samples * moments.measured_variance) & (computed > 0)
    along = np.where(moving, product, 0.0) ** 2 / np.where(moving, computed * measured, 1.0)
    freedom = (moments.samples - 1) / np.maximum(moments.samples - 3, 0.5)
    line = np.log(np.clip((1 - along) * freedom, 0, 1) + exact) + np.where(product < 0, 2 * PRICE, PRICE)
    errors = moments.squared_error() / (computed if scale is None else scale)
    equal = np.log(np.clip(np.nan_to_num(errors, nan=1.0, posinf=1.0), 0, 1) + exact)
    return np.asarray(np.minimum(0.0, np.minimum(equal, line)))


def exactness(tamed: FloatArray) -> float:
    """Share of the variance of measured values that their noise leaves unexplained, `EXACT` at least."""
    variance = float(np.var(tamed))
    return min(NOISIEST, max(EXACT, noise(tamed) / variance)) if variance > 0 else EXACT
