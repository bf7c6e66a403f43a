"""What positions, durations and rates of a trajectory are held against."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vsacli.base import units
from vsacli.base.units import Quantity
from vsacli.documents.plausibility import Measured, Rule, Slip
from vsacli.robot.plausibility.body_rules import (
    CENTIMETRES,
    DEGREES,
    FASTEST,
    MILLIMETRES,
    ROUNDED,
    SIZES,
    in_turns,
)
from vsacli.robot.plausibility.facts import ratio
from vsacli.trajectory.plausibility.facts import PER_SECOND, Facts

LONG = 100.0
"""s; shorter motions may be as slow as they like."""

UNITS_OF_TIME = (Slip("ms", 1e-3, -1), Slip("us", 1e-6, -1), Slip("min", 60, -1), Slip("h", 3600, -1))
POSITIONS = (
    "positions of revolute joints",
    "positions of prismatic joints",
    "ranges of revolute joints",
    "ranges of prismatic joints",
)
FAST = ("fast motions of revolute joints", "fast motions of prismatic joints")
"""Rules, also of the robot, that explain what others would find."""


def _positions(facts: Facts, unit: str) -> Iterator[tuple[Measured, int]]:
    """Positions in a unit, but for those within the limits of the joint."""
    for measured, joint in facts.of_joints(units.POSITION):
        low, high = facts.robot.joints[joint].limits.position
        if measured.unit == unit and not -math.inf < low <= measured.value <= high < math.inf:
            yield measured, joint


def _angles(facts: Facts) -> Iterator[Measured]:
    return (in_turns(measured) for measured, _ in _positions(facts, "rad"))


def _strokes(facts: Facts) -> Iterator[Measured]:
    for measured, _ in _positions(facts, "m"):
        yield measured._replace(size=ratio(measured.size, facts.sizes.extent))


def _slowness(facts: Facts) -> Iterator[Measured]:
    """Mean velocity of the joint that moves most, prismatic ones in reaches of the robot."""
    if facts.moved is not None and facts.duration > LONG:
        way = np.abs(np.diff(facts.moved[0])).sum(axis=1) / facts.travels
        if way.any():
            yield from facts.paced(units.TIME, way / facts.duration)


def _velocities(facts: Facts, *, revolute: bool) -> Iterator[Measured]:
    """The largest of joints of a type."""
    if facts.moved is not None:
        sizes = np.where(facts.revolute == revolute, np.abs(facts.moved[1]).max(axis=1), 0.0)
        yield from facts.paced(units.TIME, sizes, unit="rad/s" if revolute else "m/s")


def _accelerations(facts: Facts, quantity: Quantity) -> Iterator[Measured]:
    """The largest of what is farthest from a joint, m/s^2."""
    if facts.moved is not None and not facts.robot.placeholder:
        levers = np.where(facts.revolute, facts.sizes.levers, 1.0)
        yield from facts.paced(quantity, np.abs(facts.moved[2]).max(axis=1) * levers)


def _rates(facts: Facts) -> Iterator[Measured]:
    for path, quantity, value, _ in facts.numbers:
        if quantity == units.RATE and path == ("rate",):
            yield Measured(path, value, PER_SECOND, value)


def _steps(facts: Facts) -> Iterator[Measured]:
    for rate in _rates(facts):
        yield rate._replace(size=rate.value * facts.duration)


ACCELERATIONS: Rule[Facts] = Rule(
    name="accelerations",
    fields="`duration`, `times`",
    measure=lambda facts: _accelerations(facts, units.TIME),
    size="m/s^2, largest acceleration of what is farthest from the joint",
    high=300,
    usual=3,
    finding="makes what is farthest from {joint} accelerate at up to {size} m/s^2",
    reason="thirty times gravity; the fastest parallel robots reach half of it",
    slips=tuple(Slip(slip.unit, slip.factor, -2) for slip in UNITS_OF_TIME),
    advice="check it, and the positions",
    explained_by=(*POSITIONS, *SIZES, *FAST),
)

MOTION_RULES: tuple[Rule[Facts], ...] = (
    Rule(
        name="positions of revolute joints",
        fields="`position`: all values",
        measure=_angles,
        size="turns",
        high=1 + ROUNDED,
        usual=0.2,
        finding="is {size} turns",
        reason="few joints make more than a turn; positions within the limits of the joint pass",
        slips=(DEGREES,),
        in_angles=True,
    ),
    Rule(
        name="positions of prismatic joints",
        fields="`position`: all values",
        measure=_strokes,
        size="times the reach of the robot",
        high=40,
        usual=0.1,
        finding="is {size} times the reach of the robot",
        reason="even the track under an arm is shorter; positions within the limits of the joint pass",
        slips=(MILLIMETRES, CENTIMETRES),
        explained_by=SIZES,
    ),
    Rule(
        name="slow motions",
        fields="`duration`, `times`",
        measure=_slowness,
        size=f"1/s, mean velocity in rad (reaches of the robot) of motions longer than {LONG:g} s",
        low=1e-3,
        usual=0.5,
        finding="lets no joint move faster than {size} rad (reaches) a second in the mean",
        reason="a turn would take more than an hour and a half",
        slips=UNITS_OF_TIME,
    ),
    Rule(
        name="fast motions of revolute joints",
        fields="`duration`, `times`",
        measure=lambda facts: _velocities(facts, revolute=True),
        size="rad/s, largest velocity",
        high=FASTEST,
        usual=2,
        finding="makes {joint} move at up to {size} {unit}",
        reason="limbs do not turn ten times a second",
        slips=UNITS_OF_TIME,
        advice="check it, and the positions",
        explained_by=POSITIONS,
    ),
    Rule(
        name="fast motions of prismatic joints",
        fields="`duration`, `times`",
        measure=lambda facts: _velocities(facts, revolute=False),
        size="m/s, largest velocity",
        high=20,
        usual=0.5,
        finding="makes {joint} move at up to {size} {unit}",
        reason="faster than linear motors for machines are",
        slips=UNITS_OF_TIME,
        advice="check it, and the positions",
        explained_by=POSITIONS,
    ),
    ACCELERATIONS,
    replace(
        ACCELERATIONS,
        name="accelerations of sinusoids",
        fields="`frequency`",
        measure=lambda facts: _accelerations(facts, units.RATE),
        slips=(Slip("rad/s", 0.5 / math.pi, 2),),
        advice="it counts periods in a second",
    ),
    Rule(
        name="numbers of steps",
        fields="`rate`",
        measure=_steps,
        size="steps of the whole motion",
        low=10,
        usual=4000,
        finding="makes but {size} steps of the whole motion",
        reason="nothing can be seen between so few",
        slips=(Slip("kHz", 1e3), Slip("1/ms", 1e3)),
        advice="it is the number of samples in a second",
        explained_by=(*FAST, "accelerations"),
    ),
    Rule(
        name="rates",
        fields="`rate`",
        measure=_rates,
        size="samples per second",
        high=2e5,
        finding="is {size} samples per second",
        reason="no controller of a robot is so fast",
        advice="it is the number of samples in a second",
    ),
)
