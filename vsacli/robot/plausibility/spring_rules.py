"""What springs of a robot, and what they make of its joints, are held against."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws import SpringLaw
from vsacli.actuators.transmission import Command, Transmission
from vsacli.base.flags import NEAR_SINGULAR_MARGIN
from vsacli.documents.plausibility import Measured, Rule, Slip
from vsacli.documents.record_numbers import Entry, NumberPath
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.body_rules import DEGREES, SIZES, TURN
from vsacli.robot.plausibility.facts import Facts, joint_path, ratio, written_once

HALF_TURN = math.pi
SMALL_SHARE = 0.003
"""Of half a turn: half a degree."""

TOO_SOFT = (
    Slip("N m/deg", 180 / math.pi, instead_of="N m/rad"),
    Slip("kN m/rad", 1e3, instead_of="N m/rad"),
    Slip("N/mm", 1e3, instead_of="N/m"),
)
NEWTON_MILLIMETRES = Slip("N mm/rad", 1e-3, instead_of="N m/rad")
TOO_STIFF = (
    NEWTON_MILLIMETRES,
    Slip("N mm/deg", 0.18 / math.pi, instead_of="N m/rad"),
)
"""Units in which a stiffness is a smaller, or a larger number than in the expected one."""


class Corridor(NamedTuple):
    """The stiffness that a joint can have while it carries nothing, N m/rad (N/m)."""

    lower: float
    upper: float


def corridor(joint: Joint) -> Corridor | None:
    """That of a joint; None if its stiffness cannot be commanded."""
    if "stiffness" not in joint.actuator.commanded:
        return None
    solution = joint.actuator.solve(np.zeros(1), np.ones(1), np.zeros(1))
    return Corridor(float(solution.lower[0]), float(solution.upper[0]))


def _soft_ends(facts: Facts) -> Iterator[Measured]:
    """The stiffness of pairs of springs at rest, over the weight at full reach, per rad or per reach."""
    for index, joint in enumerate(() if facts.placeholder else facts.joints):
        found = corridor(joint)
        if found is not None:
            size = ratio(found.lower * _travel(facts, joint), facts.sizes.scale(joint))
            unit = "N m/rad" if joint.is_revolute else "N/m"
            beside = {"stiffness": f"{found.lower:.4g} {unit}"}
            yield Measured(joint_path(index, joint, "actuator", "spring"), math.nan, unit, size, beside)


def _travel(facts: Facts, joint: Joint) -> float:
    """A radian, or for a prismatic joint the reach of the robot, m."""
    return 1.0 if joint.is_revolute else facts.sizes.extent


def _stiff_transmissions(facts: Facts) -> Iterator[Measured]:
    """Stiffness at rest over the weight at full reach, per rad."""
    for joint, measured, held in _single_springs(facts):
        if joint.is_revolute:
            yield measured._replace(size=ratio(float(held.stiffness[0]), facts.sizes.scale(joint)))


def _soft_transmissions(facts: Facts) -> Iterator[Measured]:
    """A rad, or the reach, over the deflection under what the weight can ask, if there is any."""
    for joint, measured, held in _single_springs(facts) if any(facts.gravity) else ():
        yield measured._replace(size=ratio(_travel(facts, joint), float(held.phi[0, 1])))


def _single_springs(facts: Facts) -> Iterator[tuple[Joint, Measured, Transmission]]:
    """Each joint whose stiffness is not commanded, with its spring at rest and under what the weight can ask.

    What is measured is the stiffness or the law; its size is to be replaced.
    """
    for number, joint in enumerate(() if facts.placeholder else facts.joints):
        if joint.actuator.sprung and "stiffness" not in joint.actuator.commanded:
            command = Command.at_rest(np.array([0.0, facts.sizes.loads[number]]), np.zeros(2))
            held = joint.actuator.transmit(command, NEAR_SINGULAR_MARGIN, None)
            unit = "N m/rad" if joint.is_revolute else "N/m"
            constant = getattr(joint.actuator, "stiffness", None)
            path = joint_path(number, joint, "actuator", "spring" if constant is None else "stiffness")
            yield joint, Measured(path, math.nan if constant is None else constant, unit, math.nan), held


def _springs(facts: Facts) -> Iterator[tuple[Joint, NumberPath, SpringLaw]]:
    """The springs with their joints, as they are written."""
    for number, joint in enumerate(() if facts.placeholder else facts.joints):
        path = joint_path(number, joint, "actuator", "spring")
        for at, law in written_once(path, getattr(joint.actuator, "spring", None) or ()):
            yield joint, at, law


def _hardening(facts: Facts, share: float, *, of_pairs: bool = False) -> Iterator[Measured]:
    """Stiffness at a share of half a turn (of the reach), or where the law ends before, over that at rest.

    If asked for, only that of pairs, whose stiffness is chosen by it.
    """
    for joint, path, law in _springs(facts):
        if not law.is_linear and ("stiffness" in joint.actuator.commanded or not of_pairs):
            unit, full = ("rad", HALF_TURN) if joint.is_revolute else ("m", facts.sizes.extent)
            deflection = min(law.domain[1], share * full)
            rest, there = law.stiffness(np.array([0.0, deflection])).tolist()
            size = there / rest if rest else math.nan
            yield Measured(path, math.nan, "", size, {"deflection": f"{deflection:.3g} {unit}"})


def _deflections(facts: Facts) -> Iterator[Measured]:
    for joint, path, law in _springs(facts):
        ends = {"max_deflection": law.max_deflection, "file": law.domain[1]}
        for name, end in ends.items():
            if math.isfinite(end) and (name == "max_deflection" or law.sources):
                unit, full = ("rad", TURN) if joint.is_revolute else ("m", 2 * facts.sizes.extent)
                yield Measured((*path, name), end, unit, ratio(end, full))


def _stiffness_limits(facts: Facts) -> Iterator[Measured]:
    for index, joint in enumerate(() if facts.placeholder else facts.joints):
        found = corridor(joint)
        for side, limit in enumerate(joint.limits.stiffness if found else ()):
            if found and math.isfinite(limit):
                path = joint_path(index, joint, "limits", "stiffness", Entry(side))
                unit = "N m/rad" if joint.is_revolute else "N/m"
                beside = {"lower": f"{found.lower:.4g}", "unit": unit}
                size = ratio(limit, found.lower) if side else _lowest_size(limit, found)
                yield Measured(path, limit, unit, size, beside)


def _lowest_size(limit: float, found: Corridor) -> float:
    """The lower limit over the lower end of the corridor; NaN if it is below that end, which does no harm."""
    size = ratio(limit, found.lower)
    return size if limit > found.upper or size > 1 else math.nan


SPRING_RULES: tuple[Rule[Facts], ...] = (
    Rule(
        name="stiff springs",
        fields="`spring`",
        measure=_soft_ends,
        size="stiffness of the pair at rest, times 1 rad (the reach), over the robot's weight at its reach",
        high=1000,
        usual=4,
        finding="makes {stiffness} at rest, {size} times the robot's weight at its reach per rad (per reach)",
        reason="such a pair yields by a thousandth under the whole weight; shipped robots have 0.03 to 100",
        slips=TOO_STIFF,
        explained_by=SIZES,
    ),
    Rule(
        name="stiff transmissions",
        fields="`stiffness`, `spring` of elastic joints",
        measure=_stiff_transmissions,
        size="stiffness at rest times 1 rad, of revolute joints, over the weight of the robot at its reach",
        high=5000,
        usual=300,
        finding="is {size} times the weight of the robot at its reach per rad",
        reason="with strain wave gears even light arms stay below; prismatic joints may be stiffer",
        slips=TOO_STIFF,
        advice="if it does not yield, take `type: rigid`",
        explained_by=SIZES,
    ),
    Rule(
        name="soft transmissions",
        fields="`stiffness`, `spring` of elastic joints",
        measure=_soft_transmissions,
        size="1 rad or the reach over the deflection under what the weight of the stretched arm can ask",
        low=4,
        usual=50,
        finding="yields by more than 0.25 rad (of the reach) to what the weight of the stretched arm can ask",
        reason="the arm would hang down",
        slips=TOO_SOFT,
        explained_by=SIZES,
    ),
    Rule(
        name="hardening of springs",
        fields="`spring`",
        measure=lambda facts: _hardening(facts, 1.0, of_pairs=True),
        size="stiffness at a deflection of half a turn (of the reach), over that at rest",
        low=1.5,
        finding="is at {deflection} but {size} times as stiff as at rest",
        reason="a pair that hardly hardens cannot change its stiffness",
        advice="check the units of its constants: rad, not deg (m, not mm)",
    ),
    Rule(
        name="early hardening of springs",
        fields="`spring`",
        measure=lambda facts: _hardening(facts, SMALL_SHARE),
        size=f"stiffness at {SMALL_SHARE:g} of half a turn (of the reach), over that at rest",
        high=2,
        finding="is already at {deflection} {size} times as stiff as at rest",
        reason="springs of shipped robots take forty times the deflection to become twice as stiff",
        advice="check the units of its constants: N m/rad^3, say, not N mm/rad^3",
    ),
    Rule(
        name="deflections",
        fields="`max_deflection`, `file` of a table",
        measure=_deflections,
        size="turns (twice the reach)",
        high=0.5,
        usual=0.05,
        finding="is a deflection of more than half a turn (than the reach)",
        reason="springs in joints do not wind up so far",
        slips=(DEGREES, Slip("mm", 1e-3)),
        in_angles=True,
    ),
    Rule(
        name="limits of stiffness",
        fields="`limits.stiffness`",
        measure=_stiffness_limits,
        size="over the lowest that the springs give at rest",
        low=1,
        high=500,
        usual=2,
        finding="is {size} times the lowest that the springs give, {lower} {unit}",
        reason="below 1 nothing is within the limits, and springs do not become so much stiffer",
        slips=(*TOO_SOFT, *TOO_STIFF),
        advice="check the units of limits and springs",
    ),
)
