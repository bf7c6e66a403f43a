"""A study as it is computed: its files, its dimensions, the values of each run, and the engine."""

from __future__ import annotations

import glob
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vsacli.analysis.batch import is_alone
from vsacli.analysis.variant_groups import BATCH_SAMPLES, PreparedRun, numbers_as_rows
from vsacli.base import file_formats
from vsacli.base.did_you_mean import near_file
from vsacli.base.errors import InputError
from vsacli.base.texts import MOST_LETTERS
from vsacli.base.variables import VARIABLES
from vsacli.base.version import __version__
from vsacli.compute.engine import settle_engine
from vsacli.compute.engine.choice import check_engine
from vsacli.documents.reading import Changes, read_document
from vsacli.documents.source import Problems, Source
from vsacli.documents.tree import MapNode, parse_yaml
from vsacli.dynamics.inverse import InverseDynamics
from vsacli.dynamics.variants import Variants
from vsacli.results.store.study_table import TEXTS
from vsacli.robot.file import RobotFileWithSource, read_robot_file
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, numbers_of_robot
from vsacli.studies.sweeps.columns import KEPT, Column, curve_columns
from vsacli.studies.sweeps.dimensions import Design, Dimension, Entries
from vsacli.studies.sweeps.study_file import StudyFile
from vsacli.trajectory.changes import ChangesByFile, divide_changes_by_file
from vsacli.trajectory.file import declared_trajectory, load_trajectory


def _samples_of_run(path: str, robot: Robot, changes: Changes) -> int:
    """Return the samples of the first run, or of the file if the changes do not fit."""
    try:
        return load_trajectory(path, robot, changes).samples
    except InputError:
        return load_trajectory(path, robot).samples


class ChangedError(InputError):
    """Error: a file has changed since the study was read."""


class Point(NamedTuple):
    """The inputs of a run: the index of the trajectory, and the value of each dimension by path."""

    trajectory: int
    values: dict[str, Any]

    @property
    def changes(self) -> ChangesByFile:
        """Values divided into those for the robot file and those for the trajectory file."""
        return divide_changes_by_file(self.values)


