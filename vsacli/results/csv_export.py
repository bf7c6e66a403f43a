"""Result or simulation file to CSV: torques to send to motor drives, or any other variable."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any, Literal, TextIO, TypeAlias

import numpy as np

from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.errors import InputError, VsacliError
from vsacli.base.units import time_text
from vsacli.base.variables import VARIABLES, Variable, column_names, select_variables
from vsacli.results.store.reader import StoredResult

DEFAULT_VARIABLES = {
    "result": ("tau_motor",),
    "simulation": ("q_actual", "stiffness_actual", "tau_motor_actual"),
}
"""What is exported of each kind of file: the torques to send, or what happened."""

Side: TypeAlias = Literal["joint", "motor"]
"""Of the gear of a motor."""
CELLS = 2**18
"""Values of a variable held in memory at a time."""
RATE_TOLERANCE = 1e-6
"""Relative error of a rate typed with at least six digits, such as 333.3333."""
STEP_TOLERANCE = 1e-3
"""Error of stored times, in steps: twice that of times at 1 kHz printed with six decimals."""


@dataclass(frozen=True)
class Gap:
    """Samples of a joint that have no value: the first one's time in s, and how many they are."""

    variable: str
    joint: str
    time: float
    count: int

    def __str__(self) -> str:
        samples = "1 sample" if self.count == 1 else f"{self.count} samples"
        return f"{self.joint}.{self.variable} has no value at {samples}, first at t = {time_text(self.time)}"


class UndefinedSamplesError(VsacliError):
    """Samples to be exported have no value; nothing has been written."""

    def __init__(self, path: Path, gaps: Iterable[Gap]) -> None:
        self.gaps = tuple(gaps)
        lines = [f"{path}: {gap}" for gap in self.gaps]
        lines.append(
            "nothing was exported; mend the steps the report names, or get empty cells with --allow-nan"
        )
        super().__init__("\n".join(lines))


def export_csv(
    result: StoredResult,
    stream: TextIO,
    variables: Iterable[str] | None = None,
    *,
    rate: float | None = None,
    allow_nan: bool = False,
    side: Side = "joint",
) -> None:
    """Write time and variables as CSV with a header line; floats read back bit for bit.

    What a joint does not have is left out: a second motor, or the stiffness of a rigid joint.

    Args:
        result: an open result or simulation file.
        stream: where to write; a file should be open with newline="".
        variables: names, exported in declared order; by default those of `DEFAULT_VARIABLES`.
        rate: samples per second, the stored rate or a whole fraction of it; all samples by default.
        allow_nan: leave the cells of undefined samples empty instead of refusing.
        side: of the gear on which motion and torque of the motors are given. On the side "motor" they are in
            rad and N m at any joint, and their columns end in `_shaft_1` and `_shaft_2`.

    Raises:
        InputError: a variable is not in the file, the rate is not possible, or a gear ratio is not known.
        UndefinedSamplesError: a sample is NaN and `allow_nan` is false.
    """
    wanted = DEFAULT_VARIABLES[result.kind] if variables is None else variables
    selected = select_variables(wanted, result.declared)
    stride = 1 if rate is None else _stride(result, rate)
    shaft = {variable.name for variable in selected if side == "motor" and variable.geared}
    if shaft:
        _check_geared(result)
    if not allow_nan:
        _check_defined(result, selected, stride)
    headers = [name for variable in selected for name in _headers(result, variable, variable.name in shaft)]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", *headers])
    for start, stop in _spans(result, selected, stride):
        columns = [result.time[start:stop:stride].tolist()]
        for variable in selected:
            values = result.read(variable.name, start, stop)[::stride]
            if variable.name in shaft:
                values = values * result.gear_ratio**variable.geared
            columns += _cells(values, _existing(result, variable))
        writer.writerows(zip(*columns, strict=True))


def _headers(result: StoredResult, variable: Variable, on_shaft: bool) -> Iterator[str]:
    """Names of the columns that a variable has."""
    name = f"{variable.name}_shaft" if on_shaft else variable.name
    columns = column_names(variable._replace(name=name), result.joint_names)
    return compress(columns, _existing(result, variable).flat)


def _check_geared(result: StoredResult) -> None:
    """Refuse to guess what happens in a gear of unknown ratio."""
    there = _existing(result, VARIABLES["tau_motor"])
    unknown = np.any(np.isnan(result.gear_ratio) & there, axis=1).tolist()
    if any(unknown):
        joints = ", ".join(compress(result.joint_names, unknown))
        message = (
            f"the robot file gives no gear_ratio at {joints}, so what happens on the motors' shafts is not "
            f"known; add it (1 without a gear) and run {result.command} again, or export with --side joint"
        )
        raise InputError.one(message, result.path)


