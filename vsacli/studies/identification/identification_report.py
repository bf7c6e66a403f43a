"""The report of an identification: parameters, residuals and curves of its systems, as text and as JSON.

The standard deviations of the motor torques of the fitted robot follow from the covariance of its parameters.
The torques are those of inverse dynamics along the recorded motion with the stiffness found there, and their
derivatives by parameters are those of sensitivities. Links change torques only through base parameters, each
of which has the derivative by its first parameter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published, named
from vsacli.base.signals import STIFFNESS
from vsacli.base.tables import ReportText, TextReport, headline
from vsacli.base.texts import counted
from vsacli.base.variables import VARIABLES
from vsacli.compute.duals import value_of
from vsacli.documents.source import Source
from vsacli.robot.model import Robot
from vsacli.robot.parameters import JOINTS, parameters
from vsacli.studies.identification.conditioning import ConditionedRecording, spline_derivatives, torque_noise
from vsacli.studies.identification.estimation import Equations
from vsacli.studies.identification.fitted_system import Solution, SystemOfEquations, held_out, rms
from vsacli.studies.identification.identification_text import (
    AT_BOUND,
    INDISTINCT,
    NO_EFFECT,
    NOT_PHYSICAL,
    Number,
    RecordReport,
    Residual,
    SystemReport,
    TorqueDeviation,
    agreement_counts,
    deviation_rows,
    findings,
    parameter_rows,
    residual_rows,
    rounded_by_error,
    sum_definitions,
    use_line,
)
from vsacli.studies.identification.link_equations import LinkSystem
from vsacli.studies.identification.motor_equations import MotorSystem, joint_motion, motor_names
from vsacli.studies.identification.recording_faults import TORQUE
from vsacli.studies.identification.recordings import Record
from vsacli.studies.identification.regressor import SYMBOLS, TENSOR, derivatives_by_file
from vsacli.studies.sensitivities.slopes import derivatives_of
from vsacli.trajectory.trajectory import Motion

OK, UNIDENTIFIABLE, POOR_FIT, UNRELIABLE = "ok", "unidentifiable", "poor_fit", "unreliable"
"""Verdicts, the worst last: all parameters are identified; some are not; residuals exceed the noise; a
recording looks wrong."""


@dataclass(frozen=True)
class Torques:
    """Measured and predicted torques of a recording for a figure.

    Attributes:
        record: path of the recording.
        group: name of the motor or link.
        unit: unit of the torques.
        time, measured, predicted: times and torques at the rows of the equations, (rows,).
    """

    record: str
    group: str
    unit: str
    time: FloatArray = field(repr=False)
    measured: FloatArray = field(repr=False)
    predicted: FloatArray = field(repr=False)

    @property
    def residual(self) -> float:
        """Root mean square of measured minus predicted torque."""
        return float(np.sqrt(np.mean((self.measured - self.predicted) ** 2)))


@dataclass(frozen=True)
class Identification(Published, TextReport):
    """Parameters of a robot identified from recordings of its motion.

    Attributes:
        robot: name of the robot.
        verdict: `ok`, or the worst of `unidentifiable`, `poor_fit` and `unreliable`.
        records: properties and use of each recording.
        systems: results, joint by joint, then those of the links.
        notes: further findings, as sentences.
        fitted: robot with the identified parameters.
        deviations: uncertainty of the torques of the fitted robot, motor by motor; empty if unknown.
        torques: measured and predicted torques for figures; not in JSON.
        sources: files of the robot and the recordings, as read; not in JSON.
    """

    robot: str
    verdict: str
    records: tuple[RecordReport, ...]
    systems: tuple[SystemReport, ...]
    notes: tuple[str, ...]
    fitted: Robot = field(repr=False)
    deviations: tuple[TorqueDeviation, ...] = ()
    torques: tuple[Torques, ...] = field(repr=False, default=())
    sources: tuple[Source, ...] = field(repr=False, default=())

    format: ClassVar[str] = "vsacli-identification/2"
    shape: ClassVar = {
        "format": "format",
        **named("robot", "verdict", "records", "systems", "deviations", "notes"),
    }

    @property
    def numbers(self) -> tuple[Number, ...]:
        """Results for the parameters of all systems."""
        return tuple(number for system in self.systems for number in system.numbers)

    @property
    def title(self) -> str:
        """Name of the robot, and how many of its parameters agree with the file."""
        return (
            f"{self.robot} from {counted(len(self.records), 'recording')}: {agreement_counts(self.numbers)}"
        )

    def as_text(self, *, verbose: bool = False) -> ReportText:
        """Return the report in parts.

        Args:
            verbose: whether to add the definitions of base parameters that are sums.
        """
        lines = [*map(use_line, self.records), *sum_definitions(self.numbers, verbose=verbose)]
        return ReportText(
            headline(self.verdict, self.title),
            list(findings(self.systems, self.records, self.notes)),
            [
                parameter_rows(self.numbers, self.fitted.joint_names),
                residual_rows(self.systems),
                *([deviation_rows(self.deviations)] if self.deviations else []),
            ],
            lines,
        )


SMOOTH_CURVES = 8
"""Rows of a figure per row of the equations, whose coarse curves would have corners."""


def system_report(robot: Robot, solution: Solution, recordings: list[ConditionedRecording]) -> SystemReport:
    """Return the results and residuals of a system."""
    system, fit = solution.system, solution.fit
    path_prefix = f"{JOINTS}.{system.title}.actuator."
    names = [system.names[number].removeprefix(path_prefix) for number in solution.free]
    combinations = [
        f"only {each.words(names)} is identifiable: {rounded_by_error(each.value, each.standard_error)} "
        f"+- {each.standard_error:.2g}"
        for each in fit.inseparable
    ]
    return SystemReport(
        title=system.title,
        numbers=tuple(numbers_of(solution)),
        condition=fit.condition,
        combinations=tuple(combinations),
        residuals=tuple(_residuals(robot, solution, recordings)),
        converged=fit.converged,
    )


def numbers_of(solution: Solution) -> Iterator[Number]:
    """Yield the result of each parameter of a system."""
    system, fit = solution.system, solution.fit
    inseparable = {free_index for each in fit.inseparable for free_index, _ in each.terms}
    descriptions = zip(system.names, system.units, system.sums, strict=True)
    for index, (name, unit, sum_text) in enumerate(descriptions):
        file_value = float(system.before[index])
        if index in solution.bound:
            value, error = solution.bound[index]
            note = NOT_PHYSICAL if np.isnan(error) else "" if value == file_value else AT_BOUND
        else:
            free_index = solution.free.index(index)
            value, error = float(fit.values[free_index]), float(fit.standard_errors[free_index])
            note = INDISTINCT if free_index in inseparable else ""
            note = NO_EFFECT if free_index in fit.unexcited else note
        yield Number(name, unit, file_value, value, error, note, sum_text)


def _residuals(
    robot: Robot, solution: Solution, recordings: list[ConditionedRecording]
) -> Iterator[Residual]:
    equations = [solution.equations(each) for each in recordings]
    held_out_rms = held_out(solution, recordings)
    measured, residual, group = (
        np.concatenate(parts)
        for parts in (
            [each.measured for each in equations],
            [each.measured - each.predicted for each in equations],
            [each.group for each in equations],
        )
    )
    for name in dict.fromkeys(map(str, group)):
        row_mask = group == name
        yield Residual(
            group=name,
            unit=_unit(robot, name),
            torque=rms(measured[row_mask]),
            residual=rms(residual[row_mask]),
            noise=_group_noise(robot, name, recordings, equations),
            held_out=held_out_rms.get(name, float("nan")),
        )


def _joint_of_group(robot: Robot, group: str) -> int:
    """Return the index of the joint whose motor or link a group is."""
    return robot.joint_names.index(group.rpartition(" ")[2])


def _unit(robot: Robot, group: str) -> str:
    return VARIABLES[TORQUE].quantity.unit(robot.joint_types[_joint_of_group(robot, group)])


def _group_noise(
    robot: Robot, group: str, recordings: Sequence[ConditionedRecording], equations: Sequence[Equations]
) -> float:
    """Return the noise of a group's residual from that of torques and positions; NaN if either is unknown."""
    index = _joint_of_group(robot, group)
    motors, sprung = motor_names(robot, index), robot.joints[index].actuator.sprung
    position_noise = [each.noise()[0][each.group == group] for each in equations if each.noise is not None]
    noise = rms(np.concatenate(position_noise)) if position_noise else math.nan
    if sprung and group not in motors:  # the torque of springs follows from positions alone
        return noise
    motor = motors.index(group) if sprung else 0
    torque_noises = np.array([torque_noise(each)[index, motor] for each in recordings])
    return math.hypot(noise, rms(torque_noises[~np.isnan(torque_noises)]))


