"""Sentences of the report on the trouble of joints: kind, time, amount, uncertainty, and possible fixes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from vsacli.analysis.joint_report import DETERMINED, JUDGED, JointReport, JointUncertainty, Spread, Worst
from vsacli.analysis.report_text import apart, by_joint, count, kind_of, number, of_joints, of_motors, percent
from vsacli.base.flags import Flag
from vsacli.base.units import time_text

DIFFERENT_PEAK = 1.1
"""Ratio of a peak at the ends of a recording to the peak inside, above which its place is reported."""


def uncertainty_lines(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield the uncertainty of motor torques of recorded motions, and its consequences."""
    found = [(joint, joint.uncertainty) for joint in joints if joint.uncertainty is not None]
    for joint, uncertainty in found:
        yield from (f"{joint.name}: {sentence}" for sentence in _sentences(joint, uncertainty))
    torques = [(joint.name, each.variables[JUDGED]) for joint, each in found if JUDGED in each.variables]
    if torques:
        yield by_joint(
            "motor torque, random noise only: ", [_spread(name, spread) for name, spread in torques]
        )


def _sentences(joint: JointReport, uncertainty: JointUncertainty) -> Iterator[str]:
    yield from map(undetermined_text, uncertainty.undetermined)
    for kind, steps in uncertainty.steps.items():
        if steps:
            all_of_them = count(joint.steps[kind])
            yield f"{steps} of {all_of_them} that are {kind} may be otherwise within their uncertainty"
    for worst in uncertainty.limits.values():
        yield f"{excess(worst)} by less than its uncertainty, and does not count"
    if JUDGED in uncertainty.variables:
        yield from _peak_at_an_end(joint, uncertainty.variables[JUDGED])


def _peak_at_an_end(joint: JointReport, spread: Spread) -> Iterator[str]:
    largest = max(of_motors(joint, joint.peak_tau_motor))
    if largest > DIFFERENT_PEAK * spread.peak:
        outside, inside = (f"{number(peak)} {spread.unit}" for peak in (largest, spread.peak))
        yield f"its peak motor torque of {outside} is at a doubtful end of the record, else it is {inside}"


def _spread(name: str, spread: Spread) -> str:
    if not math.isnan(spread.rms):
        return f"{name} +- {spread.rms:.2g} {spread.unit} ({percent(spread.share)})"
    within = "" if math.isnan(spread.bound) else f", wrong by at most {percent(spread.bound)}"
    return f"{name} +- unknown{within}"


def undetermined_text(spread: Spread) -> str:
    """Return that a recording does not determine a variable, and its possible error."""
    what = f"{spread.name} is not determined by the record"
    if math.isnan(spread.bound):
        return f"{what}, since a signal that it depends on is not"
    wrong = f"it may be wrong by {percent(spread.bound)} of its root mean square"
    if not math.isnan(spread.rms):
        wrong += f", twice its standard deviation of {spread.rms:.2g} {spread.unit}"
    return f"{what}: {wrong}; {100 * DETERMINED:.0f} % is allowed"


MOST_TOLD = 4
"""Number of joints with one kind of trouble that are described in full, if at least two more have it."""


def sentences(joints: Sequence[JointReport]) -> Iterator[str]:
    """Return one sentence for each kind of trouble of a joint, with its name.

    If many joints have a kind, the others follow in a few words each.
    """
    kinds = dict.fromkeys(kind for joint in joints for kind in joint.worst)
    told = {kind: _worst_of([joint for joint in joints if kind in joint.worst], kind) for kind in kinds}
    for joint in joints:
        between = {worst.time for worst in joint.between.values()}
        for kind, worst in joint.worst.items():
            if joint in told[kind]:
                where = "; this lies between the steps" if worst.time in between else ""
                yield f"{joint.name}: {_SENTENCES.get(kind, _limit)(joint, worst)}{where}"
    for kind in kinds:
        others = {
            number: _briefly(joint, kind)
            for number, joint in enumerate(joints)
            if kind in joint.worst and joint not in told[kind]
        }
        if others:
            yield of_joints(f"also {_words(kind)}: ", others, [joint.name for joint in joints])


