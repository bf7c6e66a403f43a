"""Ends of a recording at which a filter rings.

A steep low-pass that starts and stops with the recording answers these steps with a decaying oscillation at
its cut-off. A spline follows it like a motion, and it hides the noise of the rest from a spectrum.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

PROBES = 8192
"""Number of times at which a derivative is evaluated."""

HIGHER = 3.0
"""Smallest peak of an end that rings, over the largest derivative in the middle half. The fourth derivative
of a polynomial of degree 7 from rest to rest has 2.7."""

TURNS = 3
"""Fewest changes of sign of an end that rings; a motion that starts at once has less."""

LONGEST = 0.75
"""Longest end that rings, in quarters of a recording; a sweep fills the last one."""

DECAYED = 0.5
"""Largest peak in the last quarter of an end that rings, over its peak; a motion from rest to rest ends as it
begins."""


def ringing_ends(spline: BSpline[np.float64], inside: tuple[float, float], order: int) -> tuple[float, float]:
    """Return how long both ends ring, s; 0 without ringing.

    Args:
        spline: spline near or through the samples, with one column.
        inside: first and last time with reliable derivatives, s.
        order: order of the highest derivative that is needed.
    """
    time = np.linspace(*inside, PROBES)
    derivative = spline(time, nu=order)[:, 0]
    usual = float(np.abs(derivative[PROBES // 4 : -PROBES // 4]).max())
    step = float(time[1] - time[0])
    return _ringing(derivative, usual) * step, _ringing(derivative[::-1], usual) * step


def _ringing(inward: FloatArray, usual: float) -> int:
    """Return the number of probes, from the first on, that ring."""
    beyond = np.flatnonzero(np.abs(inward[: PROBES // 4]) > usual)
    if not beyond.size:
        return 0
    end = inward[: int(beyond[-1]) + 1]
    size, turns = np.abs(end), np.count_nonzero(np.diff(np.sign(end)))
    decays = size[-len(end) // 4 :].max() < DECAYED * size.max()
    rings = size.max() > HIGHER * usual and turns >= TURNS and len(end) < LONGEST * PROBES / 4
    return len(end) if rings and decays else 0
