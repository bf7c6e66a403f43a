"""Plausibility rules of a trajectory file, given the robot: positions, durations, stiffness, wrench."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import Problem
from vsacli.base.signals import POSITION
from vsacli.documents.plausibility import Measured, OtherUnit, Rule, ValuesInFile, implausible_values
from vsacli.documents.record_values import NumberAtPath, PathIndex
from vsacli.documents.source import Source
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.robot.plausibility import robot_rules_with_findings
from vsacli.robot.plausibility.bodies import (
    CENTIMETERS,
    DEGREES,
    MILLIMETERS,
    ROUNDED,
    SIZES,
    turns,
)
from vsacli.robot.plausibility.checked_robot import (
    BodySizes,
    CheckedRobot,
    UnloadedStiffnessRange,
    motors_in_file,
    ratio_or_nan,
)
from vsacli.robot.plausibility.springs import NEWTON_MILLIMETERS, TOO_SOFT
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.times import Times

INSTANTS = 1001
"""Evenly spread times at which the motion is evaluated; sums of sinusoids change fastest."""

LONG = 100.0
"""Duration, s; shorter motions may be arbitrarily slow."""

COMMON_FORCE, COMMON_MOMENT = 100.0, 10.0
"""Force, N, and moment, N m; smaller ones may be large relative to the robot, e.g. of gripping fingers."""

LOWEST_SHARE = 0.2
"""Share of the minimum stiffness at rest; a smaller command has probably another unit."""

AMPLITUDES = frozenset(("sine", "cosine"))
"""Keys of amplitudes about a mean stiffness, which are not stiffnesses themselves."""

PER_SECOND = "per second"
UNITS_OF_TIME = (
    OtherUnit("ms", 1e-3, -1),
    OtherUnit("us", 1e-6, -1),
    OtherUnit("min", 60, -1),
    OtherUnit("h", 3600, -1),
)
UNITS_OF_STIFFNESS = (*TOO_SOFT, NEWTON_MILLIMETERS)

SPRINGS = ("springs at their largest deflection", "stiff springs", "hardening of springs")
RANGES = ("ranges of revolute joints", "ranges of prismatic joints")
POSITIONS = ("positions of revolute joints", "positions of prismatic joints", *RANGES)


def trajectory_findings(
    robot: Robot, numbers: Sequence[NumberAtPath], times: Times, motion: Profile | None, source: Source
) -> tuple[Problem, ...]:
    """Return the findings of the rules, each with its line of the trajectory file.

    Args:
        robot: robot that executes the trajectory; each of its subtrees is judged by itself.
        numbers: all numbers of the file.
        times: sample times.
        motion: profile of the position if a formula gives it; None if recorded, which is checked elsewhere.
        source: the file.
    """
    with np.errstate(all="ignore"):  # extreme values may be infinite in between
        sampled = None if motion is None else motion.at(np.linspace(*times.span, INSTANTS))
    file_lines = ValuesInFile(source)
    judged = [
        (
            CheckedTrajectory(robot, subtree, numbers, times, sampled),
            file_lines,
            robot_rules_with_findings(robot.checked, subtree, robot.sources),
        )
        for subtree in robot.checked_subtrees
    ]
    return implausible_values(TRAJECTORY_RULES, judged)


@dataclass(frozen=True)
class CheckedTrajectory:
    """A trajectory file with the data that plausibility rules need, for a subtree of the robot.

    Attributes:
        robot: robot that executes the trajectory.
        subtree: joints that are judged.
        numbers: all numbers of the file.
        times: sample times.
        motion_of_robot: position and its derivatives, (orders, joints of the robot, instants); None if they
            are recorded.
    """

    robot: Robot
    subtree: CheckedRobot
    numbers: Sequence[NumberAtPath]
    times: Times
    motion_of_robot: FloatArray | None

    @property
    def sizes(self) -> BodySizes:
        """Body sizes of the robot."""
        return self.subtree.sizes

    @property
    def sampled_motion(self) -> FloatArray | None:
        """Position and its derivatives, (orders, joints, instants); None if they are recorded."""
        motion = self.motion_of_robot
        return None if motion is None else motion[:, list(self.subtree.numbers_in_robot)]

    @property
    def revolute(self) -> BoolArray:
        """Mask of the revolute joints, (joints,)."""
        return np.array([joint.is_revolute for joint in self.subtree.joints])

    def mean_velocities(self, subtree: CheckedRobot) -> FloatArray:
        """Return the mean velocity of each joint of a subtree, (joints,), in rad (reaches) a second."""
        assert self.motion_of_robot is not None, "of motions by a formula"
        position = self.motion_of_robot[0, list(subtree.numbers_in_robot)]
        usual = [1.0 if joint.is_revolute else subtree.sizes.extent or math.nan for joint in subtree.joints]
        return np.asarray(np.abs(np.diff(position)).sum(axis=1) / usual / self.duration)

    def velocities_in_limits(self, subtree: CheckedRobot) -> FloatArray:
        """Return the largest velocity of each joint of a subtree, (joints,), over that of its motors.

        It is infinite of a joint that moves with a motor without a largest velocity.
        """
        assert self.motion_of_robot is not None, "of motions by a formula"
        largest = np.abs(self.motion_of_robot[1, list(subtree.numbers_in_robot)]).max(axis=1)
        drives = dict(subtree.joints_with_drives)  # none if they are placeholders
        limits = [
            min((motor.at_joint.max_velocity for _, motor in motors_in_file(joint)), default=math.inf)
            if number in drives
            else math.inf
            for number, joint in enumerate(subtree.joints)
        ]
        velocities: FloatArray = np.where(np.isinf(limits) & (largest > 0), math.inf, largest / limits)
        return velocities

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        first, last = self.times.span
        return last - first

    def of_joints(self, quantity: units.Quantity) -> Iterator[tuple[Measured, int]]:
        """Yield the numbers with this quantity, with magnitude as size, and the index of the joint."""
        place = {number: joint for joint, number in enumerate(self.subtree.numbers_in_robot)}
        for path, measured, value, _ in self.numbers:
            if measured == quantity and isinstance(path[-1], PathIndex) and path[-1].number in place:
                joint = place[path[-1].number]
                unit = quantity.unit(self.subtree.joints[joint].type)
                yield Measured(path, value, unit, abs(value)), joint

    def measure_timing(
        self, quantity: units.Quantity, sizes: FloatArray, **beside: str
    ) -> Iterator[Measured]:
        """Yield the time or frequency that sets the timing, with the largest size of all joints."""
        of_motion = [each for each in self.numbers if each.path[0] in ("duration", POSITION.key)]
        timings = [each for each in of_motion if each.path[-1] == "frequency"]
        timings = timings or [each for each in of_motion if each.quantity == units.TIME]
        longest = max(timings, key=lambda each: each.value, default=None)
        if longest is not None and longest.quantity == quantity:
            joint = int(np.argmax(sizes))
            names = {"joint": self.subtree.joints[joint].name, **beside}
            unit = "s" if quantity == units.TIME else PER_SECOND
            yield Measured(longest.path, longest.value, unit, float(sizes[joint]), names)


def _measure_joint_positions(checked: CheckedTrajectory, unit: str) -> Iterator[Measured]:
    """Yield positions in a unit, in turns or reaches of the robot, except those within joint limits."""
    for measured, joint in checked.of_joints(units.POSITION):
        low, high = checked.subtree.joints[joint].limits.position
        if measured.unit == unit and not -math.inf < low <= measured.value <= high < math.inf:
            in_reaches = ratio_or_nan(measured.size, checked.sizes.extent)
            yield measured._replace(size=turns(measured.value) if unit == "rad" else in_reaches)


def _measure_slowness(
    checked: CheckedTrajectory, velocities_of: Callable[[CheckedTrajectory, CheckedRobot], FloatArray]
) -> Iterator[Measured]:
    """Yield the relative velocity of the joint that is fastest.

    A subtree may move slowly while another one does not.
    """
    if checked.sampled_motion is not None and checked.duration > LONG:
        velocities = velocities_of(checked, checked.subtree)
        of_robot = [np.max(velocities_of(checked, subtree)) for subtree in checked.robot.checked_subtrees]
        if velocities.any() and not np.max(velocities) < np.max(of_robot):
            yield from checked.measure_timing(units.TIME, velocities)


def _measure_accelerations(checked: CheckedTrajectory, quantity: units.Quantity) -> Iterator[Measured]:
    """Yield the largest acceleration of the point farthest from a joint, m/s^2."""
    if checked.sampled_motion is not None and not checked.robot.placeholder:
        levers = np.where(checked.revolute, checked.sizes.levers, 1.0)
        yield from checked.measure_timing(quantity, np.abs(checked.sampled_motion[2]).max(axis=1) * levers)


def _measure_rate(checked: CheckedTrajectory) -> Iterator[Measured]:
    """Yield the rate, with the number of samples as size."""
    for path, quantity, value, _ in checked.numbers:
        if quantity == units.RATE and path == ("rate",):
            yield Measured(path, value, PER_SECOND, value * checked.duration)


def _measure_wrenches(checked: CheckedTrajectory, *, forces: bool) -> Iterator[Measured]:
    """Yield force components relative to the robot's weight, or moments relative to weight times reach."""
    scale = checked.sizes.weight * (1.0 if forces else checked.sizes.extent)
    tools = {checked.robot.tool_names[tool] for tool in checked.subtree.tools}
    common, unit = (COMMON_FORCE, "N") if forces else (COMMON_MOMENT, "N m")
    for path, quantity, value, _ in checked.numbers if not checked.robot.placeholder else ():
        of_kind = isinstance(path[-1], PathIndex) and (path[-1].number < 3) == forces
        pushed = (str(path[1]),) if path[0] == "wrenches" else checked.robot.tool_names[:1]
        if quantity == units.WRENCH and of_kind and not tools.isdisjoint(pushed):
            size = ratio_or_nan(abs(value), scale) if value else math.nan
            yield Measured(path, value, unit, min(size, 1.0) if abs(value) < common else size)


