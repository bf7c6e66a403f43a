"""Faults of a column of samples: outliers, frozen and saturated stretches, wrapped angles.

Outliers stand out of fourth-order divided differences; a polynomial through their neighbors confirms them.
The resolution of a column is the quantum of its numbers; changes beyond it and the noise are noticeable.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.trajectory.recorded.thresholds import (
    ABRUPT_SHARE,
    BLOCK,
    DIFFERENCED,
    END_SAMPLES,
    END_SHARE,
    FIT_DEVIATIONS,
    FROZEN_AT_END_STEPS,
    FROZEN_STEPS,
    HELD_CHANGES,
    HELD_ROWS,
    HELD_SHARE,
    JUMP_SHARE,
    LEAST_SHARE,
    MARGIN,
    MOST_EVENTS,
    MOST_TOGETHER,
    NOISE_DEVIATIONS,
    POLYNOMIAL,
    QUANTA,
    SATURATED_STEPS,
    SPEED_SAMPLES,
    WRAP_TOLERANCE,
)

ORDER = 4
NORMAL_MEDIAN = 0.6745
"""Median of |x| for a standard normal distribution."""

ROUNDING = 8 * np.finfo(float).eps
"""Share of the largest value below which changes count as rounding of equal values."""

FINEST = 0.01
"""Quantile of second differences that counts as the step of an encoder; smaller ones may be accidental."""

UNRESOLVED = 1e-8
"""Share of the largest value that neither sensors nor single-precision numbers resolve. Computed columns,
such as profiles of fixes, have solver errors of a fifth of it."""

CHUNK = 1024 * BLOCK
"""Number of samples whose differences are computed at a time."""


@dataclass(frozen=True, eq=False)
class Quantization:
    """Quantization and noise of a column.

    Attributes:
        differences: divided differences of fourth order, (samples - 4,), scaled so that noise keeps its
            standard deviation; a motion that is sampled fast enough contributes little.
        quantum: step of the numbers, of an encoder or of printed digits.
        noise: standard deviation near each `BLOCK` of differences, (blocks,).
        noticeable: smallest changes that exceed noise and quantum near each sample, (samples,).
    """

    differences: FloatArray
    quantum: float
    noise: FloatArray
    noticeable: FloatArray

    @classmethod
    def of(cls, time: FloatArray, values: FloatArray) -> Quantization:
        """Return the resolution of a column with more than four samples, (samples,)."""
        differences, quantum = _divided_differences(time, values), _quantum(values)
        blocks = np.maximum(np.arange(len(values)) - ORDER // 2, 0) // BLOCK
        noise = _noise_of_blocks(differences)
        noise_near_sample = noise[np.minimum(blocks, len(noise) - 1)]
        return cls(
            differences, quantum, noise, np.maximum(NOISE_DEVIATIONS * noise_near_sample, QUANTA * quantum)
        )


def _noise_of_blocks(differences: FloatArray) -> FloatArray:
    """Return the standard deviation near each `BLOCK` of differences, (blocks,).

    Outliers do not change the medians. The largest of three blocks counts, since noise may begin with a
    motion.
    """
    full_block_samples = len(differences) // BLOCK * BLOCK
    rows = differences[:full_block_samples].reshape(-1, BLOCK) if full_block_samples else differences[None]
    padded_deviations = np.pad(np.median(np.abs(rows), axis=1) / NORMAL_MEDIAN, 1, mode="edge")
    return np.maximum(np.maximum(padded_deviations[:-2], padded_deviations[1:-1]), padded_deviations[2:])


def _divided_differences(time: FloatArray, values: FloatArray) -> FloatArray:
    """Return divided differences; computed in chunks, since the weights need the memory of five columns."""
    count = len(values) - ORDER
    differences = np.empty(count)
    for start in range(0, count, CHUNK):
        stop = min(start + CHUNK, count)
        nodes = [time[start + i : stop + i] for i in range(ORDER + 1)]
        span = nodes[-1] - nodes[0]
        difference_sums, squared_weights = np.zeros(stop - start), np.zeros(stop - start)
        for i, node in enumerate(nodes):
            weight = np.ones(stop - start)
            for other_node in (*nodes[:i], *nodes[i + 1 :]):
                weight *= span / (node - other_node)
            difference_sums += weight * values[start + i : stop + i]
            squared_weights += weight**2
        differences[start:stop] = difference_sums / np.sqrt(squared_weights)
    return differences


def _quantum(values: FloatArray) -> float:
    """Return the smallest typical change between samples above rounding and the resolution of sensors."""
    max_magnitude = float(np.abs(values).max())
    changes = np.abs(np.diff(values, n=2))
    changes = changes[changes > ROUNDING * max_magnitude]
    quantile_index = int(FINEST * len(changes))
    change = float(np.partition(changes, quantile_index)[quantile_index]) if len(changes) else 0.0
    return max(change, UNRESOLVED * max_magnitude)


END_WEIGHTS = np.append(1.0, -np.vander([0.0], 4) @ np.linalg.pinv(np.vander(np.arange(1.0, 11.0), 4)))
"""Weights of a sample and the next ten, for the error of its prediction by a cubic through these."""


@dataclass(frozen=True, eq=False)
class Faults:
    """Samples, or stretches of them, that no sensor of a moving robot returns.

    Attributes:
        first: index of each sample, or of the first sample of each stretch, ascending; at least one.
        last: index of the last sample of each stretch.
        sizes: error of each sample, or duration of each stretch, s.
    """

    first: IndexArray
    last: IndexArray
    sizes: FloatArray

    @property
    def at(self) -> int:
        """Sample index of the first fault."""
        return int(self.first[0])

    @property
    def count(self) -> int:
        """Number of faults."""
        return len(self.first)

    @property
    def worst(self) -> int:
        """Index of the worst fault."""
        return int(np.argmax(self.sizes))


@dataclass(frozen=True, eq=False)
class Outliers(Faults):
    """Samples that are far off a smooth curve through their neighbors.

    Attributes:
        curve: values of that curve, (outliers,).
    """

    curve: FloatArray

    def except_for(self, is_excepted: BoolArray) -> Outliers | None:
        """Return the outliers except some, by a mask, (outliers,); None if none are left."""
        is_kept = ~is_excepted
        if not is_kept.any():
            return None
        return Outliers(self.first[is_kept], self.last[is_kept], self.sizes[is_kept], self.curve[is_kept])

    def smoothed(self, values: FloatArray) -> FloatArray:
        """Return a copy of the column, (samples,), with the curve instead of the outliers."""
        smooth = values.copy()
        smooth[self.first] = self.curve
        return smooth


def outliers(time: FloatArray, values: FloatArray, quantization: Quantization) -> Outliers | None:
    """Return samples, up to three together, that are far off a smooth curve through their neighbors."""
    magnitudes = np.abs(quantization.differences)
    centers = np.arange(len(magnitudes)) + ORDER // 2
    is_noticeable = magnitudes > quantization.noticeable[centers]
    events = _largest_disturbances(centers[is_noticeable], magnitudes[is_noticeable])
    isolated = [_isolated_outliers(time, values, event, quantization) for event in events]
    error_of_sample = dict(_outliers_at_ends(values, quantization))
    for event, samples in zip(events, isolated, strict=True):
        comparable = [
            outliers_there
            for other_event, outliers_there in zip(events, isolated, strict=True)
            if 3 * other_event.size >= event.size
        ]
        if len(list(filter(None, comparable))) >= LEAST_SHARE * len(comparable):
            error_of_sample.update(samples)
    if not error_of_sample:
        return None
    indices = np.array(sorted(error_of_sample))
    errors = np.array([error_of_sample[sample] for sample in indices.tolist()])
    return Outliers(indices, indices, np.abs(errors), values[indices] - errors)


def derivative_outliers(
    time: FloatArray, lower: FloatArray | None, values: FloatArray, quantization: Quantization
) -> Outliers | None:
    """Return the outliers of a given derivative that the next lower one contradicts.

    Kinks of a motion, and differences of an encoder's steps, are outliers of a smooth curve and yet true:
    they are nearer to a difference of neighboring samples of what was differentiated than the curve is.

    Args:
        time: times, (samples,), s.
        lower: derivative of the next lower order, (samples,); None if it is not given, so that none is sure.
        values: derivative, (samples,).
        quantization: its resolution.
    """
    if lower is None or (candidates := outliers(time, values, quantization)) is None:
        return None
    indices = np.clip(candidates.first, 1, len(time) - 2)
    spans = [(indices - 1, indices), (indices, indices + 1), (indices - 1, indices + 1)]
    slopes = np.array([_speed(time, lower, *span) for span in spans])
    value_distances, curve_distances = (
        np.abs(slopes - row).min(axis=0) for row in (values[candidates.first], candidates.curve)
    )
    return candidates.except_for(
        value_distances <= np.maximum(curve_distances, DIFFERENCED * candidates.sizes)
    )


class _Disturbance(NamedTuple):
    """Samples first to last that enter differences that are too large, and the largest of those."""

    first: int
    last: int
    size: float


def _largest_disturbances(centers: IndexArray, size: FloatArray) -> list[_Disturbance]:
    """Return the `MOST_EVENTS` largest events."""
    if not centers.size:
        return []
    starts = np.flatnonzero(np.append(True, np.diff(centers) > ORDER))
    stops = np.append(starts[1:], len(centers)) - 1
    peak_sizes = np.maximum.reduceat(size, starts)
    largest_indices = np.argsort(-peak_sizes, kind="stable")[:MOST_EVENTS]
    firsts, lasts = (
        centers[starts[largest_indices]] - ORDER // 2,
        centers[stops[largest_indices]] + ORDER // 2,
    )
    return list(map(_Disturbance, firsts.tolist(), lasts.tolist(), peak_sizes[largest_indices].tolist()))


def _outliers_at_ends(values: FloatArray, quantization: Quantization) -> Iterator[tuple[int, float]]:
    """Yield the first or last sample, and its error, if the next ones predict it worse than each other."""
    for end, inward in ((0, values), (len(values) - 1, values[::-1])):
        if len(values) < 2 * END_SAMPLES:
            continue
        windows = sliding_window_view(inward[: END_SAMPLES + len(END_WEIGHTS)], len(END_WEIGHTS))
        error, *other_errors = windows @ END_WEIGHTS
        min_error = float(quantization.noticeable[end]) * float(np.linalg.norm(END_WEIGHTS))
        if abs(error) > max(END_SHARE * np.abs(other_errors).max(), min_error):
            yield end, float(error)


def _isolated_outliers(
    time: FloatArray, values: FloatArray, event: _Disturbance, quantization: Quantization
) -> list[tuple[int, float]]:
    """Return the outliers of an event, which are off the polynomial through all others near, with errors."""
    if event.last - event.first > 2 * (ORDER + MOST_TOGETHER):
        return []
    first, last = max(0, event.first - MARGIN), min(len(values) - 1, event.last + MARGIN)
    neighbor_values, is_kept = values[first : last + 1], np.ones(last + 1 - first, dtype=bool)
    min_error = float(quantization.noticeable[event.first])
    elapsed = time[first : last + 1] - time[first]
    powers = np.vander(2 * elapsed / elapsed[-1] - 1, POLYNOMIAL + 1)
    errors_of_samples: list[tuple[int, float]] = []
    for _ in range(min(MOST_TOGETHER, len(neighbor_values) - POLYNOMIAL - 3)):
        residual, leverage = _residuals_and_leverages(powers, neighbor_values, is_kept)
        studentized = np.abs(residual) / np.sqrt(np.maximum(1 - leverage, 1e-9))
        is_kept[int(np.argmax(np.where(is_kept, studentized, 0.0)))] = False
        residual, leverage = _residuals_and_leverages(powers, neighbor_values, is_kept)
        residual_deviation = np.sqrt(np.sum(residual[is_kept] ** 2) / (is_kept.sum() - POLYNOMIAL - 1))
        outlier_bound = max(FIT_DEVIATIONS * residual_deviation, min_error) * np.sqrt(1 + leverage)
        if np.all(np.abs(residual) >= outlier_bound, where=~is_kept):
            samples = first + np.flatnonzero(~is_kept)
            errors_of_samples = list(zip(samples.tolist(), residual[~is_kept].tolist(), strict=True))
    unconfirmed = {0, len(values) - 1}  # the ends have neighbors on one side only
    return [] if unconfirmed & dict(errors_of_samples).keys() else errors_of_samples


def _residuals_and_leverages(
    powers: FloatArray, values: FloatArray, is_kept: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return values minus the polynomial fitted to those kept, and leverages: variance per noise variance."""
    inverse = np.linalg.pinv(powers[is_kept])
    return values - powers @ (inverse @ values[is_kept]), np.sum((powers @ inverse) ** 2, axis=1)


