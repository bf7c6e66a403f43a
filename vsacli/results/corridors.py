"""Stiffness inside what the load allows: which joints have it, and how much of it is worth showing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsacli.actuators.kinds import existing
from vsacli.base.arrays import FloatArray
from vsacli.base.variables import VARIABLES

BOUNDS = ("stiffness_lower", "stiffness_upper")

REACH = 0.25
"""How far from the command a bound may lie to be shown, relative to the command."""

MARGIN = 0.06
"""Free space above and below, relative to what is shown."""


def compliant_joints(actuators: Sequence[str]) -> list[int]:
    """The joints that have a stiffness, by the types of their actuators."""
    there = existing(VARIABLES["stiffness"], actuators)
    return [joint for joint, [has_stiffness] in enumerate(there) if has_stiffness]


def visible_range(command: FloatArray, *bounds: FloatArray) -> tuple[float, float]:
    """Lower and upper end of a stiffness axis.

    It holds the whole command, every bound the command violates, and the bounds near it; bounds far off, or
    infinite, do not squeeze the command into a line.

    Args:
        command: (points,), N m/rad (N/m); may hold NaN.
        bounds: nothing, or lower and upper end of the corridor, each (points,); may hold NaN and infinities.
    """
    command = command[np.isfinite(command)]
    if not command.size:
        return (0.0, 1.0)
    low, high = command.min(), command.max()
    reach = max(high - low, REACH * abs(high))
    shown = [command]
    for bound, nearer, end in zip(
        bounds, (np.maximum, np.minimum), (low - reach, high + reach), strict=False
    ):
        shown.append(nearer(bound[np.isfinite(bound)], end))
    values = np.concatenate(shown)
    margin = MARGIN * np.ptp(values) or reach
    return (float(values.min() - margin), float(values.max() + margin))
