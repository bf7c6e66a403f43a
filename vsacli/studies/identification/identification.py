"""Identify the numbers of a robot from records: from files to what is found."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.robot.model import Robot, check_robot
from vsacli.studies.identification.bandwidth import bandwidth_of, bounds
from vsacli.studies.identification.consistent_links import ConsistentLinks
from vsacli.studies.identification.delays import Delay, delay, without_delay
from vsacli.studies.identification.equations import Equations
from vsacli.studies.identification.fitted_file import to_write
from vsacli.studies.identification.found_links import doubts_of, found_links
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
from vsacli.studies.identification.link_system import LINKS, link_system
from vsacli.studies.identification.motor_system import motor_systems
from vsacli.studies.identification.record_doubts import model_doubts
from vsacli.studies.identification.records import Record, complete_joints, read_record
from vsacli.studies.identification.signals import Signals, conditioned
from vsacli.studies.identification.solution import Solution, held_out, rms, solution
from vsacli.studies.identification.torque_noise import torque_noise
from vsacli.studies.identification.unknowns import FRICTION, GROUPS, check_fit, with_friction

WORDS = (*GROUPS, LINKS)
"""What users may ask for by a word."""

OF_JOINT = ".actuator."
"""Of paths to numbers of a joint's motors and springs, what ends where they differ."""

ABOVE_NOISE, ABOVE_TORQUE = 2.0, 0.01
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
    first = solutions(sought, joints, fit, signals)
    if not first:
        raise InputError.one("the joints that were recorded have nothing of what is to be found")
    delays = [delay(first, each) for each in signals]
    late = any(each.matters(record.rate) for each, record in zip(delays, signals, strict=True))
    signals = [_aligned(*each) for each in zip(signals, delays, strict=True)]
    found = solutions(sought, joints, fit, signals) if late else first
    reports = tuple(_report(robot, each, signals) for each in found)
    links = next((found_links(robot, each) for each in found if each.system.title == LINKS), None)
    doubts = [tuple(model_doubts(robot, joints, *each)) for each in zip(records, signals, strict=True)]
    used = tuple(map(_used, records, signals, delays, doubts))
    return Identification(
        robot=robot.name,
        verdict=_verdict(reports, used, links),
        records=used,
        systems=reports,
        notes=(*_notes(robot, joints, fit, signals), *(() if links is None else doubts_of(links))),
        fitted=_fitted(robot, sought, reports, links),
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


def solutions(
    robot: Robot, joints: Sequence[int], fit: Sequence[str], signals: Sequence[Signals]
) -> list[Solution]:
    """Solve for motors joint by joint, then for all links, with what springs carry by those.

    Args:
        robot: the robot.
        joints: indices of those that were recorded.
        fit: what to find, as of `identify`.
        signals: records.
    """
    motors = [solution(system, signals) for system in motor_systems(robot, joints, fit, signals)]
    if LINKS not in fit or _without_links(robot, joints, fit, signals):
        return motors
    return [*motors, solution(link_system(robot, fit, motors), signals)]


def _without_links(
    robot: Robot, joints: Sequence[int], fit: Sequence[str], signals: Sequence[Signals]
) -> str:
    """Why nothing is found of the links, a sentence; empty if there is no reason."""
    unknown = [np.isnan(each).any() for each in np.concatenate([record.q for record in signals]).T]
    if any(unknown):
        names = ", ".join(name for name, lacking in zip(robot.joint_names, unknown, strict=True) if lacking)
        return f"links move each other, and the positions of {names} were not recorded"
    if any(joint.damper for joint in robot.joints):
        return "nothing is found of links while there are dampers, whose damping was not recorded"
    rows = len(joints) * sum(len(each.time) // each.filter.stride for each in signals)
    count = len(link_system(robot, fit, ()).names)
    if rows <= count:
        return f"{rows} equations are too few for the {count} numbers of the links; record for longer"
    return ""


def _aligned(signals: Signals, late: Delay) -> Signals:
    """A record without the delay of its torques, as far as this can be told."""
    return without_delay(signals, late.seconds) if late.matters(signals.rate) else signals


def _report(robot: Robot, found: Solution, signals: list[Signals]) -> SystemReport:
    system, fit = found.system, found.fit
    names = [system.names[number].rpartition(OF_JOINT)[2] for number in found.free]
    combinations = [
        f"only {each.words(names)} can be told: {each.value:.6g} +- {each.standard_error:.2g}"
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
    """What was found of each number of a system."""
    system, fit = found.system, found.fit
    inseparable = {at for each in fit.inseparable for at, _ in each.terms}
    said = zip(system.names, system.units, system.sums, strict=True)
    for number, (name, unit, total) in enumerate(said):
        before = float(system.before[number])
        if number in found.bound:
            value, error = found.bound[number]
            note = "came out impossible" if np.isnan(error) else "" if value == before else "at its bound"
        else:
            at = found.free.index(number)
            value, error = float(fit.values[at]), float(fit.standard_errors[at])
            note = "cannot be told apart" if at in inseparable else ""
            note = "changes nothing" if at in fit.unexcited else note
        yield Number(name, unit, before, value, error, note, total)


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
            noise=_noise(robot, name, signals, equations),
            held_out=beyond.get(name, float("nan")),
        )


def _unit(robot: Robot, group: str) -> str:
    turning = {joint.name: joint.is_revolute for joint in robot.joints}
    return "N m" if turning.get(group.rpartition(" ")[2], True) else "N"


def _noise(robot: Robot, group: str, signals: Sequence[Signals], equations: Sequence[Equations]) -> float:
    """Of a motor's torque, over all records; of what springs carry, by the noise of positions."""
    words, joint = group.split(), group.rpartition(" ")[2]
    if words[0] != "motor":
        noise = [each.noise()[0][each.group == group] for each in equations if each.noise is not None]
        return rms(np.concatenate(noise)) if noise else float("nan")
    motor = int(words[1]) - 1 if words[1].isdigit() else 0
    index = robot.joint_names.index(joint)
    each = np.array([torque_noise(of_record)[index, motor] for of_record in signals])
    return rms(each[np.isfinite(each)])


def _verdict(
    systems: Sequence[SystemReport], records: Sequence[RecordReport], links: ConsistentLinks | None
) -> str:
    residuals = [each for system in systems for each in system.residuals]
    if any(record.doubts for record in records):
        return DOUBTFUL
    held = all(system.converged for system in systems) and (links is None or links.within)
    if any(map(_fails, residuals)) or not held:
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


def _notes(
    robot: Robot, joints: Sequence[int], fit: Sequence[str], signals: Sequence[Signals]
) -> Iterator[str]:
    left = [joint.name for index, joint in enumerate(robot.joints) if index not in joints]
    if left:
        yield f"nothing was recorded of {', '.join(left)}"
    if LINKS in fit and (reason := _without_links(robot, joints, fit, signals)):
        yield reason


def _fitted(
    robot: Robot, sought: Robot, systems: Sequence[SystemReport], links: ConsistentLinks | None
) -> Robot:
    fitted = sought.replace({each.path: each.value for each in to_write(robot, systems)})
    if links is None or not links.within:
        return fitted
    joints = map(lambda joint, link: dataclasses.replace(joint, link=link), fitted.joints, links.links)
    return dataclasses.replace(fitted, joints=tuple(joints))


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
