"""Both springs where the range of preload torques ends: one of them is at an end of its law's domain."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.loops import Values, where_needed
from vsacli.springs.balance import Balance
from vsacli.springs.decoupling_matrix import Springs, spring_state
from vsacli.springs.state import PairState

SMALLEST, LARGEST = 0, 1
"""The two ends of the preload torque: side 1 at that end of its domain, or side 2 at the opposite one."""


def at_end(
    balance: Balance, end: int, tau_e: FloatArray, chosen: BoolArray, otherwise: PairState
) -> PairState:
    """The springs at an end; arrays (samples,).

    Args:
        balance: the springs.
        end: `SMALLEST` or `LARGEST`.
        tau_e: elastic torque.
        chosen: where to compute that.
        otherwise: what holds elsewhere, and where the preload has no end.
    """
    first, second = balance.first, balance.second
    tau_1, tau_2 = first.torque_range[end], second.torque_range[1 - end]
    first_ends = tau_1 <= tau_e - tau_2 if end == LARGEST else tau_1 >= tau_e - tau_2
    phi_1, phi_2 = first.domain[end], second.domain[1 - end]

    def with_first(tau_e: FloatArray) -> Values:
        phi, two = second.under(tau_e - tau_1)
        one = _everywhere(spring_state(first, np.array(phi_1)), tau_e)
        return PairState(np.full_like(tau_e, phi_1), phi, one, two).values

    def with_second(tau_e: FloatArray) -> Values:
        phi, one = first.under(tau_e - tau_2)
        two = _everywhere(spring_state(second, np.array(phi_2)), tau_e)
        return PairState(phi, np.full_like(tau_e, phi_2), one, two).values

    values = otherwise.values
    if math.isfinite(tau_1):
        values = where_needed(chosen & first_ends, with_first, (tau_e,), values)
    if math.isfinite(tau_2):
        values = where_needed(chosen & ~first_ends, with_second, (tau_e,), values)
    return PairState.of(values)


def endless(balance: Balance, tau_e: FloatArray) -> PairState:
    """What the springs come close to while the preload grows without end."""
    spring = _everywhere((math.nan, math.inf, math.nan, math.nan), tau_e)
    phi_1, phi_2 = balance.first.domain[LARGEST], balance.second.domain[1 - LARGEST]
    return PairState(np.full_like(tau_e, phi_1), np.full_like(tau_e, phi_2), spring, spring)


def _everywhere(values: Iterable[float | FloatArray], like: FloatArray) -> Springs:
    return Springs(*(np.full_like(like, value) for value in values))
