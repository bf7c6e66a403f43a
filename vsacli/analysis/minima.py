"""Clearances, that is margins and distances to limits, and a search for minima between samples.

`Sides` has the functions whose minima count. `find_brackets` finds three consecutive times around each local
minimum; `narrow_brackets` evaluates further times between them until the minimum is known. `between_samples`
applies them to the blocks of a run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from vsacli.actuators.reach import LimitCheck, VariablesOfJoint, margin, nearer_end
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.flags import SINGULAR_MARGIN, Flag
from vsacli.base.signals import STIFFNESS
from vsacli.base.variables import Block
from vsacli.dynamics.limits import MARGIN, Finding, limit_checks
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

STIFFNESS_FLAGS = Flag.INFEASIBLE | Flag.SLACK | Flag.SINGULAR | Flag.NEAR_SINGULAR | Flag.NOT_FINITE
"""Bits that concern a stiffness in its attainable range."""


class Bounded(NamedTuple):
    """A quantity with bounds.

    Attributes:
        joint: Joint of the quantity.
        joint_index: Index of the joint.
        limit: Limit that bounds it; None for the stiffness in its attainable range.
    """

    joint: Joint
    joint_index: int
    limit: LimitCheck | None

    @property
    def bits(self) -> Flag:
        """Bits that a sample may have for this quantity."""
        return STIFFNESS_FLAGS if self.limit is None else self.limit.flag

    def clearance(self, of_joint: VariablesOfJoint) -> FloatArray:
        """Return the relative distance to the nearer bound, (samples,), negative beyond it.

        It is -inf where the springs cannot carry the torque at all, and +inf where a motor variable does not
        exist, since that is near no limit.
        """
        if self.limit is not None:
            return np.fmin(self.limit.clearance(of_joint), np.inf)  # fmin replaces NaN by inf
        margins = margin(of_joint["stiffness"], of_joint["stiffness_min"], of_joint["stiffness_max"])
        return np.fmax(margins, -np.inf)

    def sides(self, min_margin: float) -> Iterator[Side]:
        """Yield each side with a bound; margins below `min_margin` are flagged."""
        if self.limit is None:
            yield 1.0, 0.0, 1.0, SINGULAR_MARGIN, -SINGULAR_MARGIN, -min_margin
            return
        size, tolerance = self.limit.largest or 1.0, self.limit.tolerance
        for sign, bound in zip((1.0, -1.0), self.limit.range, strict=True):
            if math.isfinite(bound):
                yield sign, sign * bound, size, tolerance, math.inf, math.inf

    def signed_values(self, of_joint: VariablesOfJoint, sign: float) -> FloatArray:
        """Return the values with a sign, (samples,), with missing ones replaced as in `clearance`."""
        if self.limit is None:
            return self.clearance(of_joint)
        return np.fmin(sign * self.limit.values(of_joint), np.inf)

    def at(self, block: Block, sample: int, *, between: bool = False) -> Finding:
        """Return the value and the nearer bound at a sample of a block, or at an instant between samples."""
        of_joint, limit = block.of_joint(self.joint_index), self.limit
        if limit is None:
            kind, motor, unit = MARGIN, None, units.STIFFNESS.unit(self.joint.type)
            values = of_joint["stiffness"]
            bounds = of_joint["stiffness_min"][sample], of_joint["stiffness_max"][sample]
        else:
            kind, motor, unit = limit.flag.label, limit.motor, limit.unit(self.joint.type)
            values, bounds = limit.values(of_joint), limit.range
        value, time = float(values[sample]), float(block.time[sample])
        bound = nearer_end(value, *map(float, bounds))
        return Finding(kind, time, value, bound, unit, motor, self.joint.name, between)


Side: TypeAlias = tuple[float, float, float, float, float, float]
"""One side of a quantity, whose values, times a sign, should not fall below a bound: sign, bound, distance
from it that is a clearance of 1, and distances below it beyond which flags are set, the gravest first."""


DECISIVE_FLAGS = 2
"""Number of these flags on which the verdict depends; the last, of a near-singular sample, is a warning."""


class Sides:
    """The sides of quantities, as functions of time that do not depend on the bounds, except for margins.

    So a peak has the same place and value whatever its limit is, and a tighter limit never finds a lower one.

    The sides of all variants of a batch follow each other, those of the first one first.

    Args:
        quantities: Quantities with bounds of each variant, equal except for the bounds.
        min_margin: Margin that is flagged.

    Attributes:
        count: Number of sides of a variant.
        quantity: Index of the quantity of each side, (sides,); that of the second variant follows all of the
            first.
        size: Distance from the bound that is a clearance of 1, (sides,).
        critical: Value at which the gravest flag of each side is set, (sides,).
    """

    def __init__(self, quantities: Sequence[list[Bounded]], min_margin: float) -> None:
        numbered = enumerate(quantity for variant_quantities in quantities for quantity in variant_quantities)
        sides = [
            (quantity_index, side)
            for quantity_index, quantity in numbered
            for side in quantity.sides(min_margin)
        ]
        self._quantities, self.count = quantities[0], len(sides) // len(quantities)
        self.quantity = np.array([quantity_index for quantity_index, _ in sides], dtype=np.intp)
        table = np.array([side for _, side in sides]).reshape(-1, 6)
        self._sign, self._bound, self.size = table[:, :3].T
        self._tolerances = table[:, 3:]
        self.critical = self._bound - self._tolerances[:, 0]

    def values(self, block: Block) -> FloatArray:
        """Return the values of all sides of a single variant, (sides, samples), or of each sample's own."""
        of_joints = {
            quantity_of_joint.joint_index: block.of_joint(quantity_of_joint.joint_index)
            for quantity_of_joint in self._quantities
        }
        quantities = (self._quantities[quantity_index] for quantity_index in self.quantity[: self.count])
        signed_quantities = zip(quantities, self._sign[: self.count].tolist(), strict=True)
        rows = [
            quantity.signed_values(of_joints[quantity.joint_index], sign)
            for quantity, sign in signed_quantities
        ]
        return np.array(rows).reshape(-1, len(block.time))

    def clearance(self, side: IndexArray, value: FloatArray) -> FloatArray:
        """Return the relative distances of values from the bounds of sides, (n,)."""
        clearance: FloatArray = (value - self._bound[side]) / self.size[side]
        return clearance

    def beyond(self, side: IndexArray, value: FloatArray) -> BoolArray:
        """Return which flags values have, (n, 3), by the rule of `LimitCheck.flags`."""
        beyond: BoolArray = (self._bound[side] - value)[:, None] > self._tolerances[side]
        return beyond

    def next_flag_values(self, side: IndexArray, value: FloatArray) -> FloatArray:
        """Return the values, (n,), below which sides get another flag; -inf if they have all."""
        tolerances = np.where(self.beyond(side, value), np.inf, self._tolerances[side])
        next_values: FloatArray = self._bound[side] - tolerances.min(axis=1)
        return next_values


