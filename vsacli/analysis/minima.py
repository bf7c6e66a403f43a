"""Least margins and distances to limits, between samples as well."""

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
"""Bits that concern a stiffness in its corridor."""

MARGIN = "margin"
"""Name of the clearance of a stiffness; those of limits have the names of their flags."""


class Bounded(NamedTuple):
    """A quantity that has bounds.

    Attributes:
        joint: whose it is.
        number: of the joint.
        limit: what bounds it; None is the stiffness in its corridor.
    """

    joint: Joint
    number: int
    limit: LimitCheck | None

    @property
    def bits(self) -> Flag:
        """The bits that say what is wrong with it."""
        return REACH if self.limit is None else self.limit.flag

    def clearance(self, of_joint: OfJoint) -> FloatArray:
        """Relative distance to the nearer bound, (samples,), negative beyond it.

        Where the springs cannot carry the torque at all it is -inf. A number of a motor that does not exist
        is near no limit: +inf.
        """
        if self.limit is not None:
            return np.fmin(self.limit.clearance(of_joint), np.inf)  # the one of both that is no NaN
        gap = margin(of_joint["stiffness"], of_joint["stiffness_min"], of_joint["stiffness_max"])
        return np.fmax(gap, -np.inf)

    def at(self, block: Block, step: int) -> Worst:
        """Return a step of a block as a report has it: the value, and the nearer bound."""
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
    """Everything of a robot that has bounds."""
    return [
        Bounded(joint, index, limit)
        for index, joint in enumerate(robot.joints)
        for limit in (*([None] if STIFFNESS.key in joint.actuator.commanded else []), *limit_checks(joint))
    ]


def clearances(quantities: list[Bounded], block: Block) -> FloatArray:
    """Clearances of all quantities, (quantities, samples)."""
    of_joints = {number: block.of_joint(number) for number in {quantity.number for quantity in quantities}}
    rows = [quantity.clearance(of_joints[quantity.number]) for quantity in quantities]
    return np.array(rows).reshape(-1, len(block.time))


KNOWN = 1e-3
"""Share of a minimum to which it shall be known."""

ROUNDING = 1e-10
"""Differences that do not count: a tenth of the margin that is singular, or of the excess over a limit."""

SHARES = np.array([1, 2]) / 3
"""Places in both halves of a bracket, for functions that no parabola describes."""

CLOSE = np.array([-0.01, 0.0, 0.01])
"""Places about the lowest point of a parabola, in widths of the bracket: around a smooth minimum that
becomes fifty times narrower, and its fall 2500 times smaller."""

ROUNDS = 16
"""Most rounds: 3^-16 of a step is 2e-8 of it. Smooth minima take one or two, kinks and jumps more."""

TINY = np.finfo(float).tiny

Evaluate = Callable[[IndexArray, FloatArray], FloatArray]
"""Function from numbers of quantities, (n,), and times for each, (n, times), to values (n, times)."""


class Known(NamedTuple):
    """Functions at consecutive times.

    Attributes:
        first: number of the first time.
        time: ascending, (times,).
        value: at these times, (functions, times).
    """

    first: int
    time: FloatArray
    value: FloatArray

    @property
    def stop(self) -> int:
        """Number of the time after the last one."""
        return self.first + len(self.time)

    def last(self, count: int) -> Known:
        """Return the last this many."""
        dropped = max(0, len(self.time) - count)
        return Known(self.first + dropped, self.time[dropped:], self.value[:, dropped:])

    def followed_by(self, time: FloatArray, value: FloatArray) -> Known:
        """Return these with the next ones."""
        return Known(self.first, np.append(self.time, time), np.hstack((self.value, value)))

    def opened(self) -> Known:
        """Return these with the first time twice, so that it has a neighbour on either side."""
        return Known(self.first - 1, self.time[:1], self.value[:, :1]).followed_by(*self[1:])

    def closed(self) -> Known:
        """Return these with the last time twice, slightly higher: the end of a fall is a minimum."""
        return self.followed_by(self.time[-1:], np.nextafter(self.value[:, -1:], np.inf))


class Brackets(NamedTuple):
    """Times around minima, the middle one of which has the lowest value.

    Attributes:
        function: whose minimum it is, by number, (n,).
        time: ascending, (n, 3).
        value: at these times, (n, 3).
    """

    function: IndexArray
    time: FloatArray
    value: FloatArray

    @property
    def fall(self) -> FloatArray:
        """Bound of the fall of a minimum below the middle, (n,).

        A convex function lies above the lines through the middle and either end. An end at the time of the
        middle is taken for one as far away, and as high, as the other.
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
        """Brackets whose minimum may be lower than the middle by more than `KNOWN`, (n,).

        Where a value does not exist nothing is looked for.
        """
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
        """Return some of them."""
        return Brackets(self.function[chosen], self.time[chosen], self.value[chosen])


def brackets(known: Known) -> Brackets:
    """Brackets around the local minima of functions; the first and the last time are neighbours only.

    Of equal values the last counts.
    """
    time, values = known.time, known.value
    falls = values[:, 1:] <= values[:, :-1]
    function, before = np.nonzero(falls[:, :-1] & ~falls[:, 1:])
    around = before[:, None] + np.arange(3)
    return Brackets(function, time[around], values[function[:, None], around])


def narrowed(given: Brackets, evaluate: Evaluate) -> Brackets:
    """Return the brackets narrowed until each minimum is known; every round computes all of them together."""
    function, time, value = given.function, given.time.copy(), given.value.copy()
    open_ = np.flatnonzero(given.unknown)
    for _ in range(ROUNDS):
        if not open_.size:
            break
        _, time[open_], value[open_] = _round(given._replace(time=time, value=value).where(open_), evaluate)
        open_ = open_[Brackets(function, time, value).where(open_).unknown]
    return Brackets(function, time, value)


def _round(given: Brackets, evaluate: Evaluate) -> Brackets:
    """Return the lowest of the three times and of new ones between them, with its neighbours."""
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