def _commanded_stiffness(
    checked: CheckedTrajectory,
) -> Iterator[tuple[Measured, int, UnloadedStiffnessRange]]:
    """Yield every stiffness except amplitudes, with the index of its joint and its range at rest."""
    for measured, number in checked.of_joints(units.STIFFNESS) if not checked.robot.placeholder else ():
        attainable = checked.subtree.unloaded_ranges[number]
        if attainable is not None and AMPLITUDES.isdisjoint(measured.path):
            ends = {
                "lower": f"{attainable.lower:.4g}",
                "load": "without load",
                "upper": f"{attainable.upper:.4g}",
                "unit": measured.unit,
            }
            yield measured._replace(beside=ends), number, attainable


def _stiffness_over_minimum(checked: CheckedTrajectory, *, linear: bool) -> Iterator[Measured]:
    """Yield stiffness over its minimum, at joints whose springs all have a linear part, or at the others."""
    for measured, number, attainable in _commanded_stiffness(checked):
        joint = checked.subtree.joints[number]
        laws = getattr(joint.actuator, "spring", ())
        each_linear = bool(laws) and all(
            law.polynomial is not None for law in laws
        )  # polynomial laws have a linear part
        if each_linear == linear:
            measured = measured._replace(size=ratio_or_nan(measured.size, attainable.lower))
            yield measured if linear else _under_weight(measured, joint, checked.subtree.sizes.loads[number])


