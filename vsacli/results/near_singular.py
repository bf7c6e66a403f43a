"""Scales that are not set by the peaks of nearly singular steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.simulation_variables import actual

_OF_MOTORS = (
    *("dphi", "dtheta", "ddtheta", "tau_motor", "motor_power"),
    *("dissipated_power", "current", "voltage", "copper_loss"),
)
GROWING = frozenset({*_OF_MOTORS, *map(actual, _OF_MOTORS)})
"""Variables that grow without bound towards a singular step, where they are undefined: rates of deflections
follow from the inverse of the decoupling matrix, and what motors do from them."""

TOLERATED = 0.5
"""Share of the range of all other steps by which near-singular ones may exceed it before they are cut off."""

ROOM = 0.08
"""Free space above and below, relative to that range; marks of what is cut off stand in it."""


class CalmRange(NamedTuple):
    """What an axis shows if the calm points set its scale, and whether others are cut off at its ends."""

    bottom: float
    top: float
    below: bool
    above: bool


def calm_range(curves: Sequence[FloatArray], calm: Sequence[BoolArray]) -> CalmRange | None:
    """The range of an axis for all curves of a panel; None if no point is far beyond the calm ones.

    Half of the points of each curve that are not calm are shown as well: a curve that is near-singular from
    one end of the panel to the other does not vanish from it.

    Args:
        curves: values of each, (points,); NaN where there is none.
        calm: which of them are not nearly singular.
    """
    finite = [np.isfinite(values) for values in curves]
    steady = np.concatenate([each[there & at] for each, there, at in zip(curves, finite, calm, strict=True)])
    if not steady.size:
        return None
    near = [each[there & ~at] for each, there, at in zip(curves, finite, calm, strict=True)]
    shown = np.concatenate([steady, [np.median(each) for each in near if each.size]])
    low, high = float(shown.min()), float(shown.max())
    every = np.concatenate([steady, *near])
    least, most = float(every.min()), float(every.max())
    size = high - low or abs(high) or 1.0
    below, above = least < low - TOLERATED * size, most > high + TOLERATED * size
    if not below and not above:
        return None
    bottom, top = (low if below else least) - ROOM * size, (high if above else most) + ROOM * size
    return CalmRange(bottom, top, below, above)
