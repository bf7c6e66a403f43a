"""Any two spring laws: (14) solved by safeguarded iteration on the outermost branch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.springs.balance import Balance
from vsacli.springs.bracketing import bracketed_root
from vsacli.springs.branch import Piece, outermost_piece
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
        at_inner = _stiffness(balance, piece.inner, tau_e, carried)
        at_outer = _stiffness(balance, piece.outer, tau_e, carried & np.isfinite(piece.outer))
        at_outer[carried & np.isinf(piece.outer)] = np.inf
        lower = np.where(piece.rising, at_inner, at_outer)
        upper = np.where(piece.rising, at_outer, at_inner)

        preload = np.full_like(tau_e, np.nan)
        demand = np.clip(stiffness, lower, upper)
        preload[carried] = _preload(balance, piece.select(carried), tau_e[carried], demand[carried])
        phi_1, phi_2 = balance.deflections(preload, tau_e)
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=piece.critical & piece.rising,
            upper_critical=piece.critical & ~piece.rising,
            slack_below=~piece.critical & piece.rising & balance.is_slack(piece.inner, tau_e),
            phi_1=phi_1,
            phi_2=phi_2,
        )


def _stiffness(balance: Balance, t: FloatArray, tau_e: FloatArray, where: BoolArray) -> FloatArray:
    result = np.full_like(tau_e, np.nan)
    result[where] = balance.stiffness(t[where], tau_e[where])
    return result


def _preload(balance: Balance, piece: Piece, tau_e: FloatArray, demand: FloatArray) -> FloatArray:
    """The preload torque at which the piece has the demanded stiffness, which lies within its ends."""
    return bracketed_root(
        lambda t, torque, stiffness: balance.stiffness(t, torque) - stiffness,
        piece.inner,
        _finite_outer_end(balance, piece, tau_e, demand),
        tau_e,
        demand,
    )


def _finite_outer_end(balance: Balance, piece: Piece, tau_e: FloatArray, demand: FloatArray) -> FloatArray:
    """A preload torque beyond which the stiffness exceeds the demand, by doubling the distance."""
    outer = piece.outer.copy()
    short = np.flatnonzero(np.isinf(outer))
    step = np.abs(tau_e) + demand
    while short.size:
        outer[short] = piece.inner[short] + step[short]
        step *= 2
        short = short[balance.stiffness(outer[short], tau_e[short]) < demand[short]]
    return outer
