"""All problems of files of any kind; each file is checked as by the command that reads it.

The reader of a kind is imported for a file of this kind, since all readers take longer to import than a robot
to check.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from vsacli.base import file_formats
from vsacli.base.errors import InputError, Problem
from vsacli.base.texts import counted, listed
from vsacli.documents.reading import read_document
from vsacli.files.file_kinds import FileKind, recognize
from vsacli.robot.file import load_robot
from vsacli.robot.model import Robot

if TYPE_CHECKING:
    from vsacli.trajectory.trajectory import Trajectory

MOST_ROBOTS_SHOWN = 3
SPRING_COLUMNS = {"deflection", "torque"}
WITHOUT_ROBOT = "joint names, units and limits are not checked; give the robot file, too"

Robots = Mapping[str, Robot]
"""Robots by the paths of their files."""

ERROR, WARNING, NOTE = "error", "warning", "note"


@dataclass(frozen=True)
class Message:
    """A message about a file.

    Attributes:
        severity: ERROR if the file cannot be used, WARNING if a value is implausible, NOTE otherwise.
        file: path as given.
        line: line number from 1, or 0 for the whole file.
        text: message, a clause.
    """

    severity: str
    file: str
    line: int
    text: str

    def __str__(self) -> str:
        text = self.text if self.severity == ERROR else f"{self.severity}: {self.text}"
        return str(Problem(self.file, self.line, text))

    def as_json(self) -> dict[str, Any]:
        """Return JSON values under the published keys; a line of None concerns the whole file."""
        return {
            "file": self.file,
            "line": self.line or None,
            "message": self.text,
            "severity": self.severity,
        }


@dataclass(frozen=True)
class CheckedInput:
    """A file that was checked.

    Attributes:
        path: path as given.
        summary: short description; empty if the file cannot be used.
        messages: errors, warnings and notes.
    """

    path: str
    summary: str
    messages: tuple[Message, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether the file can be used."""
        return all(message.severity != ERROR for message in self.messages)


def _failed_file(path: str, error: InputError) -> CheckedInput:
    """Return a file that cannot be used."""
    return CheckedInput(path, "", tuple(Message(ERROR, *problem) for problem in error.problems))


def _usable_file(
    path: str, summary: str, warnings: Iterable[Problem] = (), notes: Iterable[str] = ()
) -> CheckedInput:
    messages = [Message(WARNING, path, warning.line, warning.message) for warning in warnings]
    return CheckedInput(path, summary, (*messages, *(Message(NOTE, path, 0, text) for text in notes)))


def check_files(paths: Sequence[str]) -> list[CheckedInput]:
    """Check files; trajectories and poles must fit one of the robots among them.

    Raises:
        StorageError: a result file cannot be read for a reason outside of it.
    """
    kinds = {path: _kind_or_failure(path) for path in paths}
    robots: dict[str, Robot] = {}
    checked: dict[str, CheckedInput] = {}
    for path, kind in sorted(kinds.items(), key=lambda item: item[1] is not FileKind.ROBOT):
        checked[path] = kind if isinstance(kind, CheckedInput) else _check_file(path, kind, robots)
    return [checked[path] for path in kinds]


def _kind_or_failure(path: str) -> FileKind | CheckedInput:
    try:
        return recognize(path)
    except InputError as error:
        return _failed_file(path, error)


def _check_file(path: str, kind: FileKind, robots: dict[str, Robot]) -> CheckedInput:
    """Check a file; add a valid robot to the others."""
    try:
        if kind is FileKind.ROBOT:
            robots[path] = load_robot(path)
        return _CHECK_OF_KIND[kind](path, robots)
    except InputError as error:
        return _failed_file(path, error)


def _check_robot(path: str, robots: Robots) -> CheckedInput:
    robot = robots[path]
    return _usable_file(
        path, f"robot {robot.name}, {counted(len(robot.joints), 'joint')}", robot.located_warnings
    )


def _check_trajectory(path: str, robots: Robots) -> CheckedInput:
    from vsacli.files.limits_of_motion import unattainable
    from vsacli.files.placeholder_robot import placeholder_robot
    from vsacli.trajectory.file import load_trajectory

    if not robots:
        return _checked_trajectory(
            path, load_trajectory(path, placeholder_robot(path).robot), [WITHOUT_ROBOT]
        )

    def read(robot: Robot) -> tuple[Trajectory, list[str]]:
        trajectory = load_trajectory(path, robot)
        return trajectory, list(unattainable(robot, trajectory))

    readings, note = _read_for_robots(path, read, robots)
    trajectory, motion_notes = min(readings, key=lambda reading: len(reading[0].warnings) + len(reading[1]))
    return _checked_trajectory(path, trajectory, [*motion_notes, note])


def _checked_trajectory(path: str, trajectory: Trajectory, notes: Iterable[str]) -> CheckedInput:
    extent_text = f"{counted(trajectory.samples, 'sample')} over {trajectory.duration:g} s"
    summary = f"trajectory {trajectory.name}, {extent_text}"
    return _usable_file(path, summary, trajectory.located_warnings, [*trajectory.notes, *notes])


