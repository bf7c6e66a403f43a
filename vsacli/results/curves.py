"""What a figure shows of a result: curves reduced to visible detail, and the steps that fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray, IndexArray, by_joint
from vsacli.base.flags import Flag, has
from vsacli.results.envelopes import FULL_DETAIL, WIDE_COLUMNS, Envelope, column_starts, kept_samples
from vsacli.results.store.reader import StoredResult

BLOCK = 65536
"""Samples read at once, about."""


class Sampled(Protocol):
    """What holds variables over time, as a result file does."""

    @property
    def time(self) -> FloatArray:
        """Times, (samples,), s, ascending."""

    @property
    def joint_names(self) -> Sequence[str]:
        """Of the joints, or of whatever else the second axis of its variables runs over."""

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray | FlagArray:
        """Steps start..stop-1 of a variable, (steps, joints) or (steps, joints, 2)."""


@dataclass(frozen=True)
class Curve:
    """One curve.

    Attributes:
        time: (points,), s, ascending.
        values: (points,); NaN breaks the curve.
        envelope: what its samples span, if a line through them would be a blot.
    """

    time: FloatArray
    values: FloatArray
    envelope: Envelope | None = None

    @classmethod
    def reduced(cls, time: FloatArray, values: FloatArray) -> Curve:
        """What of a curve can be seen, of all its samples, (samples,)."""
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
        time, *spanned = self.envelope
        columns = Envelope(time, *(each[curve] for each in spanned))
        wide = columns.joined(column_starts(time, WIDE_COLUMNS))
        return Curve(self.time, self.values[curve], wide if wide.restless else None)


def read_curves(result: Sampled, names: Sequence[str]) -> tuple[Curves, ...]:
    """The curves of each joint: the variables in the order of `names`, a variable of the motors as two."""
    time = result.time
    pieces = [_block_curves(result, names, time, bounds) for bounds in _blocks(_starts(time), time.size)]
    return tuple(_joined(of_joint) for of_joint in zip(*pieces, strict=True))


def _starts(time: FloatArray) -> IndexArray:
    """First samples of the columns: those of a short run are a sample each."""
    return column_starts(time) if time.size > FULL_DETAIL else np.arange(time.size)


def _blocks(starts: IndexArray, samples: int) -> list[IndexArray]:
    """The run in blocks: for each, the first samples of its columns and the sample after its last."""
    bounds = np.append(starts, samples)
    cuts = np.union1d(np.flatnonzero(np.diff(bounds // BLOCK)) + 1, bounds.size - 1)
    return [bounds[first : last + 1] for first, last in zip([0, *cuts[:-1]], cuts, strict=True)]


def _block_curves(
    result: Sampled, names: Sequence[str], time: FloatArray, bounds: IndexArray
) -> list[Curves]:
    """What each joint keeps of one block."""
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
    """The curves of a joint, of those of its blocks."""
    spanned = zip(*(piece.envelope for piece in pieces), strict=True)
    return Curves(
        np.concatenate([piece.time for piece in pieces]),
        np.concatenate([piece.values for piece in pieces], axis=-1),
        Envelope(*(np.concatenate(parts, axis=-1) for parts in spanned)),
    )


@dataclass(frozen=True)
class Failures:
    """Where steps cannot be done, or nearly so.

    Attributes:
        time: (samples,), s.
        infeasible, singular: (joints, samples).
        near_singular: where they can, but what grows without bound is large, (joints, samples).
    """

    time: FloatArray
    infeasible: BoolArray
    singular: BoolArray
    near_singular: BoolArray

    @classmethod
    def of(cls, result: StoredResult) -> Failures:
        """The failures a result has flagged; none if it was stored without flags."""
        time = result.time
        if "flags" not in result.variables:
            none = np.zeros((len(result.joint_names), time.size), dtype=np.bool_)
            return cls(time, none, none, none)
        flags = np.ascontiguousarray(result.read("flags").T, dtype=np.uint16)
        return cls(time, *(has(flags, flag) for flag in (Flag.INFEASIBLE, Flag.SINGULAR, Flag.NEAR_SINGULAR)))

    def among(self, joints: Sequence[int]) -> tuple[BoolArray, BoolArray]:
        """Steps infeasible, and steps singular, for any of these joints; each (samples,)."""
        chosen = list(joints)
        return np.any(self.infeasible[chosen], axis=0), np.any(self.singular[chosen], axis=0)

    def calm(self, joint: int, time: FloatArray) -> BoolArray:
        """At which of these times, (points,), a joint is near-singular neither before nor after."""
        last = self.time.size - 1
        before = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, last)
        after = np.minimum(np.searchsorted(self.time, time), last)
        near = self.near_singular[joint]
        calm: BoolArray = ~(near[before] | near[after])
        return calm
