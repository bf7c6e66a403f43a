"""Recomputation of a result from its own inputs, to compare it or to export it at another rate."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vsacli.analysis.joint_report import JUDGED
from vsacli.analysis.run import Run
from vsacli.base.errors import InputError
from vsacli.base.outputs import Staged
from vsacli.base.progress import Tell, unheard
from vsacli.base.storage import reading_copies, reporting_temporary_errors, temporary_folder
from vsacli.base.texts import one_line
from vsacli.base.variables import ALL, ON_REQUEST, Block
from vsacli.results.exports.selection import check_rate, stride_of
from vsacli.results.store.inputs import StoredInput
from vsacli.results.store.reader import StoredResult, stored_inputs
from vsacli.results.store.writer import ResultWriter
from vsacli.robot.file import load_robot
from vsacli.robot.model import Robot
from vsacli.trajectory.file import load_trajectory
from vsacli.trajectory.times import MAX_STEPS, RecordedTimes
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class VariableDifference:
    """The difference of a variable between a result and its recomputation.

    Attributes:
        variable: name of the variable.
        values: number of values that differ.
        largest: largest difference relative to the variable's peak; NaN if one of two values is missing.
    """

    variable: str
    values: int
    largest: float

    def __str__(self) -> str:
        share = f"by at most {self.largest:.2g} of its peak"
        if np.isnan(self.largest):
            share = "where only one of both is a number"
        return f"{self.variable} differs in {self.values} values, {share}"


class Repetition(NamedTuple):
    """A result compared with its recomputation.

    Attributes:
        differences: variables that are not equal bit for bit, after rounding to the precision of the file.
        precision: precision of the file, "double" or "single".
    """

    differences: list[VariableDifference]
    precision: str


def repeat(path: str | Path, tell: Tell = unheard) -> Repetition:
    """Recompute a result with its own inputs and options, and compare all its variables.

    Args:
        path: path of the result.
        tell: as for `Run`.

    Raises:
        InputError: the result does not contain its inputs, they cannot be used, or its engine is not
            available.
    """
    with StoredResult.open(path) as result:
        robot, trajectory = rebuilt(result)
        options: dict[str, Any] = result.provenance()["options"]
        engine = str(result.attributes.get("engine", "numpy"))
        asked = (JUDGED, *_on_request(result))
        run = Run(robot, trajectory, engine=engine, asked=asked, tell=tell, **options)
        comparisons = [_VariableComparison(result, name) for name in result.variables]
        for block in run:
            for comparison in comparisons:
                comparison.add(block)
        differences = [comparison.difference for comparison in comparisons if comparison.values]
        return Repetition(differences, result.precision)


def _on_request(result: StoredResult) -> list[str]:
    """Return the variables of a result that a run has only if they are asked for."""
    return [name for name in ON_REQUEST if name in result.variables]


def rebuilt(result: StoredResult) -> tuple[Robot, Trajectory]:
    """Return the robot and trajectory from which an open result was computed, from its stored inputs.

    Raises:
        InputError: the result does not contain its inputs, or they cannot be used.
        StorageError: the disk for temporary files has no room for them.
    """
    with _reading(result.inputs(), result.path) as (of_robot, of_trajectory):
        robot = load_robot(of_robot.path, of_robot.changes)
        return robot, load_trajectory(of_trajectory.path, robot, of_trajectory.changes)


@contextmanager
def _reading(inputs: Sequence[StoredInput], path: str | Path) -> Iterator[tuple[StoredInput, StoredInput]]:
    """Make stored files readable under their original paths; yield those of robot and trajectory."""
    roles = {each.role: each for each in inputs}
    if not {"robot", "trajectory"} <= roles.keys():
        raise InputError.one("does not say from which files it was computed, so it cannot be repeated", path)
    with ExitStack() as stack:
        place = stack.enter_context(temporary_folder())
        copies = {}
        for number, each in enumerate(inputs):
            if each.content is None:
                raise InputError.one(f"does not hold {each.path}, so it cannot be repeated", path)
            copies[each.path] = str(place / str(number))
            with reporting_temporary_errors():
                Path(copies[each.path]).write_bytes(each.content)
        stack.enter_context(reading_copies(copies))
        yield roles["robot"], roles["trajectory"]


class _VariableComparison:
    """A comparison of a stored variable with the blocks of a run, in order."""

    def __init__(self, result: StoredResult, variable: str) -> None:
        self._result, self._variable = result, variable
        self._at = 0
        self._peak, self._largest = 0.0, 0.0
        self.values = 0

    def add(self, block: Block) -> None:
        """Compare the next samples."""
        computed = self._result.rounded(self._variable, getattr(block, self._variable))
        stored = self._result.read(self._variable, self._at, self._at + len(computed))
        self._at += len(computed)
        if stored.shape != computed.shape:
            raise InputError.one(f"holds {self._variable} for other steps", self._result.path)
        undefined = (stored != stored) & (computed != computed)  # NaN in both
        differing = (stored != computed) & ~undefined
        self.values += int(np.count_nonzero(differing))
        self._peak = float(np.fmax(self._peak, np.fmax.reduce(np.abs(stored), axis=None, initial=0.0)))
        distances = np.abs(stored[differing].astype(float) - computed[differing])
        self._largest = float(np.maximum(self._largest, np.max(distances, initial=0.0)))

    @property
    def difference(self) -> VariableDifference:
        """Difference found so far."""
        return VariableDifference(self._variable, self.values, self._largest / (self._peak or 1.0))


class Extracted(NamedTuple):
    """Input files of a result.

    Attributes:
        files: contents as they were read, by path relative to their common folder.
        changes: changes applied after reading, values by path.
    """

    files: dict[Path, bytes]
    changes: dict[str, Any]


def extract(path: str | Path) -> Extracted:
    """Return the inputs of a result, a simulation or a study table, of any version of its format.

    Raises:
        InputError: it is none of them, or does not hold one of its inputs.
    """
    inputs = stored_inputs(path)
    missing = [each.path for each in inputs if each.content is None]
    if missing or not inputs:
        what = ", ".join(missing) if missing else "any input"
        raise InputError.one(f"does not hold {what}", path)
    places = _places([each.path for each in inputs])
    files = {
        place: each.content for place, each in zip(places, inputs, strict=True) if each.content is not None
    }
    return Extracted(files, {path: value for each in inputs for path, value in each.changes.items()})


def _places(paths: Sequence[str]) -> list[Path]:
    """Return paths that preserve the relative locations of the files, none above their common folder.

    Control characters in names are escaped.
    """
    named = ["stdin" if path == "-" else one_line(path) for path in paths]
    deep = "/" + "d/" * sum(path.count("..") for path in named)
    whole = [os.path.normpath(os.path.join(deep, path)) for path in named]
    common = os.path.commonpath([os.path.dirname(path) for path in whole])
    return [Path(os.path.relpath(path, common)) for path in whole]


ROUNDING = 1e-9
"""Fraction of a period by which the last one may be too short."""


@contextmanager
def at_rate(result: StoredResult, rate: float) -> Iterator[StoredResult]:
    """Yield the result if decimation gives the rate or it cannot be recomputed; else a recomputed one.

    Args:
        result: open result of `vsacli invdyn`.
        rate: samples per second, Hz.

    Raises:
        InputError: the rate is not positive or gives too many samples, the stored times are damaged, or the
            stored inputs cannot be used.
    """
    check_rate(rate)
    samples = float(result.time[-1] - result.time[0]) * rate
    if samples > MAX_STEPS:
        raise InputError.one(
            f"{rate:.9g} Hz gives {samples:.4g} samples; at most {MAX_STEPS:.0e} are possible"
        )
    again = None if _takes_every_nth(result, rate) else _function_of_time(result)
    if again is None:
        yield result
        return
    robot, trajectory = again[0], _sampled(again[1], rate)
    options: dict[str, Any] = result.provenance()["options"]
    run = Run(robot, trajectory, asked=(JUDGED, *_on_request(result)), **options)
    with temporary_folder() as place:
        staged = Staged.unnamed(place / "result.h5")
        with ResultWriter(staged, robot, trajectory, (ALL, *_on_request(result))) as writer:
            for block in run:
                writer.write(block)
            writer.finish(run.report().as_json())
        with StoredResult.open(staged.temporary) as resampled:
            yield resampled


def _takes_every_nth(result: StoredResult, rate: float) -> bool:
    try:
        stride_of(result, rate, exact=True)
    except InputError:
        return False
    return True


def _function_of_time(result: StoredResult) -> tuple[Robot, Trajectory] | None:
    """Return robot and trajectory of a result if the motion is also known between samples; else None."""
    if result.kind != StoredResult.kind:
        return None
    try:
        robot, trajectory = rebuilt(result)
    except InputError:
        return None  # the export reports the problem of the rate
    return (robot, trajectory) if trajectory.known_between and not trajectory.estimates else None


def _sampled(trajectory: Trajectory, rate: float) -> Trajectory:
    """Return the trajectory sampled at whole periods of a rate, up to the last one before its end."""
    periods = int(trajectory.duration * rate + ROUNDING)
    time = trajectory.start + np.arange(periods + 1) / rate
    return trajectory.sampled(RecordedTimes(np.minimum(time, trajectory.times.span[1])))
