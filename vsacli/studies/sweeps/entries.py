"""The entries of `vary:` in a study file, held against its robot and its trajectories."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from vsacli.base.errors import InputError
from vsacli.documents.changes import ChangeError, changed
from vsacli.documents.record_numbers import numbers
from vsacli.documents.source import Problems, is_table
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.file import ReadRobot
from vsacli.robot.model import Robot
from vsacli.studies.sweeps.dimensions import Dimension, Held, dimensions_of, held
from vsacli.studies.sweeps.study_file import StudyFile
from vsacli.studies.sweeps.ways import Varied
from vsacli.trajectory.changes import divided
from vsacli.trajectory.file import read_trajectory


class Entries:
    """What varies, and what is wrong with it.

    Args:
        file: what the study file says.
        path: of the study file.
        read: the robot file.
        robot: what that says.
        trajectories: paths of the trajectory files.
    """

    def __init__(
        self, file: StudyFile, path: str, read: ReadRobot, robot: Robot, trajectories: Sequence[str]
    ) -> None:
        self._file, self._path, self._read = file, path, read
        self._joints = CommandedJoints.of(robot)
        self._documents = [read_trajectory(each, self._joints) for each in trajectories if not is_table(each)]
        self._tables = len(self._documents) < len(trajectories)
        self._found: list[tuple[Varied, Dimension]] = []

    @property
    def _dimensions(self) -> tuple[Dimension, ...]:
        return tuple(dimension for _, dimension in self._found)

    def dimensions(self) -> tuple[Dimension, ...]:
        """What varies.

        Raises:
            InputError: entries do not fit what is there, each with its line.
        """
        problems, held_numbers = Problems(self._path), self._numbers()
        for varied in self._file.vary:
            with _noting(problems, varied):
                further = dimensions_of(varied, held_numbers, self._dimensions)
                self._found += [(varied, dimension) for dimension in further]
        counts = Counter(dimension.path for dimension in self._dimensions)
        for varied, dimension in self._found:
            if counts[dimension.path] > 1:
                problems.add(varied.line, f"{dimension.path} varies twice")
        problems.check()
        return self._dimensions

    def try_values(self) -> None:
        """Make the change of each listed value alone.

        Raises:
            InputError: some cannot be made.
        """
        problems = Problems(self._path)
        for varied, dimension in self._found:
            with _noting(problems, varied):
                for value in () if dimension.linked else dimension.values or (dimension.centre,):
                    self._change(dimension.path, value)
        problems.check()

    def _numbers(self) -> list[Held]:
        trajectories = (numbers(document, self._joints.types) for document, _ in self._documents)
        every = [*numbers(self._read.document), *(each for found in trajectories for each in found)]
        return held(every, self._joints.types)

    def _change(self, path: str, value: object) -> None:
        changes = divided({path: value})
        if changes.trajectory and self._tables:
            raise ChangeError.one("a trajectory of the study is a table, in which nothing can be set")
        if changes.robot:
            changed(self._read.document, self._read.source, changes.robot)
        for document, source in self._documents if changes.trajectory else ():
            changed(document, source, changes.trajectory, self._joints.types, self._joints.exempt)


@contextmanager
def _noting(problems: Problems, varied: Varied) -> Iterator[None]:
    """Note what is wrong with an entry."""
    try:
        yield
    except InputError as error:
        for problem in error.problems:
            message = problem.message.removeprefix(f"{varied.path}: ")
            problems.add(varied.line, f"{varied.path}: {message}")