def rows_per_value(values: FloatArray, quantization: Quantization) -> int:
    """Return the number of rows in which each value is repeated; 1 if that varies."""
    changes = np.flatnonzero(values[1:] != values[:-1])
    rows = np.diff(changes)
    if len(rows) < HELD_CHANGES:
        return 1
    usual = int(np.median(rows))
    regular = np.count_nonzero(rows == usual) >= HELD_SHARE * len(rows)
    jump = float(np.median(np.abs(values[changes + 1] - values[changes])))
    return usual if regular and usual <= HELD_ROWS and jump >= QUANTA * quantization.quantum else 1


def frozen_stretches(time: FloatArray, values: FloatArray, quantization: Quantization) -> Faults | None:
    """Return stretches of equal samples while the motion goes on, as a jump or an abrupt stop shows."""
    first, last = _equal_runs(values, FROZEN_STEPS)
    ends = (first == 0) | (last == len(values) - 1)
    inner = (first >= SPEED_SAMPLES) & (last + 1 + SPEED_SAMPLES < len(values))
    stuck = np.zeros(len(first), dtype=bool)
    stuck[inner] = _catches_up(time, values, quantization, first[inner], last[inner])
    for run in np.flatnonzero(ends & (last - first >= FROZEN_AT_END_STEPS)).tolist():
        stuck[run] = _stops_abruptly(values, quantization, int(first[run]), int(last[run]))
    return _faults_of_stretches(time, first[stuck], last[stuck])


