"""Several files of a kind: whether they can be compared, what they are called, and how they differ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.texts import one_line
from vsacli.results.curves import BLOCK
from vsacli.results.store.reader import StoredResult


def check_comparable(files: Sequence[StoredResult]) -> None:
    """Refuse files that do not belong on the same axes.

    Raises:
        InputError: they are of different kinds, or have different joints.
    """
    if len({file.kind for file in files}) > 1:
        listed = ", ".join(f"{file.path} is a {file.kind}" for file in files)
        raise InputError.one(f"{listed}; compare results with results, and simulations with simulations")
    first = files[0]
    for file in files[1:]:
        if _joints(file) != _joints(first):
            message = (
                f"cannot be compared with {first.path}: it has the joints {_joints(file)}, "
                f"the other has {_joints(first)}; compare results of the same robot"
            )
            raise InputError.one(message, file.path)


def _joints(result: StoredResult) -> str:
    pairs = zip(result.joint_names, result.joint_types, strict=True)
    return ", ".join(f"{name} ({joint_type})" for name, joint_type in pairs)


def distinct_labels(results: Sequence[StoredResult]) -> list[str]:
    """Names of the trajectories; where two are equal, all with the stem of their file, or with its path."""
    for label in _LABELS:
        labels = [label(result) for result in results]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{number}: {label}" for number, label in enumerate(labels, start=1)]


_LABELS: tuple[Callable[[StoredResult], str], ...] = (
    lambda result: result.trajectory_name,
    lambda result: f"{result.trajectory_name} ({one_line(Path(result.path).stem)})",
    lambda result: f"{result.trajectory_name} ({one_line(str(result.path))})",
)


class Difference:
    """A result minus another one, at those of its own times that both have; the other is interpolated.

    Attributes:
        time: those times, (samples,), s; empty if the files have no time in common.
        joint_names: base to tip.
    """

    def __init__(self, result: StoredResult, other: StoredResult) -> None:
        self._result, self._other = result, other
        start = max(result.time[0], other.time[0])
        end = min(result.time[-1], other.time[-1])
        bounds = (np.searchsorted(result.time, start), np.searchsorted(result.time, end, side="right"))
        self._first, last = map(int, bounds)
        self.time: FloatArray = result.time[self._first : max(self._first, last)]
        self.joint_names = result.joint_names

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        """Differences at the times start..stop-1, of the shape of the variable; NaN where one of both is."""
        stop = self.time.size if stop is None else stop
        own = np.asarray(self._result.read(name, self._first + start, self._first + stop), dtype=np.float64)
        with np.errstate(over="ignore", invalid="ignore"):  # infinities are as far apart as NaN says
            return own - self._interpolated(name, self.time[start:stop])

    def _interpolated(self, name: str, time: FloatArray) -> FloatArray:
        """Values of the other result, linear between its steps."""
        steps = self._other.time
        before = max(int(np.searchsorted(steps, time[0], side="right")) - 1, 0)
        after = int(np.searchsorted(steps, time[-1])) + 1
        values = np.asarray(self._other.read(name, before, after), dtype=np.float64)
        if np.array_equal(steps[before:after], time):
            return values
        columns = values.reshape(len(values), -1)
        found = [np.interp(time, steps[before:after], column) for column in columns.T]
        return np.stack(found, axis=-1).reshape(len(time), *values.shape[1:])

    def rms(self, name: str) -> FloatArray:
        """Root mean square over the times at which neither is NaN, of the shape of a step of the variable."""
        total, count = 0.0, 0
        with np.errstate(over="ignore", invalid="ignore"):
            for start in range(0, self.time.size, BLOCK):
                block = self.read(name, start, min(start + BLOCK, self.time.size))
                block = np.where(np.isfinite(block), block, np.nan)
                total = total + np.nansum(block**2, axis=0)
                count = count + np.count_nonzero(~np.isnan(block), axis=0)
            return np.asarray(np.sqrt(np.divide(total, count)))