def bounded_quantities(robot: Robot) -> list[Bounded]:
    """Return all bounded quantities of a robot."""
    return [
        Bounded(joint, index, limit)
        for index, joint in enumerate(robot.joints)
        for limit in (*([None] if STIFFNESS.key in joint.actuator.commanded else []), *limit_checks(joint))
    ]


def clearances(quantities: list[Bounded], block: Block) -> FloatArray:
    """Return the clearances of all quantities, (quantities, samples)."""
    of_joints = {index: block.of_joint(index) for index in {quantity.joint_index for quantity in quantities}}
    rows = [quantity.clearance(of_joints[quantity.joint_index]) for quantity in quantities]
    return np.array(rows).reshape(-1, len(block.time))


MINIMUM_ACCURACY = 1e-3
"""Accuracy to which a minimum is determined, relative to its distance from the value that sets a flag."""

PRECISION = 1e-13
"""Accuracy to which a minimum is determined at that value, relative to itself: a tenth of what may decide on
a flag, and more than rounding."""

ROUNDING = 1e-10
"""Clearance by which a minimum without a further flag is below the samples, lest rounding be reported."""

NEW_TIME_SHARES = np.array([1, 2]) / 3
"""New times in both halves of a bracket, for functions that no parabola describes."""

PARABOLA_OFFSETS = np.array([-0.01, 0.0, 0.01])
"""New times about the lowest point of a parabola, in widths of the bracket: around a smooth minimum the
bracket becomes fifty times narrower, and the possible fall 2500 times smaller."""

