"""How often a load repeats itself."""

from __future__ import annotations

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


def rests(trajectory: Trajectory) -> bool:
    """Whether all joints stand still at both ends of a trajectory."""
    some = trajectory.block(0, trajectory.samples).dq
    fastest = np.abs(some).max(axis=0)
    return bool(np.all(np.maximum(np.abs(some[0]), np.abs(some[-1])) <= AT_REST * fastest))


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
