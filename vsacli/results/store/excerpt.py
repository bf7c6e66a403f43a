"""A part of a result or simulation: some joints over a time span."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, Problem
from vsacli.base.variables import MIN_STIFFNESS, OF_ANY_ROBOT, TOOLS, Variable
from vsacli.results.store.reader import StoredResult

Span = tuple[float, float]
"""First and last time of a span, both included, s."""

WHOLE: Span = (-math.inf, math.inf)


class Excerpt(StoredResult):
    """Some joints of an open file over a time span, with the interface of a file that contains only these.

    Args:
        whole: open file, which must stay open.
        joints: names in any order, read in the order of the file; all joints if empty.
        span: time span.

    Raises:
        InputError: a joint is unknown, or no sample lies in the span.
    """

    def __init__(self, whole: StoredResult, joints: Sequence[str] = (), span: Span = WHOLE) -> None:
        vars(self).update(vars(whole))  # everything not set below is that of the whole file
        self.kind, self.command, self.declared = whole.kind, whole.command, whole.declared
        self._result, self._sample_slice = whole, samples_between(whole.time, span, whole.path)
        self._joint_indices = requested_joint_indices(whole.joint_names, joints, whole.path)
        self.time = whole.time[self._sample_slice]
        self.samples = self.time.size
        self.complete = whole.complete or self._sample_slice.stop < whole.samples
        self.joint_names, self.joint_types, self.actuators = (
            tuple(labels[joint] for joint in self._joint_indices)
            for labels in (whole.joint_names, whole.joint_types, whole.actuators)
        )

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray | FlagArray:
        """Read samples start..stop-1 of the span; see `StoredResult.read`."""
        offset = self._sample_slice.start
        end = self.samples if stop is None else min(stop, self.samples)
        values = self._result.read(name, offset + start, offset + end)
        return values[:, self._joint_indices] if "joint" in self.declared[name].dims else values

    def whole_span(self) -> tuple[float, float]:
        """See `StoredResult.whole_span`."""
        return self._result.whole_span()

    def provenance(self) -> dict[str, Any]:
        """See `StoredResult.provenance`."""
        return self._result.provenance()

    def motor_constant(self, name: str) -> FloatArray:
        """See `StoredResult.motor_constant`."""
        return self._result.motor_constant(name)[self._joint_indices]

    def limits(self, name: str) -> FloatArray:
        """See `StoredResult.limits`."""
        return self._result.limits(name)[self._joint_indices]

    def existing(self, variable: Variable) -> BoolArray:
        """See `StoredResult.existing`."""
        return self._result.existing(variable)[self._joint_indices]

    def has_variable(self, variable: Variable) -> bool:
        """Return whether these joints have the variable, as far as that depends on the robot file."""
        if variable.requires in (TOOLS, MIN_STIFFNESS):  # compliance depends on joints that are not shown
            return len(self._joint_indices) == len(self._result.joint_names) and super().has_variable(
                variable
            )
        any_joint_has_it = variable.requires in OF_ANY_ROBOT or bool(self.existing(variable).any())
        return any_joint_has_it and super().has_variable(variable)


def samples_between(time: FloatArray, span: Span, path: str | Path) -> slice:
    """Return the slice of ascending times that lie in a span.

    Raises:
        InputError: no time does; with the file.
    """
    start, stop = np.searchsorted(time, span[0]), np.searchsorted(time, span[1], side="right")
    if start >= stop:
        stored_span = f"it spans {time[0]:.7g} to {time[-1]:.7g} s"
        raise InputError.one(f"has no samples {_span_text(span)}; {stored_span} (--from, --to)", path)
    return slice(int(start), int(stop))


def _span_text(span: Span) -> str:
    first, last = (f"{time:.7g}" for time in span)
    if math.isinf(span[1]):
        return f"from t = {first} s on"
    return f"up to t = {last} s" if math.isinf(span[0]) else f"from t = {first} to {last} s"


def requested_joint_indices(names: Sequence[str], requested: Sequence[str], path: str | Path) -> list[int]:
    """Return the indices of the chosen joints, ascending; all if none is chosen.

    Raises:
        InputError: a joint is not among the names; with the file.
    """
    unknown = [name for name in requested if name not in names]
    if unknown:
        raise InputError(
            Problem(str(path), 0, f"has no joint {name!r}{did_you_mean(name, names)}") for name in unknown
        )
    return [index for index, name in enumerate(names) if not requested or name in requested]
