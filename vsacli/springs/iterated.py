"""Any two spring laws: (14) solved by safeguarded iteration on the outermost branch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.arrays import FloatArray
from vsacli.springs.balance import Balance, torques
from vsacli.springs.bracketing import bracketed_root
from vsacli.springs.branch import outermost_piece
from vsacli.springs.law import SpringLaw
from vsacli.springs.pair import Pair, PairSolution


@dataclass(frozen=True)
class IteratedPair(Pair):
    """Two laws without a closed solution: a bracketing root finder along the preload torque."""

    first: SpringLaw
    second: SpringLaw

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        balance = Balance(self.first, self.second)
        piece = outermost_piece(balance, tau_e)
        carried = piece.inner <= piece.outer
        at_inner, at_outer, phi_1, phi_2 = np.full((4, tau_e.size), np.nan)
        walk = _Walk(balance, *torques(piece.inner[carried], tau_e[carried]))
        width = (piece.outer - piece.inner)[carried]
        at_inner[carried] = walk.stiffness(np.zeros_like(width))
        at_outer[carried] = walk.end_stiffness(width)
        lower = np.where(piece.rising, at_inner, at_outer)
        upper = np.where(piece.rising, at_outer, at_inner)
        demand = np.clip(stiffness, lower, upper)
        phi_1[carried], phi_2[carried] = walk.deflections(width, demand[carried])
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=piece.critical & piece.rising,
            upper_critical=piece.critical & ~piece.rising,
            slack_below=~piece.critical & piece.rising & balance.is_slack(piece.inner, tau_e),
            phi_1=phi_1,
            phi_2=phi_2,
        )


@dataclass(frozen=True)
class _Walk:
    """The piece from its inner end outwards; arrays (samples,).

    Distances are preload torques counted from there, so that the torque of a spring that is nearly slack at
    the inner end keeps its digits.
    """

    balance: Balance
    tau_1: FloatArray
    tau_2: FloatArray

    def stiffness(self, distance: FloatArray) -> FloatArray:
        """G at a distance."""
        return self.balance.stiffness(self.tau_1 + distance, self.tau_2 - distance)

    def end_stiffness(self, width: FloatArray) -> FloatArray:
        """G at the outer end; +inf where there is none."""
        endless = np.isinf(width)
        return np.where(endless, np.inf, self.stiffness(np.where(endless, 0, width)))

    def deflections(self, width: FloatArray, demand: FloatArray) -> tuple[FloatArray, FloatArray]:
        """phi_1 and phi_2 where the piece has the demanded stiffness, which lies within its ends."""
        distance = bracketed_root(
            lambda x, tau_1, tau_2, wanted: self.balance.stiffness(tau_1 + x, tau_2 - x) - wanted,
            np.zeros_like(width),
            self._finite(width, demand),
            self.tau_1,
            self.tau_2,
            demand,
        )
        return self.balance.deflections(self.tau_1 + distance, self.tau_2 - distance)

    def _finite(self, width: FloatArray, demand: FloatArray) -> FloatArray:
        """The width, or where it is infinite a distance at which G exceeds the demand."""
        endless = np.isinf(width)
        width = np.where(endless, np.abs(self.tau_1) + np.abs(self.tau_2) + demand, width)
        while (short := endless & (self.stiffness(width) < demand)).any():
            width = np.where(short, 2 * width, width)
        return width
