"""Flags of the samples of one joint: stiffness attainable, A regular, and limits kept; with their margins.

`classify_stiffness` compares the stiffness with its attainable range, which `PairSolution` holds; a
`LimitCheck` compares a result variable with a limit.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from functools import reduce
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import PairSolution
from vsacli.base.arrays import AnyArray, BoolArray, FlagArray, FloatArray
from vsacli.base.flags import LIMITS, MIN_MARGIN, SINGULAR_MARGIN, Flag, flags_where
from vsacli.base.variables import VARIABLES, deviation
from vsacli.compute.vector import Scalar

LIMIT_ROUNDING = 1e-9
"""Relative excess over a limit that is ignored as rounding, so that a motion may run along its limit."""

ALLOWED_DEVIATIONS, LARGEST_ALLOWANCE = 2.0, 0.01
"""Allowed excess of an uncertain value: standard deviations, and at most this share of the limit's range."""

VariablesOfJoint = Mapping[str, AnyArray]
"""Variables of one joint by name: (samples,), or (2, samples) for those of its motors."""


class LimitCheck(NamedTuple):
    """A limit of a joint: the range in which a result variable must stay.

    Attributes:
        flag: Bit that is set outside the range.
        variable: Name of the variable.
        motor: Motor 1 or 2 for a motor variable, else None.
        range: Lower and upper bound; either may be infinite. Bounds of variants are rows, (samples,).
    """

    flag: Flag
    variable: str
    motor: int | None
    range: tuple[float, float]

    def unit(self, joint_type: str) -> str:
        """Return the unit of the variable at a joint of this type."""
        return VARIABLES[self.variable].quantity.unit(joint_type)

    def values(self, variables: VariablesOfJoint) -> FloatArray:
        """Return the bounded values, (samples,), from the variables of the joint."""
        rows = variables[self.variable]
        return rows if self.motor is None else rows[self.motor - 1]

    def flags(self, variables: VariablesOfJoint, allowance: FloatArray | float = 0.0) -> FlagArray:
        """Return the bit where values leave the range by more than rounding and an allowance; not at NaN."""
        return flags_where(self.flag, self.outside(self.values(variables)) > self.tolerance + allowance)

    def allowance(self, variables: VariablesOfJoint) -> FloatArray | float:
        """Return the excess that uncertain values are allowed, (samples,); 0 without standard deviations.

        It is twice the standard deviation, but at most 1 % of the range, or of the bound if there is only
        one; zero for a bit that marks infeasible samples instead of an exceeded limit.
        """
        deviations = variables.get(deviation(self.variable))
        if deviations is None:
            return 0.0
        deviation_of_motor = deviations if self.motor is None else deviations[self.motor - 1]
        return np.minimum(ALLOWED_DEVIATIONS * np.nan_to_num(deviation_of_motor), self.largest_allowance)

    @property
    def largest_allowance(self) -> float:
        """Largest excess that is allowed, however uncertain the values are."""
        if self.flag not in LIMITS:
            return 0.0
        width = self.range[1] - self.range[0]
        return LARGEST_ALLOWANCE * (width if np.isfinite(width) else self.largest)

    def clearance(self, variables: VariablesOfJoint) -> FloatArray:
        """Return the distance to the nearer bound relative to the larger one; negative outside the range."""
        return self.outside(self.values(variables)) / -(self.largest or 1.0)

    @property
    def tolerance(self) -> float:
        """Excess that is ignored as rounding, at samples and between them."""
        return LIMIT_ROUNDING * self.largest

    @property
    def largest(self) -> float:
        """Largest absolute value of the finite bounds; 0 if there is none."""
        return reduce(np.maximum, (abs(bound) for bound in self.range if _is_bound(bound)), 0.0)

    @property
    def exists(self) -> bool:
        """Return whether either end bounds anything."""
        return any(map(_is_bound, self.range))

    def outside(self, values: FloatArray) -> FloatArray:
        """Return the distance outside the range; zero or negative inside, NaN for NaN."""
        return np.maximum(self.range[0] - values, values - self.range[1])


def _is_bound(end: Scalar) -> bool:
    """Return whether an end of a range is finite; rows and symbols stand for finite numbers."""
    return not isinstance(end, float | int) or math.isfinite(end)


def margin(stiffness: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Return the margin: distance of the stiffness to the nearer end of its attainable range, relative to it.

    Negative outside the range, NaN where no stiffness is attainable.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # a stiffness of zero has no margin
        relative: FloatArray = np.minimum(stiffness - lower, upper - stiffness) / stiffness
    return relative


def nearer_end(stiffness: float, lower: float, upper: float) -> float:
    """Return the nearer end of the attainable range; NaN where no stiffness is attainable."""
    return lower if stiffness - lower <= upper - stiffness or math.isnan(lower) else upper


class Reach(NamedTuple):
    """Feasibility of a stiffness, and distance to a singular matrix A; arrays (samples,)."""

    infeasible: BoolArray
    slack: BoolArray
    singular: BoolArray
    near_singular: BoolArray

    @property
    def flags(self) -> FlagArray:
        """The bits of the same names."""
        bits = (Flag.INFEASIBLE, Flag.SLACK, Flag.SINGULAR, Flag.NEAR_SINGULAR)
        first_bits, *further_bits = (flags_where(flag, mask) for flag, mask in zip(bits, self, strict=True))
        return reduce(operator.or_, further_bits, first_bits)


def classify_stiffness(
    stiffness: FloatArray, solution: PairSolution, min_margin: float = MIN_MARGIN
) -> Reach:
    """Compare a stiffness with its attainable range; margins below `min_margin` count as near-singular."""
    # At a critical end A is singular. The other ends, of a law's domain, are feasible and regular. Singular
    # samples are found by their margin, since det A has no scale; it is zero exactly only at the end.
    relative_margin = margin(stiffness, solution.lower, solution.upper)
    at_lower = stiffness - solution.lower <= solution.upper - stiffness
    critical = np.where(at_lower, solution.lower_critical, solution.upper_critical)
    infeasible = ~(
        (relative_margin >= -SINGULAR_MARGIN) & (stiffness > 0)
    )  # negated, so that NaN is infeasible
    return Reach(
        infeasible=infeasible,
        slack=infeasible & at_lower & solution.slack_below,
        singular=critical & (np.abs(relative_margin) <= SINGULAR_MARGIN),
        near_singular=critical & (relative_margin > SINGULAR_MARGIN) & (relative_margin < min_margin),
    )


def deflections_within_reach(
    stiffness: FloatArray, solution: PairSolution, min_margin: float, prescribed: FloatArray | None
) -> tuple[FloatArray, Reach]:
    """Return the deflections (61), (2, samples), NaN at infeasible samples, and the reach.

    Prescribed deflections replace those of the solution; samples where they are NaN are infeasible.
    """
    reach = classify_stiffness(stiffness, solution, min_margin)
    if prescribed is not None:
        reach = reach._replace(infeasible=reach.infeasible | np.isnan(prescribed[0]))
    phi = solution.deflections if prescribed is None else prescribed
    return np.where(reach.infeasible, np.nan, phi), reach


def reach_flags(stiffness: FloatArray, solution: PairSolution, min_margin: float = MIN_MARGIN) -> FlagArray:
    """Return the bits INFEASIBLE, SLACK, SINGULAR and NEAR_SINGULAR of the samples of a joint, (samples,)."""
    return classify_stiffness(stiffness, solution, min_margin).flags
