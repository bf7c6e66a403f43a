"""Plausibility rules of angles, lengths, limits, masses and gravity of a robot; links that no body can be."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import Problem
from vsacli.documents.plausibility import Measured, OtherUnit, Rule, ValuesInFile
from vsacli.documents.record_values import NumberPath, PathIndex
from vsacli.robot.joint import INERTIA_ROUNDING, Inertia, Joint, Pose
from vsacli.robot.plausibility.checked_robot import CheckedRobot, density_of_sphere, joint_path, ratio_or_nan

TURN = 2 * math.pi
ROUNDED = 1e-3
"""Share by which an angle printed with a few digits may exceed an integer number of turns."""

FASTEST = 60.0
"""Largest velocity, rad/s; limbs do not turn ten times a second."""

UNLIMITED_ANGLE = 1e4
"""Angle, rad; larger limits mean no limit."""

DEGREES = OtherUnit("deg", math.pi / 180)
DEGREES_PER_SECOND = OtherUnit("deg/s", math.pi / 180)
RPM = OtherUnit("rpm", math.pi / 30)
MILLIMETERS = OtherUnit("mm", 1e-3)
CENTIMETERS = OtherUnit("cm", 1e-2)
GRAMS = OtherUnit("g", 1e-3, power=2.5)
"""Unit of the mass, which has the power 5/2 in the density of the sphere, at a given inertia."""

INERTIA_POWER = -1.5
"""Power of the inertia in the density of the sphere, at a given mass."""

UNITS_OF_INERTIA = {"kg mm^2": 1e-6, "kg cm^2": 1e-4, "g cm^2": 1e-7, "g mm^2": 1e-9}
SLIPS_OF_DENSITY = (
    GRAMS,
    OtherUnit("t", 1e3, power=2.5),
    *(OtherUnit(unit, size, INERTIA_POWER, field=("inertia",)) for unit, size in UNITS_OF_INERTIA.items()),
)
SLIPS_OF_GRAVITY = (
    OtherUnit("mm/s^2", 1e-3),
    OtherUnit("km/s^2", 1e3),
    OtherUnit("cm/s^2", 1e-2),
    OtherUnit("ft/s^2", 0.3048),
)
SLIPS_OF_DAMPING = (
    OtherUnit("N mm s/rad", 1e-3, instead_of="N m s/rad"),
    OtherUnit("N m s/deg", 180 / math.pi, instead_of="N m s/rad"),
    OtherUnit("N s/mm", 1e3, instead_of="N s/m"),
)
BEYOND = 0.25
"""Lengths of a link by which its center of mass may be beyond its ends."""

SLENDER = 2.0
"""Length of a link over its radius of gyration from which on the link is long enough to have two ends; of a
thin rod it is 3.5."""

KEYS_OF_LENGTHS = ("dh", "com", "tool", "tools", "mount")
"""Keys on the paths of lengths of a robot's bodies."""

SIZES = (
    "systems of units",
    "lengths",
    "long links",
    "masses of links",
    "densities of links",
    "sizes of links",
)
"""Names of rules of numbers that determine the sizes of a robot; if one has findings, sizes mean little."""

COMMON_SYSTEMS = (("mm", "g", "g mm^2"), ("mm", "kg", "kg mm^2"), ("cm", "g", "g cm^2"), ("m", "g", "g m^2"))
UNIT_SYSTEMS = {
    units: np.array([factor for _, factor in system])
    for system in itertools.product(
        {"m": 1.0, "mm": 1e-3, "cm": 1e-2}.items(),
        {"kg": 1.0, "g": 1e-3}.items(),
        {"kg m^2": 1.0, **UNITS_OF_INERTIA, "g m^2": 1e-3}.items(),
    )
    if (units := tuple(unit for unit, _ in system)) in COMMON_SYSTEMS or "g m^2" not in units
}
"""Systems of units of lengths, masses and inertias, with the factors to the proper one, the first."""

PROPER = next(iter(UNIT_SYSTEMS))
UNLIKELY = 4.0
"""Squared distance from usual sizes that each field in another unit has to save; common systems
count as one field."""

