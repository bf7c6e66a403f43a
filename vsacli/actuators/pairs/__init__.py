"""Pairs of springs that drive a joint: (14) solved, and which stiffness can be reached."""

from __future__ import annotations

from functools import lru_cache

from vsacli.actuators.laws.law import Pair, SpringLaw

__all__ = ["make_pair"]


def make_pair(first: SpringLaw, second: SpringLaw) -> Pair:
    """Return the solver of (14) for two laws, side 1 preloaded upward: closed if possible, else iterated."""
    return first.closed_pair(second) or _iterated(first, second)


@lru_cache(maxsize=1024)
def _iterated(first: SpringLaw, second: SpringLaw) -> Pair:
    """Equal laws get the same pair, which keeps what it has found out about them."""
    from vsacli.actuators.pairs.solver import IteratedPair

    return IteratedPair(first, second)
