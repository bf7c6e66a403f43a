"""What angles, lengths and bodies of a robot are held against."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vsacli.documents.plausibility import Measured, Rule, Slip
from vsacli.robot.plausibility.facts import Facts, density_of_sphere, joint_path, ratio

TURN = 2 * math.pi
ROUNDED = 1e-3
"""Share by which an angle printed with a few digits may exceed a whole number of turns."""

FASTEST = 60.0
"""rad/s; limbs do not turn ten times a second."""

UNLIMITED_ANGLE = 1e4
"""rad; who writes larger ones into limits wants none."""

DEGREES = Slip("deg", math.pi / 180)
MILLIMETRES = Slip("mm", 1e-3)
CENTIMETRES = Slip("cm", 1e-2)
GRAMS = Slip("g", 1e-3, power=2.5)
"""At a given inertia, the density of the sphere goes with the mass to the power of 5/2, ..."""

INERTIA_POWER = -1.5
"""... and at a given mass with the inertia to this power."""

UNITS_OF_INERTIA = {"kg mm^2": 1e-6, "kg cm^2": 1e-4, "g cm^2": 1e-7, "g mm^2": 1e-9}


def in_turns(measured: Measured) -> Measured:
    """The angle in turns; none to judge if it is a multiple of a right angle in rad, but for rounding."""
    rights = measured.value / (TURN / 4)
    computed = not measured.value.is_integer() and abs(rights - round(rights)) < ROUNDED * abs(rights)
    return measured._replace(size=math.nan if computed else abs(measured.value) / TURN)


def _fixed_angles(facts: Facts) -> Iterator[Measured]:
    for measured in facts.of_unit("rad"):
        if "limits" not in measured.path and "actuator" not in measured.path:
            yield in_turns(measured)


def _ranges(facts: Facts) -> Iterator[Measured]:
    for measured in facts.of_unit("rad", "limits"):
        if abs(measured.value) < UNLIMITED_ANGLE:
            yield in_turns(measured)


def _strokes(facts: Facts) -> Iterator[Measured]:
    for measured in facts.of_unit("m", "limits"):
        yield measured._replace(size=ratio(measured.size, facts.sizes.extent))


def _velocities(facts: Facts) -> Iterator[Measured]:
    for measured in facts.of_unit("rad/s", "limits"):
        if not _power_of_ten(measured.size):
            yield measured


def _power_of_ten(value: float) -> bool:
    return value >= 100 and math.log10(value).is_integer()


def _lengths(facts: Facts) -> Iterator[Measured]:
    largest = float(np.max(facts.sizes.gyrations))
    for measured in facts.of_unit("m"):
        if {"dh", "com", "tool"} & {*measured.path}:
            beside = {"gyration": f"{largest:.3g}"}
            yield measured._replace(size=ratio(measured.size, largest), beside=beside)


def _places(facts: Facts) -> Iterator[Measured]:
    for measured in facts.of_unit("m", "base"):
        yield measured._replace(size=ratio(measured.size, facts.sizes.extent))


def _masses(facts: Facts, size: float = math.nan) -> Iterator[Measured]:
    """The mass of each link, with a size that is to be replaced."""
    for index, joint in enumerate(facts.joints):
        yield Measured(joint_path(index, joint, "link", "mass"), joint.link.mass, "kg", size)


def _densities(facts: Facts) -> Iterator[Measured]:
    for measured, joint in zip(_masses(facts), facts.joints, strict=True):
        yield measured._replace(size=density_of_sphere(joint.link))


def _gyrations(facts: Facts) -> Iterator[Measured]:
    """Over the reach from the base frame on, since single wheels and rotors have little of their own."""
    reach = facts.sizes.reach + math.hypot(*facts.base.xyz)
    for measured, gyration in zip(_masses(facts), facts.sizes.gyrations.tolist(), strict=True):
        yield measured._replace(size=ratio(gyration, reach))


def _crowding(facts: Facts) -> Iterator[Measured]:
    """The heaviest link, in the name of all, unless none has a mass, which the robot says by itself."""
    heaviest = max(_masses(facts), key=lambda measured: measured.value)
    if heaviest.value > 0:
        yield heaviest._replace(
            size=ratio(facts.sizes.mass, facts.sizes.extent**3),
            beside={"extent": f"{facts.sizes.extent:.3g}"},
        )


def _gravity(facts: Facts) -> Measured:
    size = math.hypot(*facts.gravity)
    return Measured(("gravity",), size, "m/s^2", size)


def _gravities(facts: Facts) -> Iterator[Measured]:
    """Its size, unless there is none, as in space."""
    if any(facts.gravity):
        yield _gravity(facts)


def _unit_vectors(facts: Facts) -> Iterator[Measured]:
    gravity = _gravity(facts)
    yield gravity._replace(size=abs(gravity.size - 1))


def _upward(facts: Facts) -> Iterator[Measured]:
    gravity = _gravity(facts)
    if not any(facts.base.rpy):
        yield gravity._replace(value=facts.gravity[2], size=ratio(facts.gravity[2], gravity.size))


ANGLE = Rule(
    name="fixed angles",
    fields="`alpha`, `theta`, `rpy`",
    measure=_fixed_angles,
    size="turns",
    high=1 + ROUNDED,
    usual=0.25,
    finding="is {size} turns",
    reason="an angle at which something is mounted is less than a turn",
    slips=(DEGREES,),
    in_angles=True,
)

BODY_RULES: tuple[Rule[Facts], ...] = (
    ANGLE,
    replace(
        ANGLE,
        name="ranges of revolute joints",
        fields="`limits.position`",
        measure=_ranges,
        high=2 + ROUNDED,
        reason="few joints make more than two turns; from 10,000 rad on it means no limit",
    ),
    Rule(
        name="ranges of prismatic joints",
        fields="`limits.position`",
        measure=_strokes,
        size="times the reach of the robot",
        high=40,
        usual=0.1,
        finding="is {size} times the reach of the robot",
        reason="even the track under an arm is shorter than so many arms",
        slips=(MILLIMETRES, CENTIMETRES),
    ),
    Rule(
        name="velocities of revolute joints",
        fields="`limits.velocity`",
        measure=_velocities,
        size="rad/s",
        high=FASTEST,
        usual=3,
        finding="is about ten turns a second or more",
        reason="limbs do not turn so fast; powers of ten from 100 on mean no limit",
        slips=(Slip("deg/s", math.pi / 180), Slip("rpm", math.pi / 30)),
        in_angles=True,
    ),
    Rule(
        name="velocities of prismatic joints",
        fields="`limits.velocity`",
        measure=lambda facts: facts.of_unit("m/s", "limits"),
        size="m/s",
        high=20,
        usual=0.5,
        finding="is faster than linear motors are",
        reason="faster than linear motors are",
        slips=(Slip("mm/s", 1e-3),),
    ),
    Rule(
        name="lengths",
        fields="`dh.a`, `dh.d`, `com`, `tool.xyz`",
        measure=_lengths,
        size="times the largest radius of gyration",
        high=30,
        usual=0.8,
        finding="is {size} times the largest radius of gyration of a link, {gyration} m",
        reason="masses lie along the rows that hold them; of 349 chains of real robots none has more than 8",
        slips=(MILLIMETRES, CENTIMETRES),
    ),
    Rule(
        name="place of the base",
        fields="`base.xyz`",
        measure=_places,
        size="times the reach of the robot",
        high=100,
        usual=1,
        finding="is {size} times the reach of the robot",
        reason="a robot stands in a room, whose origin is not so far away",
        slips=(MILLIMETRES,),
    ),
    Rule(
        name="densities of links",
        fields="`mass`, `inertia`",
        measure=_densities,
        size="kg/m^3, of the solid sphere with the same mass and sum of moments",
        low=2e-3,
        high=25000,
        usual=400,
        finding="makes a link as dense as a solid sphere of {size} kg/m^3",
        reason="osmium has 22,600, and the spheres of 349 chains of real robots have 0.006 to 11,000",
        slips=(
            GRAMS,
            Slip("t", 1e3, power=2.5),
            *(Slip(unit, size, INERTIA_POWER, field=("inertia",)) for unit, size in UNITS_OF_INERTIA.items()),
        ),
    ),
    Rule(
        name="sizes of links",
        fields="`mass`, `inertia`",
        measure=_gyrations,
        size="radius of gyration over the reach of the robot, from the base frame on",
        high=3,
        finding="makes a link whose radius of gyration is {size} times the reach of the robot",
        reason="a link is not larger than the whole robot; in 349 chains of real robots none exceeds 1.9",
        advice="check the units of mass, inertia and lengths",
        explained_by=("lengths", "densities of links"),
    ),
    Rule(
        name="mass of the robot",
        fields="`mass`",
        measure=_crowding,
        size="kg/m^3, of a cube as long as the reach",
        low=1e-4,
        high=1e4,
        usual=30,
        finding="makes, with the other links, {size} kg/m^3 of a cube as long as the reach, {extent} m",
        reason="the cube is almost empty: 349 chains of real robots have 0.3 to 510, iron has 7900",
        slips=(Slip("g", 1e-3), Slip("t", 1e3)),
        advice="check the units of masses and lengths",
        explained_by=("lengths", "densities of links", "sizes of links"),
    ),
    Rule(
        name="size of gravity",
        fields="`gravity`",
        measure=_gravities,
        size="m/s^2, if there is any",
        low=0.02,
        high=30,
        usual=9.81,
        finding="is that of no planet or moon",
        reason="on Jupiter it is 25, on Ceres 0.28",
        slips=(Slip("mm/s^2", 1e-3), Slip("km/s^2", 1e3), Slip("cm/s^2", 1e-2), Slip("ft/s^2", 0.3048)),
    ),
    Rule(
        name="gravity as a direction",
        fields="`gravity`",
        measure=_unit_vectors,
        size="distance of its length from 1 m/s^2",
        low=1e-3,
        finding="has the length 1",
        reason="a direction is not enough; no planet has just this",
        advice="write the acceleration, 9.81 times the direction on earth",
    ),
    Rule(
        name="direction of gravity",
        fields="`gravity`",
        measure=_upward,
        size="share of it that points along +z, if `base` is not turned",
        low=-math.inf,
        high=0.9,
        finding="points upwards, along +z of the base frame",
        reason="things fall; a robot that hangs from the ceiling has a turned `base`, `rpy: [pi, 0, 0]`",
        advice="did you mean the opposite sign? If it hangs from the ceiling, turn `base` instead",
    ),
)

SIZES = ("lengths", "densities of links", "sizes of links", "mass of the robot")
"""Rules on what the sizes of a robot follow from; where one of them finds something, these mean little."""
