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


def system_report(robot: Robot, found: Solution, signals: list[ConditionedRecording]) -> SystemReport:
    """Return the results and residuals of a system."""
    system, fit = found.system, found.fit
    of_joint = f"{JOINTS}.{system.title}.actuator."
    names = [system.names[number].removeprefix(of_joint) for number in found.free]
    combinations = [
        f"only {each.words(names)} is identifiable: {rounded_by_error(each.value, each.standard_error)} "
        f"+- {each.standard_error:.2g}"
        for each in fit.inseparable
    ]
    return SystemReport(
        title=system.title,
        numbers=tuple(numbers_of(found)),
        condition=fit.condition,
        combinations=tuple(combinations),
        residuals=tuple(_residuals(robot, found, signals)),
        converged=fit.converged,
    )


def numbers_of(found: Solution) -> Iterator[Number]:
    """Yield the result of each parameter of a system."""
    system, fit = found.system, found.fit
    inseparable = {at for each in fit.inseparable for at, _ in each.terms}
    said = zip(system.names, system.units, system.sums, strict=True)
    for number, (name, unit, total) in enumerate(said):
        before = float(system.before[number])
        if number in found.bound:
            value, error = found.bound[number]
            note = NOT_PHYSICAL if np.isnan(error) else "" if value == before else AT_BOUND
        else:
            at = found.free.index(number)
            value, error = float(fit.values[at]), float(fit.standard_errors[at])
            note = INDISTINCT if at in inseparable else ""
            note = NO_EFFECT if at in fit.unexcited else note
        yield Number(name, unit, before, value, error, note, total)


def _residuals(robot: Robot, found: Solution, signals: list[ConditionedRecording]) -> Iterator[Residual]:
    equations = [found.equations(each) for each in signals]
    beyond = held_out(found, signals)
    measured, residual, group = (
        np.concatenate(parts)
        for parts in (
            [each.measured for each in equations],
            [each.measured - each.predicted for each in equations],
            [each.group for each in equations],
        )
    )
    for name in dict.fromkeys(map(str, group)):
        rows = group == name
        yield Residual(
            group=name,
            unit=_unit(robot, name),
            torque=rms(measured[rows]),
            residual=rms(residual[rows]),
            noise=_group_noise(robot, name, signals, equations),
            held_out=beyond.get(name, float("nan")),
        )


def _joint_of_group(robot: Robot, group: str) -> int:
    """Return the index of the joint whose motor or link a group is."""
    return robot.joint_names.index(group.rpartition(" ")[2])


def _unit(robot: Robot, group: str) -> str:
    return VARIABLES[TORQUE].quantity.unit(robot.joint_types[_joint_of_group(robot, group)])


def _group_noise(
    robot: Robot, group: str, signals: Sequence[ConditionedRecording], equations: Sequence[Equations]
) -> float:
    """Return the noise of a group's residual from that of torques and positions; NaN if either is unknown."""
    index = _joint_of_group(robot, group)
    motors, sprung = motor_names(robot, index), robot.joints[index].actuator.sprung
    of_positions = [each.noise()[0][each.group == group] for each in equations if each.noise is not None]
    noise = rms(np.concatenate(of_positions)) if of_positions else math.nan
    if sprung and group not in motors:  # the torque of springs follows from positions alone
        return noise
    motor = motors.index(group) if sprung else 0
    of_torque = np.array([torque_noise(each)[index, motor] for each in signals])
    return math.hypot(noise, rms(of_torque[~np.isnan(of_torque)]))


