"""Identify the numbers of a robot from records: from files to what is found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.robot.model import Robot, check_robot
from vsacli.studies.identification.bandwidth import bandwidth_of, bounds
from vsacli.studies.identification.delays import Delay, delay, without_delay
from vsacli.studies.identification.identification_report import (
    DOUBTFUL,
    MISFIT,
    OK,
    UNTOLD,
    Identification,
    Number,
    RecordReport,
    Residual,
    SystemReport,
    Torques,
)
from vsacli.studies.identification.motor_system import motor_systems
from vsacli.studies.identification.record_doubts import model_doubts
from vsacli.studies.identification.records import Record, complete_joints, read_record
from vsacli.studies.identification.signals import Signals, conditioned
from vsacli.studies.identification.solution import Solution, SystemOfEquations, held_out, rms, solution
from vsacli.studies.identification.torque_noise import torque_noise
from vsacli.studies.identification.unknowns import FRICTION, GROUPS, check_fit, with_friction

Systems = Callable[[Robot, Sequence[int], Sequence[str]], Iterable[SystemOfEquations]]
"""Makes systems of equations of a robot, the joints that were recorded, and what is to be found."""

MAKERS: Mapping[tuple[str, ...], Systems] = MappingProxyType({GROUPS: motor_systems})
"""What makes equations, by the words of `--fit` that it serves."""

WORDS = tuple(word for words in MAKERS for word in words)

ABOVE_NOISE, ABOVE_TORQUE = 2.0, 0.02
"""Residual over the noise, and over the torque, beyond both of which the equations do not hold: what is left
is then no noise of the sensor, and more than a good model of friction leaves."""

SMOOTH_CURVES = 8
"""Rows of figures to one of the equations, whose curves have corners."""


def identify(
    robot: Robot,
    recordings: str | Path | Sequence[str | Path],
    fit: Sequence[str] = WORDS,
    bandwidth: float | None = None,
) -> Identification:
    """Find numbers of a robot from records of its motion.

    Args:
        robot: with numbers to begin with.
        recordings: CSV files with a column `time` and columns named as `vsacli export` names them: positions
            of joints and motors, and motor torques or currents; cells may be empty.
        fit: what to find: words of `WORDS`, or patterns of paths such as `joints.elbow.actuator.spring.*`.
        bandwidth: of the filter, Hz; chosen from each record if None.

    Raises:
        InputError: a record cannot be used, or `fit` names nothing.
    """
    check_robot(robot)
    paths = [recordings] if isinstance(recordings, str | Path) else list(recordings)
    if not paths:
        raise InputError.one("identification needs a record at least")
    check_fit(robot, fit, WORDS)
    records = [read_record(robot, path) for path in paths]
    joints = sorted({joint for record in records for joint in complete_joints(robot, record)})
    signals = [_conditioned(record, bandwidth) for record in records]
    sought = with_friction(robot, joints) if FRICTION in fit else robot
    systems = [system for maker in MAKERS.values() for system in maker(sought, joints, fit)]
    if not systems:
        raise InputError.one("the joints that were recorded have nothing of what is to be found")
    signals, delays = _aligned(systems, signals)
    found = [solution(system, signals) for system in systems]
    reports = tuple(_report(robot, each, signals) for each in found)
    doubts = [tuple(model_doubts(robot, joints, *each)) for each in zip(records, signals, strict=True)]
    used = tuple(map(_used, records, signals, delays, doubts))
    return Identification(
        robot=robot.name,
        verdict=_verdict(reports, used),
        records=used,
        systems=reports,
        notes=tuple(_notes(robot, joints)),
        fitted=_fitted(sought, reports),
        torques=tuple(_torques(robot, found, records, signals)),
    )


def _conditioned(record: Record, bandwidth: float | None) -> Signals:
    """A record ready for equations.

    Raises:
        InputError: the bandwidth that was asked for does not fit the record.
    """
    positions = np.concatenate((record.q[..., None], record.theta), axis=-1).reshape(len(record.time), -1)
    recorded = positions[:, np.isfinite(positions).all(axis=0)]
    chosen = bandwidth_of(record.time, recorded) if bandwidth is None else bandwidth
    low, high = bounds(record.time)
    if not low <= chosen <= high:
        raise InputError.one(
            f"its bandwidth must lie between {low:.3g} and {high:.4g} Hz, not {chosen:g}", record.path
        )
    return conditioned(record.time, record.q, record.theta, record.tau_motor, chosen)


def _aligned(
    systems: Sequence[SystemOfEquations], signals: Sequence[Signals]
) -> tuple[list[Signals], list[Delay]]:
    """Records without the delays of their torques, as far as these can be told, and these."""
    first = [solution(system, signals) for system in systems]
    delays = [delay(first, each) for each in signals]
    shifted = [
        without_delay(each, late.seconds) if late.matters(each.rate) else each
        for each, late in zip(signals, delays, strict=True)
    ]
    return shifted, delays


def _report(robot: Robot, found: Solution, signals: list[Signals]) -> SystemReport:
    system, fit = found.system, found.fit
    names = [system.names[number] for number in found.free]
    combinations = [
        f"only {each.words(names)} can be told: {each.value:.6g} +- {each.standard_error:.2g}"
        for each in fit.inseparable
    ]
    return SystemReport(
        title=system.title,
        numbers=tuple(_numbers(found)),
        condition=fit.condition,
        combinations=tuple(combinations),
        residuals=tuple(_residuals(robot, found, signals)),
        converged=fit.converged,
    )


def _numbers(found: Solution) -> Iterator[Number]:
    system, fit = found.system, found.fit
    inseparable = {at for each in fit.inseparable for at, _ in each.terms}
    for number, (name, unit) in enumerate(zip(system.names, system.units, strict=True)):
        before = float(system.before[number])
        if number in found.bound:
            value, error = found.bound[number]
            note = "came out impossible" if np.isnan(error) else "" if value == before else "at its bound"
        else:
            at = found.free.index(number)
            value, error = float(fit.values[at]), float(fit.standard_errors[at])
            note = "cannot be told apart" if at in inseparable else ""
            note = "changes nothing" if at in fit.unexcited else note
        yield Number(name, unit, before, value, error, note)


def _residuals(robot: Robot, found: Solution, signals: list[Signals]) -> Iterator[Residual]:
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
            noise=_noise(robot, name, signals),
            held_out=beyond.get(name, float("nan")),
        )


def _unit(robot: Robot, group: str) -> str:
    turning = {joint.name: joint.is_revolute for joint in robot.joints}
    return "N m" if turning.get(group.rpartition(" ")[2], True) else "N"


def _noise(robot: Robot, group: str, signals: Sequence[Signals]) -> float:
    """Of a motor's torque, over all records; NaN of what is measured by no sensor of its own."""
    words, joint = group.split(), group.rpartition(" ")[2]
    if words[0] != "motor":
        return float("nan")
    motor = int(words[1]) - 1 if words[1].isdigit() else 0
    index = robot.joint_names.index(joint)
    each = np.array([torque_noise(of_record)[index, motor] for of_record in signals])
    return rms(each)


