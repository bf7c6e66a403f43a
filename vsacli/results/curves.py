"""What a figure shows of a result: curves reduced to visible detail, and the steps that fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray, IndexArray, by_joint
from vsacli.base.flags import Flag
from vsacli.results.envelopes import FULL_DETAIL, column_starts, kept_samples
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
class Curves:
    """Curves of one joint over common times.

    Attributes:
        time: (points,), s, ascending.
        values: (curves, points); NaN breaks a curve.
    """

    time: FloatArray
    values: FloatArray


def read_curves(result: Sampled, names: Sequence[str]) -> tuple[Curves, ...]:
    """The curves of each joint: the variables in the order of `names`, a variable of the motors as two."""
    time = result.time
    pieces = [_block_curves(result, names, time, bounds) for bounds in _blocks(time)]
    return tuple(
        Curves(*(np.concatenate(parts, axis=-1) for parts in zip(*of_joint, strict=True)))
        for of_joint in zip(*pieces, strict=True)
    )


def _blocks(time: FloatArray) -> list[IndexArray]:
    """The run in blocks: for each, the first samples of its columns and the sample after its last."""
    starts = column_starts(time) if time.size > FULL_DETAIL else np.arange(time.size)
    bounds = np.append(starts, time.size)
    cuts = np.union1d(np.flatnonzero(np.diff(bounds // BLOCK)) + 1, bounds.size - 1)
    return [bounds[first : last + 1] for first, last in zip([0, *cuts[:-1]], cuts, strict=True)]


def _block_curves(
    result: Sampled, names: Sequence[str], time: FloatArray, bounds: IndexArray
) -> list[tuple[FloatArray, FloatArray]]:
    """Times and values that each joint keeps of one block."""
    start, stop = int(bounds[0]), int(bounds[-1])
    shape = (len(result.joint_names), -1, stop - start)
    variables = [by_joint(result.read(name, start, stop)).reshape(shape) for name in names]
    values = np.concatenate(variables, axis=1)
    starts = bounds[:-1] - start
    kept = [np.unique(np.concatenate([kept_samples(curve, starts) for curve in joint])) for joint in values]
    return [(time[start + index], joint[:, index]) for joint, index in zip(values, kept, strict=True)]


@dataclass(frozen=True)
class Failures:
    """Where steps cannot be done.

    Attributes:
        time: (samples,), s.
        infeasible, singular: (joints, samples).
    """

    time: FloatArray
    infeasible: BoolArray
    singular: BoolArray

    @classmethod
    def of(cls, result: StoredResult) -> Failures:
        """The failures a result has flagged; none if it was stored without flags."""
        time = result.time
        if "flags" not in result.variables:
            none = np.zeros((len(result.joint_names), time.size), dtype=np.bool_)
            return cls(time, none, none)
        flags = np.ascontiguousarray(result.read("flags").T, dtype=np.uint16)
        return cls(time, (flags & Flag.INFEASIBLE) != 0, (flags & Flag.SINGULAR) != 0)

    def among(self, joints: Sequence[int]) -> tuple[BoolArray, BoolArray]:
        """Steps infeasible, and steps singular, for any of these joints; each (samples,)."""
        chosen = list(joints)
        return np.any(self.infeasible[chosen], axis=0), np.any(self.singular[chosen], axis=0)
