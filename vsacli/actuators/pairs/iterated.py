"""Any two spring laws: (14) solved by Newton's method on the outermost branch, guarded by bracketing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.pair import Pair, PairSolution
from vsacli.actuators.pairs.balance import Balance
from vsacli.actuators.pairs.corridor import corridor
from vsacli.actuators.pairs.folds import Folds, map_folds
from vsacli.actuators.pairs.search import deflections_at
from vsacli.base.arrays import FloatArray


@dataclass(frozen=True)
class IteratedPair(Pair):
    """Two laws without a closed solution."""

    first: SpringLaw
    second: SpringLaw

    @cached_property
    def _balance(self) -> Balance:
        return Balance(self.first, self.second)

    @cached_property
    def _folds(self) -> Folds:
        return map_folds(self.first, self.second)

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        balance, folds = self._balance, self._folds
        with np.errstate(all="ignore"):  # trial steps may lead anywhere, and are refused there
            ends = corridor(balance, folds, tau_e)
            lower = np.minimum(ends.inner.stiffness, ends.outer.stiffness)
            upper = np.maximum(ends.inner.stiffness, ends.outer.stiffness)
            demand = np.minimum(np.maximum(stiffness, lower), upper)
            phi_1, phi_2 = deflections_at(balance, ends, tau_e, demand)
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=ends.critical & ends.rising,
            upper_critical=ends.critical & ~ends.rising,
            slack_below=~ends.critical & ends.rising & ends.slack,
            phi_1=phi_1,
            phi_2=phi_2,
        )