ROUNDS = 16
"""Largest number of rounds, after which a bracket is 3^-16 = 2e-8 of a sample distance wide. Smooth minima
need one or two, kinks and jumps more."""

TINY = np.finfo(float).tiny

Evaluate = Callable[[IndexArray, FloatArray], FloatArray]
"""Function from indices of quantities, (n,), and times for each, (n, times), to values (n, times)."""


class SampledFunctions(NamedTuple):
    """Functions at consecutive times.

    Attributes:
        first: Index of the first time.
        time: Times of each function, ascending, (functions, times).
        value: Values at these times, (functions, times).
    """

    first: int
    time: FloatArray
    value: FloatArray

    @property
    def stop(self) -> int:
        """Index of the time after the last one."""
        return self.first + int(self.time.shape[1])

    def last(self, count: int) -> SampledFunctions:
        """Return the last `count` times."""
        dropped = max(0, self.time.shape[-1] - count)
        return SampledFunctions(self.first + dropped, self.time[:, dropped:], self.value[:, dropped:])

    def followed_by(self, time: FloatArray, value: FloatArray) -> SampledFunctions:
        """Return these times followed by others."""
        return SampledFunctions(self.first, np.hstack((self.time, time)), np.hstack((self.value, value)))

    def opened(self) -> SampledFunctions:
        """Return these with the first time twice, so that it has a neighbor on either side."""
        first = SampledFunctions(self.first - 1, self.time[:, :1], self.value[:, :1])
        return first.followed_by(*self[1:])

    def closed(self) -> SampledFunctions:
        """Return these with the last time twice, slightly higher: the end of a fall is a minimum."""
        return self.followed_by(self.time[:, -1:], np.nextafter(self.value[:, -1:], np.inf))

    def indices_of(self, function: IndexArray, time: FloatArray) -> IndexArray:
        """Return where times, (n,), of functions are among the times of these functions, from the left."""
        places = np.empty(len(time), dtype=np.intp)
        for number in set(function.tolist()):
            of_number = function == number
            places[of_number] = np.searchsorted(self.time[number], time[of_number])
        return places

    def times(self, function: IndexArray, place: IndexArray) -> FloatArray:
        """Return the times of functions at places, (n,)."""
        return self.time[function, place]


