"""Reduction of long runs to visible detail: curves, their envelopes, stretches of samples, ranges of axes.

Figures and pages show the same reduction, so that a peak of one sample is seen everywhere. A run is divided
into columns of equal time, as wide as a pixel; each keeps its first and last sample, its extremes and a gap.
Ranges of axes follow from the parts that have to be seen: attainable stiffness near the command, and
    everything but the peaks of nearly singular samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray, IndexArray, by_joint
from vsacli.base.simulation_variables import COMMANDS

COLUMNS = 1200
"""Intervals of time that a long run is divided into: one pixel column each of a 4 inch panel at 300 dpi."""

FULL_DETAIL = 2 * COLUMNS
"""Runs of up to this many samples are drawn as they are."""

WIDE_COLUMNS = 200
"""Intervals of which an envelope is drawn: each is about as wide as a line in a panel of 3 inches."""

RESTLESS = 3.0
"""Range of the samples of such an interval, over the step of their mean to the next, from which on an
envelope is drawn. A curve that rises or falls has 1, and so has a wave of which 100 fill a panel, whose line
still reads; one of which 300 do, a blot, 5; noise 4 with four samples in an interval, and more with more."""

SEEN_SHARE = 0.01
"""Share of the height of a panel that the width of a line takes."""

BLOCK = 65536
"""Samples read at once, about."""


class Sampled(Protocol):
    """An object that holds variables over time, as a result file does."""

    @property
    def time(self) -> FloatArray:
        """Times, (samples,), s, ascending."""

    @property
    def joint_names(self) -> Sequence[str]:
        """Names of the joints, or of whatever else the second axis of its variables runs over."""

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray | FlagArray:
        """Samples start..stop-1 of a variable, (samples, joints) or (samples, joints, 2)."""


class Envelope(NamedTuple):
    """Mean and extremes of the samples of each column.

    Attributes:
        time: of the middle of each column, (columns,), s.
        mean, low, high: of its samples, (..., columns); NaN if one of them is.
    """

    time: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, time: FloatArray, values: FloatArray, starts: IndexArray) -> Envelope:
        """Return the envelope of values, (..., samples), in columns that begin at these samples."""
        return cls(time, values, values, values).joined(starts)

    def joined(self, starts: IndexArray) -> Envelope:
        """Return the envelope with fewer columns, which begin at these."""
        ends = np.append(starts[1:], self.time.size) - 1
        with np.errstate(invalid="ignore"):  # means of infinities
            mean = np.add.reduceat(self.mean, starts, axis=-1) / (ends - starts + 1)
        low = np.minimum.reduceat(self.low, starts, axis=-1)
        high = np.maximum.reduceat(self.high, starts, axis=-1)
        return Envelope((self.time[starts] + self.time[ends]) / 2, mean, low, high)

    @property
    def restless(self) -> bool:
        """Whether a line through all samples of the one curve would be a blot, as of noise.

        Its samples go up and down within a column much more than from column to column, and visibly.
        """
        whole = np.isfinite(self.mean)
        if np.count_nonzero(whole) < 2:
            return False
        high, low = self.high[whole], self.low[whole]
        with np.errstate(over="ignore"):  # of a simulation that diverged
            steps = np.abs(np.diff(self.mean[whole]))
            visible = SEEN_SHARE * (high.max() - low.min())
            return bool(np.median(high - low) > max(visible, RESTLESS * np.median(steps)))


@dataclass(frozen=True)
class Curve:
    """One curve.

    Attributes:
        time: (points,), s, ascending.
        values: (points,); NaN breaks the curve.
        envelope: range of its samples, if a line through them would be a blot.
    """

    time: FloatArray
    values: FloatArray
    envelope: Envelope | None = None

    @classmethod
    def reduced(cls, time: FloatArray, values: FloatArray) -> Curve:
        """Return the visible part of a curve with all its samples, (samples,)."""
        starts = _starts(time)
        kept = kept_samples(values, starts)
        return Curves(time[kept], values[None, kept], Envelope.of(time, values[None], starts))[0]


@dataclass(frozen=True)
class Curves:
    """Curves of one joint over common times.

    Attributes:
        time: (points,), s, ascending.
        values: (curves, points); NaN breaks a curve.
        envelope: of all samples, which may be more than the points.
    """

    time: FloatArray
    values: FloatArray
    envelope: Envelope

    def __getitem__(self, curve: int) -> Curve:
        """One of them."""
        time, *ranges = self.envelope
        columns = Envelope(time, *(each[curve] for each in ranges))
        wide = columns.joined(column_starts(time, WIDE_COLUMNS))
        return Curve(self.time, self.values[curve], wide if wide.restless else None)


def read_curves(result: Sampled, names: Sequence[str]) -> tuple[Curves, ...]:
    """Read the curves of each joint: the variables in the order of `names`, a variable of motors as two."""
    time = result.time
    pieces = [_block_curves(result, names, time, bounds) for bounds in _blocks(_starts(time), time.size)]
    return tuple(_joined(of_joint) for of_joint in zip(*pieces, strict=True))


def _starts(time: FloatArray) -> IndexArray:
    """Return the first samples of the columns: those of a short run are a sample each."""
    return column_starts(time) if time.size > FULL_DETAIL else np.arange(time.size)


def _blocks(starts: IndexArray, samples: int) -> list[IndexArray]:
    """Divide the run: for each block, the first samples of its columns and the sample after its last."""
    bounds = np.append(starts, samples)
    cuts = np.union1d(np.flatnonzero(np.diff(bounds // BLOCK)) + 1, bounds.size - 1)
    return [bounds[first : last + 1] for first, last in zip([0, *cuts[:-1]], cuts, strict=True)]


def _block_curves(
    result: Sampled, names: Sequence[str], time: FloatArray, bounds: IndexArray
) -> list[Curves]:
    """Reduce one block of each joint."""
    start, stop = int(bounds[0]), int(bounds[-1])
    shape = (len(result.joint_names), -1, stop - start)
    variables = [by_joint(result.read(name, start, stop)).reshape(shape) for name in names]
    values, time = np.concatenate(variables, axis=1), time[start:stop]
    starts = bounds[:-1] - start
    kept = [np.unique(np.concatenate([kept_samples(curve, starts) for curve in joint])) for joint in values]
    return [
        Curves(time[index], joint[:, index], Envelope.of(time, joint, starts))
        for joint, index in zip(values, kept, strict=True)
    ]


def _joined(pieces: Sequence[Curves]) -> Curves:
    """Concatenate the blocks of a joint."""
    ranges = zip(*(piece.envelope for piece in pieces), strict=True)
    return Curves(
        np.concatenate([piece.time for piece in pieces]),
        np.concatenate([piece.values for piece in pieces], axis=-1),
        Envelope(*(np.concatenate(parts, axis=-1) for parts in ranges)),
    )


def column_starts(time: FloatArray, columns: int = COLUMNS) -> IndexArray:
    """Return the first sample of each of these equal intervals of time that hold any; ascending from 0."""
    edges = np.linspace(time[0], time[-1], columns + 1)[:-1]
    return np.unique(np.searchsorted(time, edges))


def kept_samples(values: FloatArray, starts: IndexArray) -> IndexArray:
    """Return ascending indices of the samples that draw the same line as all of them.

    From each column the first and the last sample and the extremes; between any two of these a NaN where
    there is one, so that no gap is bridged.

    Args:
        values: one curve, (samples,).
        starts: first sample of each column, ascending from 0.
    """
    lengths = np.diff(starts, append=values.size)
    extremes = [
        _first_hits(values == np.repeat(extreme.reduceat(values, starts), lengths), starts)
        for extreme in (np.fmin, np.fmax)
    ]
    kept = np.unique(np.concatenate([starts, starts + lengths - 1, *extremes]))
    gaps = np.append(np.flatnonzero(np.isnan(values)), values.size)
    next_gap = gaps[np.searchsorted(gaps, kept)]
    return np.union1d(kept, next_gap[next_gap < values.size])


def _first_hits(hits: BoolArray, starts: IndexArray) -> IndexArray:
    """Return the first True of each column that has one."""
    indices = np.flatnonzero(hits)
    column = np.searchsorted(starts, indices, side="right")
    return indices[np.diff(column, prepend=0) > 0]


def marked_spans(time: FloatArray, marked: BoolArray) -> FloatArray:
    """Return the stretches of time made of marked samples, each reaching half-way to its neighbors.

    Stretches less than a column apart are drawn as one.

    Args:
        time: (samples,), s, ascending.
        marked: (samples,).

    Returns:
        Start and end of each stretch, (stretches, 2), s.
    """
    borders = np.concatenate([time[:1], (time[1:] + time[:-1]) / 2, time[-1:]])
    changes = np.flatnonzero(np.diff(marked, prepend=False, append=False))
    start, end = borders[changes].reshape(-1, 2).T
    joined = np.flatnonzero(start[1:] - end[:-1] <= (time[-1] - time[0]) / COLUMNS)
    return np.column_stack([np.delete(start, joined + 1), np.delete(end, joined)])


REACH = 0.25
"""Distance from the command up to which a bound is shown, relative to the command."""

MARGIN = 0.06
"""Free space above and below, relative to the visible range."""


def visible_range(command: FloatArray, *bounds: FloatArray) -> tuple[float, float]:
    """Return lower and upper end of a stiffness axis.

    It holds the whole command, every bound the command violates, and the bounds near it; bounds far off, or
    infinite, do not squeeze the command into a line.

    Args:
        command: (points,), N m/rad (N/m); may hold NaN.
        bounds: nothing, or lower and upper end of the corridor, each (points,); may hold NaN and infinities.
    """
    command = command[np.isfinite(command)]
    if not command.size:
        return (0.0, 1.0)
    low, high = command.min(), command.max()
    reach = max(high - low, REACH * abs(high))
    shown = [command]
    for bound, nearer, end in zip(
        bounds, (np.maximum, np.minimum), (low - reach, high + reach), strict=False
    ):
        shown.append(nearer(bound[np.isfinite(bound)], end))
    values = np.concatenate(shown)
    margin = MARGIN * np.ptp(values) or reach
    return (float(values.min() - margin), float(values.max() + margin))


_OF_MOTORS = (
    *("dphi", "dtheta", "ddtheta", "tau_motor", "motor_power"),
    *("dissipated_power", "current", "voltage", "copper_loss"),
)
GROWING = frozenset({*_OF_MOTORS, COMMANDS["tau_motor"]})
"""Variables that grow without bound towards a singular sample, where they are undefined: rates of deflections
follow from the inverse of the decoupling matrix, and motion and torque of motors from these."""

TOLERATED = 0.5
"""Share of the range of all other samples by which near-singular ones may exceed it uncut."""

ROOM = 0.08
"""Free space above and below, relative to that range; marks of cut peaks stand in it."""


def calm_range(curves: Sequence[FloatArray], calm: Sequence[BoolArray]) -> tuple[float, float] | None:
    """Return the range of an axis for all curves of a panel; None if no point is far beyond the calm ones.

    Half of the points of each curve that are not calm are shown as well: a curve that is near-singular from
    one end of the panel to the other does not vanish from it.

    Args:
        curves: values of each, (points,); NaN where there is none.
        calm: which of them are not nearly singular.
    """
    finite = [np.isfinite(values) for values in curves]
    steady = np.concatenate([each[there & at] for each, there, at in zip(curves, finite, calm, strict=True)])
    if not steady.size:
        return None
    near = [each[there & ~at] for each, there, at in zip(curves, finite, calm, strict=True)]
    shown = np.concatenate([steady, [np.median(each) for each in near if each.size]])
    low, high = float(shown.min()), float(shown.max())
    every = np.concatenate([steady, *near])
    least, most = float(every.min()), float(every.max())
    size = high - low or abs(high) or 1.0
    below, above = least < low - TOLERATED * size, most > high + TOLERATED * size
    if not below and not above:
        return None
    return (low if below else least) - ROOM * size, (high if above else most) + ROOM * size
