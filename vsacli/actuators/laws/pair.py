"""Two springs acting on one link: what solving (14) means, whatever the laws are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray


class PairSolution(NamedTuple):
    """Reachable stiffness on the branch, and the deflections for the demanded one; arrays (samples,).

    Attributes:
        lower: smallest reachable stiffness, N m/rad (N/m); NaN where the torque cannot be carried at all.
        upper: largest reachable stiffness; +inf where nothing bounds it.
        lower_critical: whether `lower` is a critical point, where A is singular (else the end of a domain).
        upper_critical: the same for `upper`.
        slack_below: whether a side that only pulls goes slack below `lower`.
        phi_1: deflection of side 1 for the stiffness clipped into [lower, upper], rad (m).
        phi_2: deflection of side 2.
    """

    lower: FloatArray
    upper: FloatArray
    lower_critical: BoolArray
    upper_critical: BoolArray
    slack_below: BoolArray
    phi_1: FloatArray
    phi_2: FloatArray

    @classmethod
    def unbounded(
        cls, lower: FloatArray, phi_1: FloatArray, phi_2: FloatArray, *, lower_critical: bool
    ) -> PairSolution:
        """A solution without upper end; the lower end is a critical point, or where a tendon goes slack."""
        return cls(
            lower=lower,
            upper=np.full_like(lower, np.inf),
            lower_critical=np.full_like(lower, lower_critical, dtype=bool),
            upper_critical=np.zeros_like(lower, dtype=bool),
            slack_below=np.full_like(lower, not lower_critical, dtype=bool),
            phi_1=phi_1,
            phi_2=phi_2,
        )

    @property
    def deflections(self) -> FloatArray:
        """phi_1 and phi_2, (2, samples)."""
        return np.stack((self.phi_1, self.phi_2))

    def exchanged(self) -> PairSolution:
        """The same with the two sides exchanged."""
        return self._replace(phi_1=self.phi_2, phi_2=self.phi_1)


class Pair(ABC):
    """Two springs on the branch of the largest preload: phi_1 up, phi_2 down.

    Along a given tau_e the joint stiffness G is a function of the preload; its critical points are the
    singularities of the decoupling matrix, its monotone pieces the branches of solutions. The branch used is
    the piece that reaches the largest preload; it needs no memory of the previous step.
    """

    @abstractmethod
    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample.

        Args:
            tau_e: elastic torque, (samples,), N m (N).
            stiffness: demanded joint stiffness, (samples,), N m/rad (N/m).
        """


def tendon_solution(lower: FloatArray, phi_1: FloatArray, phi_2: FloatArray) -> PairSolution:
    """Solution of two tendons, which is singular nowhere.

    Deflections that rounding has made those of a tendon that pushes are zero.
    """
    return PairSolution.unbounded(lower, np.maximum(phi_1, 0), np.minimum(phi_2, 0), lower_critical=False)
