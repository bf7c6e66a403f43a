"""Trajectory files: `vsacli-trajectory/1`, or a bare CSV table of samples."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from vsacli import profiles, units
from vsacli.courses import (
    POSITIONS,
    RIGID_POSITIONS,
    STIFFNESSES,
    WRENCHES,
    PositionCourse,
    Recorded,
    StiffnessCourse,
    WrenchCourse,
)
from vsacli.errors import FieldProblem, InputError
from vsacli.profiles import Signal
from vsacli.recorded import Recording, read_recording, recorded_trajectory
from vsacli.robot import Rigid, Robot
from vsacli.samples import SampledProfile
from vsacli.spec.fields import POSITIVE, check_fields, number, text, value
from vsacli.spec.reading import read_document
from vsacli.times import Times, UniformTimes
from vsacli.trajectory import Profile, Trajectory, WrenchProfile, no_stiffness

FORMAT = "vsacli-trajectory/1"
DEFAULT_RATE = 1000.0


@dataclass(frozen=True)
class TrajectoryFile:
    """The content of a trajectory file."""

    name: str = text("name of the trajectory")
    duration: float | None = number(
        units.TIME,
        "duration; absent if anything is recorded, required otherwise",
        check=POSITIVE,
        default=None,
    )
    rate: float | None = number(
        units.RATE,
        f"samples per second, {DEFAULT_RATE:g} by default; absent if anything is recorded",
        check=POSITIVE,
        default=None,
    )
    position: PositionCourse = value(POSITIONS, "motion of the joints")
    stiffness: StiffnessCourse | None = value(
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
    def recorded(self) -> dict[Signal, str]:
        """The CSV file of each signal that is recorded."""
        courses = {
            profiles.POSITION: self.position,
            profiles.STIFFNESS: self.stiffness,
            profiles.WRENCH: self.wrench,
        }
        return {signal: course.file for signal, course in courses.items() if isinstance(course, Recorded)}

    def _time_problems(self) -> Iterator[FieldProblem]:
        if self.recorded:
            for name in ("duration", "rate"):
                if getattr(self, name) is not None:
                    yield FieldProblem((name,), "the times come from the CSV file; leave this key out")
        elif self.duration is None:
            yield FieldProblem((), "missing key 'duration' (s)")
        else:
            try:
                _uniform_times(self.duration, self.rate)
            except InputError as error:
                yield FieldProblem(("duration",), str(error))


@dataclass(frozen=True)
class _WithoutStiffness(TrajectoryFile):
    """The content for a robot without antagonistic joints."""

    stiffness: StiffnessCourse | None = value(
        STIFFNESSES, "stiffness of the antagonistic joints", default=None
    )


@dataclass(frozen=True)
class _Rigid(_WithoutStiffness):
    """The content for a robot whose joints are all rigid."""

    position: PositionCourse = value(RIGID_POSITIONS, "motion of the joints")


def load_trajectory(path: str | os.PathLike[str], robot: Robot) -> Trajectory:
    """Read a trajectory for a robot from a YAML file, or from a CSV file with position and stiffness.

    Raises:
        InputError: with every problem of the file, each with its line.
    """
    if Path(path).suffix.lower() == ".csv":
        return recorded_trajectory(path, robot.joint_names, robot.without_stiffness)
    members = dict(zip(robot.joint_names, robot.joint_types, strict=True))
    exempt = {units.STIFFNESS: robot.without_stiffness}
    document, source = read_document(path, _content(robot), FORMAT, members, exempt)
    recordings = _read_recordings(document, Path(path).parent, robot)
    times = _times(document, recordings)
    recorded = {profile.signal: profile for recording in recordings for profile in recording.profiles}
    return Trajectory(
        times,
        _profile(document.position, profiles.POSITION, times, recorded),
        no_stiffness(len(robot.joints), times)
        if document.stiffness is None
        else _profile(document.stiffness, profiles.STIFFNESS, times, recorded),
        wrench=_wrench(document.wrench, times, recorded),
        name=document.name,
        warnings=[warning for recording in recordings for warning in recording.warnings],
        sources=[source, *(recording.source for recording in recordings)],
    )


def _content(robot: Robot) -> type[TrajectoryFile]:
    """The record that says what a trajectory of this robot must have."""
    if all(isinstance(joint.actuator, Rigid) for joint in robot.joints):
        return _Rigid
    return _WithoutStiffness if len(robot.without_stiffness) == len(robot.joints) else TrajectoryFile


def _read_recordings(document: TrajectoryFile, folder: Path, robot: Robot) -> list[Recording]:
    """Each CSV file once, for the signals that are wanted from it; all with the times of the first."""
    wanted: dict[Path, list[Signal]] = defaultdict(list)
    for signal, file in document.recorded.items():
        wanted[folder / file].append(signal)
    recordings = [
        read_recording(file, robot.joint_names, signals, robot.without_stiffness)
        for file, signals in wanted.items()
    ]
    for other in recordings[1:]:
        recordings[0].check_times(other)
    return recordings


def _times(document: TrajectoryFile, recordings: Sequence[Recording]) -> Times:
    if document.duration is None:  # then something is recorded, see `TrajectoryFile`
        return recordings[0].times
    return _uniform_times(document.duration, document.rate)


def _uniform_times(duration: float, rate: float | None) -> UniformTimes:
    return UniformTimes(duration, DEFAULT_RATE if rate is None else rate)


def _wrench(
    course: WrenchCourse | None, times: Times, recorded: Mapping[Signal, SampledProfile]
) -> WrenchProfile | None:
    if course is None:
        return None
    return WrenchProfile(_profile(course, profiles.WRENCH, times, recorded), course.frame)


def _profile(
    course: PositionCourse | StiffnessCourse | WrenchCourse,
    signal: Signal,
    times: Times,
    recorded: Mapping[Signal, SampledProfile],
) -> Profile:
    return recorded[signal] if isinstance(course, Recorded) else course.over(times.span)
