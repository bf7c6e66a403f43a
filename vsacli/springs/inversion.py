"""Inverse of a spring law by Newton's method in a shrinking bracket, for laws without a closed one."""

from __future__ import annotations

import numpy as np

from vsacli.arrays import FloatArray
from vsacli.springs.law import SpringLaw

MOST_STEPS = 200
"""More than bisection alone needs for all digits of a double."""


def inverse(law: SpringLaw, torque: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Deflection at which the law has a torque, between `low` and `high` that enclose it.

    Each entry is iterated until its own step no longer changes it, independently of the others.
    """
    phi = (low + high) / 2
    active = np.isfinite(torque)
    phi = np.where(active, phi, np.nan)
    for _ in range(MOST_STEPS):
        error = law.torque(phi) - torque
        low, high = np.where(error <= 0, phi, low), np.where(error >= 0, phi, high)
        newton = phi - error / law.stiffness(phi)
        inside = (newton >= low) & (newton <= high)
        following = np.where(inside, newton, (low + high) / 2)
        active &= np.abs(following - phi) > 2 * np.finfo(float).eps * np.abs(phi)
        if not active.any():
            break
        phi = np.where(active, following, phi)
    return phi
