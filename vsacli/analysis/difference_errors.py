"""Errors of derivatives against finite differences over several steps, with the noise of the values.

Values and derivatives are computed at seven times around each time that is checked, at several scales of the
step. `DifferenceErrors` finds the step whose error and noise are least, and scales both by the peak.
"""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import AnyArray, BoolArray, FloatArray

OFFSETS = np.arange(-3, 4)
"""Offsets of the times of a difference from the time that is checked, in steps."""

MIDDLE = len(OFFSETS) // 2
"""Index of the offset zero."""

WEIGHTS = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60
"""Central first difference of sixth order over these offsets."""

SIXTH_DIFFERENCE = np.array([1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0]) / math.sqrt(924)
"""Sixth difference over these offsets, scaled so that independent errors keep their size."""

NEIGHBORS = 5
"""Number of neighbors to either side whose largest sixth difference estimates the noise: one may be small by
chance, but of 11 normally distributed ones the largest is below a third of the width once in 10^7 draws."""

SMALL_JOINT = 1e-3
"""Smallest scale of a joint's errors, as a share of the largest joint's peak: smaller peaks may be rounding
of the larger torques."""


class DifferenceErrors:
    """Errors of a derivative relative to its peak; `add` times in order, then call `relative`.

    A time has all its scales only until its neighbors are known: a long chain has many columns.

    Args:
        steps: Difference steps of all times of each variant, (scales, times, variants), s.
        bound: Least bound on an error; the error nearest to its bound decides.
        noise_gain: Multiple of the estimated noise that is allowed.
    """

    def __init__(self, steps: FloatArray, bound: float, noise_gain: float) -> None:
        self._steps, self._bound, self._noise_gain = steps, bound, noise_gain
        self._open: tuple[AnyArray, ...] = ()  # of the times not judged yet, and of the neighbors before them
        self._judged = 0  # number of times judged
        self._errors_and_bounds: list[tuple[FloatArray, ...]] = []
        self._peak: FloatArray | float = 0.0

    def add(
        self,
        values: FloatArray,
        derivatives: FloatArray,
        compared: BoolArray,
        size: FloatArray,
        grain: FloatArray | float = 0.0,
    ) -> None:
        """Merge some times.

        Args:
            values: Values of the variable, (scales, offsets, times, variants, joints, motors).
            derivatives: Derivatives to be checked, as above.
            compared: Whether the difference is compared, (scales, times, variants, joints).
            size: Scale of the errors, if larger than the derivatives; (times, variants, joints, motors).
            grain: Smallest noise of the values, (scales, times, variants, joints, motors).
        """
        difference, *noise = (
            _combined(weights, each)
            for weights, each in (
                (WEIGHTS, values),
                (SIXTH_DIFFERENCE, values),
                (SIXTH_DIFFERENCE, derivatives),
            )
        )
        is_compared = np.broadcast_to(compared[..., None], difference.shape)
        of_value, of_derivative = (np.where(is_compared, np.abs(each), 0.0) for each in noise)
        middle = derivatives[:, MIDDLE]
        terms: tuple[AnyArray, ...] = (
            difference,
            middle,
            np.maximum(of_value, grain),
            of_derivative,
            is_compared,
        )
        if self._open:
            terms = tuple(np.concatenate(pair, axis=1) for pair in zip(self._open, terms, strict=True))
        self._open = terms
        valid: BoolArray = np.any(is_compared, axis=0)
        self._peak = np.maximum(self._peak, np.max(size, axis=0, where=valid, initial=0.0))
        self._judge(self._first_open + terms[0].shape[1] - NEIGHBORS)

    @property
    def _first_open(self) -> int:
        """Index of the first time in `_open`."""
        return max(self._judged - NEIGHBORS, 0)

    def _judge(self, end: int) -> None:
        """Find the errors of the times before `end`, and drop what no later time needs.

        The step with the least sum of error and noise decides: noise grows as steps shrink, and a wrong
        derivative is wrong at each step.
        """
        if end <= self._judged:
            return
        begin = self._first_open
        now = slice(self._judged - begin, end - begin)
        difference, derivative, *noise, is_compared = self._open
        steps = self._steps[:, self._judged : end, :, None, None]
        of_value, of_derivative = (_largest_near(each)[:, now] for each in noise)
        admitted = self._noise_gain * (of_value / steps + of_derivative)
        error = np.abs(difference[:, now] / steps - derivative[:, now])
        best = np.argmin(np.where(is_compared[:, now], error + admitted, np.inf), axis=0)[None]
        valid = is_compared[:, now].any(axis=0)
        at_best = (np.take_along_axis(each, best, axis=0)[0] for each in (error, admitted))
        self._errors_and_bounds.append(tuple(np.where(valid, each, 0.0) for each in at_best))
        self._judged = end
        self._open = tuple(each[:, self._first_open - begin :].copy() for each in self._open)

    def relative(self) -> tuple[FloatArray, FloatArray]:
        """Return the error nearest to its bound of any joint, and that bound, (times, variants) each."""
        self._judge(self._steps.shape[1])
        error, admitted = map(np.concatenate, zip(*self._errors_and_bounds, strict=True))
        scale = np.maximum(self._peak, SMALL_JOINT * np.max(self._peak, axis=(-2, -1), keepdims=True))
        error, bound = (
            np.divide(each, scale, out=np.zeros_like(each), where=scale != 0).reshape(*each.shape[:2], -1)
            for each in (error, admitted)
        )
        worst = np.argmax(error / np.maximum(bound, self._bound), axis=2)[..., None]
        error, bound = (np.take_along_axis(each, worst, axis=2)[..., 0] for each in (error, bound))
        return error, bound


def _combined(weights: FloatArray, values: FloatArray) -> FloatArray:
    """Return a weighted sum over the offsets of values (scales, offsets, ...)."""
    scales, offsets, *rest = values.shape
    return (weights @ values.reshape(scales, offsets, -1)).reshape(scales, *rest)


def _largest_near(noise: FloatArray) -> FloatArray:
    """Return the largest of each time (axis 1) and its neighbors."""
    largest = noise.copy()
    for shift in range(1, min(NEIGHBORS + 1, noise.shape[1])):
        np.maximum(largest[:, shift:], noise[:, :-shift], out=largest[:, shift:])
        np.maximum(largest[:, :-shift], noise[:, shift:], out=largest[:, :-shift])
    return largest