def _under_weight(measured: Measured, joint: Joint, load: float) -> Measured:
    """Return a stiffness above the minimum at rest relative to that under the weight.

    Springs that harden like an exponential function are a thousand times as stiff under their load.
    """
    least = float(joint.actuator.solve(np.array([load]), np.ones(1), np.zeros(1)).lower[0])
    if not (measured.size > 1 and measured.value < measured.size * least):
        return measured
    of_weight = {"lower": f"{least:.4g}", "load": "under the weight of the stretched arm"}
    return measured._replace(size=max(1.0, measured.value / least), beside={**measured.beside, **of_weight})


def _stiffness_over_maximum(checked: CheckedTrajectory) -> Iterator[Measured]:
    for measured, _, attainable in _commanded_stiffness(checked):
        yield measured._replace(size=measured.size / attainable.upper)


MOTION_RULES: tuple[Rule[CheckedTrajectory], ...] = (
    Rule("positions of revolute joints", "`position`: all values",
        lambda checked: _measure_joint_positions(checked, "rad"),
        size="turns", high=1 + ROUNDED, usual=0.2,
        reason="few joints turn further; positions within the limits pass",
        finding="is {size} turns", units=(DEGREES,), in_angles=True),
    Rule("positions of prismatic joints", "`position`: all values",
        lambda checked: _measure_joint_positions(checked, "m"),
        size="over the reach", high=40, usual=0.1,
        reason="tracks are shorter; positions within the limits pass",
        finding="is {size} times the reach of the robot",
        units=(MILLIMETERS, CENTIMETERS), explained_by=SIZES),
    Rule("slow motions", "`duration`, `times`",
        lambda checked: _measure_slowness(checked, CheckedTrajectory.mean_velocities),
        size=f"1/s, mean velocity in rad (reaches) of motions longer than {LONG:g} s",
        low=1e-3, usual=0.5, reason="a turn would take more than an hour and a half",
        finding="lets no joint move faster than {size} rad (reaches) a second in the mean",
        units=UNITS_OF_TIME),
    Rule("motions slow for the motors", "`duration`, `times`",
        lambda checked: _measure_slowness(checked, CheckedTrajectory.velocities_in_limits),
        size=f"largest velocity of a joint over that of its motor, of motions longer than {LONG:g} s",
        low=1e-3, usual=0.3, reason="motors are chosen for the velocities of motions",
        finding="lets no joint reach more than {size} times the largest velocity of its motors",
        units=UNITS_OF_TIME, explained_by=("slow motions",)),
    Rule("accelerations", "`duration`, `times`", lambda checked: _measure_accelerations(checked, units.TIME),
        size="m/s^2, largest acceleration of the farthest point", high=300, usual=3,
        reason="the fastest parallel robots reach half",
        finding="makes what is farthest from {joint} accelerate at up to {size} m/s^2",
        units=tuple(each._replace(power=-2) for each in UNITS_OF_TIME),
        advice="check it, and the positions",
        explained_by=(*POSITIONS, *SIZES)),
    Rule("accelerations of sinusoids", "`frequency`",
        lambda checked: _measure_accelerations(checked, units.RATE),
        size="m/s^2, largest acceleration of the farthest point", high=300, usual=3,
        reason="the fastest parallel robots reach half",
        finding="makes what is farthest from {joint} accelerate at up to {size} m/s^2",
        units=(OtherUnit("rad/s", 0.5 / math.pi, 2),), advice="it counts periods in a second",
        explained_by=(*POSITIONS, *SIZES)),
    Rule("numbers of samples", "`rate`", _measure_rate,
        size="samples in all", low=10, usual=4000,
        reason="too few to show anything",
        finding="gives only {size} samples of the whole motion",
        units=(OtherUnit("kHz", 1e3), OtherUnit("1/ms", 1e3)),
        advice="it is the number of samples in a second", explained_by=("accelerations",)),
)  # fmt: skip