@dataclass(frozen=True)
class Study:
    """A study.

    Attributes:
        file: content of the study file.
        source: study file as read.
        read: robot file as read.
        robot: robot without changes.
        trajectories: paths of the trajectory files.
        trajectory_sources: files that were read for each trajectory.
        dimensions: varied quantities.
        design: combination of values for each run.
        warnings: sentences about implausible values of the robot and the trajectories, without changes.
        engine: engine, "numpy" or "c".
        compiler: C compiler of the engine; otherwise empty.
    """

    file: StudyFile
    source: Source
    read: RobotFileWithSource
    robot: Robot
    trajectories: tuple[str, ...]
    trajectory_sources: tuple[tuple[Source, ...], ...]
    dimensions: tuple[Dimension, ...]
    design: Design
    warnings: tuple[str, ...]
    engine: str = "numpy"
    compiler: str = ""

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.trajectories) * self.design.points

    @property
    def kept(self) -> tuple[Column, ...]:
        """Columns stored for each run."""
        return tuple(KEPT[name] for name in dict.fromkeys(self.file.keep or KEPT))

    @property
    def costs(self) -> tuple[Column, ...]:
        """Columns stored for each run's optimum, if one is computed."""
        return () if self.file.optimize is None else self.file.optimize.costs

    @property
    def over_time(self) -> tuple[Column, ...]:
        """Columns stored for each run over time."""
        return curve_columns(self.file.variables or ())

    @property
    def sources(self) -> list[Source]:
        """All files that were read, without duplicates."""
        files = (
            self.source,
            *self.robot.sources,
            *(each for files in self.trajectory_sources for each in files),
        )
        return list(dict.fromkeys(files))

    def point(self, run: int) -> Point:
        """Return the inputs of a run; runs of one trajectory are consecutive."""
        trajectory, point = divmod(run, self.design.points)
        return Point(trajectory, self.design.values(point))

    @cached_property
    def _first_run(self) -> PreparedRun | None:
        """Robot and trajectory of the first run, or of the files if that fails; None if runs are alone."""
        changes = self.point(0).changes
        try:
            robot = self.read.robot(changes.robot)
            trajectory = declared_trajectory(self.trajectories[0], robot, changes.trajectory)
        except InputError:
            robot, trajectory = self.robot, declared_trajectory(self.trajectories[0], self.robot)
        is_single = self.file.optimize is not None or is_alone(robot, trajectory)
        return None if is_single else PreparedRun(robot, trajectory)

    @cached_property
    def varied_parameters(self) -> tuple[Parameter, ...]:
        """Numbers of the robot that are rows of the kernel.

        They depend on the study alone, so that a row does not depend on the runs that are computed with it.
        """
        if self._first_run is None:
            return ()
        robot = self._first_run.robot
        candidates = [parameter for each in self.dimensions for parameter in _numbers_matched_by(robot, each)]
        try:
            return numbers_as_rows(*self._first_run, list(dict.fromkeys(candidates)))
        except InputError:  # of which the row of the first run tells
            return ()

    @cached_property
    def samples_of_kernel(self) -> int:
        """Number of samples in all runs that share a kernel, assuming those of the first run."""
        changes = self.point(0).changes.trajectory
        robots = self.design.different([each for each in self.dimensions if not self._is_row(each)])
        runs = sum(_samples_of_run(path, self.robot, changes) for path in self.trajectories)
        return runs * self.design.points // robots

    @cached_property
    def runs_of_batch(self) -> int:
        """Number of runs that are computed together, if their robots differ in `varied` alone."""
        return 1 if self._first_run is None else max(1, BATCH_SAMPLES // self._first_run.trajectory.samples)

    def _is_row(self, dimension: Dimension) -> bool:
        """Return whether a dimension is of the motion, or of numbers that are rows of the kernel."""
        if not divide_changes_by_file({dimension.path: None}).robot:
            return True
        paths = {str(parameter) for parameter in self.varied_parameters}
        matching_paths = [str(parameter) for parameter in _numbers_matched_by(self.robot, dimension)]
        return dimension.numeric and bool(matching_paths) and paths.issuperset(matching_paths)

    def with_engine(self, name: str) -> Study:
        """Return the study with the engine of a name, see `settle_engine`.

        Raises:
            InputError: the engine is unknown, or its C compiler is missing.
        """
        check_engine(name)
        if name == "numpy":
            return self
        kernel = Variants((self.robot,), self.robot, self.varied_parameters).kernel(
            InverseDynamics(self.robot)
        )
        engine_choice = settle_engine(name, kernel, self.samples_of_kernel if name == "auto" else 0)
        return replace(self, engine=engine_choice.name, compiler=engine_choice.compiler)

    @cached_property
    def digest(self) -> str:
        """Hexadecimal digest of everything that rows depend on, except trajectory and values of a run."""
        robot = [source.sha256 for source in self.robot.sources]
        column_names = [*TEXTS, *(each.name for each in self.kept)]
        curve_names = [self.file.every, *(each.name for each in self.over_time)]
        optimize_text = [] if self.file.optimize is None else [repr(self.file.optimize)]
        files = [*self._named_files.values()]
        return _digest(
            [[*self.computed_by.values()], robot, column_names, curve_names, files, *optimize_text]
        )

    @property
    def computed_by(self) -> dict[str, str]:
        """Engine and versions, by name; with others, rows may differ in the last digit."""
        return {
            "vsacli": __version__,
            "NumPy": np.__version__,
            "the engine": self.engine,
            "the C compiler": self.compiler,
        }

    @property
    def fingerprint(self) -> str:
        """Hexadecimal digest of the whole study, with all its files and its engine."""
        return _digest([self.digest, [source.sha256 for source in self.sources]])

    @cached_property
    def _named_files(self) -> dict[str, str]:
        """SHA-256, by path, of files that listed values name relative to the robot or a trajectory."""
        folders = {Path(each).parent for each in (self.robot.sources[0].path, *self.trajectories)}
        texts = (text for each in self.dimensions for value in each.values for text in _nested_texts(value))
        files = (file for text in texts for file in sorted(folder / text for folder in folders))
        return {str(file): hashlib.sha256(file.read_bytes()).hexdigest() for file in files if file.is_file()}

    @cached_property
    def _sha256_by_path(self) -> dict[str, str]:
        """SHA-256 of all files that rows depend on, by path."""
        return self._named_files | {source.path: source.sha256 for source in self.sources}

    def check_read(self, sources: Iterable[Source]) -> None:
        """Check that files that were read again have not changed.

        Raises:
            ChangedError: a file has changed since the study was read.
        """
        for source in sources:
            if self._sha256_by_path.get(source.path, source.sha256) != source.sha256:
                raise _changed_error(source.path)

    def check_files(self) -> None:
        """Check that no file of the study has changed.

        Raises:
            ChangedError: a file has changed since the study was read, or is missing.
        """
        for path, sha256 in self._sha256_by_path.items():
            try:
                content = Path(path).read_bytes()
            except OSError:
                content = b""
            if hashlib.sha256(content).hexdigest() != sha256:
                raise _changed_error(path)

    def as_named(self, error: InputError) -> InputError:
        """Return the error with file names relative to the study, so that it is equal on every machine."""
        folder = Path(self.source.path).parent
        return InputError(
            problem._replace(file=str(Path(problem.file).relative_to(folder)))
            if problem.file and Path(problem.file).is_relative_to(folder)
            else problem
            for problem in error.problems
        )

    def key(self, point: Point) -> str:
        """Return the hexadecimal digest of everything that a row depends on."""
        trajectory = [source.sha256 for source in self.trajectory_sources[point.trajectory]]
        return _digest([self.digest, trajectory, point.values])


def _changed_error(path: str) -> ChangedError:
    return ChangedError.one("was changed while the study was computed; run it again", path)


def _nested_texts(value: Any) -> Iterator[str]:
    match value:
        case str() if len(value) <= MOST_LETTERS:
            yield value
        case list():
            yield from (text for entry in value for text in _nested_texts(entry))
        case dict():
            yield from (text for entry in value.values() for text in _nested_texts(entry))


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:24]


