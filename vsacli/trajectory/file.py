"""Trajectory files: `vsacli-trajectory/1`, or a bare CSV table of samples."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, make_dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

from vsacli.base import file_formats, units
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InputError, Problem, check_path
from vsacli.base.progress import Progress, unseen
from vsacli.base.signals import COMMANDED, POSITION, WRENCH, WRENCHES, Signal, wrench_on
from vsacli.documents.fields import POSITIVE, REQUIRED, ItemsByName, Name, number, value
from vsacli.documents.reading import ChangeError, Changes, apply_changes, format_changes, read_document
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.record_values import numbers_in_record
from vsacli.documents.source import Source, is_table
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.model import Robot, check_robot
from vsacli.trajectory.curves.closed_form import Declaration, Formula, Recorded, Use, declared_as
from vsacli.trajectory.devices import set_uncommanded_dampers
from vsacli.trajectory.plausibility import trajectory_findings
from vsacli.trajectory.profile import Profile, WrenchProfile
from vsacli.trajectory.times import Times, UniformTimes
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.trajectory.fits import FitChoice
    from vsacli.trajectory.recorded.recording import RecordedSignals

DEFAULT_RATE = 1000.0


@dataclass(frozen=True)
class TrajectoryFile(DeclaredRecord):
    """The content of a trajectory file.

    The declaration of each signal is an attribute named by its key; see `trajectory_file_class`.
    """

    name: str = value(Name(), "name of the trajectory")
    duration: float | None = number(
        units.TIME,
        "duration; absent if a signal is recorded; else required, unless it follows from the times "
        "of via points or from the parts of a sequence",
        check=POSITIVE,
        default=None,
    )
    rate: float | None = number(
        units.RATE,
        f"sampling rate, {DEFAULT_RATE:g} by default; a recorded signal is taken at its own times without "
        "this key, and at equally spaced ones with it; for a recording without times, rate of its rows",
        check=POSITIVE,
        default=None,
    )
    slow_down: float = number(
        units.DIMENSIONLESS,
        "factor by which the motion is slower than declared and recorded here; it does not change the "
        "`rate` at which a fit is taken",
        check=POSITIVE,
        default=1.0,
    )

    untaken: ClassVar[tuple[Signal, ...]] = ()
    """Signals of devices that are on no joint of the robot."""

    tools: ClassVar[tuple[str, ...] | None] = None
    """Names of the robot's tools; None if the robot is unknown."""

    def _problems(self) -> Iterator[FieldProblem]:
        yield from (*self._time_problems(), *self._device_problems(), *self._wrench_problems())

    @property
    def declared(self) -> dict[Signal, Declaration]:
        """Declarations of the signals that have one."""
        signals = (POSITION, *COMMANDED.values(), WRENCH)
        declarations = {signal: getattr(self, signal.key) for signal in signals}
        by_tool: tuple[Declaration, ...] = getattr(self, WRENCHES) or ()
        tools = self.tools or tuple(each.name for each in by_tool)
        declarations |= {
            wrench_on(each.name, tools.index(each.name)): each for each in by_tool if each.name in tools
        }
        return {
            signal: declaration for signal, declaration in declarations.items() if declaration is not None
        }

    @property
    def recorded(self) -> dict[Signal, Recorded]:
        """Declarations of the recorded signals."""
        return {signal: each for signal, each in self.declared.items() if isinstance(each, Recorded)}

    @property
    def formulas(self) -> dict[Signal, Formula]:
        """Declarations of the signals that are not recorded."""
        return {signal: each for signal, each in self.declared.items() if isinstance(each, Formula)}

    @property
    def lasts(self) -> float | None:
        """Duration, s, as given or as it follows from a formula; None if undetermined."""
        durations = (self.duration, *(formula.lasts for formula in self.formulas.values()))
        return next((duration for duration in durations if duration is not None), None)

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """Yield the problems of formulas that cannot last this long, in s."""
        for signal, formula in self.formulas.items():
            path = signal.key.split(".")
            yield from (problem.inside(*path) for problem in formula.problems_over(duration))

    def _wrench_problems(self) -> Iterator[FieldProblem]:
        """Yield the problems of wrenches on tools that the robot does not have, or that are not named."""
        declarations: tuple[Declaration, ...] = getattr(self, WRENCHES) or ()
        key = WRENCH.key if getattr(self, WRENCH.key) else WRENCHES
        if declarations and key == WRENCH.key:
            yield FieldProblem((key,), f"give `{key}` or `{WRENCHES}`, not both")
        elif self.tools == () and (declarations or key == WRENCH.key):
            yield FieldProblem((key,), "the robot has no tools; name them by `tools` in its file")
        elif self.tools is not None and len(self.tools) > 1 and key == WRENCH.key:
            example = f"{WRENCHES}: {{{self.tools[0]}: {{type: ..., frame: ..., ...}}}}"
            yield FieldProblem((key,), f"the robot has the tools {', '.join(self.tools)}; give `{example}`")
        elif self.tools is not None:
            for each in declarations:
                if each.name not in self.tools:
                    suggestion = did_you_mean(each.name, self.tools)
                    yield FieldProblem((key, each.name), f"the robot has no tool {each.name!r}{suggestion}")

    def _device_problems(self) -> Iterator[FieldProblem]:
        for signal in self.declared:
            if signal in self.untaken:
                yield FieldProblem(
                    (signal.key,), f"no joint of the robot has a {signal.device}; leave it out"
                )

    def _time_problems(self) -> Iterator[FieldProblem]:
        if self.recorded:
            if self.duration is not None:
                yield FieldProblem(("duration",), "the times come from the CSV file; leave this key out")
        elif self.lasts is None:
            yield FieldProblem((), "missing key 'duration' (s)")
        else:
            try:
                UniformTimes(self.lasts * self.slow_down, self.rate or DEFAULT_RATE)
            except InputError as error:
                yield FieldProblem((self._longest,), str(error))
            else:
                yield from self.problems_over(self.lasts)

    @property
    def _longest(self) -> str:
        """Key that is the likely reason for too many samples: of duration and rate the larger one."""
        if self.slow_down != 1:
            return "slow_down"
        return "rate" if self.rate is not None and self.rate > (self.lasts or 0) else "duration"


