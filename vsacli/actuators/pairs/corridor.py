"""The branch of (14): the outermost monotone piece of the joint stiffness over the preload.

Where the two torques have opposite signs, rho_1 > 0 > rho_2 (the springs harden away from zero), so that
the joint stiffness has critical points only where they have one sign. Towards larger preload from the
outermost of them, the piece is monotone to the end of the laws' domain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.pairs.balance import Balance
from vsacli.actuators.pairs.ends import LARGEST, SMALLEST, at_end
from vsacli.actuators.pairs.folds import Folds
from vsacli.actuators.pairs.outermost import outermost_fold
from vsacli.actuators.pairs.state import PairState
from vsacli.base.arrays import BoolArray, FloatArray


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
    springs = PairState.of(
        at_end(balance, SMALLEST, tau_e, carried & ~critical, fold.values, lambda springs: springs.values)
    )
    outer = End(*at_end(balance, LARGEST, tau_e, carried, _endless(balance, tau_e), _end))
    return Corridor(
        inner=_known(_end(springs), carried),
        outer=_known(outer, carried),
        rising=outer.stiffness >= springs.stiffness,
        critical=critical,
        slack=balance.is_slack(tau_e, least),
        springs=springs,
    )


def _end(springs: PairState) -> End:
    return End(springs.phi_1, springs.phi_2, springs.stiffness)


def _endless(balance: Balance, tau_e: FloatArray) -> End:
    """What the springs come close to while the preload grows without end."""
    phi_1, phi_2 = balance.first.domain[LARGEST], balance.second.domain[1 - LARGEST]
    return End(*(np.full_like(tau_e, value) for value in (phi_1, phi_2, np.inf)))


def _known(end: End, carried: BoolArray) -> End:
    return end._replace(stiffness=np.where(carried, end.stiffness, np.nan))
