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
        self._pending: tuple[
            AnyArray, ...
        ] = ()  # of the times not judged yet, and of the neighbors before them
        self._settled_count = 0  # number of times judged
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
            _weighted_sum(weights, array)
            for weights, array in (
                (WEIGHTS, values),
                (SIXTH_DIFFERENCE, values),
                (SIXTH_DIFFERENCE, derivatives),
            )
        )
        is_compared = np.broadcast_to(compared[..., None], difference.shape)
        value_noise, derivative_noise = (np.where(is_compared, np.abs(array), 0.0) for array in noise)
        middle_derivatives = derivatives[:, MIDDLE]
        terms: tuple[AnyArray, ...] = (
            difference,
            middle_derivatives,
            np.maximum(value_noise, grain),
            derivative_noise,
            is_compared,
        )
        if self._pending:
            terms = tuple(np.concatenate(pair, axis=1) for pair in zip(self._pending, terms, strict=True))
        self._pending = terms
        valid: BoolArray = np.any(is_compared, axis=0)
        self._peak = np.maximum(self._peak, np.max(size, axis=0, where=valid, initial=0.0))
        self._settle_errors(self._first_pending + terms[0].shape[1] - NEIGHBORS)

    @property
    def _first_pending(self) -> int:
        """Index of the first time in `_pending`."""
        return max(self._settled_count - NEIGHBORS, 0)

    def _settle_errors(self, end: int) -> None:
        """Find the errors of the times before `end`, and drop what no later time needs.

        The step with the least sum of error and noise decides: noise grows as steps shrink, and a wrong
        derivative is wrong at each step.
        """
        if end <= self._settled_count:
            return
        begin = self._first_pending
        judged_slice = slice(self._settled_count - begin, end - begin)
        difference, derivative, *noise, is_compared = self._pending
        steps = self._steps[:, self._settled_count : end, :, None, None]
        value_noise, derivative_noise = (_largest_of_neighbors(array)[:, judged_slice] for array in noise)
        tolerated_noise = self._noise_gain * (value_noise / steps + derivative_noise)
        error = np.abs(difference[:, judged_slice] / steps - derivative[:, judged_slice])
        best_scale = np.argmin(
            np.where(is_compared[:, judged_slice], error + tolerated_noise, np.inf), axis=0
        )[None]
        valid = is_compared[:, judged_slice].any(axis=0)
        best_errors = (np.take_along_axis(array, best_scale, axis=0)[0] for array in (error, tolerated_noise))
        self._errors_and_bounds.append(tuple(np.where(valid, array, 0.0) for array in best_errors))
        self._settled_count = end
        self._pending = tuple(array[:, self._first_pending - begin :].copy() for array in self._pending)

    def relative(self) -> tuple[FloatArray, FloatArray]:
        """Return the error nearest to its bound of any joint, and that bound, (times, variants) each."""
        self._settle_errors(self._steps.shape[1])
        error, tolerated_noise = map(np.concatenate, zip(*self._errors_and_bounds, strict=True))
        scale = np.maximum(self._peak, SMALL_JOINT * np.max(self._peak, axis=(-2, -1), keepdims=True))
        error, bound = (
            np.divide(array, scale, out=np.zeros_like(array), where=scale != 0).reshape(*array.shape[:2], -1)
            for array in (error, tolerated_noise)
        )
        worst = np.argmax(error / np.maximum(bound, self._bound), axis=2)[..., None]
        error, bound = (np.take_along_axis(array, worst, axis=2)[..., 0] for array in (error, bound))
        return error, bound


def _weighted_sum(weights: FloatArray, values: FloatArray) -> FloatArray:
    """Return a weighted sum over the offsets of values (scales, offsets, ...)."""
    scales, offsets, *rest = values.shape
    return (weights @ values.reshape(scales, offsets, -1)).reshape(scales, *rest)


def _largest_of_neighbors(noise: FloatArray) -> FloatArray:
    """Return the largest of each time (axis 1) and its neighbors."""
    largest = noise.copy()
    for shift in range(1, min(NEIGHBORS + 1, noise.shape[1])):
        np.maximum(largest[:, shift:], noise[:, :-shift], out=largest[:, shift:])
        np.maximum(largest[:, :-shift], noise[:, shift:], out=largest[:, :-shift])
    return largest