def torque_comparisons(
    robot: Robot,
    solutions: Sequence[Solution],
    records: Sequence[Record],
    recordings: Sequence[ConditionedRecording],
) -> Iterator[Torques]:
    """Yield measured and predicted torques of all recordings and systems."""
    for record, recording in zip(records, recordings, strict=True):
        stride = max(1, recording.filter.stride // SMOOTH_CURVES)
        fine_recording = recording._replace(filter=recording.filter._replace(stride=stride))
        time: FloatArray = fine_recording.time[::stride]
        for each in solutions:
            equations = each.equations(fine_recording)
            for name in dict.fromkeys(map(str, equations.group)):
                row_mask = equations.group == name
                yield Torques(
                    record=record.path,
                    group=name,
                    unit=_unit(robot, name),
                    time=time,
                    measured=equations.measured[row_mask],
                    predicted=equations.predicted[row_mask],
                )


DEVIATION_SAMPLES = 200
"""Samples of each recording at which torques are compared: ten per period of its fastest motion, or more."""

LINK_PATH_ENDS = ("mass", *(f"com.{axis}" for axis in range(3)), *(f"inertia.{entry}" for entry in TENSOR))
"""Ends of the paths of a link's parameters, in the order of `derivatives_by_file`."""


def torque_deviations(
    robot: Robot, solutions: Sequence[Solution], recordings: Sequence[ConditionedRecording]
) -> tuple[TorqueDeviation, ...]:
    """Return the largest standard deviations of each motor's torque, along the recordings and elsewhere.

    There is none unless the positions of all joints, and those of motors that set a stiffness, were recorded.

    Args:
        robot: fitted robot.
        solutions: solutions of the equations, which have the covariances.
        recordings: conditioned recordings.
    """
    has_stiffness = [STIFFNESS.key in actuator.commanded for actuator in robot.actuators]
    positions = [part for each in recordings for part in (each.q, each.theta[:, has_stiffness])]
    has_massless_link = any(joint.link.mass == 0 for joint in robot.joints)
    if (
        has_massless_link
        or any(joint.damper for joint in robot.joints)
        or any(np.isnan(e).any() for e in positions)
    ):
        return ()
    motions = [_recorded_motion(robot, each) for each in recordings]
    torque, deviation = _largest_torque_deviations(robot, solutions, motions)
    _, recombined_deviation = _largest_torque_deviations(robot, solutions, map(_recombined, motions))
    return tuple(
        TorqueDeviation(name, VARIABLES[TORQUE].quantity.unit(joint.type), *map(float, motor_values))
        for joint, *joint_values in zip(robot.joints, torque, deviation, recombined_deviation, strict=True)
        for name, *motor_values in zip(
            motor_names(robot, robot.joints.index(joint)), *joint_values, strict=False
        )
    )


def _recorded_motion(robot: Robot, recording: ConditionedRecording) -> Motion:
    """Return the motion of a recording with its stiffness."""
    stiffness = np.full_like(recording.q, np.nan)
    for index, actuator in enumerate(robot.actuators):
        if STIFFNESS.key in actuator.commanded:
            stiffness[:, index] = value_of(actuator.springs_of(joint_motion(recording, index)).stiffness)
    motion_arrays = (
        *(
            recording.time,
            recording.q,
            recording.dq,
            recording.ddq,
            *spline_derivatives(recording.time, recording.ddq),
        ),
        *(stiffness, *spline_derivatives(recording.time, stiffness)),
    )
    stride = max(1, len(recording.time) // DEVIATION_SAMPLES)
    time, q, dq, ddq, d3q, d4q, *stiffness_arrays = (each[::stride] for each in motion_arrays)
    return Motion(time, q, dq, ddq, d3q, d4q, dict(zip(STIFFNESS.names, stiffness_arrays, strict=True)))


def _recombined(motion: Motion) -> Motion:
    """Return a motion with positions, velocities, and so on, that occur in another one at other times."""
    random = np.random.default_rng(0)
    shuffled = {name: random.permuted(each, axis=0) for name, each in motion.of_joints.items()}
    return Motion.of(motion.time, shuffled)


def _largest_torque_deviations(
    robot: Robot, solutions: Sequence[Solution], motions: Iterable[Motion]
) -> tuple[FloatArray, FloatArray]:
    """Return the largest motor torques and their largest standard deviations, (joints, 2)."""
    weights = [
        [_derivatives_of_file(robot, each.system, number) for number in each.free] for each in solutions
    ]
    run_parameters = parameters(robot, list({path: None for each in weights for one in each for path in one}))
    index_of_path = {str(each): at for at, each in enumerate(run_parameters)}
    magnitudes, deviations = [], []
    for motion in motions:
        part = derivatives_of(robot, motion, run_parameters)
        slopes = np.moveaxis(part.over_time(TORQUE), 1, 0)  # (parameters, samples, joints, 2)
        variance = np.zeros(slopes.shape[1:])
        for solution, system_weights in zip(solutions, weights, strict=True):
            unknown_slopes = np.array(
                [sum(w * slopes[index_of_path[path]] for path, w in one.items()) for one in system_weights]
            )
            variance += np.einsum(
                "f...,fg,g...->...", unknown_slopes, solution.fit.covariance, unknown_slopes
            )
        magnitudes.append(np.abs(part.block.tau_motor))
        deviations.append(np.sqrt(variance))
    torque, deviation = (np.fmax.reduce(np.concatenate(each)) for each in (magnitudes, deviations))
    return torque, deviation


def _derivatives_of_file(robot: Robot, system: SystemOfEquations, number: int) -> dict[str, float]:
    """Return the derivatives of parameters of the file, by path, by an unknown of a system."""
    if isinstance(system, MotorSystem):
        return {str(system.sought[number]): 1.0}
    assert isinstance(system, LinkSystem), "of motors or links"
    if number >= system.bodies:
        return {str(system.part(number)): 1.0}
    index, symbol = divmod(int(system.base.kept[number]), len(SYMBOLS))
    joint = robot.joints[index]
    weights = np.linalg.inv(derivatives_by_file(joint.link))[:, symbol]
    paths = (f"{JOINTS}.{joint.name}.link.{end}" for end in LINK_PATH_ENDS)
    return {path: float(weight) for path, weight in zip(paths, weights, strict=True) if weight}
