"""Identification of a robot's parameters from recordings, and the robot file with the result.

Motors are identified joint by joint, then all links together with the torque of their springs. Checks of the
recordings and explanations of the residuals decide the verdict.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from vsacli.base.errors import InputError
from vsacli.base.progress import Countdown, Progress, unseen
from vsacli.base.texts import listed
from vsacli.base.wrench import WRENCH_NAMES, wrench_columns
from vsacli.documents.columns_file import load_columns
from vsacli.documents.edited import edited, moved_files, texts_at, unaliased, with_errors
from vsacli.robot.file import text_to_change
from vsacli.robot.model import Robot, check_robot
from vsacli.robot.modified_dh import modified_link
from vsacli.robot.parameters import JOINTS, parameters
from vsacli.studies.identification.conditioning import (
    ConditionedRecording,
    bandwidth_bounds,
    bandwidth_of,
    conditioned,
)
from vsacli.studies.identification.consistent_links import ConsistentLinks, doubts_of, found_links
from vsacli.studies.identification.explanations import Explanation, explanation
from vsacli.studies.identification.fitted_system import Solution, fit_system
from vsacli.studies.identification.identification_report import (
    OK,
    POOR_FIT,
    UNIDENTIFIABLE,
    UNRELIABLE,
    Identification,
    system_report,
    torque_comparisons,
    torque_deviations,
)
from vsacli.studies.identification.identification_text import (
    Number,
    RecordReport,
    Residual,
    SystemReport,
    far_from_file,
    rounded_by_error,
)
from vsacli.studies.identification.link_equations import link_system, without_links
from vsacli.studies.identification.motor_equations import (
    FRICTION,
    GROUPS,
    LINKS,
    SPRINGS,
    check_fit,
    describe_lack,
    motor_systems,
    unknowns,
    values_of_sums,
    with_friction,
)
from vsacli.studies.identification.recording_checks import (
    Delay,
    Gain,
    delay,
    gain_findings,
    model_doubts,
    without_delay,
)
from vsacli.studies.identification.recordings import (
    Record,
    check_distinct,
    complete_joints,
    read_motor_recording,
)

WORDS = (*GROUPS, LINKS)
"""Names of the groups of parameters."""

PUSHED = "links are not identified, since a wrench acts on {}"

ABOVE_NOISE, ABOVE_TORQUE = 2.0, 0.01
"""Ratios of residual to noise and of residual to torque; beyond both, the equations do not hold: the residual
is then more than sensor noise, and more than a good friction model leaves."""


def identify(
    robot: Robot,
    recordings: str | Path | Sequence[str | Path],
    fit: Sequence[str] = WORDS,
    bandwidth: float | None = None,
    columns: str | Path | None = None,
    *,
    progress: Progress = unseen,
) -> Identification:
    """Identify parameters of a robot from recordings of its motion.

    Args:
        robot: robot with initial values of the parameters.
        recordings: CSV files with a column `time` and columns named as by `vsacli export`: positions of
            joints and motors, and motor torques or currents; cells may be empty.
        fit: parameters to identify: words of `WORDS`, or patterns of paths such as
            `joints.elbow.actuator.spring.*`.
        bandwidth: bandwidth of the filter, Hz; chosen for each recording if None.
        columns: file that maps other column names.
        progress: shows the progress over the systems of equations, each of which is reported and explained.

    Raises:
        InputError: a recording cannot be used, or `fit` matches no parameter.
    """
    check_robot(robot)
    check_fit(robot, fit, WORDS)
    records = _read_all_recordings(robot, recordings, columns)
    complete_indices = {joint for record in records for joint in complete_joints(robot, record)}
    joints = [
        joint for joint in sorted(complete_indices) if not robot.joints[joint].damper_at("transmission")
    ]
    conditioned_recordings = [_condition_record(record, bandwidth) for record in records]
    tools_by_path = {each.path: tools for each in records if (tools := _pushed_tools(robot, each))}
    if LINKS not in fit and all(robot.joints[index].actuator.sprung for index in joints):
        tools_by_path = {}
    robot_with_friction = with_friction(robot, joints) if FRICTION in fit else robot
    first_solutions = solutions(
        robot_with_friction, joints, fit, conditioned_recordings, pushed=bool(tools_by_path)
    )
    notes = list(_identification_notes(robot, joints, fit, conditioned_recordings, records, tools_by_path))
    if not first_solutions:
        has_unknowns = any(unknowns(robot_with_friction, index, fit) for index in joints)
        failure = "nothing can be identified" if has_unknowns else describe_lack(robot, joints, fit)
        raise InputError.one(f"{failure} ({'; '.join(notes)})" if notes else failure)
    delays = [delay(first_solutions, each) for each in conditioned_recordings]
    conditioned_recordings, are_delays_removed = _without_delays(conditioned_recordings, delays)
    final_solutions = (
        solutions(robot_with_friction, joints, fit, conditioned_recordings, pushed=bool(tools_by_path))
        if are_delays_removed
        else first_solutions
    )
    with progress(2 * len(final_solutions)) as bar:
        systems = Countdown(bar.update, 2 * len(final_solutions))
        reports = tuple(
            _count_results(
                systems, (system_report(robot, each, conditioned_recordings) for each in final_solutions)
            )
        )
        doubts = [
            tuple(model_doubts(robot, joints, *each))
            for each in zip(records, conditioned_recordings, strict=True)
        ]
        gains, explanations = [], []
        if not any(doubts):
            gains = gain_findings(
                robot_with_friction,
                joints,
                [each for each in final_solutions if each.system.title != LINKS],
                conditioned_recordings,
            )
            explanations = list(
                _count_results(
                    systems, _explanations(robot, final_solutions, reports, conditioned_recordings, gains)
                )
            )
        systems.finish()
    links = next(
        (found_links(robot_with_friction, each) for each in final_solutions if each.system.title == LINKS),
        None,
    )
    motor_solutions = (each for each in final_solutions if each.system.title != LINKS)
    sum_values = {path: value for each in motor_solutions for path, value in values_of_sums(each).items()}
    fitted = _identified_robot(robot, robot_with_friction, reports, links, sum_values)
    record_reports = tuple(map(_record_report, records, conditioned_recordings, delays, doubts))
    implausible_values = far_from_file(number for report in reports for number in report.numbers)
    return Identification(
        robot=robot.name,
        verdict=UNRELIABLE
        if implausible_values
        else _verdict(reports, record_reports, links, explanations, gains),
        records=record_reports,
        systems=reports,
        notes=(
            *implausible_values,
            *notes,
            *(() if links is None else doubts_of(links)),
            *(sentence for each in explanations for sentence in each.sentences),
            *(each.sentence for each in gains),
        ),
        fitted=fitted,
        deviations=torque_deviations(fitted, final_solutions, conditioned_recordings),
        torques=tuple(torque_comparisons(robot, final_solutions, records, conditioned_recordings)),
        sources=(*robot.sources, *(each.source for each in records)),
    )


_Result = TypeVar("_Result")


def _pushed_tools(robot: Robot, record: Record) -> str:
    """Return the tools on which a wrench is recorded, joined; "" if there are none."""
    tools = robot.tool_names
    words = {tool: wrench_columns(f"{tool}.{WRENCH_NAMES[0]}") for tool in tools}
    words["the end effector" if len(tools) == 1 else "a tool"] = wrench_columns(WRENCH_NAMES[0])
    return " and ".join(tool for tool, each in words.items() if not set(each).isdisjoint(record.unused))


def _count_results(systems: Countdown, results: Iterable[_Result]) -> Iterator[_Result]:
    """Yield the results, and count each when it is there."""
    for result in results:
        systems.count()
        yield result


def _without_delays(
    recordings: Sequence[ConditionedRecording], delays: Sequence[Delay]
) -> tuple[list[ConditionedRecording], bool]:
    """Return signals without their significant delays, and whether any delay was removed."""
    has_delay = [by.matters(each.rate) for each, by in zip(recordings, delays, strict=True)]
    recordings_with_delays = zip(recordings, delays, has_delay, strict=True)
    return [
        without_delay(each, by.seconds) if matters else each for each, by, matters in recordings_with_delays
    ], any(has_delay)


def _read_all_recordings(
    robot: Robot, recordings: str | Path | Sequence[str | Path], columns: str | Path | None
) -> list[Record]:
    """Read all recordings.

    Raises:
        InputError: there is none, one cannot be used, or two are identical.
    """
    paths = [recordings] if isinstance(recordings, str | Path) else list(recordings)
    if not paths:
        raise InputError.one("identification needs at least 1 recording")
    mapping = load_columns(columns)
    records = [read_motor_recording(robot, path, mapping) for path in paths]
    check_distinct(records)
    return records


def _condition_record(record: Record, bandwidth: float | None) -> ConditionedRecording:
    """Return a recording filtered and differentiated.

    Raises:
        InputError: the requested bandwidth does not fit the recording.
    """
    chosen_bandwidth = bandwidth_of(record.time, record.q, record.theta) if bandwidth is None else bandwidth
    min_bandwidth, max_bandwidth = bandwidth_bounds(record.time)
    if not min_bandwidth <= chosen_bandwidth <= max_bandwidth:
        raise InputError.one(
            f"the bandwidth must be between {min_bandwidth:.3g} and {max_bandwidth:.4g} Hz for {record.path} "
            f"({1 / (record.time[1] - record.time[0]):.4g} Hz), not {chosen_bandwidth:g}"
        )
    return conditioned(record.time, record.q, record.theta, record.tau_motor, chosen_bandwidth)


def solutions(
    robot: Robot,
    joints: Sequence[int],
    fit: Sequence[str],
    recordings: Sequence[ConditionedRecording],
    *,
    pushed: bool = False,
) -> list[Solution]:
    """Solve for motors joint by joint, then for all links with the torques of their springs.

    Args:
        robot: robot with initial values.
        joints: indices of the recorded joints.
        fit: see `identify`.
        recordings: conditioned recordings.
        pushed: whether a wrench acts on the end effector, so that links have no equations.
    """
    motors = [fit_system(system, recordings) for system in motor_systems(robot, joints, fit, recordings)]
    links = link_system(robot, fit, motors, links=LINKS in fit, joints=joints)
    if pushed or not links.names or without_links(robot, joints, links, recordings):
        return motors
    return [*motors, fit_system(links, recordings)]


def _verdict(
    systems: Sequence[SystemReport],
    records: Sequence[RecordReport],
    links: ConsistentLinks | None,
    explanations: Sequence[Explanation],
    gains: Sequence[Gain],
) -> str:
    residuals = [each for system in systems for each in system.residuals]
    if any(record.doubts for record in records) or any(each.unreliable for each in gains):
        return UNRELIABLE
    is_consistent = all(system.converged for system in systems) and (links is None or links.within)
    if any(map(_is_poor_fit, residuals)) or not is_consistent or any(each.matters for each in explanations):
        return POOR_FIT
    numbers = (number for system in systems for number in system.numbers)
    return OK if all(number.identifiable for number in numbers) else UNIDENTIFIABLE


def _is_poor_fit(residual: Residual) -> bool:
    max_residual = max(residual.residual, residual.held_out if np.isfinite(residual.held_out) else 0.0)
    noise = residual.noise if np.isfinite(residual.noise) else 0.0
    return max_residual > max(ABOVE_NOISE * noise, ABOVE_TORQUE * residual.torque)


def _record_report(
    record: Record, recording: ConditionedRecording, delay: Delay, doubts: tuple[str, ...]
) -> RecordReport:
    return RecordReport(
        path=record.path,
        duration=float(recording.time[-1] - recording.time[0]),
        rate=recording.rate,
        bandwidth=recording.filter.bandwidth,
        delay=delay.seconds,
        delay_error=delay.standard_error,
        corrected=delay.matters(recording.rate),
        doubts=(*record.doubts, *doubts),
        unused=record.unused,
    )


def _identification_notes(
    robot: Robot,
    joints: Sequence[int],
    fit: Sequence[str],
    recordings: Sequence[ConditionedRecording],
    records: Sequence[Record],
    tools_by_path: Mapping[str, str],
) -> Iterator[str]:
    unrecorded_names = [joint.name for index, joint in enumerate(robot.joints) if index not in joints]
    damped_names = [joint.name for joint in robot.joints if joint.damper_at("transmission")]
    if unrecorded_names := [name for name in unrecorded_names if name not in damped_names]:
        whose = "its" if len(unrecorded_names) == 1 else "their"
        sentence = f"no columns of {', '.join(unrecorded_names)}: {whose} parameters are not identified"
        yield f"{sentence}{_ignored_columns_clause(records)}"
    if damped_names:
        names = ", ".join(damped_names)
        yield (
            f"the parameters of {names} are not identified: the torque of the damper parallel to the springs "
            "is unknown"
        )
    yield from (f"{path}: {PUSHED.format(tools)}" for path, tools in tools_by_path.items())
    system = link_system(robot, fit, links=LINKS in fit, joints=joints)
    if tools_by_path or not system.names:
        return
    if reason := without_links(robot, joints, system, recordings):
        yield reason
    elif not system.bodies:
        yield "parameters of joints are identified with the links of the file, which are assumed to be exact"
    elif SPRINGS not in fit and any(each.sprung for each in robot.actuators):
        yield "links are identified with the springs of the file, which are assumed to be exact"


MAX_IGNORED_COLUMNS = 5
"""Largest number of ignored columns that a note names."""


def _ignored_columns_clause(records: Sequence[Record]) -> str:
    """Return a clause with the columns that were not used, which may be misnamed ones; "" without any."""
    unused = list(dict.fromkeys(column for record in records for column in record.unused))
    if not unused:
        return ""
    return f"; ignored columns: {listed(unused, MAX_IGNORED_COLUMNS)}"


def _explanations(
    robot: Robot,
    solutions: Sequence[Solution],
    reports: Sequence[SystemReport],
    recordings: Sequence[ConditionedRecording],
    gains: Sequence[Gain],
) -> Iterator[Explanation]:
    """Yield explanations of the residuals."""
    # links are identified from the torque of springs, so a fault of the springs would be explained twice
    explanations: list[Explanation] = []
    for solution, report in zip(solutions, reports, strict=True):
        are_springs_wrong = any(each.matters for each in explanations) or any(
            each.unreliable for each in gains
        )
        if solution.system.title != LINKS or not are_springs_wrong:
            fails = any(map(_is_poor_fit, report.residuals))
            explanations.append(explanation(robot, solution, recordings, fails=fails))
            yield explanations[-1]


def _identified_robot(
    robot: Robot,
    robot_with_friction: Robot,
    systems: Sequence[SystemReport],
    links: ConsistentLinks | None,
    sum_values: Mapping[str, float],
) -> Robot:
    values = {each.path: each.value for each in to_write(robot, systems)} | dict(sum_values)
    fitted = robot_with_friction.replace(values | ({} if links is None else dict(links.parts)))
    if links is None or not links.links:
        return fitted
    joints = map(lambda joint, link: dataclasses.replace(joint, link=link), fitted.joints, links.links)
    return dataclasses.replace(fitted, joints=tuple(joints))


ZERO_PARAMETER = 1e-9
"""Size of link parameters, SI units, below which they are rounding errors."""


def to_write(robot: Robot, systems: Iterable[SystemReport]) -> Iterator[Number]:
    """Yield the identified parameters of the robot file, and changed friction that the file lacks."""
    file_paths = set(map(str, parameters(robot)))
    for number in (number for system in systems for number in system.numbers):
        if number.identifiable and not number.sum and (number.path in file_paths or number.changed):
            yield number


ERROR_DIGITS_RATIO = 100.0
"""Ratio of standard errors to those of which two digits are written: errors of parameters go together, and
torques are determined better than each parameter alone."""


def fitted_text(robot: Robot, identification: Identification, folder: str | Path) -> str:
    """Return the text of the robot's file with the identified parameters and their standard errors.

    Everything else, comments included, remains as the user wrote it; paths still refer to the same files.
    Identified friction is inserted if the file has none.

    Args:
        robot: robot as read from its file.
        identification: result of the identification.
        folder: folder of the new file.

    Raises:
        InputError: the robot was not read from a file.
    """
    source_text, source_folder = text_to_change(robot)
    file_paths = set(map(str, parameters(robot)))
    fitted_values = {str(each): each.value for each in parameters(identification.fitted)}
    values: dict[str, Any] = {}
    errors: dict[str, str] = {}
    for number in to_write(robot, identification.systems):
        path = _path_in_text(robot, number.path)
        value = fitted_values.get(number.path, number.value)
        value = float(rounded_by_error(value, number.standard_error / ERROR_DIGITS_RATIO, math.inf))
        errors[path] = f"{number.standard_error:.2g}"
        if fitted_values.get(number.path, number.value) == number.before:
            continue
        if number.path in file_paths:
            values[path] = value
        else:
            parent, _, key = path.rpartition(".")
            values.setdefault(parent, {"coulomb": 0.0})[key] = value
    values |= dict(_changed_parts(robot, identification.fitted, {*values, *errors}))
    values |= _changed_links(robot, identification.fitted, source_text)
    files = dict(moved_files(source_text, source_folder, Path(folder)))
    text = edited(unaliased(source_text, values), {**values, **files})
    return with_errors(text, errors)


def _path_in_text(robot: Robot, path: str) -> str:
    """Return the path of a parameter of a joint as the text of the robot has it, with the joint's index."""
    _, joint, *rest = path.split(".")
    return ".".join((JOINTS, str(robot.joint_names.index(joint)), *rest))


