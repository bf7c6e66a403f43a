"""What a report says of the trouble of its joints: what, when, by how much, and what would mend it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from vsacli.analysis.joint_report import JointReport, Worst
from vsacli.analysis.report_text import apart, count, kind_of, number, of_joints
from vsacli.base.flags import Flag
from vsacli.base.units import time_text

MOST_TOLD = 4
"""Joints whose trouble of a kind is told in full, where more than one more have it."""


def sentences(joints: Sequence[JointReport]) -> Iterator[str]:
    """One sentence for each kind of trouble of a joint, naming it.

    Where many joints have a kind, the others follow in a few words each.
    """
    kinds = dict.fromkeys(kind for joint in joints for kind in joint.worst)
    told = {kind: _told([joint for joint in joints if kind in joint.worst], kind) for kind in kinds}
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


def _told(joints: Sequence[JointReport], kind: str) -> Sequence[JointReport]:
    """Those of the joints that have a kind of trouble with the most steps, or farthest beyond their limit."""
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
    """By how much a limit is exceeded, and where."""
    whose = Flag.labelled(worst.kind).quantity_of(worst.motor)
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
