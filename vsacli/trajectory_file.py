"""Trajectory files: `vsacli-trajectory/1`, or a bare CSV table of samples."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from vsacli import profiles, units
from vsacli.errors import FieldProblem, InputError
from vsacli.profiles import Signal
from vsacli.recorded import Recording, read_recording, recorded_trajectory
from vsacli.robot import Robot
from vsacli.samples import SampledProfile
from vsacli.spec.fields import (
    POSITIVE,
    Check,
    OneOf,
    PerJoint,
    check_fields,
    choice,
    integer,
    number,
    text,
    value,
    vector,
)
from vsacli.spec.reading import read_document
from vsacli.times import Times, UniformTimes
from vsacli.trajectory import Profile, Trajectory, WrenchProfile
from vsacli.wrench import WRENCH_FRAMES

FORMAT = "vsacli-trajectory/1"
DEFAULT_RATE = 1000.0

_POSITION_DEGREE = Check(
    lambda degree: degree in profiles.DEGREES and degree >= 7,
    "odd, 7 to 15 (the motion must be four times differentiable,"
    " so all derivatives up to the third must vanish at the ends)",
)
_STIFFNESS_DEGREE = Check(
    lambda degree: degree in profiles.DEGREES,
    "odd, 3 to 15 (the stiffness must be twice differentiable, so its rate must vanish at the ends)",
)
_WRENCH_DEGREE = Check(
    lambda degree: degree in profiles.DEGREES,
    "odd, 3 to 15 (the wrench must be twice differentiable, so its rate must vanish at the ends)",
)


@dataclass(frozen=True)
class PositionPolynomial:
    """Rest to rest: all derivatives up to (degree-1)/2 vanish at both ends."""

    degree: int = integer("degree of the polynomial, odd, 7 to 15", check=_POSITION_DEGREE)
    start: tuple[float, ...] = value(PerJoint(units.POSITION), "position at the start")
    end: tuple[float, ...] = value(PerJoint(units.POSITION), "position at the end")

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.RestToRest(
            signal=profiles.POSITION, span=span, degree=self.degree, start=self.start, end=self.end
        )


@dataclass(frozen=True)
class PositionConstant:
    """The robot stands still."""

    value: tuple[float, ...] = value(PerJoint(units.POSITION), "position all the time")

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.Constant(signal=profiles.POSITION, span=span, value=self.value)


@dataclass(frozen=True)
class StiffnessPolynomial:
    """From one stiffness to another: all derivatives up to (degree-1)/2 vanish at both ends."""

    degree: int = integer("degree of the polynomial, odd, 3 to 15", check=_STIFFNESS_DEGREE)
    start: tuple[float, ...] = value(PerJoint(units.STIFFNESS), "stiffness at the start", check=POSITIVE)
    end: tuple[float, ...] = value(PerJoint(units.STIFFNESS), "stiffness at the end", check=POSITIVE)

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.RestToRest(
            signal=profiles.STIFFNESS, span=span, degree=self.degree, start=self.start, end=self.end
        )


@dataclass(frozen=True)
class StiffnessConstant:
    """The same stiffness all the time."""

    value: tuple[float, ...] = value(PerJoint(units.STIFFNESS), "stiffness all the time", check=POSITIVE)

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.Constant(signal=profiles.STIFFNESS, span=span, value=self.value)


@dataclass(frozen=True)
class Recorded:
    """Samples from a CSV table, whose times are those of the trajectory."""

    file: str = text("path of the CSV file, relative to the trajectory file")

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class _Framed:
    frame: str = choice(WRENCH_FRAMES, "along whose axes `fx fy fz mx my mz` are given")


@dataclass(frozen=True)
class WrenchPolynomial(_Framed):
    """From one wrench to another: all derivatives up to (degree-1)/2 vanish at both ends."""

    degree: int = integer("degree of the polynomial, odd, 3 to 15", check=_WRENCH_DEGREE)
    start: tuple[float, ...] = vector(6, units.WRENCH, "wrench at the start, `[fx, fy, fz, mx, my, mz]`")
    end: tuple[float, ...] = vector(6, units.WRENCH, "wrench at the end")

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.RestToRest(
            signal=profiles.WRENCH, span=span, degree=self.degree, start=self.start, end=self.end
        )


@dataclass(frozen=True)
class WrenchConstant(_Framed):
    """The same wrench all the time."""

    value: tuple[float, ...] = vector(6, units.WRENCH, "wrench all the time, `[fx, fy, fz, mx, my, mz]`")

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.Constant(signal=profiles.WRENCH, span=span, value=self.value)


@dataclass(frozen=True)
class RecordedWrench(Recorded, _Framed):
    """Samples from a CSV table with the columns fx, fy, fz, mx, my, mz."""


PositionCourse: TypeAlias = PositionPolynomial | PositionConstant | Recorded
StiffnessCourse: TypeAlias = StiffnessPolynomial | StiffnessConstant | Recorded
WrenchCourse: TypeAlias = WrenchPolynomial | WrenchConstant | RecordedWrench


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
    position: PositionCourse = value(
        OneOf({"polynomial": PositionPolynomial, "constant": PositionConstant, "csv": Recorded}),
        "motion of the joints",
    )
    stiffness: StiffnessCourse = value(
        OneOf({"polynomial": StiffnessPolynomial, "constant": StiffnessConstant, "csv": Recorded}),
        "stiffness of the joints",
    )
    wrench: WrenchCourse | None = value(
        OneOf({"polynomial": WrenchPolynomial, "constant": WrenchConstant, "csv": RecordedWrench}),
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


def load_trajectory(path: str | os.PathLike[str], robot: Robot) -> Trajectory:
    """Read a trajectory for a robot from a YAML file, or from a CSV file with position and stiffness.

    Raises:
        InputError: with every problem of the file, each with its line.
    """
    if Path(path).suffix.lower() == ".csv":
        return recorded_trajectory(path, robot.joint_names)
    members = dict(zip(robot.joint_names, robot.joint_types, strict=True))
    document, source = read_document(path, TrajectoryFile, FORMAT, members)
    recordings = _read_recordings(document, Path(path).parent, robot)
    times = _times(document, recordings)
    recorded = {profile.signal: profile for recording in recordings for profile in recording.profiles}
    return Trajectory(
        times,
        _profile(document.position, profiles.POSITION, times, recorded),
        _profile(document.stiffness, profiles.STIFFNESS, times, recorded),
        wrench=_wrench(document.wrench, times, recorded),
        name=document.name,
        warnings=[warning for recording in recordings for warning in recording.warnings],
        sources=[source, *(recording.source for recording in recordings)],
    )


def _read_recordings(document: TrajectoryFile, folder: Path, robot: Robot) -> list[Recording]:
    """Each CSV file once, for the signals that are wanted from it; all with the times of the first."""
    wanted: dict[Path, list[Signal]] = defaultdict(list)
    for signal, file in document.recorded.items():
        wanted[folder / file].append(signal)
    recordings = [read_recording(file, robot.joint_names, signals) for file, signals in wanted.items()]
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