def torque_comparisons(
    robot: Robot,
    found: Sequence[Solution],
    records: Sequence[Record],
    signals: Sequence[ConditionedRecording],
) -> Iterator[Torques]:
    """Yield measured and predicted torques of all recordings and systems."""
    for record, coarse in zip(records, signals, strict=True):
        stride = max(1, coarse.filter.stride // SMOOTH_CURVES)
        of_record = coarse._replace(filter=coarse.filter._replace(stride=stride))
        time: FloatArray = of_record.time[::stride]
        for each in found:
            equations = each.equations(of_record)
            for name in dict.fromkeys(map(str, equations.group)):
                rows = equations.group == name
                yield Torques(
                    record=record.path,
                    group=name,
                    unit=_unit(robot, name),
                    time=time,
                    measured=equations.measured[rows],
                    predicted=equations.predicted[rows],
                )


SAMPLES = 200
"""Samples of each recording at which torques are compared: ten per period of its fastest motion, or more."""

OF_LINK = ("mass", *(f"com.{axis}" for axis in range(3)), *(f"inertia.{entry}" for entry in TENSOR))
"""Ends of the paths of a link's parameters, in the order of `derivatives_by_file`."""


def torque_deviations(
    robot: Robot, found: Sequence[Solution], records: Sequence[ConditionedRecording]
) -> tuple[TorqueDeviation, ...]:
    """Return the largest standard deviations of each motor's torque, along the recordings and elsewhere.

    There is none unless the positions of all joints, and those of motors that set a stiffness, were recorded.

    Args:
        robot: fitted robot.
        found: solutions of the equations, which have the covariances.
        records: conditioned recordings.
    """
    settable = [STIFFNESS.key in actuator.commanded for actuator in robot.actuators]
    positions = [part for each in records for part in (each.q, each.theta[:, settable])]
    massless = any(joint.link.mass == 0 for joint in robot.joints)
    if massless or any(joint.damper for joint in robot.joints) or any(np.isnan(e).any() for e in positions):
        return ()
    motions = [_recorded_motion(robot, each) for each in records]
    torque, deviation = _largest_deviations(robot, found, motions)
    _, elsewhere = _largest_deviations(robot, found, map(_recombined, motions))
    return tuple(
        TorqueDeviation(name, VARIABLES[TORQUE].quantity.unit(joint.type), *map(float, of_motor))
        for joint, *of_joint in zip(robot.joints, torque, deviation, elsewhere, strict=True)
        for name, *of_motor in zip(motor_names(robot, robot.joints.index(joint)), *of_joint, strict=False)
    )


def _recorded_motion(robot: Robot, signals: ConditionedRecording) -> Motion:
    """Return the motion of a recording with its stiffness."""
    stiffness = np.full_like(signals.q, np.nan)
    for index, actuator in enumerate(robot.actuators):
        if STIFFNESS.key in actuator.commanded:
            stiffness[:, index] = value_of(actuator.springs_of(joint_motion(signals, index)).stiffness)
    of_time = (
        *(signals.time, signals.q, signals.dq, signals.ddq, *spline_derivatives(signals.time, signals.ddq)),
        *(stiffness, *spline_derivatives(signals.time, stiffness)),
    )
    every = max(1, len(signals.time) // SAMPLES)
    time, q, dq, ddq, d3q, d4q, *of_stiffness = (each[::every] for each in of_time)
    return Motion(time, q, dq, ddq, d3q, d4q, dict(zip(STIFFNESS.names, of_stiffness, strict=True)))


def _recombined(motion: Motion) -> Motion:
    """Return a motion with positions, velocities, and so on, that occur in another one at other times."""
    random = np.random.default_rng(0)
    shuffled = {name: random.permuted(each, axis=0) for name, each in motion.of_joints.items()}
    return Motion.of(motion.time, shuffled)


def _largest_deviations(
    robot: Robot, found: Sequence[Solution], motions: Iterable[Motion]
) -> tuple[FloatArray, FloatArray]:
    """Return the largest motor torques and their largest standard deviations, (joints, 2)."""
    weights = [[_by_file(robot, each.system, number) for number in each.free] for each in found]
    chosen = parameters(robot, list({path: None for each in weights for one in each for path in one}))
    place = {str(each): at for at, each in enumerate(chosen)}
    sizes, deviations = [], []
    for motion in motions:
        part = derivatives_of(robot, motion, chosen)
        slopes = np.moveaxis(part.over_time(TORQUE), 1, 0)  # (parameters, samples, joints, 2)
        variance = np.zeros(slopes.shape[1:])
        for solution, of_system in zip(found, weights, strict=True):
            own = np.array([sum(w * slopes[place[path]] for path, w in one.items()) for one in of_system])
            variance += np.einsum("f...,fg,g...->...", own, solution.fit.covariance, own)
        sizes.append(np.abs(part.block.tau_motor))
        deviations.append(np.sqrt(variance))
    torque, deviation = (np.fmax.reduce(np.concatenate(each)) for each in (sizes, deviations))
    return torque, deviation


def _by_file(robot: Robot, system: SystemOfEquations, number: int) -> dict[str, float]:
    """Return the derivatives of parameters of the file, by path, by an unknown of a system."""
    if isinstance(system, MotorSystem):
        return {str(system.sought[number]): 1.0}
    assert isinstance(system, LinkSystem), "of motors or links"
    if number >= system.bodies:
        return {str(system.part(number)): 1.0}
    index, symbol = divmod(int(system.base.kept[number]), len(SYMBOLS))
    joint = robot.joints[index]
    weights = np.linalg.inv(derivatives_by_file(joint.link))[:, symbol]
    paths = (f"{JOINTS}.{joint.name}.link.{end}" for end in OF_LINK)
    return {path: float(weight) for path, weight in zip(paths, weights, strict=True) if weight}
