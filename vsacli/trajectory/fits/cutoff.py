"""How much motion there is just below the cut-off of a penalised spline, of a derivative.

A common factor t of all penalties lowers the frequency of the cut-off by t^(1/2n), n their order. What two
splines differ by lies between their cut-offs: it is motion, and noise, whose part follows from how the
posterior variance changes with t.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.penalised import Model

STEP = 2.4
"""Of log t from one spline to the next: a sixth of the frequency with differences of order seven."""


BANDS = 4
"""Over which a spectrum is looked at; their frequencies go down to the half."""

FALLING = 25.0
"""Ratio of the power in the lowest to that in the highest of them, from which on a spectrum falls towards the
cut-off. With jumps of jerk that of d4q is flat: on 180 records the ratio was 0.2 to 20. Of steps of velocity
within 200 ms it was 17 to 120, unless noise hid how smooth they are."""


class MotionPower(NamedTuple):
    """Power of a derivative of the motion between neighbouring cut-offs, the highest first.

    Attributes:
        found: what splines differ by, less what noise makes of that, in units of its variance, (bands,).
        expected: the same by the prior, (bands,).
    """

    found: FloatArray
    expected: FloatArray


def motion_power(model: Model, order: int, bands: int, weight: FloatArray) -> MotionPower:
    """Of a derivative, below the cut-off of a spline.

    With the gain H = 1/(1 + t g) of a spline at a frequency and noise of density N the posterior variance is
    v = int N H, and int N H^2 = v + dv/dlog t. The prior expects motion of the density N / g at t = 1.
    Products of gains are differences: H1 H2 (t1 - t2) = t1 H1 - t2 H2.

    Args:
        model: the spline, t = 1.
        order: of the derivative.
        bands: how many.
        weight: of each of `Model.probes`.
    """
    logarithms = STEP * np.arange(bands + 1)
    splines = [model.stiffened(each) for each in logarithms.tolist()]
    variance = np.array([weight @ each.variances(order) for each in splines])
    squared = variance * (1 + np.gradient(np.log(variance), STEP, edge_order=2))
    rows = np.array([each.spline(model.probes, nu=order)[:, 0] for each in splines])
    found = np.diff(rows, axis=0) ** 2 @ weight / model.noise_variance
    less, more = np.exp(logarithms[:-1]), np.exp(logarithms[1:])
    both = (more * variance[1:] - less * variance[:-1]) / (more - less)
    noise = squared[:-1] + squared[1:] - 2 * both
    expected = more * (both - squared[1:]) - less * (squared[:-1] - both)
    return MotionPower(found - noise, expected)


def falls(model: Model, order: int) -> bool:
    """Whether the spectrum of a derivative falls towards the cut-off, as that of no impulse does."""
    lowest_last = motion_power(model, order, BANDS, model.inside / np.sum(model.inside)).found
    return bool(lowest_last[-1] > FALLING * max(lowest_last[0], 0.0))