POWERS = np.array([(1, 0, 0), (-3, 1, 0), (1, 0.5, -0.5), (0, 2.5, -1.5), (-1, -0.5, 0.5)])
"""Powers of length, mass and inertia of reach, mass over reach cubed, and the sizes of three rules."""

USUAL, SPREADS = np.array([-0.1, 1.4, 2.45]), np.array([0.5, 0.8, 0.6])
"""Median and spread of the logarithms of reach, m, mass over reach cubed, kg/m^3, and median density of
links, of half of the bundled and real robots; few are as small as fingers, so a spread of 0.35 became 0.5."""

MOST, LONG = 0.6, 8.0
"""Share of the lengths that are longer than this number of gyrations if all of them have another
unit, not a few."""

Measure: TypeAlias = Callable[[CheckedRobot], Iterator[Measured]]


def turns(angle: float) -> float:
    """Return an angle in turns; NaN (not judged) for a computed multiple of a right angle, up to rounding."""
    rights = angle / (TURN / 4)
    computed = not angle.is_integer() and abs(rights - round(rights)) < ROUNDED * abs(rights)
    return math.nan if computed else abs(angle) / TURN


def _measure_numbers(
    unit: str,
    *keys: str,
    without: tuple[str, ...] = (),
    size: Callable[[CheckedRobot, float], float] | None = None,
) -> Measure:
    """Return the measure of numbers in a unit with any of `keys` and none of `without` on their paths.

    Their size is |value|, unless given by `size`.
    """

    def measure(checked: CheckedRobot) -> Iterator[Measured]:
        for number in checked.of_unit(unit):
            on_path = {*number.path}
            if (not keys or on_path & {*keys}) and not on_path & {*without}:
                yield number if size is None else number._replace(size=size(checked, number.value))

    return measure


def _in_extents(checked: CheckedRobot, length: float) -> float:
    return ratio_or_nan(abs(length), checked.sizes.extent)


def _turns_of_limit(_: CheckedRobot, angle: float) -> float:
    return turns(angle) if abs(angle) < UNLIMITED_ANGLE else math.nan


def _speed_of_limit(_: CheckedRobot, velocity: float) -> float:
    """Return |velocity|; NaN for powers of ten from 100 on, which mean no limit."""
    size = abs(velocity)
    return math.nan if size >= 100 and math.log10(size).is_integer() else size


