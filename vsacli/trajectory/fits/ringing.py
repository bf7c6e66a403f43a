"""Ends of a recording at which a filter rings.

A steep low-pass that starts and stops with the recording answers these steps with a decaying oscillation at
its cut-off. A spline follows it like a motion, and it hides the noise of the rest from a spectrum. Noise of
the whole recording may hide it in the highest derivative, and the motion in lower ones. It is as long at both
ends, where the filter ran forwards and backwards.
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

HIGHEST = 9.0
"""The same for an end that may be longer, or turn less; those of a sweep from 0.2 to 4 Hz have 4."""

TURNS = 3
"""Fewest changes of sign of an end that rings; a motion that starts at once has less."""

LONGEST = 0.75
"""Longest end that rings, in quarters of a recording; a sweep fills the last one."""

DECAYED = 0.5
"""Largest peak in the last quarter of an end that rings, over its peak; a motion from rest to rest ends as it
begins."""


def ringing_ends(spline: BSpline[np.float64], inside: tuple[float, float], order: int) -> tuple[float, float]:
    """Return how long both ends ring, s, by three neighboring derivatives; 0 without ringing.

    Args:
        spline: spline near or through the samples, with one column.
        inside: first and last time with reliable derivatives, s.
        order: order of the highest derivative that is needed.
    """
    time = np.linspace(*inside, PROBES)
    derivatives = [spline(time, nu=near)[:, 0] for near in (order - 1, order, order + 1)]
    probes = max(_ringing(inward) for row in derivatives for inward in (row, row[::-1]))
    return (probes * float(time[1] - time[0]),) * 2


def _ringing(inward: FloatArray) -> int:
    """Return the number of probes of a derivative, from the first on, that ring."""
    usual = float(np.abs(inward[PROBES // 4 : -PROBES // 4]).max())
    beyond = np.flatnonzero(np.abs(inward[: PROBES // 4]) > usual)
    if not beyond.size:
        return 0
    end = inward[: int(beyond[-1]) + 1]
    size, turns = np.abs(end), np.count_nonzero(np.diff(np.sign(end)))
    decays = size[-len(end) // 4 :].max() < DECAYED * size.max()
    high = turns >= TURNS - 1 and size.max() > HIGHEST * usual
    rings = turns >= TURNS and size.max() > HIGHER * usual and len(end) < LONGEST * PROBES / 4
    return len(end) if decays and (high or rings) else 0
