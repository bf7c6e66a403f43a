"""The exported part of a result: some variables, at a sample rate, on one side of the gears."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.texts import joined
from vsacli.base.units import time_text
from vsacli.base.variables import VARIABLES, Labels, Variable, column_names, select_variables
from vsacli.results.store.reader import StoredResult

Side: TypeAlias = Literal["joint", "motor"]
"""Side of the gear of a motor."""

MAX_BLOCK_VALUES = 2**18
"""Number of values of a variable in memory at a time."""

MAX_STRIDES_TRIED = 1000
"""Number of decimation factors among which a rate that is easily typed is looked for."""

RATE_TOLERANCE = 1e-6
"""Relative tolerance of a rate, for rates typed with at least six digits, such as 333.3333."""
LARGEST_TOLERANCE = 1e-3
"""Largest relative tolerance of a rate for which the duration is no whole number of intervals."""

STEP_TOLERANCE = 1e-3
"""Tolerance of stored times, in sampling intervals: twice the error of times at 1 kHz printed with six
decimals."""

MISSING, INFINITE = "has no value", "is infinite"
FAULTS = ("", MISSING, INFINITE)
"""Faults of a sample, as predicates in messages."""


@dataclass(frozen=True)
class ExportVariable:
    """A variable of an export.

    Attributes:
        variable: declaration of the variable; on the motor side its name ends in `_shaft`.
        stored: name of the variable in the result.
        existing: mask of existing columns, (joints, columns of each), or (columns, 1) of other variables.
        scale: factor for the stored values; None if they are exported unchanged.
    """

    variable: Variable
    stored: str
    existing: BoolArray
    scale: FloatArray | None

    @property
    def on_shaft(self) -> bool:
        """Whether the variable is on the motor shaft, which rotates at joints of any type."""
        return self.scale is not None

    @property
    def name(self) -> str:
        """Name in the export."""
        return self.variable.name

    def columns(self, labels: Labels) -> Iterator[str]:
        """Return the names of the existing columns."""
        return compress(column_names(self.variable, labels), self.existing.flat)

    def units(self, joint_types: Iterable[str]) -> list[str]:
        """Return the unit at each joint, or of each column of another variable."""
        quantity = self.variable.quantity
        if "joint" not in self.variable.dims:
            return [quantity.of_axis(column) for column in range(len(self.existing))]
        return [quantity.unit("revolute" if self.on_shaft else joint_type) for joint_type in joint_types]

    def column_values(self, values: FloatArray | FlagArray) -> npt.NDArray[Any]:
        """Return the existing columns, (columns, samples), of values (samples, ...)."""
        return values.reshape(len(values), -1).T[self.existing.ravel()]

    def row_names(self, labels: Labels) -> list[str]:
        """Return names of the rows of `existing`: the variable at each joint, or the axes of the wrench."""
        if "joint" not in self.variable.dims:
            return column_names(self.variable, labels)
        return [f"{joint}.{self.name}" for joint in labels["joint"]]

    def faults(self, values: FloatArray | FlagArray) -> npt.NDArray[np.uint8]:
        """Return the worst fault of the existing values as an index of `FAULTS`, (samples, places)."""
        shape = len(values), *self.existing.shape
        is_faulty = [
            np.any(np.reshape(predicate(values), shape) & self.existing, axis=-1)
            for predicate in (np.isnan, np.isinf)
        ]
        return np.select(is_faulty, [FAULTS.index(MISSING), FAULTS.index(INFINITE)]).astype(np.uint8)


class ExportSamples(NamedTuple):
    """Consecutive samples of an export: times, (samples,), s, and values, (samples, ...), by name."""

    time: FloatArray
    values: Mapping[str, FloatArray | FlagArray]


class Selection:
    """Variables of a result selected for export.

    Args:
        result: open result or simulation file.
        variables: names of the variables, exported in declared order.
        rate: samples per second, the stored rate or a whole fraction of it; all samples if None.
        side: side of the gear on which motion and torque of the motors are given; on the side "motor" in rad
            and N m at any joint.

    Attributes:
        result: result or simulation file as given.
        variables: selected variables.

    Raises:
        InputError: a variable is unknown, the rate is not possible, or a gear ratio is unknown.
    """

    def __init__(
        self,
        result: StoredResult,
        variables: Iterable[str],
        rate: float | None = None,
        side: Side = "joint",
    ) -> None:
        self.result = result
        selected = select_variables(variables, result.declared)
        self._stride = 1 if rate is None else stride_of(result, rate)
        on_shaft = {variable.name for variable in selected if side == "motor" and variable.geared}
        if on_shaft:
            _check_geared(result)
        self.variables = tuple(
            _export_variable(result, variable, variable.name in on_shaft) for variable in selected
        )

    @property
    def time(self) -> FloatArray:
        """Times of the samples, (samples,), s."""
        return self.result.time[:: self._stride]

    @property
    def steps(self) -> int:
        """Number of samples, summed over all variables."""
        return len(self.time) * len(self.variables)

    def spans(self, variables: Sequence[ExportVariable]) -> Iterator[tuple[int, int]]:
        """Yield at least one range of consecutive samples, each small enough to bound memory use."""
        max_columns = max((variable.existing.size for variable in variables), default=1)
        span_length = max(1, MAX_BLOCK_VALUES // (max_columns * self._stride))
        sample_count = len(self.time)
        for start in range(0, max(1, sample_count), span_length):
            yield start, min(start + span_length, sample_count)

    def blocks(self) -> Iterator[ExportSamples]:
        """Yield all samples in blocks that fit into memory; at least one block."""
        for start, stop in self.spans(self.variables):
            yield ExportSamples(
                self.time[start:stop],
                {variable.name: self.read(variable, start, stop) for variable in self.variables},
            )

    def read(self, variable: ExportVariable, start: int, stop: int) -> FloatArray | FlagArray:
        """Read samples start..stop-1 of a variable, (samples, ...)."""
        span = start * self._stride, min(stop * self._stride, self.result.samples)
        values = self.result.read(variable.stored, *span)[:: self._stride]
        return values if variable.scale is None else values * variable.scale


def _export_variable(result: StoredResult, variable: Variable, on_shaft: bool) -> ExportVariable:
    existing = _existing_mask(result, variable)
    if not on_shaft:
        return ExportVariable(variable, variable.name, existing, None)
    scale = result.gear_ratio**variable.geared
    return ExportVariable(variable._replace(name=f"{variable.name}_shaft"), variable.name, existing, scale)


def _existing_mask(result: StoredResult, variable: Variable) -> BoolArray:
    """Return a mask of existing columns, (joints, columns of each), or (columns, 1) of other variables."""
    if "joint" not in variable.dims:
        return np.ones((len(column_names(variable, result.labels)), 1), dtype=bool)
    return result.existing(variable)


def _check_geared(result: StoredResult) -> None:
    """Refuse values on the motor side if a gear ratio is unknown."""
    existing = _existing_mask(result, VARIABLES["tau_motor"])
    is_unknown = np.any(np.isnan(result.gear_ratio) & existing, axis=1).tolist()
    if any(is_unknown):
        joints = ", ".join(compress(result.joint_names, is_unknown))
        message = (
            f"--side motor needs the gear_ratio of {joints} in the robot file (1 without a gear); add it and "
            f"run {result.command} again, or use --side joint"
        )
        raise InputError.one(message, result.path)


def stride_of(result: StoredResult, rate: float, *, exact: bool = False) -> int:
    """Return the decimation factor from the stored rate to a rate, Hz.

    Samples over the span of a recording have the rate that was requested only up to a whole number of
    intervals, such as 1000.002 Hz; its fractions are those of the requested one.

    Args:
        result: result with equally spaced times.
        rate: samples per second, Hz.
        exact: whether the stored rate must be a multiple within `RATE_TOLERANCE`.

    Raises:
        InputError: the stored rate is not a multiple of it, or the times are not equally spaced.
    """
    check_rate(rate)
    again = f"run {result.command} with --set rate={rate:.9g}, then export without --rate"
    stored = _stored_rate(result, again)
    ratio = stored / rate
    stride = round(ratio)
    half_interval = 0.5 / (result.samples - 1)
    tolerance = max(RATE_TOLERANCE, 0.0 if exact else min(half_interval, LARGEST_TOLERANCE))
    if ratio < 1 - tolerance:
        raise InputError.one(
            f"{rate:.9g} Hz exceeds the stored rate of {stored:.9g} Hz; use a lower rate, or {again}"
        )
    if abs(ratio - stride) > tolerance * ratio:
        choices = joined((f"{each:.9g}" for each in _near_rates(stored, rate, tolerance)), "or")
        raise InputError.one(
            f"the stored rate of {stored:.9g} Hz is not a multiple of {rate:.9g} Hz; use {choices} Hz, "
            f"or {again}"
        )
    return stride


def _near_rates(stored: float, rate: float, tolerance: float) -> list[float]:
    """Return the nearest fractions below and above a rate that are easily typed; if there are none, any."""
    few_digits = (float(f"{stored:.{digits}g}") for digits in range(1, 18))
    nominal = next(each for each in few_digits if abs(each - stored) <= tolerance * stored)
    least, most = math.floor(nominal / rate), math.ceil(nominal / rate)
    sides = (range(most, most + MAX_STRIDES_TRIED), range(least, 0, -1))
    found = [rate for strides in sides for rate in _typed(nominal, strides)]
    return found or [nominal / most, nominal / least]


def _typed(nominal: float, strides: Iterable[int]) -> list[float]:
    """Return the first quotient of a rate that has at most four digits, if there is one."""
    for stride in strides:
        rate = float(f"{nominal / stride:.4g}")
        if abs(nominal - rate * stride) <= RATE_TOLERANCE * nominal:
            return [rate]
    return []


def check_rate(rate: float) -> None:
    """Refuse a rate, Hz, that is not finite and positive."""
    if not (rate > 0 and math.isfinite(rate)):
        raise InputError.one(f"the rate must be positive, not {rate:g} Hz")


def _stored_rate(result: StoredResult, again: str) -> float:
    """Return the samples per second of a file with equally spaced times; `again` computes such a file."""
    time, steps = result.time, result.samples - 1
    if steps < 1:
        raise InputError.one(
            "holds fewer than two samples and so no rate; export without --rate", result.path
        )
    step = float(time[-1] - time[0]) / steps
    error = np.abs(time - (time[0] + step * np.arange(result.samples)))
    if error.max() > STEP_TOLERANCE * step:
        place = f"near t = {time_text(float(time[error.argmax()]))}"
        message = f"the stored times are not equally spaced ({place}); {again}"
        raise InputError.one(message, result.path)
    return 1 / step