@cache
def trajectory_file_class(
    taken: frozenset[str],
    *,
    rigid: bool,
    untaken: tuple[Signal, ...] = (),
    tools: tuple[str, ...] | None = None,
) -> type[TrajectoryFile]:
    """Return the class of trajectory files for joints that need these signals.

    With another class for each file, `load_trajectory` of a 7R takes 1.7 times as long.

    Args:
        taken: keys of the signals that command some joint. They are required, except those of devices.
        rigid: whether all joints are rigid.
        untaken: signals of devices that are on no joint. They must be absent.
        tools: names of the robot's tools; None for an unknown robot, which has those of the file.
    """
    fields = {POSITION.key: value(declared_as(Use(POSITION, rigid)), POSITION.meaning)}
    for key, signal in COMMANDED.items():
        is_required = key in taken and signal.device is None
        meaning = signal.meaning + ("; may be absent if there are none" if is_required else "")
        fields[key] = value(declared_as(Use(signal)), meaning, default=REQUIRED if is_required else None)
    fields[WRENCH.key] = value(declared_as(Use(WRENCH)), WRENCH.meaning, default=None)
    by_tool = ItemsByName(declared_as(Use(WRENCH, by_tool=True)), "tool")
    meaning = "wrenches by tool, for a robot with several: each as `wrench`, with its own frame"
    fields[WRENCHES] = value(by_tool, meaning, default=None)
    signal_fields = [(name, Any, field) for name, field in fields.items()]
    namespace = {"__doc__": TrajectoryFile.__doc__, "untaken": untaken, "tools": tools}
    return make_dataclass(
        "TrajectoryFile", signal_fields, bases=(TrajectoryFile,), namespace=namespace, frozen=True
    )


OF_ANY_ROBOT = trajectory_file_class(frozenset(), rigid=True)
"""Class of trajectory files for an unknown robot: accepts a file that some robot accepts."""


