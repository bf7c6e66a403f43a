"""Pairs of springs that drive a joint: solution of (14), and the attainable range of the stiffness.

Equal cubic springs and tendons have closed solutions, in the file of their law. For all others: `balance` has
the equations and steps, `critical_points` and `folds` the singularities that end a branch, `corridor` the
attainable range, `solver` the iteration on it. `pair_springs` has the pairs in motion, (62)-(72).
"""

from __future__ import annotations

from functools import lru_cache

from vsacli.actuators.laws.law import Pair, SpringLaw

__all__ = ["make_pair"]


def make_pair(first: SpringLaw, second: SpringLaw) -> Pair:
    """Return the solver of (14) for two laws with phi_1 up: closed if the laws have one, else iterated."""
    first, second = first.unlimited, second.unlimited
    return first.closed_pair(second) or _cached_iterated_pair(first, second)


@lru_cache(maxsize=1024)
def _cached_iterated_pair(first: SpringLaw, second: SpringLaw) -> Pair:
    # Equal laws share the map of their folds: otherwise the run of the measured spring takes 1.8 times as
    # long.
    from vsacli.actuators.pairs.solver import IteratedPair

    return IteratedPair(first, second)