def _measure_lengths(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield lengths over the largest gyration; mounts on the base, where all may stand, over the reach."""
    largest, reach = float(np.max(checked.sizes.gyrations)), checked.sizes.reach
    for number in _measure_numbers("m", *KEYS_OF_LENGTHS)(checked):
        if "mount" in number.path and number.path[1] == PathIndex(0, checked.joints[0].name):
            size, reference = ratio_or_nan(number.size, reach), f"the reach of what it carries, {reach:.3g} m"
        else:
            size = ratio_or_nan(number.size, largest)
            reference = f"the largest radius of gyration of a link, {largest:.3g} m"
        yield number._replace(size=size, beside={"reference": reference})


def _measure_link_masses(size: Callable[[CheckedRobot, int], float]) -> Measure:
    """Return the measure of the mass of each link, with a size from its index."""

    def measure(checked: CheckedRobot) -> Iterator[Measured]:
        for index, joint in enumerate(checked.joints):
            path = joint_path(index, joint, "link", "mass")
            yield Measured(path, joint.link.mass, "kg", size(checked, index))

    return measure


def _relative_gyration(checked: CheckedRobot, index: int) -> float:
    """Return the radius of gyration over the reach from the base frame; single wheels have little reach."""
    return ratio_or_nan(
        float(checked.sizes.gyrations[index]), checked.sizes.reach + checked.distance_from_base_frame
    )


def _measure_centers_of_mass(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield how far the center of mass of each slender link is beyond its ends, over its length.

    The length of a link that carries no joint is its `a`, since its frame may be anywhere along `d`.
    """
    for index, joint in enumerate(checked.joints):
        carries = index in checked.parents
        a, d, alpha = joint.dh.a, joint.dh.d if carries else 0.0, joint.dh.alpha
        length = math.hypot(a, d)
        if joint.is_revolute and length > SLENDER * checked.sizes.gyrations[index] > 0:
            along = np.array([a, d * math.sin(alpha), d * math.cos(alpha)]) / length**2
            com = float(along @ joint.link.com)  # -1 at the joint, 0 at the link's frame
            places = [-1.0, 0.0, *(float(along @ point) for point in _points_on_link(checked, index))]
            ends = np.array([min(places), max(places)])
            beyond = {
                words: float(np.max((ends - com * factor) * (1, -1)))
                for words, factor in {"": 1.0, "the opposite sign": -1.0, "a tenth of it": 0.1}.items()
            }
            meant = [words for words, length in beyond.items() if length < BEYOND]
            beside = {
                "end": "its joint" if com < ends[0] else "its far end",
                "meant": (*meant, "the opposite sign")[0],
            }
            path = joint_path(index, joint, "link", "com")
            yield Measured(path, math.nan, "m", beyond[""], beside)


def _points_on_link(checked: CheckedRobot, carrier: int) -> Iterator[tuple[float, float, float]]:
    """Yield the positions of mounts and tools on a link, in its frame, m."""
    for joint, parent in zip(checked.joints, checked.parents, strict=True):
        if parent == carrier and joint.mount is not None:
            yield joint.mount.xyz
    for tool, parent in zip(checked.end_effectors, checked.tool_joints, strict=True):
        if parent == carrier:
            yield tool.xyz


def _measure_gravity(size: Callable[[float], float]) -> Measure:
    """Return the measure of the magnitude of gravity, with a size from it."""

    def measure(checked: CheckedRobot) -> Iterator[Measured]:
        value = math.hypot(*checked.gravity)
        yield Measured(("gravity",), value, "m/s^2", size(value))

    return measure


def _measure_load_of_gravity(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the largest sine of the angles between gravity and successive axes, if all joints are revolute.

    Without any such angle all axes are along gravity, in every configuration.
    """
    size = math.hypot(*checked.gravity)
    if size and not checked.placeholder and all(joint.is_revolute for joint in checked.joints):
        off_base = np.cross(_turned_z(checked.base), checked.gravity) / size
        off_mounts = (_turned_z(joint.mount)[:2] for joint in checked.joints if joint.mount is not None)
        twists = (math.sin(checked.joints[carrier].dh.alpha) for carrier in {*checked.parents} - {-1})
        sines = [math.hypot(*off_base), *(math.hypot(*off) for off in off_mounts), *map(abs, twists)]
        yield Measured(("gravity",), size, "m/s^2", max(sines))


def _turned_z(pose: Pose) -> tuple[float, float, float]:
    """Return the z axis of a pose, in the frame in which it is given."""
    (cr, cp, cy), (sr, sp, sy) = (tuple(map(wave, pose.rpy)) for wave in (math.cos, math.sin))
    return cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr


def _measure_upward_gravity(checked: CheckedRobot) -> Iterator[Measured]:
    upward = checked.gravity[2]
    if not any(checked.base.rpy):
        yield Measured(("gravity",), upward, "m/s^2", ratio_or_nan(upward, math.hypot(*checked.gravity)))


def _guess_system(checked: CheckedRobot) -> tuple[str, ...]:
    """Return the units that make a robot most usual; the proper ones if its sizes are plausible in these."""
    gyrations, mass = checked.sizes.gyrations[checked.sizes.gyrations > 0], checked.sizes.mass
    reach = np.array([checked.sizes.reach + checked.distance_from_base_frame])
    lengths = np.abs([(*joint.link.com, joint.dh.a, joint.dh.d) for joint in checked.joints])
    densities = np.array([density_of_sphere(joint.link) for joint in checked.joints])
    if not mass or not len(gyrations) or not lengths.any():
        return PROPER
    sizes = [reach, mass / reach**3, lengths[lengths > 0] / max(gyrations)]
    sizes += [densities[densities > 0], gyrations / reach]
    rules = [rule for rule in BODY_RULES if rule.name in ("lengths", "densities of links", "sizes of links")]
    ranges = [(0.0, math.inf), (3e-3, 2e4), *((rule.low, rule.high) for rule in rules)]
    if _are_plausible(sizes, ranges, PROPER):
        return PROPER
    units = min(UNIT_SYSTEMS, key=lambda units: _distance_from_usual(sizes, units))
    length, mass, inertia = UNIT_SYSTEMS[units]
    shortest = np.quantile(sizes[2], 1 - MOST, method="lower") * math.sqrt(mass / inertia)
    return units if (length == 1 or shortest > LONG) and _are_plausible(sizes, ranges, units) else PROPER


def _are_plausible(
    sizes: list[FloatArray], ranges: list[tuple[float, float]], units: tuple[str, ...]
) -> bool:
    scales = np.prod(UNIT_SYSTEMS[units] ** POWERS, axis=1)
    return all(
        np.all((low <= size * scale) & (size * scale < high))
        for size, scale, (low, high) in zip(sizes, scales, ranges, strict=True)
    )


def _distance_from_usual(sizes: list[FloatArray], units: tuple[str, ...]) -> float:
    """Return the sum of squares of the deviations from usual sizes, and a charge for each field."""
    changes = 1 if units in COMMON_SYSTEMS else np.count_nonzero(UNIT_SYSTEMS[units] != 1)
    logarithms = np.log10([np.median(size) for size in sizes]) + POWERS @ np.log10(UNIT_SYSTEMS[units])
    return float(np.sum(((logarithms[[0, 1, 3]] - USUAL) / SPREADS) ** 2)) + UNLIKELY * changes


def _measure_unit_systems(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the first length, mass and inertia, each with the number of its units in the proper one."""
    sizes, joint = checked.sizes, checked.joints[0]
    text = f"{sizes.reach:.3g} m, {sizes.mass:.3g} kg and {np.max(sizes.gyrations):.3g} m"
    numbers = {
        "lengths": next((each for each in _measure_lengths(checked) if each.value), None),
        "masses": Measured(joint_path(0, joint, "link", "mass"), joint.link.mass, "kg", math.nan),
        "inertias": Measured(joint_path(0, joint, "link", "inertia"), math.nan, "kg m^2", math.nan),
    }
    factors = UNIT_SYSTEMS[_guess_system(checked)]
    for (kind, number), factor in zip(numbers.items(), factors, strict=True):
        if factor != 1 and number is not None:
            yield number._replace(size=1 / factor, beside={"kind": kind, "sizes": text})


BODY_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("fixed angles", "`alpha`, `theta`, `rpy`",
        _measure_numbers("rad", without=("limits", "actuator"), size=lambda _, angle: turns(angle)),
        size="turns", high=1 + ROUNDED, usual=0.25,
        reason="mounting angles are less than a turn",
        finding="is {size} turns", units=(DEGREES,), in_angles=True),
    Rule("ranges of revolute joints", "`limits.position`",
        _measure_numbers("rad", "limits", size=_turns_of_limit),
        size="turns", high=2 + ROUNDED, usual=0.25,
        reason="few joints turn further; from 10,000 rad on, no limit is meant",
        finding="is {size} turns", units=(DEGREES,), in_angles=True),
    Rule("ranges of prismatic joints", "`limits.position`", _measure_numbers("m", "limits", size=_in_extents),
        size="over the reach", high=40, usual=0.1,
        reason="tracks of arms are shorter",
        finding="is {size} times the reach of the robot", units=(MILLIMETERS, CENTIMETERS)),
    Rule("velocities of revolute joints", "`limits.velocity`",
        _measure_numbers("rad/s", "limits", size=_speed_of_limit),
        size="rad/s", high=FASTEST, usual=3,
        reason="limbs are slower; powers of ten from 100 on mean no limit",
        finding="is about ten turns a second or more",
        units=(DEGREES_PER_SECOND, RPM), in_angles=True),
    Rule("velocities of prismatic joints", "`limits.velocity`", _measure_numbers("m/s", "limits"),
        size="m/s", high=20, usual=0.5, reason="linear motors are slower",
        finding="is faster than linear motors are", units=(OtherUnit("mm/s", 1e-3),)),
    Rule(SIZES[0], "all of `dh.a`, `dh.d`, `com` and `xyz`, of `mass`, or of `inertia`",
        _measure_unit_systems,
        size="proper unit over that with which reach, density and mass over reach cubed are most usual",
        high=2, reason="only if one of these or the size of a link is implausible",
        finding="is too large, as are all {kind}: reach, mass and radius of gyration of {sizes} fit no robot",
        units=tuple(
            OtherUnit(unit, float(factor), instead_of=proper)
            for units, factors in UNIT_SYSTEMS.items()
            for unit, factor, proper in zip(units, factors, PROPER, strict=True)
        )),
    Rule("lengths", "`dh.a`, `dh.d`, `com`, `xyz` of `mount`, `tool`, `tools`", _measure_lengths,
        size="over the largest radius of gyration; of mounts on the base, over the reach", high=30, usual=0.8,
        reason="real robots: up to 8",
        finding="is {size} times {reference}",
        units=(MILLIMETERS, CENTIMETERS), explained_by=SIZES[:1]),
    Rule("long links", "`dh.a`, `dh.d`, `com`, `xyz` of `mount`, `tool`, `tools`",
        _measure_numbers("m", *KEYS_OF_LENGTHS),
        size="m", high=20,
        reason="links of space manipulators have up to 10 m",
        finding="is longer than links are", units=(MILLIMETERS,), explained_by=SIZES[:2]),
    Rule("masses of links", "`mass`",
        _measure_link_masses(lambda checked, index: checked.joints[index].link.mass),
        size="kg", high=1e4, usual=5,
        reason="links of the largest excavators are lighter",
        finding="is heavier than links are", units=(GRAMS._replace(power=1),), explained_by=SIZES[:3]),
    Rule("densities of links", "`mass`, `inertia`",
        _measure_link_masses(lambda checked, index: density_of_sphere(checked.joints[index].link)),
        size="kg/m^3, of a solid sphere with this mass and sum of moments",
        low=2e-3, high=25000, usual=400,
        reason="real robots: 0.006 to 11,000; osmium: 22,600",
        finding="makes a link as dense as a solid sphere of {size} kg/m^3", units=SLIPS_OF_DENSITY,
        explained_by=(SIZES[0], *SIZES[2:4])),
    Rule("sizes of links", "`mass`, `inertia`", _measure_link_masses(_relative_gyration),
        size="radius of gyration over the reach from the base frame", high=3,
        reason="real robots: up to 1.9",
        finding="makes a link whose radius of gyration is {size} times the reach of the robot",
        advice="check the units of mass, inertia and lengths",
        explained_by=SIZES[:5]),
    Rule("centers of mass", "`com`", _measure_centers_of_mass,
        size="of revolute joints: link lengths beyond joint, next joints and tools, if above 2 gyrations",
        low=-math.inf, high=BEYOND,
        reason="links end near their joints; real robots: up to 0.15",
        finding="puts the center of mass {size} link lengths beyond {end}",
        advice="did you mean {meant}? It is given in the link frame", explained_by=SIZES),
    Rule("size of gravity", "`gravity`", _measure_gravity(lambda size: size or math.nan),
        size="m/s^2, if there is any", low=0.02, high=30, usual=9.81,
        reason="Jupiter: 25; Ceres: 0.28",
        finding="is that of no planet or moon", units=SLIPS_OF_GRAVITY),
    Rule("gravity as a direction", "`gravity`", _measure_gravity(lambda size: abs(size - 1)),
        size="distance of its magnitude from 1 m/s^2", low=1e-3,
        reason="a unit vector is only a direction",
        finding="has the length 1", advice="write the acceleration, 9.81 times the direction on earth"),
    Rule("direction of gravity", "`gravity`", _measure_upward_gravity,
        size="share along +z, if `base` is not turned", low=-math.inf, high=0.9,
        reason="gravity points down; a robot on the ceiling has a `base` with `rpy: [pi, 0, 0]`",
        finding="points upwards, along +z of the base frame",
        advice="did you mean the opposite sign? If it hangs from the ceiling, turn `base` instead"),
)  # fmt: skip

WHOLE_ROBOT_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule("load of gravity", "`gravity`", _measure_load_of_gravity,
        size="largest sine of its angle with an axis, if all joints are revolute", low=1e-3,
        reason="along all axes it loads no joint",
        finding="is along the axes of all joints, so that it loads none of them",
        advice="if these axes are horizontal, turn it, e.g. [0, -9.81, 0]; if vertical, write [0, 0, 0]"),
)  # fmt: skip
"""Rules that are not about one subtree alone: a single joint that gravity loads is enough."""