def _catches_up(
    time: FloatArray, values: FloatArray, quantization: Quantization, first: IndexArray, last: IndexArray
) -> BoolArray:
    """Return whether the jump after each run fits the speeds before and after it."""
    after = last + 1
    before_speed = _speed(time, values, first - SPEED_SAMPLES, first)
    after_speed = _speed(time, values, after, after + SPEED_SAMPLES)
    jump = values[after] - values[last]
    expected = (before_speed + after_speed) / 2 * (time[after] - time[first])
    share = np.divide(jump, expected, out=np.zeros_like(jump), where=expected != 0)
    low, high = JUMP_SHARE
    onward = before_speed * after_speed > 0
    return np.asarray(
        onward & (np.abs(jump) >= quantization.noticeable[first]) & (low <= share) & (share <= high)
    )


def _speed(time: FloatArray, values: FloatArray, start: IndexArray, stop: IndexArray) -> FloatArray:
    return np.asarray((values[stop] - values[start]) / (time[stop] - time[start]))


def _stops_abruptly(values: FloatArray, quantization: Quantization, first: int, last: int) -> bool:
    """Return whether a run at an end of the recording begins, or ends, at full speed."""
    reach = SPEED_SAMPLES + 1
    near = values[max(0, first - reach) : first + 1] if first else values[last : last + reach + 1][::-1]
    steps = np.diff(near)
    if len(steps) < reach:
        return False
    noticeable = float(quantization.noticeable[first if first else last])
    least = max(noticeable, ABRUPT_SHARE * float(np.abs(steps).mean()))
    return bool((np.all(steps > 0) or np.all(steps < 0)) and abs(steps[-1]) >= least)


