"""Integrals over the intervals between steps, from values and rates at their ends."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray


def integrals(intervals: FloatArray, values: FloatArray, rates: FloatArray) -> FloatArray:
    """Time integral over each interval, by the cubic with the values and rates at its ends; error O(h^5).

    Args:
        intervals: lengths h, (samples - 1,), s.
        values: of the integrand, (..., samples).
        rates: its derivative, likewise.
    """
    integral: FloatArray = rates[..., :-1] - rates[..., 1:]
    integral *= intervals / 6
    integral += values[..., 1:]
    integral += values[..., :-1]
    integral *= intervals / 2
    return integral


def work_on_each_other(intervals: FloatArray, dtheta: FloatArray, ddtheta: FloatArray) -> FloatArray:
    """Integral of each motor's velocity times the acceleration of the other over each interval.

    By the cubics with the velocities and accelerations at the ends; error O(h^5). The sum of both is the
    difference of theta_1' theta_2', as it must be.

    Args:
        intervals: lengths h, (samples - 1,), s.
        dtheta: (joints, 2, samples).
        ddtheta: likewise.
    """
    before, after = dtheta[..., :-1], dtheta[..., 1:]
    rise, rise_after = intervals * ddtheta[..., :-1], intervals * ddtheta[..., 1:]

    def turned(one: FloatArray, two: FloatArray) -> FloatArray:
        """What is one motor's times what is the other's, less the same with the motors exchanged."""
        return one * two[:, ::-1] - two * one[:, ::-1]

    area = turned(before, after) - turned(rise, rise_after) / 30
    area += (turned(before, rise - rise_after) + turned(rise - rise_after, after)) / 5
    whole = (after * after[:, ::-1] - before * before[:, ::-1]) + area
    return whole / 2


def positive_part(intervals: FloatArray, power: FloatArray, work: FloatArray) -> FloatArray:
    """Time integral of the positive part of a power over each interval.

    Args:
        intervals: lengths h, (samples - 1,), s.
        power: (..., samples); where it changes its sign in an interval it is taken for linear, error O(h^3).
        work: its integral over each interval, (..., samples - 1); no positive part is less.
    """
    positive: FloatArray = np.maximum(work, 0.0)
    before, after = power[..., :-1], power[..., 1:]
    turns = before * after < 0
    if turns.any():
        low, high = np.minimum(before, after)[turns], np.maximum(before, after)[turns]
        linear = np.broadcast_to(intervals, turns.shape)[turns] / 2 * high**2 / (high - low)
        positive[turns] = np.maximum(linear, positive[turns])
    return positive


def trapezoids(intervals: FloatArray, values: FloatArray) -> FloatArray:
    """Time integral over each interval of what is linear in it; error O(h^3)."""
    integral: FloatArray = intervals / 2 * (values[..., 1:] + values[..., :-1])
    return integral