def _worst_of(joints: Sequence[JointReport], kind: str) -> Sequence[JointReport]:
    """Return the joints with the most samples of a kind of trouble, or farthest beyond their limit."""
    if len(joints) <= MOST_TOLD + 1:
        return joints

    def size(joint: JointReport) -> float:
        return joint.steps.get(kind, _share_beyond(joint.worst[kind]))

    return sorted(joints, key=size, reverse=True)[:MOST_TOLD]


def _share_beyond(worst: Worst) -> float:
    return abs(worst.value - worst.bound) / abs(worst.bound) if worst.bound else math.inf


def _words(kind: str) -> str:
    words = kind.replace("_", " ")
    return f"over the {words}" if kind.endswith("limit") else words


def _briefly(joint: JointReport, kind: str) -> str:
    if kind in joint.steps:
        return f"({_steps(joint, kind)})"
    worst = joint.worst[kind]
    value, bound = apart(worst.value, worst.bound)
    return f"({value} {worst.unit}, limit {bound})"


def _steps(joint: JointReport, kind: str) -> str:
    found = joint.steps[kind]
    return count(found) if found == 1 else f"{count(found)}, from {time_text(joint.first_time[kind])}"


def _infeasible(joint: JointReport, worst: Worst) -> str:
    steps = _steps(joint, "infeasible")
    slack = f"; a tendon goes slack at {count(joint.steps['slack'])}" if joint.steps["slack"] else ""
    preload = "; the opposite preload would reach it" if joint.other_preload else ""
    hints = f"({steps}){slack}{preload}"
    when = f"at t = {time_text(worst.time)}"
    if math.isnan(worst.bound):
        return f"its springs cannot carry the elastic torque {when} at any stiffness {hints}"
    value, bound = apart(worst.value, worst.bound)
    if "stiffness" not in kind_of(joint).commanded:
        relation = "below" if worst.value < worst.bound else "above"
        load = f"elastic torque {value} {worst.unit} {when}"
        return f"{load} is {relation} the {bound} that its spring carries {hints}"
    relation, remedy = ("below", "raise") if worst.value < worst.bound else ("above", "lower")
    return (
        f"stiffness {value} {worst.unit} {when} is {relation} the {bound} "
        f"its load allows, {remedy} it {hints}"
    )


def _singular(joint: JointReport, worst: Worst) -> str:
    if math.isnan(worst.bound):
        when = f"at t = {time_text(worst.time)}"
        return f"its spring is slack {when}: motor torques are undefined ({_steps(joint, 'singular')})"
    remedy = "lower" if worst.bound == joint.reachable[1] else "raise"
    return (
        f"stiffness {worst.value:.6g} {worst.unit} at t = {time_text(worst.time)} is singular: "
        f"motor torques are undefined at the end of its range, {remedy} it ({_steps(joint, 'singular')})"
    )


def _near_singular(joint: JointReport, worst: Worst) -> str:
    gap, when = abs(worst.value - worst.bound) / worst.value, f"at t = {time_text(worst.time)}"
    return (
        f"warning: stiffness {worst.value:.6g} {worst.unit} {when} is {100 * gap:.2g} % "
        f"from singular, where motor torques grow without bound ({_steps(joint, 'near_singular')})"
    )


def _not_finite(joint: JointReport, worst: Worst) -> str:
    return (
        f"a number of its motors is not finite at t = {time_text(worst.time)}: motion, stiffness or load are "
        f"too large, or no numbers (infeasible: {_steps(joint, 'infeasible')})"
    )


def _unstable(joint: JointReport, worst: Worst) -> str:
    return (
        f"what moves inside its transmission is unstable from t = {time_text(worst.time)} on: its damper "
        f"carries {number(worst.value)} {worst.unit} that the springs cannot; raise the stiffness "
        f"({_steps(joint, 'singular')})"
    )


def _limit(joint: JointReport, worst: Worst) -> str:
    return f"{excess(worst)} (first at {time_text(joint.first_time[worst.kind])})"


def excess(worst: Worst) -> str:
    """Return by how much a limit is exceeded, and where."""
    whose = Flag.labeled(worst.kind).quantity_of(worst.motor)
    value, bound = apart(worst.value, worst.bound)
    relation = "below" if worst.value < worst.bound else "above"
    return f"{whose} is {value} {worst.unit} at t = {time_text(worst.time)}, {relation} its limit {bound}"


_SENTENCES = {
    "not_finite": _not_finite,
    "infeasible": _infeasible,
    "singular": _singular,
    "near_singular": _near_singular,
    "internal_instability": _unstable,
}
