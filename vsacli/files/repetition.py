"""Repetition of a result from its own inputs, to compare it or to export it at another rate."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vsacli.analysis.run import Run
from vsacli.base.errors import InputError
from vsacli.base.outputs import Staged
from vsacli.base.progress import Tell, unheard
from vsacli.base.storage import reading_copies, reporting_temporary_errors, temporary_folder
from vsacli.base.variables import Block
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
class Difference:
    """The difference of a variable of a result from its repetition.

    Attributes:
        variable: its name.
        values: how many differ.
        largest: largest difference over the variable's peak; NaN if one of two values is missing.
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
    """A result compared with its repetition.

    Attributes:
        differences: the variables that are not equal bit for bit, once rounded to the precision of the file.
        precision: of the file, "double" or "single".
    """

    differences: list[Difference]
    precision: str


def repeat(path: str | Path, tell: Tell = unheard) -> Repetition:
    """Compute a result again, with its own inputs and options, and compare all its variables.

    Args:
        path: the result.
        tell: as of `Run`.

    Raises:
        InputError: the result does not hold its inputs, they cannot be used, or its engine is not to be had.
    """
    with StoredResult.open(path) as result:
        robot, trajectory = rebuilt(result)
        options: dict[str, Any] = result.provenance()["options"]
        engine = str(result.attributes.get("engine", "numpy"))
        run = Run(robot, trajectory, engine=engine, tell=tell, **options)
        comparisons = [_Comparison(result, name) for name in result.variables]
        for block in run:
            for comparison in comparisons:
                comparison.add(block)
        differences = [comparison.difference for comparison in comparisons if comparison.values]
        return Repetition(differences, result.precision)


def rebuilt(result: StoredResult) -> tuple[Robot, Trajectory]:
    """Robot and trajectory that an open result was computed from, as its inputs say that it holds.

    Raises:
        InputError: the result does not hold its inputs, or they cannot be used.
        StorageError: there is no room for them beside it while they are read.
    """
    with _reading(result.inputs(), result.path) as (of_robot, of_trajectory):
        robot = load_robot(of_robot.path, of_robot.changes)
        return robot, load_trajectory(of_trajectory.path, robot, of_trajectory.changes)


@contextmanager
def _reading(inputs: Sequence[StoredInput], path: str | Path) -> Iterator[tuple[StoredInput, StoredInput]]:
    """Read files as they were then; those of robot and trajectory."""
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


class _Comparison:
    """A comparison of a stored variable with the blocks of a run, in order."""

    def __init__(self, result: StoredResult, variable: str) -> None:
        self._result, self._variable = result, variable
        self._at = 0
        self._peak, self._largest = 0.0, 0.0
        self.values = 0

    def add(self, block: Block) -> None:
        """Compare the next steps."""
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
    def difference(self) -> Difference:
        """Return the difference found."""
        return Difference(self._variable, self.values, self._largest / (self._peak or 1.0))


class Extracted(NamedTuple):
    """The inputs of a result.

    Attributes:
        files: contents as they were read, by path relative to their common folder.
        changes: made after reading, values by path.
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
    """Files as they stand to each other, wherever the run was; none is above the folder they go to."""
    named = ["stdin" if path == "-" else path for path in paths]
    deep = "/" + "d/" * sum(path.count("..") for path in named)
    whole = [os.path.normpath(os.path.join(deep, path)) for path in named]
    common = os.path.commonpath([os.path.dirname(path) for path in whole])
    return [Path(os.path.relpath(path, common)) for path in whole]


ROUNDING = 1e-9
"""Share of a period by which the last one may be too short."""


@contextmanager
def at_rate(result: StoredResult, rate: float) -> Iterator[StoredResult]:
    """The result itself if every n-th of its steps makes the rate, or nothing does; else computed again.

    Args:
        result: an open result of `vsacli invdyn`.
        rate: samples per second, Hz.

    Raises:
        InputError: the rate is not positive or gives too many samples, the stored times are damaged, or the
            inputs that the result holds cannot be used.
    """
    check_rate(rate)
    samples = float(result.time[-1] - result.time[0]) * rate
    if samples > MAX_STEPS:
        message = f"the rate {rate:.9g} Hz gives {samples:.4g} samples; at most {MAX_STEPS:.0e} are possible"
        raise InputError.one(message, result.path)
    again = None if _takes_every_nth(result, rate) else _function_of_time(result)
    if again is None:
        yield result
        return
    robot, trajectory = again[0], _sampled(again[1], rate)
    options: dict[str, Any] = result.provenance()["options"]
    run = Run(robot, trajectory, **options)
    with temporary_folder() as place:
        staged = Staged.unnamed(place / "result.h5")
        with ResultWriter(staged, robot, trajectory) as writer:
            for block in run:
                writer.write(block)
            writer.finish(run.report().as_json())
        with StoredResult.open(staged.temporary) as resampled:
            yield resampled


def _takes_every_nth(result: StoredResult, rate: float) -> bool:
    try:
        stride_of(result, rate)
    except InputError:
        return False
    return True


def _function_of_time(result: StoredResult) -> tuple[Robot, Trajectory] | None:
    """Robot and trajectory of a result, if its steps are not all that is known of the motion."""
    if result.kind != StoredResult.kind:
        return None
    try:
        robot, trajectory = rebuilt(result)
    except InputError:
        return None  # the export says what is wrong with the rate
    return (robot, trajectory) if trajectory.known_between and not trajectory.estimates else None


def _sampled(trajectory: Trajectory, rate: float) -> Trajectory:
    """Return the trajectory at whole periods of a rate; if its end is none, up to the last one before."""
    periods = int(trajectory.duration * rate + ROUNDING)
    time = trajectory.start + np.arange(periods + 1) / rate
    return trajectory.sampled(RecordedTimes(np.minimum(time, trajectory.times.span[1])))
