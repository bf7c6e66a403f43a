"""Integrals over the intervals between steps, from values and rates at their ends."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.control_flow import where_needed


def integrals(intervals: FloatArray, values: FloatArray, rates: FloatArray) -> FloatArray:
    """Time integral over each interval, by the cubic with the values and rates at its ends; error O(h^5).

    Args:
        intervals: lengths h, (samples - 1,), s.
        values: of the integrand, (..., samples).
        rates: its derivative, likewise.
    """
    before, after = ((values[..., part], rates[..., part]) for part in (slice(None, -1), slice(1, None)))
    return integral(intervals, before, after)


def integral(
    interval: FloatArray, before: tuple[FloatArray, FloatArray], after: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """The same of single intervals, from value and rate before and after each."""
    (value, rate), (next_value, next_rate) = before, after
    return ((rate - next_rate) * (interval / 6) + next_value + value) * (interval / 2)


def work_on_each_other(
    interval: FloatArray, before: tuple[FloatArray, FloatArray], after: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Integral of each motor's velocity times the acceleration of the other over each interval, (2, ...).

    By the cubics with the velocities and accelerations at the ends; error O(h^5). The sum of both is the
    difference of theta_1' theta_2', as it must be.

    Args:
        interval: length h, s.
        before: velocities and accelerations of both motors, each (2, ...).
        after: the same at the end of the interval.
    """
    (begin, rise), (end, rise_after) = before, after
    rise, rise_after = interval * rise, interval * rise_after

    def turned(one: FloatArray, two: FloatArray) -> FloatArray:
        """What is one motor's times what is the other's, less the same with the motors exchanged."""
        return one * two[::-1] - two * one[::-1]

    area = turned(begin, end) - turned(rise, rise_after) / 30
    area = area + (turned(begin, rise - rise_after) + turned(rise - rise_after, end)) / 5
    whole = (end * end[::-1] - begin * begin[::-1]) + area
    return whole / 2


def positive_part(intervals: FloatArray, power: FloatArray, work: FloatArray) -> FloatArray:
    """Time integral of the positive part of a power over each interval.

    Args:
        intervals: lengths h, (samples - 1,), s.
        power: (..., samples); where it changes its sign in an interval it is taken for linear, error O(h^3).
        work: its integral over each interval, (..., samples - 1); no positive part is less.
    """
    return positive_work(np.broadcast_to(intervals, work.shape), power[..., :-1], power[..., 1:], work)


def positive_work(
    interval: FloatArray, before: FloatArray, after: FloatArray, work: FloatArray
) -> FloatArray:
    """The same of single intervals, from the power before and after each; arrays of one shape."""
    positive = np.maximum(work, 0.0)
    (found,) = where_needed(before * after < 0, _linear, (interval, before, after, positive), (positive,))
    return found


def _linear(
    interval: FloatArray, before: FloatArray, after: FloatArray, positive: FloatArray
) -> tuple[FloatArray]:
    """Of a power that changes its sign, if that is more than what is there."""
    low, high = np.minimum(before, after), np.maximum(before, after)
    return (np.maximum(interval / 2 * high**2 / (high - low), positive),)


def trapezoids(intervals: FloatArray, values: FloatArray) -> FloatArray:
    """Time integral over each interval of what is linear in it; error O(h^3)."""
    integral: FloatArray = intervals / 2 * (values[..., 1:] + values[..., :-1])
    return integral
