"""The branch of (14): the outermost monotone piece of the joint stiffness over the preload.

Where the two torques have opposite signs, rho_1 > 0 > rho_2 (the springs harden away from zero), so that
the joint stiffness has critical points only where they have one sign. Towards larger preload from the
outermost of them, the piece is monotone to the end of the laws' domain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.springs.balance import Balance
from vsacli.springs.ends import LARGEST, SMALLEST, at_end, endless
from vsacli.springs.folds import Folds
from vsacli.springs.outermost import outermost_fold
from vsacli.springs.state import PairState


class End(NamedTuple):
    """Deflections at an end of the piece, and the joint stiffness there; arrays (samples,).

    Where the piece has no end, an infinite stiffness at the deflections that the laws come close to.
    """

    phi_1: FloatArray
    phi_2: FloatArray
    stiffness: FloatArray


class Corridor(NamedTuple):
    """The piece between its ends; arrays (samples,).

    Attributes:
        inner: its end at the smaller preload; the stiffness is NaN where tau_e cannot be carried.
        outer: its end at the larger preload, likewise.
        rising: whether the stiffness increases with the preload.
        critical: whether the inner end is a critical point (else the end of a law's domain).
        slack: whether a side that only pulls carries no torque at the inner end.
        springs: both springs at the inner end.
    """

    inner: End
    outer: End
    rising: BoolArray
    critical: BoolArray
    slack: BoolArray
    springs: PairState


def corridor(balance: Balance, folds: Folds, tau_e: FloatArray) -> Corridor:
    """The piece of the joint stiffness that reaches the largest preload, for each tau_e (samples,)."""
    least, largest = balance.domain(tau_e)
    carried = least <= largest
    known, fold = outermost_fold(balance, folds, tau_e)
    critical = carried & known & ((tau_e != 0) | ((least < 0) & (largest > 0)))
    springs = at_end(balance, SMALLEST, tau_e, carried & ~critical, fold)
    outer = at_end(balance, LARGEST, tau_e, carried, endless(balance, tau_e))
    return Corridor(
        inner=_end(springs, carried),
        outer=_end(outer, carried),
        rising=outer.stiffness >= springs.stiffness,
        critical=critical,
        slack=balance.is_slack(tau_e, least),
        springs=springs,
    )


def _end(springs: PairState, carried: BoolArray) -> End:
    return End(springs.phi_1, springs.phi_2, np.where(carried, springs.stiffness, np.nan))
