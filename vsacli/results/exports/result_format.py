"""The declaration of a format of exported results, and the export itself."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.errors import InputError, VsacliError
from vsacli.base.progress import Progress, unseen
from vsacli.base.units import time_text
from vsacli.results.exports.selection import FAULTS, INFINITE, MISSING, ExportVariable, Selection, Side
from vsacli.results.store.reader import StoredResult

TORQUES = {"result": ("tau_motor",), "simulation": ("q", "stiffness", "tau_motor")}
"""Default variables by the kind of the file: the torques to send, or the simulated motion."""


@dataclass(frozen=True)
class ResultFormat:
    """A format for the export of result variables.

    Attributes:
        write: function that writes a selection to a text or binary stream, and reports the samples done.
        binary: whether the stream is binary.
        missing: representation of a missing value in words; None if the format has none.
        variables: variables exported by default, by the kind of the file.
        check: function that refuses a selection that the format cannot represent.
    """

    write: Callable[[Selection, Any, Callable[[int], object]], None]
    binary: bool = False
    missing: str | None = None
    variables: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: TORQUES)
    check: Callable[[Selection], None] = lambda _selection: None


@dataclass(frozen=True)
class Gap:
    """Non-finite samples of a joint, or of an axis of the wrench.

    Attributes:
        place: joint and variable, or the column of the wrench.
        fault: MISSING or INFINITE.
        time: time of the first such sample, s.
        count: number of such samples.
    """

    place: str
    fault: str
    time: float
    count: int

    def __str__(self) -> str:
        samples_text = "1 sample" if self.count == 1 else f"{self.count} samples"
        return f"{self.place} {self.fault} at {samples_text}, first at t = {time_text(self.time)}"


class UndefinedSamplesError(VsacliError):
    """Samples to export without a finite value; nothing has been written."""

    def __init__(self, path: Path, gaps: Iterable[Gap], missing: str | None) -> None:
        self.gaps = tuple(gaps)
        faults = {gap.fault for gap in self.gaps}
        nan_advice = f", or get {missing} with --allow-nan" if missing else ""
        infinite_advice = "export them as they are with --allow-nan" if missing else "leave the variable out"
        advice = {MISSING: f"fix the steps that the report names{nan_advice}", INFINITE: infinite_advice}
        advice_text = "; ".join(words for fault, words in advice.items() if fault in faults)
        super().__init__(
            "\n".join([*(f"{path}: {gap}" for gap in self.gaps), f"nothing was exported; {advice_text}"])
        )


def export_result(
    result: StoredResult,
    stream: Any,
    form: ResultFormat,
    variables: Iterable[str] | None = None,
    *,
    rate: float | None = None,
    allow_nan: bool = False,
    side: Side = "joint",
    progress: Progress = unseen,
) -> None:
    """Write time and variables in a format.

    Args:
        result: open result or simulation file.
        stream: output stream, text or binary as the format requires; line ends of text are written as they
            are.
        form: format to write.
        variables: names of the variables, exported in declared order; by default those of the format.
        rate: samples per second, the stored rate or a whole fraction of it; all samples by default.
        allow_nan: whether to export missing samples as such, and infinite values unchanged, instead of
            refusing.
        side: side of the gear on which motion and torque of the motors are given; see `Selection`.
        progress: shows the progress.

    Raises:
        InputError: a variable is not in the file or not possible in the format, the rate is not possible, a
            gear ratio is unknown, or a package is missing.
        UndefinedSamplesError: a sample is NaN or infinite and `allow_nan` is false.
    """
    names = form.variables[result.kind] if variables is None else variables
    selection = Selection(result, names, rate, side)
    form.check(selection)
    if allow_nan and form.missing is None:
        raise InputError.one(
            "--allow-nan cannot be used with joint-trajectory, which cannot represent missing values; use csv"
        )
    gaps = (
        []
        if allow_nan
        else [gap for variable in selection.variables for gap in _variable_gaps(selection, variable)]
    )
    if gaps:
        raise UndefinedSamplesError(result.path, gaps, form.missing)
    with progress(selection.steps) as bar:
        form.write(selection, stream, bar.update)


def _variable_gaps(selection: Selection, variable: ExportVariable) -> Iterator[Gap]:
    """Yield the non-finite samples of a variable, for each joint that has it."""
    faults = np.concatenate(
        [variable.faults(selection.read(variable, *span)) for span in selection.spans([variable])]
    )
    for row_name, row_faults in zip(variable.row_names(selection.result.labels), faults.T, strict=True):
        for fault in (MISSING, INFINITE):
            mask = row_faults == FAULTS.index(fault)
            if mask.any():
                yield Gap(row_name, fault, float(selection.time[mask.argmax()]), int(mask.sum()))