def load_trajectory(
    path: str | os.PathLike[str],
    robot: Robot,
    changes: Changes = MappingProxyType({}),
    *,
    progress: Progress = unseen,
) -> Trajectory:
    """Read a trajectory for a robot from a YAML file, or from a CSV file with position and stiffness.

    Args:
        path: path of the file.
        robot: robot that executes the trajectory.
        changes: values that override those of a YAML file, by path, e.g. `{"duration": 2}`; stored in
            results.
        progress: function that opens a progress bar over the samples of all components of a recorded signal,
            e.g. `lambda samples: tqdm(total=samples)`; fitting splines to millions of samples takes seconds.

    Raises:
        InputError: the file has problems; lists each with its line.
        TypeError: path or robot is of another type.
    """
    check_path(path, "load_trajectory(path, robot)")
    check_robot(robot)
    return _add_device_signals(declared_trajectory(path, robot, changes, progress), robot)


def read_trajectory(path: str | os.PathLike[str], joints: CommandedJoints) -> tuple[TrajectoryFile, Source]:
    """Read a YAML trajectory file for joints.

    Raises:
        InputError: the file has problems; lists each with its line.
    """
    cls = trajectory_file_class(
        joints.commanding_signals,
        rigid=joints.rigid,
        untaken=joints.absent_device_signals,
        tools=joints.tools,
    )
    return read_document(path, cls, file_formats.TRAJECTORY, joints.types, joints.exempt)


def declared_trajectory(
    path: str | os.PathLike[str],
    robot: Robot,
    changes: Changes = MappingProxyType({}),
    progress: Progress = unseen,
) -> Trajectory:
    """Return a trajectory as declared in its file, without signals of uncommanded devices.

    Except for its warnings, it is the same for all robots with the same `CommandedJoints`.

    Args:
        path: see `load_trajectory`.
        robot: see `load_trajectory`.
        changes: see `load_trajectory`.
        progress: see `load_trajectory`.

    Raises:
        InputError: the file has problems; lists each with its line.
    """
    joints = CommandedJoints.of(robot)
    if is_table(path):
        from vsacli.trajectory.recorded.recording import recorded_trajectory

        return recorded_trajectory(path, joints, progress, _rate_of_table(path, changes))
    document, source = apply_changes(*read_trajectory(path, joints), changes, joints.types, joints.exempt)
    recordings = _read_recordings(document, Path(path).parent, joints, progress)
    with _blaming_change(changes, "rate"):
        declared_times = _declared_times(document, recordings, source.path)
    if recordings:
        _check_lasting(document, declared_times, source.path, joints.names)
    times, profiles = _stretch_profiles(
        document.slow_down, declared_times, _declared_profiles(document, declared_times, recordings)
    )
    motion = profiles[POSITION.key] if POSITION in document.formulas else None
    numbers = tuple(numbers_in_record(document, joints.types))
    return Trajectory(
        times,
        profiles[POSITION.key],
        profiles,
        wrench=_declared_wrench(document, profiles, joints),
        name=document.name,
        warnings=[
            *(warning for recording in recordings for warning in recording.warnings),
            *_formula_warnings(document, declared_times, joints),
            *trajectory_findings(robot, numbers, times, motion, source),
        ],
        notes=[
            *(note for recording in recordings for note in recording.notes),
            *_formula_notes(document, declared_times),
        ],
        sources=[source, *(recording.source for recording in recordings)],
    )


def _rate_of_table(path: str | os.PathLike[str], changes: Changes) -> float | None:
    """Return the sample rate, 1/s, that changes give to a table; nothing else of a table can be changed.

    Raises:
        ChangeError: something else is changed, or the rate is not valid.
    """
    if other_changes := {key: value for key, value in changes.items() if key != "rate"}:
        reason = f"{os.fspath(path)} is a CSV table, whose rate alone can be set"
        raise ChangeError.of(
            format_changes(other_changes)[0], f"{reason}; name it in a YAML trajectory and set its keys"
        )
    if not changes:
        return None
    from vsacli.documents.columns_file import parse_rate

    with _blaming_change(changes, "rate"):
        return parse_rate(changes["rate"])


@contextmanager
def _blaming_change(changes: Changes, path: str) -> Iterator[None]:
    """Raise errors of a value as errors of its change, if it was changed."""
    try:
        yield
    except InputError as error:
        if path not in changes:
            raise
        problems = [each._replace(file="", line=0) for each in error.problems]
        raise ChangeError(problems, format_changes({path: changes[path]})[0]) from None


