"""How a motion begins and ends: at rest, on its way, or as often as its load repeats itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.studies.remedies.motions import Load
from vsacli.trajectory.trajectory import Trajectory

SAME = 1e-6
"""Largest difference of what repeats itself, relative to the largest value of each variable."""

AT_REST = 1e-9
"""Largest share of its largest velocity with which a motion rests: rounding."""

LOADING = ("q", "dq", "ddq", "tau_e", "dtau_e", "ddtau_e")
"""What the motors have to do with, but for the stiffness."""

FEWEST_STEPS = 20
"""Steps of a period; what repeats itself faster is not told from noise."""


class Ends(NamedTuple):
    """How a motion begins and ends.

    Attributes:
        periods: how many equal periods it has; 0 if it does not repeat itself.
        moving: whether it begins, and ends, on its way without repeating itself.
    """

    periods: int = 0
    moving: tuple[bool, bool] = (False, False)

    @classmethod
    def of(cls, trajectory: Trajectory, loads: Sequence[Load]) -> Ends:
        """Those of a trajectory with the loads of all joints."""
        moving = _moving_ends(trajectory)
        if not any(moving):
            return cls()
        counts = [periods(load) for load in loads]
        return cls(math.gcd(*counts)) if all(counts) else cls(0, moving)


def rests(trajectory: Trajectory) -> bool:
    """Whether all joints stand still at both ends of a trajectory."""
    return not any(_moving_ends(trajectory))


def _moving_ends(trajectory: Trajectory) -> tuple[bool, bool]:
    """Whether any joint moves at the start, and at the end."""
    some = np.abs(trajectory.block(0, trajectory.samples).dq)
    first, last = (bool(np.any(row > AT_REST * some.max(axis=0))) for row in some[[0, -1]])
    return first, last


def periods(load: Load) -> int:
    """How many equal periods, whole numbers of steps, a load has; 0 if it does not end as it begins.

    Every second instant of a load is a step.
    """
    arrays = load.command.arrays()
    rows = np.stack([arrays[name] for name in LOADING])
    tolerance = SAME * np.abs(rows).max(axis=1, keepdims=True)
    steps = rows.shape[1] // 2
    for count in range(max(steps // FEWEST_STEPS, 1), 0, -1):
        period, rest = divmod(steps, count)
        if not rest and np.all(np.abs(rows[:, 2 * period :] - rows[:, : -2 * period]) <= tolerance):
            return count
    return 0
