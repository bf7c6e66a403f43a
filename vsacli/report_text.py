"""The report as text: headline, table, a sentence for each kind of trouble, what to know before a start."""

from __future__ import annotations

import math
from collections.abc import Iterator

from vsacli.flags import Flag
from vsacli.report import JointReport, Report, Worst
from vsacli.self_check import LADDER_BOUND, SPRING_BOUND
from vsacli.units import POSITION, TORQUE

WIDTH = 78

QUANTITY_OF_LIMIT = {
    Flag.POSITION_LIMIT.label: "position",
    Flag.VELOCITY_LIMIT.label: "velocity",
    Flag.STIFFNESS_LIMIT.label: "stiffness",
    Flag.DEFLECTION_LIMIT.label: "deflection",
    Flag.MOTOR_VELOCITY_LIMIT.label: "velocity",
    Flag.MOTOR_TORQUE_LIMIT.label: "torque",
}

TROUBLE = ("infeasible", "singular", "over_limit")
"""Kinds that make the verdict worse than ok."""


def render(report: Report) -> str:
    """The report as lines of text, without a final newline."""
    return "\n".join(
        [
            _headline(report),
            *_table(report),
            *(f"warning: {warning}" for warning in report.warnings),
            *(sentence for joint in report.joints for sentence in sentences(joint)),
            *_start(report),
            _self_check(report),
        ]
    )


def sentences(joint: JointReport) -> Iterator[str]:
    """One sentence for each kind of trouble of a joint, naming it."""
    for kind, worst in joint.worst.items():
        yield f"{joint.name}: {_SENTENCES.get(kind, _limit)(joint, worst)}"


def _headline(report: Report) -> str:
    steps = f"{report.samples} steps" if report.samples != 1 else "1 step"
    left = f"{report.robot}, {report.trajectory}: {steps}, {report.duration:g} s"
    if not report.complete:
        left += " planned, stopped early"
    return f"{left:<{WIDTH - 32}} {_verdict(report):>31}".rstrip()


def _verdict(report: Report) -> str:
    verdict = report.verdict
    words = verdict.upper().replace("_", " ")
    concerned = sum(1 for joint in report.joints if joint.steps.get(verdict))
    return f"{words} ({concerned} of {len(report.joints)} joints)" if verdict in TROUBLE else words


def _table(report: Report) -> Iterator[str]:
    rows: list[tuple[str, ...]] = [
        ("joint", "peak tau_e", "peak motor 1 / 2", "stiffness", "reachable", "margin")
    ]
    rows += [_row(joint) for joint in report.joints]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        name, *cells = (
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield "   ".join([name, *cells])


def _row(joint: JointReport) -> tuple[str, ...]:
    torque = TORQUE.unit(joint.type)
    motors = " / ".join(_number(peak) for peak in joint.peak_tau_motor)
    return (
        joint.name,
        f"{_number(joint.peak_tau_e)} {torque}",
        f"{motors} {torque}",
        _span(*joint.stiffness),
        _corridor(*joint.reachable),
        "none" if math.isnan(joint.margin) else f"{100 * joint.margin:.2f} %",
    )


def _corridor(lower: float, upper: float) -> str:
    if math.isnan(lower):
        return "nothing"
    return f"from {_number(lower)}" if math.isinf(upper) else f"{_number(lower)}-{_number(upper)}"


def _span(low: float, high: float) -> str:
    return f"{low:.6g}" if low == high else f"{low:.6g}-{high:.6g}"


def _number(value: float) -> str:
    """One decimal for large numbers, three digits for small ones."""
    return "-" if math.isnan(value) else f"{value:.1f}" if abs(value) >= 10 else f"{value:.3g}"


def _steps(joint: JointReport, kind: str) -> str:
    count = joint.steps[kind]
    return f"{count} step{'s' if count > 1 else ''}, from {joint.first_time[kind]:.3f} s"


def _infeasible(joint: JointReport, worst: Worst) -> str:
    when = f"at t = {worst.time:.3f} s"
    hint = "; with the opposite preload it would be reachable" if joint.other_preload else ""
    steps = _steps(joint, "infeasible")
    if math.isnan(worst.bound):
        return f"its springs cannot carry the elastic torque {when} at any stiffness ({steps}){hint}"
    relation = "below" if worst.value < worst.bound else "above"
    return (
        f"stiffness {worst.value:g} {worst.unit} {when} is {relation} the {worst.bound:.6g} "
        f"its load allows ({steps}){hint}"
    )


def _singular(joint: JointReport, worst: Worst) -> str:
    return (
        f"stiffness {worst.value:g} {worst.unit} at t = {worst.time:.3f} s touches the end of its corridor, "
        f"where motor torques are undefined ({_steps(joint, 'singular')})"
    )


def _near_singular(joint: JointReport, worst: Worst) -> str:
    gap = 100 * abs(worst.value - worst.bound) / worst.value
    return (
        f"warning: stiffness {worst.value:g} {worst.unit} at t = {worst.time:.3f} s is within "
        f"{gap:.2g} % of the singular value {worst.bound:.6g}, "
        f"near which motor torques grow without bound ({_steps(joint, 'near_singular')})"
    )


def _limit(joint: JointReport, worst: Worst) -> str:
    quantity = QUANTITY_OF_LIMIT[worst.kind]
    whose = quantity if worst.motor is None else f"{quantity} of motor {worst.motor}"
    relation = "below" if worst.value < worst.bound else "above"
    return (
        f"{whose} {worst.value:.6g} {worst.unit} at t = {worst.time:.3f} s is {relation} its limit "
        f"{worst.bound:g} (first at {joint.first_time[worst.kind]:.3f} s)"
    )


_SENTENCES = {"infeasible": _infeasible, "singular": _singular, "near_singular": _near_singular}


def _start(report: Report) -> Iterator[str]:
    known = [joint for joint in report.joints if not any(map(math.isnan, joint.start_theta))]
    if not known:
        return
    places = ", ".join(
        f"{joint.name} {joint.start_theta[0]:+.4g} {joint.start_theta[1]:+.4g} {POSITION.unit(joint.type)}"
        for joint in known
    )
    yield f"start motors at: {places}"
    steps = [joint for joint in known if not math.isnan(max(joint.torque_step))]
    if steps:
        joint = max(steps, key=lambda each: max(each.torque_step))
        yield f"torque step at start: {max(joint.torque_step):.3g} {TORQUE.unit(joint.type)} ({joint.name})"


def _self_check(report: Report) -> str:
    check = report.self_check
    if check.passed:
        return f"self-check passed ({check.ladder:.0e}, bound {LADDER_BOUND:.0e})"
    return (
        f"SELF-CHECK FAILED: derivatives are off by {check.ladder:.1e} (bound {LADDER_BOUND:.0e}), "
        f"springs by {check.spring_residual:.1e} (bound {SPRING_BOUND:.0e}); do not use these torques"
    )