def _changed_parts(robot: Robot, fitted: Robot, identified: set[str]) -> Iterator[tuple[str, float]]:
    """Yield path in the text and value of parameters that changed with a sum, but are not links'."""
    values = {str(each): each.value for each in parameters(fitted)}
    for each in parameters(robot):
        path = str(each)
        changed = each.part != "link" and values.get(path, each.value) != each.value
        if changed and (text_path := _path_in_text(robot, path)) not in identified:
            yield text_path, _rounded_parameter(values[path])


def _changed_links(robot: Robot, fitted: Robot, text: str) -> dict[str, Any]:
    """Return parameters of changed links by path, in the frames of the file's convention."""
    modified = dict(texts_at(text, "convention")).get("convention") == "modified"
    changes: dict[str, Any] = {}
    for index, (joint, file_joint) in enumerate(zip(fitted.joints, robot.joints, strict=True)):
        if joint.link != file_joint.link:
            link = modified_link(joint) if modified else joint.link
            link_path = f"{JOINTS}.{index}.link"
            changes[f"{link_path}.mass"] = _rounded_parameter(link.mass)
            changes[f"{link_path}.com"] = [_rounded_parameter(each) for each in link.com]
            changes[f"{link_path}.inertia"] = {
                key: _rounded_parameter(value) for key, value in vars(link.inertia).items()
            }
    return changes


def _rounded_parameter(value: float) -> float:
    """Return a value with 7 digits, more than recordings determine, and 0 for a rounding error."""
    return 0.0 if abs(value) < ZERO_PARAMETER else float(f"{value:.7g}")