INERTIA_UNIT = "kg m^2"


def impossible_links(joints: Sequence[Joint], file_lines: ValuesInFile | None) -> Iterator[Problem]:
    """Yield warnings about links without mass or inertia, and about broken triangle inequalities.

    A robot without any mass has no warnings about zeros, since one for the whole robot says so.
    """
    massless = not any(joint.link.mass for joint in joints)
    for number, joint in enumerate(joints):
        path, link = joint_path(number, joint, "link"), joint.link
        no_inertia = link.inertia.principal_moments[-1] == 0
        if not massless and link.mass == 0 and no_inertia:
            advice = "give those of the link, the inertia about its center of mass"
            yield _problem_at_path(path, f": mass and inertia are zero; {advice}", file_lines)
        elif not massless and link.mass == 0:
            yield _problem_at_path((*path, "mass"), " is zero; give the mass of the link, in kg", file_lines)
        elif not massless and no_inertia:
            advice = f"give the inertia of the link about its center of mass, in {INERTIA_UNIT}"
            yield _problem_at_path((*path, "inertia"), f" is zero; {advice}", file_lines)
        if excess := _describe_triangle_violation((*path, "inertia"), link.inertia, file_lines):
            advice = "which no rigid body allows; check the entries"
            yield _problem_at_path((*path, "inertia"), f": {excess}, {advice}", file_lines)


