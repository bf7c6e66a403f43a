"""Trajectory files: `vsacli-trajectory/1`, or a bare CSV table of samples."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vsacli.actuators.rigid import Rigid
from vsacli.base import units
from vsacli.base.errors import FieldProblem, InputError, Problem, check_path
from vsacli.base.signals import POSITION, STIFFNESS, WRENCH, Signal
from vsacli.documents.fields import POSITIVE, check_fields, number, text, value
from vsacli.documents.reading import read_document
from vsacli.robot.model import Robot, check_robot
from vsacli.trajectory.declared import POSITIONS, RIGID_POSITIONS, STIFFNESSES, WRENCHES, Course, WrenchCourse
from vsacli.trajectory.profile import Profile, WrenchProfile
from vsacli.trajectory.times import Times, UniformTimes, uniform_times_over
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.trajectory.declared.csv_samples import Recorded
    from vsacli.trajectory.recorded.recording import Recording
    from vsacli.trajectory.recorded.samples import SampledProfile

FORMAT = "vsacli-trajectory/1"
DEFAULT_RATE = 1000.0


@dataclass(frozen=True)
class TrajectoryFile:
    """The content of a trajectory file."""

    name: str = text("name of the trajectory")
    duration: float | None = number(
        units.TIME,
        "duration; absent if anything is recorded, required unless it follows from the times of via points"
        " or the parts of a sequence",
        check=POSITIVE,
        default=None,
    )
    rate: float | None = number(
        units.RATE,
        f"samples per second, {DEFAULT_RATE:g} by default; if anything is recorded, its times by default, and"
        " with this key its fit at equally spaced times",
        check=POSITIVE,
        default=None,
    )
    position: Course | Recorded = value(POSITIONS, "motion of the joints")
    stiffness: Course | Recorded | None = value(
        STIFFNESSES, "stiffness of the antagonistic joints; may be absent if there are none"
    )
    wrench: WrenchCourse | None = value(
        WRENCHES,
        "what the environment exerts on the end effector: force, and moment about the tool frame's origin",
        default=None,
    )

    def __post_init__(self) -> None:
        check_fields(self, *self._time_problems())

    @property
    def recorded(self) -> dict[Signal, Recorded]:
        """The courses that are recorded."""
        courses = {
            POSITION: self.position,
            STIFFNESS: self.stiffness,
            WRENCH: self.wrench,
        }
        return {
            signal: course
            for signal, course in courses.items()
            if course is not None and not isinstance(course, Course)
        }

    @property
    def declared(self) -> dict[str, Course]:
        """What is not recorded, by its key."""
        courses = {"position": self.position, "stiffness": self.stiffness, "wrench": self.wrench}
        return {key: course for key, course in courses.items() if isinstance(course, Course)}

    @property
    def lasts(self) -> float | None:
        """The duration, s, as given or as it follows from a course; None if it follows from nothing here."""
        durations = (self.duration, *(course.lasts for course in self.declared.values()))
        return next((duration for duration in durations if duration is not None), None)

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """What keeps the courses from lasting so long, in s."""
        for key, course in self.declared.items():
            yield from (problem.inside(key) for problem in course.problems_over(duration))

    def _time_problems(self) -> Iterator[FieldProblem]:
        if self.recorded:
            if self.duration is not None:
                yield FieldProblem(("duration",), "the times come from the CSV file; leave this key out")
        elif self.lasts is None:
            yield FieldProblem((), "missing key 'duration' (s)")
        else:
            try:
                _uniform_times(self.lasts, self.rate)
            except InputError as error:
                yield FieldProblem(("duration",), str(error))
            else:
                yield from self.problems_over(self.lasts)


@dataclass(frozen=True)
class _WithoutStiffness(TrajectoryFile):
    """The content for a robot without antagonistic joints."""

    stiffness: Course | Recorded | None = value(
        STIFFNESSES, "stiffness of the antagonistic joints", default=None
    )


@dataclass(frozen=True)
class _Rigid(_WithoutStiffness):
    """The content for a robot whose joints are all rigid."""

    position: Course | Recorded = value(RIGID_POSITIONS, "motion of the joints")


OF_ANY_ROBOT: type[TrajectoryFile] = _Rigid
"""The content for a robot that is not known: what some robot would accept."""


def load_trajectory(path: str | os.PathLike[str], robot: Robot) -> Trajectory:
    """Read a trajectory for a robot from a YAML file, or from a CSV file with position and stiffness.

    Raises:
        InputError: with every problem of the file, each with its line.
        TypeError: path or robot is none.
    """
    check_path(path, "load_trajectory(path, robot)")
    check_robot(robot)
    if Path(path).suffix.lower() == ".csv":
        from vsacli.trajectory.recorded.recording import recorded_trajectory

        return recorded_trajectory(path, _types(robot), robot.without_stiffness)
    members = _types(robot)
    exempt = {units.STIFFNESS: robot.without_stiffness}
    document, source = read_document(path, _content(robot), FORMAT, members, exempt)
    recordings = _read_recordings(document, Path(path).parent, robot)
    times = _times(document, recordings, source.path)
    if recordings:
        _check_lasting(document, times, source.path, robot.joint_names)
    recorded = {profile.signal: profile for recording in recordings for profile in recording.profiles}
    return Trajectory(
        times,
        _profile(document.position, POSITION, times, recorded),
        {}
        if document.stiffness is None
        else {"stiffness": _profile(document.stiffness, STIFFNESS, times, recorded)},
        wrench=_wrench(document.wrench, times, recorded),
        name=document.name,
        warnings=_warnings(document, times, members),
        notes=[*(note for recording in recordings for note in recording.notes), *_notes(document, times)],
        sources=[source, *(recording.source for recording in recordings)],
    )


def _content(robot: Robot) -> type[TrajectoryFile]:
    """The record that says what a trajectory of this robot must have."""
    if all(isinstance(joint.actuator, Rigid) for joint in robot.joints):
        return _Rigid
    return _WithoutStiffness if len(robot.without_stiffness) == len(robot.joints) else TrajectoryFile


def _types(robot: Robot) -> dict[str, str]:
    """The joints, each with its type."""
    return dict(zip(robot.joint_names, robot.joint_types, strict=True))


def _read_recordings(document: TrajectoryFile, folder: Path, robot: Robot) -> list[Recording]:
    """Each CSV file once, for the signals that are wanted from it; all with the times of the first."""
    wanted: dict[Path, dict[Signal, str | None]] = defaultdict(dict)
    for signal, course in document.recorded.items():
        wanted[folder / course.file][signal] = course.fit
    if not wanted:
        return []
    from vsacli.trajectory.recorded.recording import read_recording

    resampled = document.rate is not None
    recordings = [
        read_recording(file, _types(robot), fits, robot.without_stiffness, resampled=resampled)
        for file, fits in wanted.items()
    ]
    for other in recordings[1:]:
        recordings[0].check_times(other)
    return recordings


def _times(document: TrajectoryFile, recordings: Sequence[Recording], file: str) -> Times:
    if recordings:
        recorded = recordings[0].times
        try:
            return recorded if document.rate is None else uniform_times_over(recorded.span, document.rate)
        except InputError as error:
            raise InputError.one(f"rate: {error}", file) from None
    assert document.lasts is not None, "see TrajectoryFile"
    return _uniform_times(document.lasts, document.rate)


def _uniform_times(duration: float, rate: float | None) -> UniformTimes:
    return UniformTimes(duration, DEFAULT_RATE if rate is None else rate)


def _check_lasting(document: TrajectoryFile, times: Times, file: str, joint_names: Sequence[str]) -> None:
    """Refuse courses that cannot last as long as what is recorded; the file alone could not tell."""
    first, last = times.span
    problems = list(document.problems_over(last - first))
    if problems:
        raise InputError(Problem(file, 0, problem.in_file(joint_names)) for problem in problems)


def _warnings(document: TrajectoryFile, times: Times, joints: Mapping[str, str]) -> Iterator[str]:
    for key, course in document.declared.items():
        yield from (f"{key}: {warning}" for warning in course.warnings_over(times.span, joints))


def _notes(document: TrajectoryFile, times: Times) -> Iterator[str]:
    for key, course in document.declared.items():
        yield from (f"{key}: {note}" for note in course.notes_over(times.span))


def _wrench(
    course: WrenchCourse | None, times: Times, recorded: Mapping[Signal, SampledProfile]
) -> WrenchProfile | None:
    if course is None:
        return None
    return WrenchProfile(_profile(course, WRENCH, times, recorded), course.frame)


def _profile(
    course: Course | Recorded,
    signal: Signal,
    times: Times,
    recorded: Mapping[Signal, SampledProfile],
) -> Profile:
    return course.over(times.span) if isinstance(course, Course) else recorded[signal]
