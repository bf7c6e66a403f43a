"""Both springs where the range of preload torques ends: one of them is at an end of its law's domain."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.pairs.balance import Balance
from vsacli.actuators.pairs.state import PairState
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, where_needed

SMALLEST, LARGEST = 0, 1
"""The two ends of the preload torque: side 1 at that end of its domain, or side 2 at the opposite one."""


def at_end(
    balance: Balance,
    end: int,
    tau_e: FloatArray,
    chosen: BoolArray,
    otherwise: Values,
    wanted: Callable[[PairState], Values],
) -> Values:
    """What is wanted of the springs at an end; arrays (samples,).

    Args:
        balance: the springs.
        end: `SMALLEST` or `LARGEST`.
        tau_e: elastic torque.
        chosen: where to compute that.
        otherwise: what holds elsewhere, and where the preload has no end.
        wanted: arrays to return, as many as there are otherwise.
    """
    first, second = balance.first, balance.second
    tau_1, tau_2 = first.torque_range[end], second.torque_range[1 - end]
    first_ends = tau_1 <= tau_e - tau_2 if end == LARGEST else tau_1 >= tau_e - tau_2

    def with_first(tau_e: FloatArray) -> Values:
        phi_1 = np.full_like(tau_e, first.domain[end])
        phi_2, two = second.under(tau_e - tau_1)
        return wanted(PairState(phi_1, phi_2, _everywhere(balance.ends[0][end], tau_e), two))

    def with_second(tau_e: FloatArray) -> Values:
        phi_1, one = first.under(tau_e - tau_2)
        phi_2 = np.full_like(tau_e, second.domain[1 - end])
        return wanted(PairState(phi_1, phi_2, one, _everywhere(balance.ends[1][1 - end], tau_e)))

    values = otherwise
    if math.isfinite(tau_1):
        values = where_needed(chosen & first_ends, with_first, (tau_e,), values)
    if math.isfinite(tau_2):
        values = where_needed(chosen & ~first_ends, with_second, (tau_e,), values)
    return values


def _everywhere(spring: SpringState, like: FloatArray) -> SpringState:
    return SpringState(*(np.full_like(like, value) for value in spring))