def _verdict(systems: Sequence[SystemReport], records: Sequence[RecordReport]) -> str:
    residuals = [each for system in systems for each in system.residuals]
    if any(record.doubts for record in records):
        return DOUBTFUL
    if any(map(_fails, residuals)) or not all(system.converged for system in systems):
        return MISFIT
    return OK if all(number.told for system in systems for number in system.numbers) else UNTOLD


def _fails(residual: Residual) -> bool:
    worst = max(residual.residual, residual.held_out if np.isfinite(residual.held_out) else 0.0)
    noise = residual.noise if np.isfinite(residual.noise) else 0.0
    return worst > max(ABOVE_NOISE * noise, ABOVE_TORQUE * residual.torque)


def _used(record: Record, signals: Signals, late: Delay, doubts: tuple[str, ...]) -> RecordReport:
    return RecordReport(
        path=record.path,
        duration=float(signals.time[-1] - signals.time[0]),
        rate=signals.rate,
        bandwidth=signals.filter.bandwidth,
        delay=late.seconds,
        delay_error=late.standard_error,
        corrected=late.matters(signals.rate),
        doubts=(*record.doubts, *doubts),
        unused=record.unused,
    )


def _notes(robot: Robot, joints: Sequence[int]) -> Iterator[str]:
    left = [joint.name for index, joint in enumerate(robot.joints) if index not in joints]
    if left:
        yield f"nothing was recorded of {', '.join(left)}"


def _fitted(robot: Robot, systems: Sequence[SystemReport]) -> Robot:
    found = {number.path: number.value for system in systems for number in system.numbers if number.told}
    return robot.replace(found)


def _torques(
    robot: Robot, found: Sequence[Solution], records: Sequence[Record], signals: Sequence[Signals]
) -> Iterator[Torques]:
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
