"""What all formats of exported results have in common, and the export itself."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.errors import InputError, VsacliError
from vsacli.base.progress import Progress, unseen
from vsacli.base.units import time_text
from vsacli.results.exports.selection import Chosen, Selection, Side
from vsacli.results.store.reader import StoredResult

TORQUES = {"result": ("tau_motor",), "simulation": ("q_actual", "stiffness_actual", "tau_motor_actual")}
"""Variables by the kind of the file: the torques to send, or what happened."""


@dataclass(frozen=True)
class ResultFormat:
    """A format in which variables of a result leave.

    Attributes:
        write: writes a selection to a stream of text, or of bytes, and tells how many steps are done.
        binary: whether the stream is one of bytes.
        missing: how it shows a value that is missing; None if it cannot.
        variables: what is exported by default, by the kind of the file.
        check: refuses variables that the format has no place for, by name.
    """

    write: Callable[[Selection, Any, Callable[[int], object]], None]
    binary: bool = False
    missing: str | None = None
    variables: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: TORQUES)
    check: Callable[[Selection], None] = lambda _selection: None


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

    def __init__(self, path: Path, gaps: Iterable[Gap], missing: str | None) -> None:
        self.gaps = tuple(gaps)
        otherwise = f", or get {missing} with --allow-nan" if missing else ""
        lines = [f"{path}: {gap}" for gap in self.gaps]
        lines.append(f"nothing was exported; mend the steps the report names{otherwise}")
        super().__init__("\n".join(lines))


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
        result: an open result or simulation file.
        stream: where to write, text or bytes as the format says; of text, its lines end as they are written.
        form: the format.
        variables: names, exported in declared order; by default what the format says.
        rate: samples per second, the stored rate or a whole fraction of it; all samples by default.
        allow_nan: show that samples are missing instead of refusing.
        side: of the gear on which motion and torque of the motors are given; see `Selection`.
        progress: shows how far the work is.

    Raises:
        InputError: a variable is not in the file or has no place in the format, the rate is not possible, a
            gear ratio is not known, or a package is missing.
        UndefinedSamplesError: a sample is NaN and `allow_nan` is false.
    """
    wanted = form.variables[result.kind] if variables is None else variables
    selection = Selection(result, wanted, rate, side)
    form.check(selection)
    if allow_nan and form.missing is None:
        raise InputError.one("this format cannot show that a value is missing; leave out --allow-nan")
    if not allow_nan:
        _check_defined(selection, form.missing)
    with progress(selection.steps) as bar:
        form.write(selection, stream, bar.update)


def _check_defined(selection: Selection, missing: str | None) -> None:
    """Raise UndefinedSamplesError if any value to be exported is NaN."""
    of_joints = [chosen for chosen in selection.chosen if "joint" in chosen.variable.dims]
    gaps = [gap for chosen in of_joints for gap in _gaps(selection, chosen)]
    if gaps:
        raise UndefinedSamplesError(selection.result.path, gaps, missing)


def _gaps(selection: Selection, chosen: Chosen) -> Iterator[Gap]:
    missing = np.concatenate(
        [chosen.undefined(selection.read(chosen, *span)) for span in selection.spans([chosen])]
    )
    for joint, steps in zip(selection.result.joint_names, missing.T, strict=True):
        if steps.any():
            first = float(selection.time[steps.argmax()])
            yield Gap(chosen.variable.name, joint, first, int(steps.sum()))
