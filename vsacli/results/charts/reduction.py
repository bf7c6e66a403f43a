"""Reduction of long runs to visible detail: curves, envelopes, marked intervals, and ranges of axes.

Figures and pages show the same reduction, so that a peak of one sample is visible everywhere. A run is
divided into columns of equal time, one pixel wide; each keeps its first and last sample, its extremes and a
gap. Ranges of axes are chosen for the relevant parts: attainable stiffness near the command, and everything
except peaks of near-singular samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray, IndexArray, by_joint
from vsacli.base.simulation_variables import COMMANDS

COLUMNS = 1200
"""Time intervals into which a long run is divided: one pixel column each of a 4 inch panel at 300 dpi."""

FULL_DETAIL = 2 * COLUMNS
"""Largest number of samples drawn without reduction."""

WIDE_COLUMNS = 200
"""Time intervals of an envelope, each about as wide as a line in a panel of 3 inches."""

RESTLESS = 3.0
"""Smallest ratio of the range of samples in such an interval to the step of their mean to the next interval
for which an envelope is drawn. The ratio is 1 for a monotone curve, and for a wave with 100 periods in a
panel, whose line is still readable; 5 with 300 periods, a blot; 4 for noise with four samples in an interval,
and more with more samples."""

LINE_WIDTH_SHARE = 0.01
"""Width of a line as a fraction of the height of a panel."""

BLOCK_SAMPLES = 65536
"""Approximate number of samples read at once."""


class Sampled(Protocol):
    """An object with variables over time, such as a result file."""

    @property
    def time(self) -> FloatArray:
        """Times, (samples,), s, ascending."""

    @property
    def joint_names(self) -> Sequence[str]:
        """Names of the joints, or of the other objects along the second axis of the variables."""

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray | FlagArray:
        """Return samples start..stop-1 of a variable, (samples, joints) or (samples, joints, 2)."""


class Envelope(NamedTuple):
    """Mean and extremes of the samples of each column.

    Attributes:
        time: centers of the columns, (columns,), s.
        mean, low, high: mean and extremes, (..., columns); NaN if a sample is NaN.
    """

    time: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, time: FloatArray, values: FloatArray, starts: IndexArray) -> Envelope:
        """Return the envelope of values, (..., samples), in columns that begin at these samples."""
        return cls(time, values, values, values).coarsened(starts)

    def coarsened(self, starts: IndexArray) -> Envelope:
        """Return an envelope with fewer columns, which begin at these columns."""
        ends = np.append(starts[1:], self.time.size) - 1
        with np.errstate(invalid="ignore"):  # mean of infinities of both signs
            mean = np.add.reduceat(self.mean, starts, axis=-1) / (ends - starts + 1)
        low = np.minimum.reduceat(self.low, starts, axis=-1)
        high = np.maximum.reduceat(self.high, starts, axis=-1)
        return Envelope((self.time[starts] + self.time[ends]) / 2, mean, low, high)

    @property
    def restless(self) -> bool:
        """Whether a line through all samples of the single curve would be a blot, as for noise.

        This is so if the samples vary visibly within a column, and much more than from column to column.
        """
        finite = np.isfinite(self.mean)
        if np.count_nonzero(finite) < 2:
            return False
        high, low = self.high[finite], self.low[finite]
        with np.errstate(over="ignore"):  # a simulation may have diverged
            mean_steps = np.abs(np.diff(self.mean[finite]))
            min_range = LINE_WIDTH_SHARE * (high.max() - low.min())
            return bool(np.median(high - low) > max(min_range, RESTLESS * np.median(mean_steps)))


@dataclass(frozen=True)
class Curve:
    """One curve.

    Attributes:
        time: times, (points,), s, ascending.
        values: values, (points,); NaN breaks the curve.
        envelope: range of the samples, if a line through them would be a blot.
    """

    time: FloatArray
    values: FloatArray
    envelope: Envelope | None = None

    @classmethod
    def reduced(cls, time: FloatArray, values: FloatArray) -> Curve:
        """Return the visible part of a curve given with all its samples, (samples,)."""
        starts = _reduction_starts(time)
        kept_indices = kept_samples(values, starts)
        return Curves(
            time[kept_indices], values[None, kept_indices], Envelope.of(time, values[None], starts)
        )[0]


@dataclass(frozen=True)
class Curves:
    """Curves of one joint over common times.

    Attributes:
        time: times, (points,), s, ascending.
        values: values, (curves, points); NaN breaks a curve.
        envelope: envelope of all samples, which may outnumber the points.
    """

    time: FloatArray
    values: FloatArray
    envelope: Envelope

    def __getitem__(self, curve_index: int) -> Curve:
        """Return one of the curves."""
        time, *ranges = self.envelope
        columns = Envelope(time, *(values[curve_index] for values in ranges))
        coarse = columns.coarsened(column_starts(time, WIDE_COLUMNS))
        return Curve(self.time, self.values[curve_index], coarse if coarse.restless else None)


def read_curves(result: Sampled, names: Sequence[str]) -> tuple[Curves, ...]:
    """Read the curves of each joint, in the order of `names`; a variable of motors has two curves."""
    time = result.time
    blocks = [
        _block_curves(result, names, time, bounds)
        for bounds in _block_bounds(_reduction_starts(time), time.size)
    ]
    return tuple(_concatenate_blocks(joint_blocks) for joint_blocks in zip(*blocks, strict=True))


def _reduction_starts(time: FloatArray) -> IndexArray:
    """Return the first sample of each column; in a short run each sample is a column."""
    return column_starts(time) if time.size > FULL_DETAIL else np.arange(time.size)


def _block_bounds(starts: IndexArray, samples: int) -> list[IndexArray]:
    """Divide the run into blocks: first samples of their columns, and the sample after the last."""
    bounds = np.append(starts, samples)
    cuts = np.union1d(np.flatnonzero(np.diff(bounds // BLOCK_SAMPLES)) + 1, bounds.size - 1)
    return [bounds[first : last + 1] for first, last in zip([0, *cuts[:-1]], cuts, strict=True)]


def _block_curves(
    result: Sampled, names: Sequence[str], time: FloatArray, bounds: IndexArray
) -> list[Curves]:
    """Reduce one block of samples, for each joint."""
    start, stop = int(bounds[0]), int(bounds[-1])
    shape = (len(result.joint_names), -1, stop - start)
    variables = [by_joint(result.read(name, start, stop)).reshape(shape) for name in names]
    values, time = np.concatenate(variables, axis=1), time[start:stop]
    starts = bounds[:-1] - start
    kept_indices = [
        np.unique(np.concatenate([kept_samples(curve, starts) for curve in joint_values]))
        for joint_values in values
    ]
    return [
        Curves(time[indices], joint_values[:, indices], Envelope.of(time, joint_values, starts))
        for joint_values, indices in zip(values, kept_indices, strict=True)
    ]


def _concatenate_blocks(blocks: Sequence[Curves]) -> Curves:
    """Concatenate the blocks of a joint."""
    ranges = zip(*(block.envelope for block in blocks), strict=True)
    return Curves(
        np.concatenate([block.time for block in blocks]),
        np.concatenate([block.values for block in blocks], axis=-1),
        Envelope(*(np.concatenate(arrays, axis=-1) for arrays in ranges)),
    )


def column_starts(time: FloatArray, columns: int = COLUMNS) -> IndexArray:
    """Return the first sample of each of the equal time intervals that is not empty; ascending from 0."""
    edges = np.linspace(time[0], time[-1], columns + 1)[:-1]
    return np.unique(np.searchsorted(time, edges))


def kept_samples(values: FloatArray, starts: IndexArray) -> IndexArray:
    """Return ascending indices of the samples that draw the same line as all samples.

    From each column the first and the last sample and the extremes are kept; between any two of these also a
    NaN, if there is one, so that no gap is bridged.

    Args:
        values: values of one curve, (samples,).
        starts: first sample of each column, ascending from 0.
    """
    lengths = np.diff(starts, append=values.size)
    extremes = [
        _first_true_indices(values == np.repeat(ufunc.reduceat(values, starts), lengths), starts)
        for ufunc in (np.fmin, np.fmax)
    ]
    kept = np.unique(np.concatenate([starts, starts + lengths - 1, *extremes]))
    gaps = np.append(np.flatnonzero(np.isnan(values)), values.size)
    next_gap = gaps[np.searchsorted(gaps, kept)]
    return np.union1d(kept, next_gap[next_gap < values.size])


def _first_true_indices(mask: BoolArray, starts: IndexArray) -> IndexArray:
    """Return the first True of each column that has one."""
    indices = np.flatnonzero(mask)
    column_indices = np.searchsorted(starts, indices, side="right")
    return indices[np.diff(column_indices, prepend=0) > 0]


def marked_spans(time: FloatArray, marked: BoolArray) -> FloatArray:
    """Return the time intervals of marked samples, each extended half-way to its neighbors.

    Intervals less than a column apart are joined.

    Args:
        time: times, (samples,), s, ascending.
        marked: marks, (samples,).

    Returns:
        Start and end of each interval, (intervals, 2), s.
    """
    borders = np.concatenate([time[:1], (time[1:] + time[:-1]) / 2, time[-1:]])
    changes = np.flatnonzero(np.diff(marked, prepend=False, append=False))
    start, end = borders[changes].reshape(-1, 2).T
    merged = np.flatnonzero(start[1:] - end[:-1] <= (time[-1] - time[0]) / COLUMNS)
    return np.column_stack([np.delete(start, merged + 1), np.delete(end, merged)])


REACH = 0.25
"""Distance from the command within which a bound is shown, relative to the command."""

MARGIN = 0.06
"""Free space above and below, relative to the visible range."""


def visible_range(command: FloatArray, *bounds: FloatArray) -> tuple[float, float]:
    """Return lower and upper end of a stiffness axis.

    The range contains the entire command, every bound that the command violates, and bounds near it; distant
    or infinite bounds do not compress the command into a line.

    Args:
        command: commanded stiffness, (points,), N m/rad (N/m); may contain NaN.
        bounds: nothing, or minimum and maximum attainable stiffness, each (points,); may contain NaN and
            infinities.
    """
    command = command[np.isfinite(command)]
    if not command.size:
        return (0.0, 1.0)
    low, high = command.min(), command.max()
    reach = max(high - low, REACH * abs(high))
    visible_values = [command]
    for bound, clip, limit in zip(
        bounds, (np.maximum, np.minimum), (low - reach, high + reach), strict=False
    ):
        visible_values.append(clip(bound[np.isfinite(bound)], limit))
    values = np.concatenate(visible_values)
    margin = MARGIN * np.ptp(values) or reach
    return (float(values.min() - margin), float(values.max() + margin))


_OF_MOTORS = (
    *("dphi", "dtheta", "ddtheta", "tau_motor", "motor_power"),
    *("dissipated_power", "current", "voltage", "copper_loss"),
)
GROWING = frozenset({*_OF_MOTORS, COMMANDS["tau_motor"]})
"""Variables that grow without bound near a singular sample, and are undefined at it: deflection rates follow
from the inverse of the decoupling matrix, and motion and torque of motors from these."""

TOLERATED_EXCESS = 0.5
"""Share of the range of all other samples by which near-singular samples may exceed it without being cut
off."""

PEAK_MARGIN = 0.08
"""Free space above and below, relative to that range, for the marks of peaks that are cut off."""


def calm_range(curves: Sequence[FloatArray], calm: Sequence[BoolArray]) -> tuple[float, float] | None:
    """Return the range of an axis for all curves of a panel; None if no point is far beyond the calm ones.

    The range also contains half of the points of each curve that are not calm, so that a curve that is
    near-singular from one end of the panel to the other remains visible.

    Args:
        curves: values of each curve, (points,); NaN where there is none.
        calm: marks of the points that are not near-singular, (points,) for each curve.
    """
    finite = [np.isfinite(values) for values in curves]
    calm_values = np.concatenate(
        [
            curve[finite_mask & calm_mask]
            for curve, finite_mask, calm_mask in zip(curves, finite, calm, strict=True)
        ]
    )
    if not calm_values.size:
        return None
    near_singular_values = [
        curve[finite_mask & ~calm_mask]
        for curve, finite_mask, calm_mask in zip(curves, finite, calm, strict=True)
    ]
    visible_values = np.concatenate(
        [calm_values, [np.median(curve) for curve in near_singular_values if curve.size]]
    )
    low, high = float(visible_values.min()), float(visible_values.max())
    all_values = np.concatenate([calm_values, *near_singular_values])
    least, most = float(all_values.min()), float(all_values.max())
    extent = high - low or abs(high) or 1.0
    below, above = least < low - TOLERATED_EXCESS * extent, most > high + TOLERATED_EXCESS * extent
    if not below and not above:
        return None
    return (low if below else least) - PEAK_MARGIN * extent, (high if above else most) + PEAK_MARGIN * extent