def _describe_triangle_violation(path: NumberPath, inertia: Inertia, file_lines: ValuesInFile | None) -> str:
    """Return by how much the largest moment exceeds the sum of the others; empty if it does not.

    Moments are named by their axes if these are principal axes, unless the file has other axes.
    """
    low, middle, high = inertia.principal_moments
    if high - low - middle <= INERTIA_ROUNDING * high:
        return ""
    names = ["xx", "yy", "zz"]
    largest = names.pop(int(np.argmax(np.diag(inertia.tensor))))
    in_file = file_lines is None or _is_written((*path, largest), high, file_lines)
    if in_file and np.count_nonzero(inertia.tensor - np.diag(np.diag(inertia.tensor))) == 0:
        moment, sum_of_others = f"{largest} =", f"{' + '.join(names)} ="
    else:
        moment, sum_of_others = "the largest principal moment", "the sum of the others"
    largest_moment, others, excess = (
        f"{size:.4g} {INERTIA_UNIT}" for size in (high, low + middle, high - low - middle)
    )
    return f"{moment} {largest_moment} exceeds {sum_of_others} {others} by {excess}"


def _is_written(path: NumberPath, value: float, file_lines: ValuesInFile) -> bool:
    return file_lines.as_in_file(Measured(path, value, INERTIA_UNIT, math.nan)) is not None


def _problem_at_path(path: NumberPath, message: str, file_lines: ValuesInFile | None) -> Problem:
    """Return a problem with the line of a path, unless the file has another mass there: it was changed."""
    message = ".".join(map(str, path)) + message
    if file_lines is None or (path[-1] == "mass" and not _is_written(path, 0.0, file_lines)):
        return Problem("", 0, message)
    return Problem(file_lines.path, file_lines.line(path), message)