def load_study(path: str | os.PathLike[str], engine: str = "numpy") -> Study:
    """Read a study, its robot and its trajectories.

    Raises:
        InputError: a file is wrong (with every problem of the first such file), the engine is unknown, or its
            C compiler is missing.
    """
    file, source = read_document(path, StudyFile, file_formats.STUDY)
    folder = Path(source.path).parent
    _check_file_exists(source, "robot", file.robot)
    read = read_robot_file(folder / file.robot)
    robot = read.robot()
    for each in curve_columns(file.variables or ()):
        if not robot.has_variable(VARIABLES[each.name]):
            raise InputError.one(f"variables: no joint of {robot.name} has a {each.name}", source.path)
    trajectories = _trajectory_paths(file, folder, source)
    loaded_trajectories = [load_trajectory(each, robot) for each in trajectories]
    entries = Entries(file, source.path, read, robot, trajectories)
    dimensions = entries.dimensions()
    try:
        design = Design(file, dimensions, len(trajectories))
    except InputError as error:
        raise InputError.one(str(error), source.path) from None
    entries.try_values()
    sources = tuple(each.sources for each in loaded_trajectories)
    warnings = dict.fromkeys(
        (*robot.warnings, *(text for each in loaded_trajectories for text in each.warnings))
    )
    study = Study(file, source, read, robot, trajectories, sources, dimensions, design, tuple(warnings))
    return study.with_engine(engine)


def _numbers_matched_by(robot: Robot, dimension: Dimension) -> list[Parameter]:
    """Return the numbers of a robot to which a dimension leads, or which are part of what it leads to."""
    patterns = (dimension.path, f"{dimension.path}.*")
    return [each for each in numbers_of_robot(robot) if each.matches(*patterns)]


def _check_file_exists(source: Source, key: str, name: str) -> None:
    """Raise an error at the line of a key that names a missing file, relative to the study."""
    folder = Path(source.path).parent
    if not (folder / name).exists():
        suggestion = near_file(folder / name).replace(f"'{folder}{os.sep}", "'")
        raise InputError.one(f"{key}: {name}: no such file{suggestion}", source.path, _line_of(source, key))


def _line_of(source: Source, key: str) -> int:
    root = parse_yaml(source.text or "", Problems(source.path))
    return root.key_lines.get(key, 0) if isinstance(root, MapNode) else 0


def _trajectory_paths(file: StudyFile, folder: Path, source: Source) -> tuple[str, ...]:
    paths: list[str] = []
    for pattern in file.trajectory:
        full_path = str(folder / pattern)
        if os.path.exists(full_path) or not glob.has_magic(pattern):
            _check_file_exists(source, "trajectory", pattern)
            matching_paths = [full_path]
        else:
            matching_paths = sorted(glob.glob(full_path))
        if not matching_paths:
            line = _line_of(source, "trajectory")
            raise InputError.one(f"trajectory: no file fits {pattern!r}", source.path, line)
        paths += [each for each in matching_paths if each not in paths]
    return tuple(paths)
