"""What is reported of each system of equations: its numbers, residuals and curves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.variables import VARIABLES
from vsacli.robot.model import Robot
from vsacli.robot.parameters import JOINTS
from vsacli.studies.identification.estimation.equations import Equations
from vsacli.studies.identification.estimation.solution import Solution, held_out, rms
from vsacli.studies.identification.identification_report import (
    Number,
    Residual,
    SystemReport,
    Torques,
)
from vsacli.studies.identification.motors.motor_equations import motor_names
from vsacli.studies.identification.records.record_columns import TORQUE
from vsacli.studies.identification.records.records import Record
from vsacli.studies.identification.records.signals import Signals
from vsacli.studies.identification.records.torque_noise import torque_noise

SMOOTH_CURVES = 8
"""Rows of figures to one of the equations, whose curves have corners."""


def system_report(robot: Robot, found: Solution, signals: list[Signals]) -> SystemReport:
    """What a system told, and how well it holds."""
    system, fit = found.system, found.fit
    of_joint = f"{JOINTS}.{system.title}.actuator."
    names = [system.names[number].removeprefix(of_joint) for number in found.free]
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


def _joint_of(robot: Robot, group: str) -> int:
    """Index of the joint whose motor, or link, a group is."""
    return robot.joint_names.index(group.rpartition(" ")[2])


def _unit(robot: Robot, group: str) -> str:
    return VARIABLES[TORQUE].quantity.unit(robot.joint_types[_joint_of(robot, group)])


def _noise(robot: Robot, group: str, signals: Sequence[Signals], equations: Sequence[Equations]) -> float:
    """Of what is measured, by that of torques, and by that of positions; NaN if either is not known."""
    index = _joint_of(robot, group)
    motors, sprung = motor_names(robot, index), robot.joints[index].actuator.sprung
    of_positions = [each.noise()[0][each.group == group] for each in equations if each.noise is not None]
    noise = rms(np.concatenate(of_positions)) if of_positions else math.nan
    if sprung and group not in motors:  # what springs carry, which positions tell
        return noise
    motor = motors.index(group) if sprung else 0
    of_torque = np.array([torque_noise(each)[index, motor] for each in signals])
    return math.hypot(noise, rms(of_torque[~np.isnan(of_torque)]))


def torques(
    robot: Robot, found: Sequence[Solution], records: Sequence[Record], signals: Sequence[Signals]
) -> Iterator[Torques]:
    """Measured and predicted torques of all records and systems."""
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
