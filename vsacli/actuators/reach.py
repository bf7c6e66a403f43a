"""Is a step reachable, regular and within limits? Margins and flags of one joint, over samples."""

from __future__ import annotations

import operator
from functools import reduce
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.pair import PairSolution
from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag

TOUCHING = 1e-9
"""Relative margin that counts as zero: deflections are good to about 1e-16/margin, so to 1e-7 at this one."""

NEAR_SINGULAR = 0.01
"""Relative margin to a critical point below which a step is near-singular; the paper's runs keep 3 %."""

LIMIT_ROUNDING = 1e-9
"""Relative excess over a limit that is none, so that a motion may run along its limit."""


def margin(stiffness: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Relative distance of the stiffness to the nearer end of its corridor; negative outside, NaN if none."""
    return np.minimum(stiffness - lower, upper - stiffness) / stiffness


def check_near_singular(threshold: float) -> None:
    """Refuse a threshold for near-singular steps that no margin can be compared with.

    Raises:
        InputError: it is not above `TOUCHING` and below 1.
    """
    if not TOUCHING < threshold < 1:
        raise InputError.one(
            f"the near-singular margin must lie between {TOUCHING:g} and 1, as 0.01 does, not {threshold:g}"
        )


class Reach(NamedTuple):
    """Whether a stiffness is within reach, and how near to a singular matrix A; arrays (samples,)."""

    infeasible: BoolArray
    slack: BoolArray
    singular: BoolArray
    near_singular: BoolArray

    @property
    def flags(self) -> FlagArray:
        """The bits of the same names."""
        bits = (Flag.INFEASIBLE, Flag.SLACK, Flag.SINGULAR, Flag.NEAR_SINGULAR)
        first, *others = (_bit(flag, where) for flag, where in zip(bits, self, strict=True))
        return reduce(operator.or_, others, first)


def reach(stiffness: FloatArray, solution: PairSolution, near_singular: float = NEAR_SINGULAR) -> Reach:
    """Reach of the steps of a joint; near-singular is what has a smaller margin than that."""
    gap = margin(stiffness, solution.lower, solution.upper)
    at_lower = stiffness - solution.lower <= solution.upper - stiffness
    critical = np.where(at_lower, solution.lower_critical, solution.upper_critical)
    infeasible = ~((gap >= -TOUCHING) & (stiffness > 0))
    return Reach(
        infeasible=infeasible,
        slack=infeasible & at_lower & solution.slack_below,
        singular=critical & (np.abs(gap) <= TOUCHING),
        near_singular=critical & (gap > TOUCHING) & (gap < near_singular),
    )


def reach_flags(
    stiffness: FloatArray, solution: PairSolution, near_singular: float = NEAR_SINGULAR
) -> FlagArray:
    """Bits INFEASIBLE, SLACK, SINGULAR and NEAR_SINGULAR of the steps of a joint, (samples,)."""
    return reach(stiffness, solution, near_singular).flags


class LimitCheck(NamedTuple):
    """A finite limit of a joint: which result variable must stay in which range.

    Attributes:
        flag: the bit that says it does not.
        variable: name of the variable.
        motor: 1 or 2 if the variable is one of a motor, else None.
        range: lower and upper bound.
    """

    flag: Flag
    variable: str
    motor: int | None
    range: tuple[float, float]


def excess(values: FloatArray, bounds: tuple[float, float]) -> FloatArray:
    """How far values lie outside [lower, upper]; zero or negative inside, NaN for NaN."""
    return np.maximum(bounds[0] - values, values - bounds[1])


def limit_flags(check: LimitCheck, values: FloatArray) -> FlagArray:
    """The bit of a limit where the values leave its range by more than rounding; NaN does not."""
    largest = max(abs(bound) for bound in check.range if np.isfinite(bound))
    return _bit(check.flag, excess(values, check.range) > LIMIT_ROUNDING * largest)


def has(flags: FlagArray, bits: Flag) -> BoolArray:
    """Where any of the bits is set."""
    hit: BoolArray = (flags & np.uint16(bits)) != 0
    return hit


def _bit(flag: Flag, where: BoolArray) -> FlagArray:
    return where.astype(np.uint16) * np.uint16(flag)
