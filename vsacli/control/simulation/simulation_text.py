"""The report of a simulation as text."""

from __future__ import annotations

import math
from collections.abc import Iterator

from vsacli.analysis.joint_report import Worst
from vsacli.analysis.report_text import WIDTH, aligned, energy_lines, warnings_and_notes
from vsacli.base.flags import Flag
from vsacli.base.units import POSITION, STIFFNESS, TORQUE, Quantity
from vsacli.control.simulation.simulation_report import JointTracking, SimulationReport

HEADER = ("joint", "q error: peak", "end", "stiffness error: peak", "end", "peak motor 1 / 2")


def render(report: SimulationReport) -> str:
    """The report as lines of text, without a final newline."""
    return "\n".join(
        [
            _headline(report),
            *aligned([HEADER, *map(_row, report.joints)]),
            *warnings_and_notes(report.warnings, report.notes),
            *(_limit(joint, worst) for joint in report.joints for worst in joint.worst.values()),
            *([] if report.ending is None else [report.ending]),
            *energy_lines([(joint.name, joint.type, joint.energy) for joint in report.joints]),
            *_loss(report),
        ]
    )


def _headline(report: SimulationReport) -> str:
    left = f"{report.robot}, {report.trajectory}: {report.controller}, {report.duration:g} s"
    verdict = report.verdict.upper().replace("_", " ")
    return f"{left:<{WIDTH - len(verdict) - 1}} {verdict}"


def _row(joint: JointTracking) -> tuple[str, ...]:
    motors = " / ".join(_number(peak) for peak in joint.peak_tau_motor if not math.isnan(peak))
    return (
        joint.name,
        _with_unit(joint.q.peak, POSITION, joint),
        _with_unit(joint.q.final, POSITION, joint),
        _with_unit(joint.stiffness.peak, STIFFNESS, joint),
        _with_unit(joint.stiffness.final, STIFFNESS, joint),
        f"{motors} {TORQUE.unit(joint.type)}",
    )


def _with_unit(value: float, quantity: Quantity, joint: JointTracking) -> str:
    return "-" if math.isnan(value) else f"{_number(value)} {quantity.unit(joint.type)}"


def _number(value: float) -> str:
    """One decimal for large numbers, two digits for small ones."""
    return f"{value:.1f}" if abs(value) >= 10 else f"{value:.2g}"


def _limit(joint: JointTracking, worst: Worst) -> str:
    whose = Flag.labelled(worst.kind).quantity_of(worst.motor)
    relation = "below" if worst.value < worst.bound else "above"
    return (
        f"{joint.name}: {whose} is {worst.value:.6g} {worst.unit} at t = {worst.time:.3f} s, "
        f"{relation} its limit {worst.bound:.6g}"
    )


def _loss(report: SimulationReport) -> Iterator[str]:
    """What measuring positions alone costs."""
    for joint, ideal in zip(report.joints, report.with_full_state, strict=False):
        unit = POSITION.unit(joint.type)
        yield (
            f"{joint.name}: with the full state the q error is {ideal.peak:.2g} {unit} at its peak, "
            f"{ideal.final:.2g} {unit} at the end"
        )