def saturated_stretches(time: FloatArray, values: FloatArray, quantization: Quantization) -> Faults | None:
    """Return stretches at the largest or smallest value where a motion beyond it is cut off."""
    first, last = _equal_runs(values, SATURATED_STEPS)
    extreme = (values[first] == values.max()) | (values[first] == values.min())
    inner = extreme & (first >= 3) & (last + 3 < len(values))
    first, last = first[inner], last[inner]
    least = quantization.noticeable[first]
    beyond = [_overshoot(values, first, -1) >= least, _overshoot(values, last, 1) >= least]
    cut = beyond[0] & beyond[1]
    return _faults_of_stretches(time, first[cut], last[cut])


def _overshoot(values: FloatArray, edge: IndexArray, outward: int) -> FloatArray:
    """Return the distance by which a motion that slows down towards an edge would exceed it.

    Its steps, away from the edge, are s1 (cut short), s2, s3. Slowing down by c = s3 - s2 per step, it would
    continue by s2^2 / (2 c) - s2/2 beyond the sample before the edge.
    """
    at = [values[edge + outward * step] for step in range(4)]
    sign = np.sign(at[0] - at[1])
    cut, step, before = (sign * (near - far) for near, far in pairwise(at))
    slowing = np.maximum(before - step, np.finfo(float).tiny)
    with np.errstate(over="ignore"):
        farther = step**2 / (2 * slowing) - step / 2 - cut
    return np.asarray(np.where(step > 0, np.minimum(farther, step), -1.0))


def angle_wraps(values: FloatArray) -> Faults | None:
    """Return jumps by about 2 pi amid small steps."""
    steps = np.abs(np.diff(values))
    near = np.abs(steps - 2 * np.pi) < WRAP_TOLERANCE
    around = np.pad(steps, 1)
    lone = near & (around[:-2] < WRAP_TOLERANCE) & (around[2:] < WRAP_TOLERANCE)
    samples = np.flatnonzero(lone) + 1
    return Faults(samples, samples, steps[lone]) if samples.size else None


def _equal_runs(values: FloatArray, least: int) -> tuple[IndexArray, IndexArray]:
    """Return first and last sample of each run of equal values with at least `least` steps."""
    same = np.concatenate(([False], values[1:] == values[:-1], [False]))
    edges = np.flatnonzero(same[1:] != same[:-1])
    first, last = edges[::2], edges[1::2]
    long = last - first >= least
    return first[long], last[long]


def _faults_of_stretches(time: FloatArray, first: IndexArray, last: IndexArray) -> Faults | None:
    return Faults(first, last, time[last] - time[first]) if first.size else None