class Brackets(NamedTuple):
    """Times around minima, the middle one of which has the lowest value.

    Attributes:
        function: Index of the function, (n,).
        time: Times, ascending, (n, 3).
        value: Values at these times, (n, 3).
    """

    function: IndexArray
    time: FloatArray
    value: FloatArray

    @property
    def fall_bound(self) -> FloatArray:
        """Bound on the fall of a minimum below the middle, (n,).

        A convex function lies above the lines through the middle and either end. An end at the time of the
        middle is replaced by the mirror image of the other end.
        """
        left_width, right_width = np.diff(self.time).T
        left_rise, right_rise = self.value[:, 0] - self.value[:, 1], self.value[:, 2] - self.value[:, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            fall: FloatArray = np.maximum(
                np.where(left_width > 0, left_rise * right_width / left_width, right_rise),
                np.where(right_width > 0, right_rise * left_width / right_width, left_rise),
            )
        return fall

    def unresolved(self, critical: FloatArray) -> BoolArray:
        """Return whether each minimum may be below the middle by more than is ignored; not at missing values.

        The answer for a minimum above its critical value holds for lower critical values as well: a looser
        limit never finds a lower minimum.

        Args:
            critical: Value of each function at which a flag is set, (functions,).
        """
        with np.errstate(invalid="ignore"):
            tolerance = MINIMUM_ACCURACY * np.abs(self.value[:, 1] - critical[self.function])
            unresolved: BoolArray = self.fall_bound > tolerance + PRECISION * np.abs(self.value).max(axis=1)
        return unresolved & np.isfinite(self.value).all(axis=1)

    @property
    def lowest_of_parabola(self) -> FloatArray:
        """Time of the minimum of the parabola through the three, (n, 1); the middle without one."""
        (left, middle, right), (left_value, middle_value, right_value) = (
            np.hsplit(array, 3) for array in (self.time, self.value)
        )
        left_weight, right_weight = (
            (middle - left) * (right_value - middle_value),
            (right - middle) * (left_value - middle_value),
        )
        shift = ((right - middle) * right_weight - (middle - left) * left_weight) / np.maximum(
            2 * (left_weight + right_weight), TINY
        )
        return np.clip(middle + shift, left, right)

    def where(self, selection: BoolArray | IndexArray) -> Brackets:
        """Return a selection of the brackets."""
        return Brackets(self.function[selection], self.time[selection], self.value[selection])


def find_brackets(functions: SampledFunctions) -> Brackets:
    """Return brackets of the local minima of functions; the first and the last time are neighbors only.

    Of equal adjacent values, the last is the middle.
    """
    values = functions.value
    falls = values[:, 1:] <= values[:, :-1]
    function, left_index = np.nonzero(falls[:, :-1] & ~falls[:, 1:])
    bracket_index = function[:, None], left_index[:, None] + np.arange(3)
    return Brackets(function, functions.times(*bracket_index), values[bracket_index])


def narrow_brackets(wide: Brackets, evaluate: Evaluate, critical: FloatArray) -> Brackets:
    """Return the brackets narrowed until each minimum is known; each round evaluates all of them together.

    The critical values decide on the number of rounds alone, see `Brackets.unresolved`.
    """
    function, time, value = wide.function, wide.time.copy(), wide.value.copy()
    unresolved = np.flatnonzero(wide.unresolved(critical))
    for _ in range(ROUNDS):
        if not unresolved.size:
            break
        _, time[unresolved], value[unresolved] = _narrow_once(
            wide._replace(time=time, value=value).where(unresolved), evaluate
        )
        unresolved = unresolved[Brackets(function, time, value).where(unresolved).unresolved(critical)]
    return Brackets(function, time, value)


def _narrow_once(wide: Brackets, evaluate: Evaluate) -> Brackets:
    """Return the lowest of the three times and of new ones between them, with its neighbors."""
    left, middle, right = np.hsplit(wide.time, 3)
    near_parabola_minimum = wide.lowest_of_parabola + PARABOLA_OFFSETS * (right - left)
    new_times = np.hstack(
        (
            left + NEW_TIME_SHARES * (middle - left),
            middle + NEW_TIME_SHARES * (right - middle),
            np.clip(near_parabola_minimum, left, right),
        )
    )
    times = np.hstack((wide.time, new_times))
    values = np.hstack((wide.value, evaluate(wide.function, new_times)))
    row_index = np.arange(len(times))[:, None]
    order = row_index, times.argsort(axis=1, kind="stable")
    times, values = times[order], values[order]
    lowest = np.clip(values.argmin(axis=1), 1, values.shape[1] - 2)[:, None]
    bracket_index = row_index, lowest + np.arange(-1, 2)
    return Brackets(wide.function, times[bracket_index], values[bracket_index])
