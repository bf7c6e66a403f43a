"""Inverse of a spring law without a closed one, by Newton's method in a shrinking bracket."""

from __future__ import annotations

import numpy as np

from vsacli.arrays import FloatArray
from vsacli.springs.law import SpringLaw

MOST_STEPS = 200
"""More than bisection alone needs for all digits of a double."""

LAST_STEP = 1e-8
"""Relative error of the torque from which one more Newton step leaves rounding only: it squares the error."""


def inverse(
    law: SpringLaw, torque: FloatArray, low: FloatArray, high: FloatArray, start: FloatArray
) -> FloatArray:
    """Deflection at which the law has a torque, between `low` and `high` that enclose it.

    Each entry is iterated until its own torque is met, independently of the others.
    """
    shape = torque.shape
    torque, low, high = (array.flatten() for array in (torque, low, high))
    phi = np.where(torque == 0, 0.0, start.ravel())
    phi[~np.isfinite(torque)] = np.nan
    active = np.flatnonzero(np.isfinite(torque) & (torque != 0))
    for _ in range(MOST_STEPS):
        if not active.size:
            break
        trial = phi[active]
        error = law.torque(trial) - torque[active]
        low[active] = np.where(error <= 0, trial, low[active])
        high[active] = np.where(error >= 0, trial, high[active])
        with np.errstate(divide="ignore", invalid="ignore"):  # no stiffness at rest: halve the bracket
            newton = trial - error / law.stiffness(trial)
        inside = (newton >= low[active]) & (newton <= high[active])
        phi[active] = np.where(inside, newton, (low[active] + high[active]) / 2)
        met = inside & (np.abs(error) <= LAST_STEP * np.abs(torque[active]))
        active = active[~met & (low[active] < high[active])]
    return phi.reshape(shape)
