"""Is a step reachable, regular and within limits? Margins and flags of one joint, over samples."""

from __future__ import annotations

import math
import operator
from functools import reduce
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.pair import PairSolution
from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.flags import NEAR_SINGULAR_MARGIN, SINGULAR_MARGIN, Flag, marked


def margin(stiffness: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Relative distance of the stiffness to the nearer end of its corridor; negative outside, NaN if none."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a stiffness of zero has none
        relative: FloatArray = np.minimum(stiffness - lower, upper - stiffness) / stiffness
    return relative


def nearer_end(stiffness: float, lower: float, upper: float) -> float:
    """The end of the corridor that a stiffness is nearer to; NaN if there is none."""
    return lower if stiffness - lower <= upper - stiffness or math.isnan(lower) else upper


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
        first, *others = (marked(flag, where) for flag, where in zip(bits, self, strict=True))
        return reduce(operator.or_, others, first)


def reach(
    stiffness: FloatArray, solution: PairSolution, near_singular: float = NEAR_SINGULAR_MARGIN
) -> Reach:
    """Reach of the steps of a joint; near-singular is what has a smaller margin than that."""
    gap = margin(stiffness, solution.lower, solution.upper)
    at_lower = stiffness - solution.lower <= solution.upper - stiffness
    critical = np.where(at_lower, solution.lower_critical, solution.upper_critical)
    infeasible = ~((gap >= -SINGULAR_MARGIN) & (stiffness > 0))
    return Reach(
        infeasible=infeasible,
        slack=infeasible & at_lower & solution.slack_below,
        singular=critical & (np.abs(gap) <= SINGULAR_MARGIN),
        near_singular=critical & (gap > SINGULAR_MARGIN) & (gap < near_singular),
    )


def deflections_within_reach(
    stiffness: FloatArray, solution: PairSolution, near_singular: float, integrated: FloatArray | None
) -> tuple[FloatArray, Reach]:
    """Deflections (61), (2, samples), NaN where the step is infeasible, and the reach of the steps.

    Integrated deflections take the place of those of the solution; a step where they are NaN is infeasible.
    """
    reached = reach(stiffness, solution, near_singular)
    if integrated is not None:
        reached = reached._replace(infeasible=reached.infeasible | np.isnan(integrated[0]))
    phi = solution.deflections if integrated is None else integrated
    return np.where(reached.infeasible, np.nan, phi), reached


def reach_flags(
    stiffness: FloatArray, solution: PairSolution, near_singular: float = NEAR_SINGULAR_MARGIN
) -> FlagArray:
    """Bits INFEASIBLE, SLACK, SINGULAR and NEAR_SINGULAR of the steps of a joint, (samples,)."""
    return reach(stiffness, solution, near_singular).flags