def _check_poles(path: str, robots: Robots) -> CheckedInput:
    from vsacli.control.poles import PolesFile

    document, _ = read_document(path, PolesFile, file_formats.POLES)
    summary = f"poles of {counted(len(document.joints), 'joint')}"
    if not robots:
        return _usable_file(path, summary, notes=[WITHOUT_ROBOT])
    _, note = _read_for_robots(path, lambda robot: _load_gains(path, robot), robots)
    return _usable_file(path, summary, notes=[note])


def _load_gains(path: str, robot: Robot) -> Any:
    """Return gains with or without integral action, which requires one more pole."""
    from vsacli.control.poles import load_gains

    try:
        return load_gains(path, robot, integral=False)
    except InputError:
        return load_gains(path, robot, integral=True)


def _read_for_robots(path: str, read: Callable[[Robot], Any], robots: Robots) -> tuple[list[Any], str]:
    """Return the content for each robot that it fits, and a note on these robots.

    Raises:
        InputError: the file fits no robot; with the problems for the robot that it fits best.
    """
    fitting: dict[str, Any] = {}
    errors: dict[str, InputError] = {}
    for robot_path, robot in robots.items():
        try:
            fitting[robot_path] = read(robot)
        except InputError as error:
            errors[robot_path] = error
    if not fitting:
        best_robot = min(errors, key=lambda robot_path: len(errors[robot_path].problems))
        raise InputError([*errors[best_robot].problems, *_no_fit_problems(path, len(errors), best_robot)])
    robots_text = listed([*fitting], MOST_ROBOTS_SHOWN)
    count_text = "" if len(robots) == 1 else f"{len(fitting)} of {len(robots)} robots: "
    return list(fitting.values()), f"fits {count_text}{robots_text}"


def _no_fit_problems(path: str, robots: int, best: str) -> Iterator[Problem]:
    if robots > 1:
        message = f"fits none of the {robots} robots; the problems above are those with {best}"
        yield Problem(path, 0, message)


def _check_table(path: str, robots: Robots) -> CheckedInput:
    from vsacli.actuators.laws.table import MeasuredSpring
    from vsacli.documents.csv_file import read_header
    from vsacli.documents.table import read_table

    if set(read_header(path).columns) != SPRING_COLUMNS:
        return _check_trajectory(path, robots)
    table = read_table(path)
    spring = MeasuredSpring(file=table)
    warnings = [Problem(path, 0, warning) for warning in spring.warnings]
    return _usable_file(path, f"spring of {counted(len(table.values), 'row')}", warnings)


def _check_catalog(path: str, _: Robots) -> CheckedInput:
    from vsacli.studies.sizing.catalog import read_catalog

    return _usable_file(path, f"catalog of {counted(len(read_catalog(path).records), 'motor')}")


def _check_urdf(path: str, _: Robots) -> CheckedInput:
    from vsacli.robot.urdf.reader import read_urdf

    urdf = read_urdf(path)
    flaws = [link.flaw for link in urdf.links.values() if link.flaw is not None]
    warnings = [*flaws, *((warning.line, warning.message) for warning in urdf.warnings)]
    messages = tuple(Message(WARNING, path, *doubt) for doubt in warnings)
    return CheckedInput(path, f"URDF of {urdf.name}, {counted(len(urdf.joints), 'joint')}", messages)


def _check_stored(path: str, _: Robots) -> CheckedInput:
    from vsacli.results.store.reader import open_stored

    with open_stored(path) as result:
        result.check()
        names = f"{result.robot_name}, {result.trajectory_name}"
        return _usable_file(
            path, f"{result.kind} of {names}, {counted(result.samples, 'sample')}, {result.verdict}"
        )


def _check_study(path: str, _: Robots) -> CheckedInput:
    """Check a study with the files that it names, whatever robots are among the files."""
    from vsacli.studies.sweeps.study import load_study

    study = load_study(path)
    return _usable_file(path, f"study {study.file.name}, {counted(study.runs, 'run')} of {study.robot.name}")


def _check_columns(path: str, _: Robots) -> CheckedInput:
    """Check a columns file; whether its columns exist depends on the recording."""
    from vsacli.documents.columns_file import load_columns

    mapping = load_columns(path)
    return _usable_file(path, f"columns of recordings, {counted(len(mapping.columns), 'name')}")


def _check_study_table(path: str, _: Robots) -> CheckedInput:
    from vsacli.results.store.study_table import StoredStudy

    with StoredStudy(path) as table:
        table.check()
        return _usable_file(
            path, f"table of {table.study_name}, {counted(table.rows, 'run')} of {table.robot_name}"
        )


_CHECK_OF_KIND: dict[FileKind, Callable[[str, Robots], CheckedInput]] = {
    FileKind.ROBOT: _check_robot,
    FileKind.TRAJECTORY: _check_trajectory,
    FileKind.POLES: _check_poles,
    FileKind.TABLE: _check_table,
    FileKind.CATALOG: _check_catalog,
    FileKind.URDF: _check_urdf,
    FileKind.RESULT: _check_stored,
    FileKind.SIMULATION: _check_stored,
    FileKind.STUDY: _check_study,
    FileKind.COLUMNS: _check_columns,
    FileKind.STUDY_TABLE: _check_study_table,
}