EFFORT_RULES: tuple[Rule[CheckedTrajectory], ...] = (
    Rule("forces on the end effector", "`wrench`, `wrenches`",
        lambda checked: _measure_wrenches(checked, forces=True),
        size=f"over the weight; above 1 only from {COMMON_FORCE:g} N on",
        low=1e-4, high=10, usual=0.2, reason="the robot could not bear more, and would not feel less",
        finding="is {size} of the weight of the robot",
        units=(OtherUnit("kN", 1e3), OtherUnit("g", 9.81e-3), OtherUnit("mN", 1e-3)), explained_by=SIZES),
    Rule("moments on the end effector", "`wrench`, `wrenches`",
        lambda checked: _measure_wrenches(checked, forces=False),
        size=f"over weight times reach; above 1 only from {COMMON_MOMENT:g} N m on",
        low=1e-5, high=10, usual=0.02, reason="the robot could not bear more, and would not feel less",
        finding="is {size} of the weight of the robot at its reach",
        units=(OtherUnit("kN m", 1e3), OtherUnit("N mm", 1e-3), OtherUnit("N cm", 1e-2)), explained_by=SIZES),
    Rule("stiffness compared with linear parts of springs", "`stiffness`: all values",
        lambda checked: _stiffness_over_minimum(checked, linear=True),
        size="over the lowest of cubic and polynomial springs at rest",
        low=LOWEST_SHARE, high=20, usual=1.5,
        reason="below, unattainable; far above, the linear part would not matter",
        finding="is {size} times the minimum of {lower} {unit} without load",
        units=UNITS_OF_STIFFNESS, advice="check its unit and those of the springs", explained_by=SPRINGS),
    Rule("stiffness compared with other springs", "`stiffness`: all values",
        lambda checked: _stiffness_over_minimum(checked, linear=False),
        size="over the lowest of springs of other laws, above 1 under the weight of the stretched arm",
        low=LOWEST_SHARE, high=1000, usual=3,
        reason="below, unattainable; bundled robots: up to 300",
        finding="is {size} times the minimum of {lower} {unit} {load}",
        units=UNITS_OF_STIFFNESS, advice="check its unit and those of the springs", explained_by=SPRINGS),
    Rule("stiffness beyond the springs", "`stiffness`: all values", _stiffness_over_maximum,
        size="over the highest of the springs at rest", high=5, usual=0.5,
        reason="unattainable",
        finding="is {size} times the maximum of {upper} {unit} without load",
        units=UNITS_OF_STIFFNESS, advice="check its unit and those of the springs", explained_by=SPRINGS),
)  # fmt: skip

TRAJECTORY_RULES = (*MOTION_RULES, *EFFORT_RULES)