def _add_device_signals(trajectory: Trajectory, robot: Robot) -> Trajectory:
    try:
        return set_uncommanded_dampers(trajectory, robot)
    except InputError as error:
        raise InputError.one(str(error), trajectory.sources[0].path) from None


def _read_recordings(
    document: TrajectoryFile, folder: Path, joints: CommandedJoints, progress: Progress
) -> list[RecordedSignals]:
    """Read each CSV file once, for all signals declared from it; check that all files have equal times."""
    if not document.recorded:
        return []
    from vsacli.documents.column_mapping import ColumnMapping
    from vsacli.trajectory.recorded.recording import read_recorded_signals

    fits_by_file: dict[Path, dict[Signal, FitChoice]] = defaultdict(dict)
    mappings: dict[Path, ColumnMapping] = defaultdict(lambda: ColumnMapping(rate=document.rate))
    for signal, declaration in document.recorded.items():
        file = folder / declaration.file
        fits_by_file[file][signal] = declaration.fit_choice
        mappings[file] = mappings[file].combined_with(declaration.mapping)

    resampled, unwrap = document.rate is not None, getattr(document.recorded.get(POSITION), "unwrap", False)
    recordings = [
        read_recorded_signals(
            file, joints, fits, mappings[file], resampled=resampled, unwrap=unwrap, progress=progress
        )
        for file, fits in fits_by_file.items()
    ]
    for other in recordings[1:]:
        recordings[0].check_times(other)
    return recordings


def _declared_times(document: TrajectoryFile, recordings: Sequence[RecordedSignals], file: str) -> Times:
    if recordings:
        return recordings[0].times_at(document.rate, file)
    assert document.lasts is not None, "see TrajectoryFile"
    return UniformTimes(document.lasts, document.rate or DEFAULT_RATE)


def _declared_profiles(
    document: TrajectoryFile, times: Times, recordings: Sequence[RecordedSignals]
) -> dict[str, Profile]:
    """Return the profiles by signal key, at the declared pace."""
    first, last = times.span
    formulas = {
        signal.key: each.profile_over((0.0, last - first)) for signal, each in document.formulas.items()
    }
    return {**formulas, **{each.signal.key: each for one in recordings for each in one.profiles}}


def _declared_wrench(
    document: TrajectoryFile, profiles: Mapping[str, Profile], joints: CommandedJoints
) -> WrenchProfile | None:
    """Return the wrenches on the tools; None without any."""
    declarations = {signal: each for signal, each in document.declared.items() if signal.components}
    if not declarations:
        return None
    frames = dict.fromkeys(joints.wrenches.values()) | {
        signal: each.frame for signal, each in declarations.items()
    }
    frame = next(iter(declarations.values())).frame if len(joints.tools) == 1 else tuple(frames.values())
    return WrenchProfile({signal: profiles[signal.key] for signal in declarations}, frame)


def _stretch_profiles(
    factor: float, times: Times, profiles: dict[str, Profile]
) -> tuple[Times, dict[str, Profile]]:
    if factor == 1:
        return times, profiles
    return times.stretched(factor), {key: each.stretched(factor) for key, each in profiles.items()}


def _check_lasting(document: TrajectoryFile, times: Times, file: str, joint_names: Sequence[str]) -> None:
    """Raise an error if formulas cannot last as long as the recording, whose duration is not in the file."""
    first, last = times.span
    problems = list(document.problems_over(last - first))
    if problems:
        raise InputError(Problem(file, 0, problem.in_file(joint_names)) for problem in problems)


def _formula_warnings(document: TrajectoryFile, times: Times, joints: CommandedJoints) -> Iterator[str]:
    for signal, formula in document.formulas.items():
        for warning in formula.warnings_over(times.span, joints.types):
            yield f"{signal.key}: {warning}"


def _formula_notes(document: TrajectoryFile, times: Times) -> Iterator[str]:
    for signal, formula in document.formulas.items():
        yield from (f"{signal.key}: {note}" for note in formula.notes_over(times.span))
