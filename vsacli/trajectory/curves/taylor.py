"""Taylor polynomials with their derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsacli.base.arrays import FloatArray


def taylor_series(derivatives: Sequence[FloatArray], offset: FloatArray, orders: int) -> list[FloatArray]:
    """The polynomial of given derivatives and its own derivatives of order 0 to orders-1, by Horner's rule.

    Args:
        derivatives: at the centre of each sample, from order 0 to the degree, each (components, samples).
        offset: from the centre, (samples,).
        orders: how many are wanted.
    """
    return [_sum(derivatives[order:] or [np.zeros_like(derivatives[0])], offset) for order in range(orders)]


def _sum(derivatives: Sequence[FloatArray], offset: FloatArray) -> FloatArray:
    total = derivatives[-1].copy()
    for power in range(len(derivatives) - 1, 0, -1):
        total *= offset / power
        total += derivatives[power - 1]
    return total
