"""Numbers of a trajectory that are hardly what was meant, for the robot that is to execute it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vsacli.actuators.laws import LAWS
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import Problem
from vsacli.base.units import Quantity
from vsacli.documents.plausibility import Entry, Measured, Number, Rule, Slip, Written, findings
from vsacli.documents.source import Source
from vsacli.robot.model import Robot
from vsacli.robot.plausibility import strange_of_robot
from vsacli.robot.plausibility.body_rules import CENTIMETRES, DEGREES, MILLIMETRES, ROUNDED, SIZES, in_turns
from vsacli.robot.plausibility.drive_rules import TOO_SOFT, TOO_STIFF, Corridor, corridor
from vsacli.robot.plausibility.facts import BodySizes, ratio
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.times import Times

INSTANTS = 1001
"""Times, evenly spread, at which the motion is looked at; sums of sinusoids are the fastest to change."""

PER_SECOND = "per second"

LONG = 100.0
"""s; shorter motions may be as slow as they like."""

COMMON_FORCE, COMMON_MOMENT = 100.0, 10.0
"""N, N m; up to these, wrenches may be large beside the robot, as of fingers that grip."""

WITH_LINEAR_PART = ("cubic", "polynomial")
"""Laws with a constant for the stiffness at rest; with others it is small at rest and grows fast."""


@dataclass(frozen=True)
class Facts:
    """What the rules know of a trajectory.

    Attributes:
        robot: that is to execute it.
        numbers: all of the file.
        times: the steps.
        motion: the position over time if it is given by a formula; recorded ones are looked at elsewhere.
    """

    robot: Robot
    numbers: Sequence[Number]
    times: Times
    motion: Profile | None

    @cached_property
    def sizes(self) -> BodySizes:
        """Of the robot."""
        return BodySizes(self.robot.joints)

    @cached_property
    def moved(self) -> FloatArray | None:
        """Position and its derivatives, (orders, joints, instants); None if they are recorded."""
        return None if self.motion is None else self.motion.at(np.linspace(*self.times.span, INSTANTS))

    @cached_property
    def corridors(self) -> list[Corridor | None]:
        """What stiffness each joint can have at rest; None if it takes none."""
        return [corridor(joint) for joint in self.robot.joints]

    @cached_property
    def with_linear_part(self) -> set[str]:
        """Names of the joints whose springs all have a linear part."""
        return {
            joint.name
            for joint in self.robot.joints
            if all(
                LAWS.name_of(type(law)) in WITH_LINEAR_PART for law in getattr(joint.actuator, "spring", ())
            )
        }

    @property
    def revolute(self) -> BoolArray:
        """Which joints are, (joints,)."""
        return np.array([joint.is_revolute for joint in self.robot.joints])

    @property
    def travels(self) -> FloatArray:
        """A common way of each joint, (joints,): 1 rad, or the reach of the robot, m."""
        return np.where(self.revolute, 1.0, self.sizes.extent or math.nan)

    @property
    def duration(self) -> float:
        """From the first step to the last, s."""
        first, last = self.times.span
        return last - first

    def of_joints(self, quantity: Quantity) -> Iterator[tuple[Measured, int]]:
        """The numbers that measure this, each with its joint and with its magnitude as size."""
        for path, measured, value in self.numbers:
            if measured == quantity and isinstance(path[-1], Entry):
                joint = path[-1].number
                unit = quantity.unit(self.robot.joint_types[joint])
                yield Measured(path, value, unit, abs(value)), joint

    def paced(self, quantity: Quantity, sizes: FloatArray, **beside: str) -> Iterator[Measured]:
        """The number that the pace follows from, if it is a time or a frequency, with the largest size."""
        given = [each for each in self.numbers if each.path[-1] == "frequency"]
        given = given or [each for each in self.numbers if each.quantity == units.TIME]
        longest = max(given, key=lambda each: each.value, default=None)
        if longest is not None and longest.quantity == quantity:
            joint = int(np.argmax(sizes))
            names = {"joint": self.robot.joint_names[joint], **beside}
            unit = "s" if quantity == units.TIME else PER_SECOND
            yield Measured(longest.path, longest.value, unit, float(sizes[joint]), names)


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
    if facts.moved is not None:
        levers = np.where(facts.revolute, facts.sizes.levers, 1.0)
        yield from facts.paced(quantity, np.abs(facts.moved[2]).max(axis=1) * levers)


def _rates(facts: Facts) -> Iterator[Measured]:
    for path, quantity, value in facts.numbers:
        if quantity == units.RATE and path == ("rate",):
            yield Measured(path, value, PER_SECOND, value)


def _steps(facts: Facts) -> Iterator[Measured]:
    for rate in _rates(facts):
        yield rate._replace(size=rate.value * facts.duration)


def _wrenches(facts: Facts, *, forces: bool) -> Iterator[Measured]:
    """Components over the weight of the robot, moments over that at its reach."""
    scale = facts.sizes.weight * (1.0 if forces else facts.sizes.extent)
    common, unit = (COMMON_FORCE, "N") if forces else (COMMON_MOMENT, "N m")
    for path, quantity, value in facts.numbers:
        if quantity == units.WRENCH and isinstance(path[-1], Entry) and (path[-1].number < 3) == forces:
            size = ratio(abs(value), scale) if value else math.nan
            yield Measured(path, value, unit, min(size, 1.0) if abs(value) < common else size)


def _stiffness(facts: Facts, *, linear: bool) -> Iterator[Measured]:
    """Commanded stiffness over the lowest that the springs give at rest."""
    if facts.robot.placeholder:
        return
    for measured, joint in facts.of_joints(units.STIFFNESS):
        found = facts.corridors[joint]
        if found is not None and linear == (facts.robot.joints[joint].name in facts.with_linear_part):
            beside = {"lower": f"{found.lower:.4g}", "unit": measured.unit}
            yield measured._replace(size=ratio(measured.size, found.lower), beside=beside)


def _stiffness_above(facts: Facts) -> Iterator[Measured]:
    """Commanded stiffness over the highest that the springs give at rest."""
    if facts.robot.placeholder:
        return
    for measured, joint in facts.of_joints(units.STIFFNESS):
        found = facts.corridors[joint]
        if found is not None and math.isfinite(found.upper):
            beside = {"upper": f"{found.upper:.4g}", "unit": measured.unit}
            yield measured._replace(size=ratio(measured.size, found.upper), beside=beside)


UNITS_OF_TIME = (Slip("ms", 1e-3, -1), Slip("us", 1e-6, -1), Slip("min", 60, -1), Slip("h", 3600, -1))
STIFFNESS_UNITS = (*TOO_SOFT, *TOO_STIFF)
POSITIONS = (
    "positions of revolute joints",
    "positions of prismatic joints",
    "ranges of revolute joints",
    "ranges of prismatic joints",
)
FAST = ("fast motions of revolute joints", "fast motions of prismatic joints")
SPRINGS = ("stiff springs", "hardening of springs")
"""Rules, also of the robot, that explain what others would find."""
LOWEST_SHARE = 0.2
"""A smaller share of the lowest stiffness at rest is no soft wish but another unit."""

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

TRAJECTORY_RULES: tuple[Rule[Facts], ...] = (
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
        usual=0.2,
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
        high=60,
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
        measure=lambda facts: _stiffness(facts, linear=True),
        size="over the lowest that cubic and polynomial springs give at rest",
        low=LOWEST_SHARE,
        high=20,
        usual=1.5,
        finding="is {size} times the lowest that the springs give without load, {lower} {unit}",
        reason="below there is no way, and far above the linear part of the springs would not matter",
        slips=STIFFNESS_UNITS,
        advice="check the units of both",
        explained_by=SPRINGS,
    ),
    Rule(
        name="stiffness beside other springs",
        fields="`stiffness`: all values",
        measure=lambda facts: _stiffness(facts, linear=False),
        size="over the lowest that springs of other laws give at rest",
        low=LOWEST_SHARE,
        high=5000,
        usual=3,
        finding="is {size} times the lowest that the springs give without load, {lower} {unit}",
        reason="below there is no way; of the robots that come along none goes beyond 300",
        slips=STIFFNESS_UNITS,
        advice="check the units of both",
        explained_by=SPRINGS,
    ),
    Rule(
        name="stiffness beyond the springs",
        fields="`stiffness`: all values",
        measure=_stiffness_above,
        size="over the highest that the springs give at rest",
        high=5,
        usual=0.5,
        finding="is {size} times the highest that the springs give without load, {upper} {unit}",
        reason="there is no way to so much",
        slips=STIFFNESS_UNITS,
        advice="check the units of both",
        explained_by=SPRINGS,
    ),
)


def implausible(facts: Facts, source: Source) -> tuple[Problem, ...]:
    """What the rules find, with the lines of the trajectory file."""
    known = strange_of_robot(facts.robot.facts)
    return findings(TRAJECTORY_RULES, facts, Written(source), known)
