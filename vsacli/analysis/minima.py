"""Clearances, that is margins and distances to limits, and a search for their minima between samples.

`brackets` finds three consecutive times around each local minimum; `narrowed` evaluates further times between
them until the minimum is known. `between_samples` applies both to the blocks of a run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vsacli.actuators.reach import LimitCheck, OfJoint, margin, nearer_end
from vsacli.analysis.joint_report import Worst
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.flags import Flag
from vsacli.base.signals import STIFFNESS
from vsacli.base.variables import Block
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

REACH = Flag.INFEASIBLE | Flag.SLACK | Flag.SINGULAR | Flag.NEAR_SINGULAR | Flag.NOT_FINITE
"""Bits that concern a stiffness in its attainable range."""

MARGIN = "margin"
"""Name of the clearance of a stiffness; clearances of limits have the names of their flags."""


class Bounded(NamedTuple):
    """A quantity with bounds.

    Attributes:
        joint: Joint of the quantity.
        number: Index of the joint.
        limit: Limit that bounds it; None for the stiffness in its attainable range.
    """

    joint: Joint
    number: int
    limit: LimitCheck | None

    @property
    def bits(self) -> Flag:
        """Bits that a sample may have for this quantity."""
        return REACH if self.limit is None else self.limit.flag

    def clearance(self, of_joint: OfJoint) -> FloatArray:
        """Return the relative distance to the nearer bound, (samples,), negative beyond it.

        It is -inf where the springs cannot carry the torque at all, and +inf where a motor variable does not
        exist, since that is near no limit.
        """
        if self.limit is not None:
            return np.fmin(self.limit.clearance(of_joint), np.inf)  # fmin replaces NaN by inf
        gap = margin(of_joint["stiffness"], of_joint["stiffness_min"], of_joint["stiffness_max"])
        return np.fmax(gap, -np.inf)

    def at(self, block: Block, step: int) -> Worst:
        """Return a sample of a block for a report: the value, and the nearer bound."""
        of_joint, limit = block.of_joint(self.number), self.limit
        if limit is None:
            kind, motor, unit = MARGIN, None, units.STIFFNESS.unit(self.joint.type)
            values = of_joint["stiffness"]
            ends = of_joint["stiffness_min"][step], of_joint["stiffness_max"][step]
        else:
            kind, motor, unit = limit.flag.label, limit.motor, limit.unit(self.joint.type)
            values, ends = limit.values(of_joint), limit.range
        value = float(values[step])
        return Worst(kind, float(block.time[step]), value, nearer_end(value, *map(float, ends)), unit, motor)


def bounded_quantities(robot: Robot) -> list[Bounded]:
    """Return all bounded quantities of a robot."""
    return [
        Bounded(joint, index, limit)
        for index, joint in enumerate(robot.joints)
        for limit in (*([None] if STIFFNESS.key in joint.actuator.commanded else []), *limit_checks(joint))
    ]


def clearances(quantities: list[Bounded], block: Block) -> FloatArray:
    """Return the clearances of all quantities, (quantities, samples)."""
    of_joints = {number: block.of_joint(number) for number in {quantity.number for quantity in quantities}}
    rows = [quantity.clearance(of_joints[quantity.number]) for quantity in quantities]
    return np.array(rows).reshape(-1, len(block.time))


KNOWN = 1e-3
"""Relative accuracy to which a minimum is determined."""

ROUNDING = 1e-10
"""Difference that is ignored: a tenth of the singular margin, or of the ignored excess over a limit."""

SHARES = np.array([1, 2]) / 3
"""New times in both halves of a bracket, for functions that no parabola describes."""

CLOSE = np.array([-0.01, 0.0, 0.01])
"""New times about the lowest point of a parabola, in widths of the bracket: around a smooth minimum the
bracket becomes fifty times narrower, and the possible fall 2500 times smaller."""

ROUNDS = 16
"""Largest number of rounds, after which a bracket is 3^-16 = 2e-8 of a sample distance wide. Smooth minima
need one or two, kinks and jumps more."""

TINY = np.finfo(float).tiny

Evaluate = Callable[[IndexArray, FloatArray], FloatArray]
"""Function from indices of quantities, (n,), and times for each, (n, times), to values (n, times)."""


class Known(NamedTuple):
    """Functions at consecutive times.

    Attributes:
        first: Index of the first time.
        time: Times, ascending, (times,).
        value: Values at these times, (functions, times).
    """

    first: int
    time: FloatArray
    value: FloatArray

    @property
    def stop(self) -> int:
        """Index of the time after the last one."""
        return self.first + len(self.time)

    def last(self, count: int) -> Known:
        """Return the last `count` times."""
        dropped = max(0, len(self.time) - count)
        return Known(self.first + dropped, self.time[dropped:], self.value[:, dropped:])

    def followed_by(self, time: FloatArray, value: FloatArray) -> Known:
        """Return these times followed by others."""
        return Known(self.first, np.append(self.time, time), np.hstack((self.value, value)))

    def opened(self) -> Known:
        """Return these with the first time twice, so that it has a neighbor on either side."""
        return Known(self.first - 1, self.time[:1], self.value[:, :1]).followed_by(*self[1:])

    def closed(self) -> Known:
        """Return these with the last time twice, slightly higher: the end of a fall is a minimum."""
        return self.followed_by(self.time[-1:], np.nextafter(self.value[:, -1:], np.inf))


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
    def fall(self) -> FloatArray:
        """Bound on the fall of a minimum below the middle, (n,).

        A convex function lies above the lines through the middle and either end. An end at the time of the
        middle is replaced by the mirror image of the other end.
        """
        before, after = np.diff(self.time).T
        first, second = self.value[:, 0] - self.value[:, 1], self.value[:, 2] - self.value[:, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            fall: FloatArray = np.maximum(
                np.where(before > 0, first * after / before, second),
                np.where(after > 0, second * before / after, first),
            )
        return fall

    @property
    def unknown(self) -> BoolArray:
        """Whether the minimum may be below the middle by more than `KNOWN`, (n,); not at missing values."""
        with np.errstate(invalid="ignore"):
            unknown: BoolArray = self.fall > KNOWN * np.abs(self.value[:, 1]) + ROUNDING
        return unknown & np.isfinite(self.value).all(axis=1)

    @property
    def lowest_of_parabola(self) -> FloatArray:
        """Time of the minimum of the parabola through the three, (n, 1); the middle without one."""
        (left, middle, right), (at_left, at_middle, at_right) = (
            np.hsplit(array, 3) for array in (self.time, self.value)
        )
        before, after = (middle - left) * (at_right - at_middle), (right - middle) * (at_left - at_middle)
        shift = ((right - middle) * after - (middle - left) * before) / np.maximum(2 * (before + after), TINY)
        lowest: FloatArray = np.clip(middle + shift, left, right)
        return lowest

    def where(self, chosen: BoolArray | IndexArray) -> Brackets:
        """Return a selection of the brackets."""
        return Brackets(self.function[chosen], self.time[chosen], self.value[chosen])


def brackets(known: Known) -> Brackets:
    """Return brackets of the local minima of functions; the first and the last time are neighbors only.

    Of equal adjacent values, the last is the middle.
    """
    time, values = known.time, known.value
    falls = values[:, 1:] <= values[:, :-1]
    function, before = np.nonzero(falls[:, :-1] & ~falls[:, 1:])
    around = before[:, None] + np.arange(3)
    return Brackets(function, time[around], values[function[:, None], around])


def narrowed(given: Brackets, evaluate: Evaluate) -> Brackets:
    """Return the brackets narrowed until each minimum is known; each round evaluates all of them together."""
    function, time, value = given.function, given.time.copy(), given.value.copy()
    open_ = np.flatnonzero(given.unknown)
    for _ in range(ROUNDS):
        if not open_.size:
            break
        _, time[open_], value[open_] = _round(given._replace(time=time, value=value).where(open_), evaluate)
        open_ = open_[Brackets(function, time, value).where(open_).unknown]
    return Brackets(function, time, value)


def _round(given: Brackets, evaluate: Evaluate) -> Brackets:
    """Return the lowest of the three times and of new ones between them, with its neighbors."""
    left, middle, right = np.hsplit(given.time, 3)
    close = given.lowest_of_parabola + CLOSE * (right - left)
    new = np.hstack(
        (left + SHARES * (middle - left), middle + SHARES * (right - middle), np.clip(close, left, right))
    )
    times = np.hstack((given.time, new))
    values = np.hstack((given.value, evaluate(given.function, new)))
    each = np.arange(len(times))[:, None]
    order = each, times.argsort(axis=1, kind="stable")
    times, values = times[order], values[order]
    lowest = np.clip(values.argmin(axis=1), 1, values.shape[1] - 2)[:, None]
    around = each, lowest + np.arange(-1, 2)
    return Brackets(given.function, times[around], values[around])
