"""What stiffness and wrench of a trajectory are held against."""

from __future__ import annotations

import math
from collections.abc import Iterator

from vsacli.actuators.laws import LAWS
from vsacli.base import units
from vsacli.documents.plausibility import Measured, Rule, Slip
from vsacli.documents.record_numbers import Entry
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.body_rules import SIZES
from vsacli.robot.plausibility.facts import ratio
from vsacli.robot.plausibility.spring_rules import NEWTON_MILLIMETRES, TOO_SOFT, Corridor
from vsacli.trajectory.plausibility.facts import Facts

COMMON_FORCE, COMMON_MOMENT = 100.0, 10.0
"""N, N m; up to these, wrenches may be large beside the robot, as of fingers that grip."""

WITH_LINEAR_PART = ("cubic", "polynomial")
"""Laws with a constant for the stiffness at rest; with others it is small at rest and grows fast."""


STIFFNESS_UNITS = (*TOO_SOFT, NEWTON_MILLIMETRES)

SPRINGS = ("stiff springs", "hardening of springs", "early hardening of springs")
"""Rules of the robot that explain what is found here."""

AMPLITUDES = frozenset(("sine", "cosine"))
"""Keys of what swings about a stiffness, and is none."""

LOWEST_SHARE = 0.2
"""A smaller share of the lowest stiffness at rest is no soft wish but another unit."""


def _wrenches(facts: Facts, *, forces: bool) -> Iterator[Measured]:
    """Components over the weight of the robot, moments over that at its reach."""
    scale = facts.sizes.weight * (1.0 if forces else facts.sizes.extent)
    common, unit = (COMMON_FORCE, "N") if forces else (COMMON_MOMENT, "N m")
    for path, quantity, value, _ in facts.numbers if not facts.robot.placeholder else ():
        if quantity == units.WRENCH and isinstance(path[-1], Entry) and (path[-1].number < 3) == forces:
            size = ratio(abs(value), scale) if value else math.nan
            yield Measured(path, value, unit, min(size, 1.0) if abs(value) < common else size)


def _commanded(facts: Facts) -> Iterator[tuple[Measured, Joint, Corridor]]:
    """Every stiffness but amplitudes, with its joint, and with what the springs give at rest."""
    for measured, number in facts.of_joints(units.STIFFNESS) if not facts.robot.placeholder else ():
        found = facts.corridors[number]
        if found is not None and AMPLITUDES.isdisjoint(measured.path):
            ends = {"lower": f"{found.lower:.4g}", "upper": f"{found.upper:.4g}", "unit": measured.unit}
            yield measured._replace(beside=ends), facts.robot.joints[number], found


def _above_lowest(facts: Facts, *, linear: bool) -> Iterator[Measured]:
    """Over the lowest, at joints whose springs all have a linear part, or at the others."""
    for measured, joint, found in _commanded(facts):
        laws = getattr(joint.actuator, "spring", ())
        each_linear = bool(laws) and all(LAWS.name_of(type(law)) in WITH_LINEAR_PART for law in laws)
        if each_linear == linear:
            yield measured._replace(size=ratio(measured.size, found.lower))


def _above_highest(facts: Facts) -> Iterator[Measured]:
    for measured, _, found in _commanded(facts):
        yield measured._replace(size=measured.size / found.upper)


EFFORT_RULES: tuple[Rule[Facts], ...] = (
    Rule(
        name="forces on the end effector",
        fields="`wrench`",
        measure=lambda facts: _wrenches(facts, forces=True),
        size=f"over the weight of the robot; above 1 only from {COMMON_FORCE:g} N on",
        low=1e-4,
        high=10,
        usual=0.2,
        finding="is {size} of the weight of the robot",
        reason="the robot could not bear more, and would not feel less",
        slips=(Slip("kN", 1e3), Slip("g", 9.81e-3), Slip("mN", 1e-3)),
        explained_by=SIZES,
    ),
    Rule(
        name="moments on the end effector",
        fields="`wrench`",
        measure=lambda facts: _wrenches(facts, forces=False),
        size=f"over the weight of the robot at its reach; above 1 only from {COMMON_MOMENT:g} N m on",
        low=1e-5,
        high=10,
        usual=0.02,
        finding="is {size} of the weight of the robot at its reach",
        reason="the robot could not bear more, and would not feel less",
        slips=(Slip("kN m", 1e3), Slip("N mm", 1e-3), Slip("N cm", 1e-2)),
        explained_by=SIZES,
    ),
    Rule(
        name="stiffness beside linear parts of springs",
        fields="`stiffness`: all values",
        measure=lambda facts: _above_lowest(facts, linear=True),
        size="over the lowest that cubic and polynomial springs give at rest",
        low=LOWEST_SHARE,
        high=20,
        usual=1.5,
        finding="is {size} times the lowest that the springs give without load, {lower} {unit}",
        reason="below there is no way, and far above the linear part of the springs would not matter",
        slips=STIFFNESS_UNITS,
        advice="check its unit and those of the springs",
        explained_by=SPRINGS,
    ),
    Rule(
        name="stiffness beside other springs",
        fields="`stiffness`: all values",
        measure=lambda facts: _above_lowest(facts, linear=False),
        size="over the lowest that springs of other laws give at rest",
        low=LOWEST_SHARE,
        high=1000,
        usual=3,
        finding="is {size} times the lowest that the springs give without load, {lower} {unit}",
        reason="below there is no way; of the robots that come along none goes beyond 300",
        slips=STIFFNESS_UNITS,
        advice="check its unit and those of the springs",
        explained_by=SPRINGS,
    ),
    Rule(
        name="stiffness beyond the springs",
        fields="`stiffness`: all values",
        measure=_above_highest,
        size="over the highest that the springs give at rest",
        high=5,
        usual=0.5,
        finding="is {size} times the highest that the springs give without load, {upper} {unit}",
        reason="there is no way to so much",
        slips=STIFFNESS_UNITS,
        advice="check its unit and those of the springs",
        explained_by=SPRINGS,
    ),
)
