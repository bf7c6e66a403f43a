"""The relative hardening of a spring that is pulled: its monotone pieces, sampled."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vsacli.actuators.bracketing import bracketed_root
from vsacli.actuators.laws.law import SpringLaw
from vsacli.base.arrays import FloatArray, IndexArray

TORQUES = np.concatenate((np.geomspace(1e-14, 1e14, 281), np.geomspace(1e15, 1e120, 106)))
"""Torques, N m, at which a spring without an end is sampled: ten a decade where springs have features."""

SHARES = np.concatenate(
    (
        np.geomspace(1e-12, 0.01, 100),
        np.linspace(0.01, 0.99, 400)[1:-1],
        1 - np.geomspace(0.01, 1e-9, 70),
        [1.0],
    )
)
"""Shares of the largest deflection at which one with an end is sampled; a measured curve has some dozen
features."""

NEAR = np.geomspace(1e-4, 0.5, 16)
"""Shares of the way to the neighbouring nodes at which it is sampled next to a peak."""

FLAT = 1e-13
"""Relative change of the hardening, over a doubling of the deflection, that may be rounding."""


@dataclass(frozen=True)
class Hardening:
    """rho = zeta/sigma over positive torques; arrays (nodes,), ascending in deflection.

    Attributes:
        law: the spring.
        phi: deflections, rad (m).
        tau: torques, N m (N).
        rho: relative hardening.
        peaks: indices where it turns around.
    """

    law: SpringLaw
    phi: FloatArray
    tau: FloatArray
    rho: FloatArray
    peaks: IndexArray

    def pieces(self) -> Iterator[slice]:
        """Nodes of each monotone piece; neighbours share the node at the peak."""
        bounds = [0, *self.peaks.tolist(), len(self.phi) - 1]
        for first, last in pairwise(bounds):
            yield slice(first, last + 1)

    def rises(self, piece: slice) -> bool:
        """Whether the hardening increases over a piece."""
        rho = self.rho[piece]
        return bool(rho[-1] >= rho[0])


def sample_hardening(law: SpringLaw) -> Hardening | None:
    """Sample a law; None if it carries no positive torque."""
    end = law.torque_range[1]
    if end <= 0:
        return None
    phi = law.deflection(np.array([end])) * SHARES if math.isfinite(end) else law.deflection(TORQUES)
    phi = np.concatenate(([0.0], phi))
    peaks = _peaks(law, phi)
    phi = np.unique(np.concatenate((phi, peaks, *(_around(peak, phi) for peak in peaks))))
    rho = law.hardening(phi)
    known = np.isfinite(rho)
    phi, rho = phi[known], rho[known]
    return Hardening(law, phi, law.torque(phi), rho, np.searchsorted(phi, peaks))


def _around(peak: float, phi: FloatArray) -> FloatArray:
    above = int(np.searchsorted(phi, peak, side="right"))
    below = int(np.searchsorted(phi, peak)) - 1
    return np.concatenate((peak + (phi[above] - peak) * NEAR, peak + (phi[below] - peak) * NEAR))


def _peaks(law: SpringLaw, phi: FloatArray) -> FloatArray:
    """Deflections strictly between nodes at which eta sigma - zeta^2 changes its sign."""

    def bend(phi: FloatArray) -> FloatArray:
        _, sigma, zeta, eta = law.derivatives(phi, 3)
        difference = eta * sigma - zeta * zeta
        return np.where(np.abs(difference) <= FLAT * (np.abs(eta * sigma) + zeta * zeta), 0.0, difference)

    sign = np.sign(bend(phi))
    kept = np.flatnonzero(sign)
    turn = np.flatnonzero(sign[kept[:-1]] != sign[kept[1:]])
    peaks: FloatArray = np.unique(bracketed_root(bend, phi[kept[turn]], phi[kept[turn + 1]]))
    inner: FloatArray = peaks[(peaks > phi[0]) & (peaks < phi[-1])]  # rounding moves one onto an end
    return inner