def _stride(result: StoredResult, rate: float) -> int:
    """Number of stored steps to one exported step."""
    if not (rate > 0 and math.isfinite(rate)):
        raise InputError.one(f"the rate must be positive, not {rate:g} Hz")
    stored = _stored_rate(result)
    ratio = stored / rate
    stride = round(ratio)
    if ratio < 1 - RATE_TOLERANCE:
        message = f"the rate {rate:.9g} Hz exceeds the stored {stored:.9g} Hz; samples are not interpolated"
        raise InputError.one(message, result.path)
    if abs(ratio - stride) > RATE_TOLERANCE * ratio:
        nearest = f"{stored / math.ceil(ratio):.9g} and {stored / math.floor(ratio):.9g} Hz"
        message = (
            f"the stored {stored:.9g} Hz are no whole multiple of {rate:.9g} Hz; the nearest are {nearest}"
        )
        raise InputError.one(message, result.path)
    return stride


def _stored_rate(result: StoredResult) -> float:
    """Samples per second of a file with equal steps."""
    time, steps = result.time, result.samples - 1
    if steps < 1:
        raise InputError.one(
            "holds fewer than two samples and so no rate; export without --rate", result.path
        )
    step = float(time[-1] - time[0]) / steps
    error = np.abs(time - (time[0] + step * np.arange(result.samples)))
    if error.max() > STEP_TOLERANCE * step:
        place = f"near t = {time_text(float(time[error.argmax()]))}"
        message = (
            f"the stored times are not equally spaced ({place}); set rate: {_round(1 / step):g} in the"
            f" trajectory file and run {result.command} again, or export without --rate"
        )
        raise InputError.one(message, result.path)
    return 1 / step


def _round(rate: float) -> float:
    """A rate to three digits, as somebody would choose it."""
    return float(f"{rate:.3g}")


def _spans(result: StoredResult, variables: tuple[Variable, ...], stride: int) -> Iterator[tuple[int, int]]:
    """Consecutive ranges of samples of moderate size, each starting at an exported one."""
    widest = max((len(column_names(variable, result.joint_names)) for variable in variables), default=1)
    length = stride * max(1, CELLS // (widest * stride))
    for start in range(0, result.samples, length):
        yield start, min(start + length, result.samples)


def _check_defined(result: StoredResult, variables: tuple[Variable, ...], stride: int) -> None:
    """Raise UndefinedSamplesError if any value to be exported is NaN."""
    of_joints = [variable for variable in variables if "joint" in variable.dims]
    gaps = [gap for variable in of_joints for gap in _gaps(result, variable, stride)]
    if gaps:
        raise UndefinedSamplesError(result.path, gaps)


def _gaps(result: StoredResult, variable: Variable, stride: int) -> Iterator[Gap]:
    spans, there = _spans(result, (variable,), stride), _existing(result, variable)
    missing = np.concatenate(
        [_undefined(result.read(variable.name, *span)[::stride], there) for span in spans]
    )
    for joint, steps in zip(result.joint_names, missing.T, strict=True):
        if steps.any():
            first = float(result.time[::stride][steps.argmax()])
            yield Gap(variable.name, joint, first, int(steps.sum()))


def _existing(result: StoredResult, variable: Variable) -> BoolArray:
    """(joints, columns of each): which columns of a variable there are; of the wrench (axes, 1)."""
    if "joint" not in variable.dims:
        return np.ones((len(column_names(variable, ())), 1), dtype=bool)
    return result.existing(variable)


def _undefined(values: FloatArray | FlagArray, there: BoolArray) -> BoolArray:
    """(samples, joints): whether a value that the joint has is NaN."""
    missing: BoolArray = np.isnan(values).reshape(len(values), *there.shape)
    undefined: BoolArray = np.any(missing & there, axis=-1)
    return undefined


def _cells(values: FloatArray | FlagArray, there: BoolArray) -> list[list[Any]]:
    """The columns of a variable that are there, as numbers; NaN becomes None, which csv leaves empty."""
    flat: np.ndarray[Any, Any] = values.reshape(len(values), -1).T[there.ravel()]
    missing = np.isnan(flat)
    if missing.any():
        flat = flat.astype(object)
        flat[missing] = None
    columns: list[list[Any]] = flat.tolist()
    return columns
