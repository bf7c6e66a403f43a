"""Margins and flags of the samples of one joint: attainable, regular, and within limits."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from functools import reduce
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import PairSolution
from vsacli.base.arrays import AnyArray, BoolArray, FlagArray, FloatArray
from vsacli.base.flags import LIMITS, NEAR_SINGULAR_MARGIN, SINGULAR_MARGIN, Flag, has, marked
from vsacli.base.variables import VARIABLES, deviation

LIMIT_ROUNDING = 1e-9
"""Relative excess over a limit that does not count, so that a motion may run along its limit."""

ALLOWED_DEVIATIONS, LARGEST_ALLOWANCE = 2.0, 0.01
"""Standard deviations, and share of a limit's range, by which an uncertain value may seem to exceed it."""

OfJoint = Mapping[str, AnyArray]
"""Variables of one joint by name, (samples,), those of its motors (2, samples)."""


class Excess(NamedTuple):
    """The worst excess over a limit.

    Attributes:
        first: index of the first step beyond the limit.
        step: index of the worst one.
        value: of the variable there.
        bound: the end of the range that it is beyond.
        size: how far.
    """

    first: int
    step: int
    value: float
    bound: float
    size: float


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

    def unit(self, joint_type: str) -> str:
        """Unit of the variable at a joint of this type."""
        return VARIABLES[self.variable].quantity.unit(joint_type)

    def values(self, of_joint: OfJoint) -> FloatArray:
        """Return the bounded values, (samples,), from the variables of the joint."""
        rows = of_joint[self.variable]
        return rows if self.motor is None else rows[self.motor - 1]

    def flags(self, of_joint: OfJoint, allowance: FloatArray | float = 0.0) -> FlagArray:
        """Return the bit where the range is left by more than rounding and an allowance.

        NaN does not leave it.
        """
        allowed = LIMIT_ROUNDING * self._largest + allowance
        return marked(self.flag, self._outside(self.values(of_joint)) > allowed)

    def allowance(self, of_joint: OfJoint) -> FloatArray | float:
        """Return by how much uncertain values may seem to exceed the range, (samples,); 0 for certain ones.

        Twice the standard deviation, but at most 1 % of the range, or of the bound if there is only one; none
        where the bit is no limit, but says that there is no way.
        """
        deviations = of_joint.get(deviation(self.variable))
        if deviations is None:
            return 0.0
        of_motor = deviations if self.motor is None else deviations[self.motor - 1]
        return np.minimum(ALLOWED_DEVIATIONS * np.nan_to_num(of_motor), self.largest_allowance)

    @property
    def largest_allowance(self) -> float:
        """Largest seeming excess, however uncertain the values are."""
        if self.flag not in LIMITS:
            return 0.0
        width = self.range[1] - self.range[0]
        return LARGEST_ALLOWANCE * (width if np.isfinite(width) else self._largest)

    def clearance(self, of_joint: OfJoint) -> FloatArray:
        """Return the distance inside the range relative to its larger end; negative outside, NaN for NaN."""
        clearance: FloatArray = self._outside(self.values(of_joint)) / -(self._largest or 1.0)
        return clearance

    def worst(self, of_joint: OfJoint, flags: FlagArray) -> Excess | None:
        """Return the worst of the steps with the bit among these flags, (samples,); None without any."""
        values = self.values(of_joint)
        outside = np.nan_to_num(self._outside(values), nan=-np.inf)
        hit = has(flags, self.flag) & (outside > 0)
        if not hit.any():
            return None
        step = int(np.where(hit, outside, -np.inf).argmax())
        value, (lower, upper) = float(values[step]), self.range
        return Excess(int(hit.argmax()), step, value, lower if value < lower else upper, float(outside[step]))

    @property
    def _largest(self) -> float:
        """The larger finite bound in size; 0 if there is none."""
        return max((abs(bound) for bound in self.range if np.isfinite(bound)), default=0.0)

    def _outside(self, values: FloatArray) -> FloatArray:
        """Return the distance outside the range; zero or negative inside, NaN for NaN."""
        return np.maximum(self.range[0] - values, values - self.range[1])


def within(bound: float) -> tuple[float, float]:
    """Return the range of a quantity whose size is bounded."""
    return -bound, bound


def margin(stiffness: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Relative distance of the stiffness to the nearer end of its corridor; negative outside, NaN if none."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a stiffness of zero has none
        relative: FloatArray = np.minimum(stiffness - lower, upper - stiffness) / stiffness
    return relative


def nearer_end(stiffness: float, lower: float, upper: float) -> float:
    """Return the end of the corridor that a stiffness is nearer to; NaN if there is none."""
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
