"""Excitation trajectories of a family: sums of sinusoids for position and stiffness, from rest to rest.

`allowed` gives the range of each joint: the limits of the robot, or cautious ones if it has none. An
`ExcitationFamily` makes members of its family from parameters, and `feasible` scales each down as the limits
of torques, currents and other variables require.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.analysis.minima import Bounded, bounded_quantities, clearances
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.flags import Flag
from vsacli.base.signals import POSITION, STIFFNESS, Signal
from vsacli.base.variables import Block
from vsacli.dynamics.inverse import command_of, compute_block, link_torques_along
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import ImpossibleError, admissible_stiffness
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.devices import set_uncommanded_dampers
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.times import UniformTimes
from vsacli.trajectory.trajectory import Motion, Trajectory

MARGIN = 0.05
"""Relative distance that an excitation keeps from each limit and from the ends of the attainable stiffness:
an allowance for errors of unidentified parameters; the paper's own example keeps 6 % from these ends."""

USUAL_REACH = {"revolute": np.pi / 4, "prismatic": 0.1}
"""Range in either direction of joints without position limits, rad and m."""

USUAL_SPEED = {"revolute": 1.0, "prismatic": 0.25}
"""Speed of joints without velocity limit, rad/s and m/s; 0.25 m/s is the reduced speed of ISO 10218-1."""

USUAL_STIFFENING = 2.0
"""Ratio of maximum to minimum stiffness if nothing else bounds the maximum."""

SPREAD = 100.0
"""Ratio of the ends of the attainable stiffness above which the upper one is no bound: for a four-bar it is
1e9."""


class Allowed(NamedTuple):
    """Bounds of all joints, reduced by `MARGIN`.

    Attributes:
        lowest, highest: smallest and largest positions, (joints,), rad (m).
        speed: largest speed in either direction, (joints,), rad/s (m/s).
        assumptions: assumptions in place of missing limits, as sentences.
    """

    lowest: FloatArray
    highest: FloatArray
    speed: FloatArray
    assumptions: tuple[str, ...]


def allowed(robot: Robot, middle: FloatArray | None = None) -> Allowed:
    """Return the allowed ranges of a robot's joints.

    Args:
        robot: robot with limits.
        middle: positions about which joints without position limits move, (joints,); zero if None.
    """
    about = np.zeros(len(robot.joints)) if middle is None else middle
    words = "zero" if middle is None else "its middle in the motion given"
    ranges = np.array(
        [_position_range(joint, float(each)) for joint, each in zip(robot.joints, about, strict=True)]
    )
    limits = np.array([min(map(abs, joint.limits.velocity)) for joint in robot.joints])
    usual = [USUAL_SPEED[joint.type] for joint in robot.joints]
    speeds = np.where(np.isfinite(limits), limits, usual)
    lowest, highest = ranges.T
    return Allowed(lowest, highest, (1 - MARGIN) * speeds, tuple(_assumptions(robot, words)))


def _position_range(joint: Joint, middle: float) -> tuple[float, float]:
    """Return the position range of a joint; a missing limit is `USUAL_REACH` from the middle or further."""
    lower, upper = joint.limits.position
    reach = USUAL_REACH[joint.type]
    if not np.isfinite(lower):
        lower = min(middle, upper - reach) - reach
    if not np.isfinite(upper):
        upper = max(middle, lower + reach) + reach
    pad = MARGIN * max(abs(lower), abs(upper))
    return lower + pad, upper - pad


def _assumptions(robot: Robot, middle: str) -> Iterator[str]:
    """Yield a clause for each kind of missing limit, with all joints that lack it."""
    places: dict[str, list[str]] = {}
    for joint in robot.joints:
        for lacking in _missing_limits(joint, middle):
            places.setdefault(lacking, []).append(joint.name)
    for lacking, names in places.items():
        yield f"no {lacking}: {', '.join(names)}"


def _missing_limits(joint: Joint, middle: str) -> Iterator[str]:
    """Yield the missing limits of a joint, each with its assumption."""
    position, velocity = units.POSITION.unit(joint.type), units.VELOCITY.unit(joint.type)
    if not np.isfinite(joint.limits.position).all():
        reach = f"{USUAL_REACH[joint.type]:.3g} {position} either way from {middle} assumed"
        yield f"limits.position ({reach})"
    if not np.isfinite(joint.limits.velocity).all():
        yield f"limits.velocity ({USUAL_SPEED[joint.type]:g} {velocity} assumed)"
    if STIFFNESS.key in joint.actuator.commanded and not np.isfinite(joint.limits.stiffness[1]):
        most = f"at most {USUAL_STIFFENING:g} times the least assumed where springs set no end"
        yield f"limits.stiffness ({most})"
    if not all(np.isfinite(motor.max_torque) for motor in joint.actuator.motors):
        yield "max_torque of motors (none assumed)"


LEAST_SHARE = 0.1
"""Smallest stiffness as a share of the largest, for springs that may go slack."""

HARMONICS = 5
"""Harmonics of each signal of a joint, as in Swevers et al. (1997)."""

RATE = 1000.0
"""Sample rate of the trajectory, and so of the planned recording, Hz."""

RAMP = 0.1
"""Share of the duration in which the sums rise from rest, and in which they fall back."""

SAMPLES_PER_PERIOD = 24
"""Samples per period of the highest harmonic at which limits are checked and information is summed: extremes
exceed them by at most 0.9 % of the amplitude, which is within `MARGIN`."""

DIGITS = 4
"""Significant digits of amplitudes and offsets in the file."""


@dataclass(frozen=True)
class ExcitationFamily:
    """A family of excitations of a robot, whose members have parameters of about unit size around zero.

    For each signal and joint these are the sine and cosine amplitude of each harmonic, to be divided by the
    harmonic's number so that all have about the same speed; then the used share of the allowed range, and the
    position within it.

    Attributes:
        robot: robot to excite.
        allowed: allowed ranges of its joints.
        duration: duration, s.
        frequency: frequency of the lowest harmonic, Hz.
    """

    robot: Robot
    allowed: Allowed
    duration: float
    frequency: float

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the parameters of a member: (signals, joints, parameters)."""
        return 2, len(self.robot.joints), 2 * HARMONICS + 2

    @property
    def counts(self) -> BoolArray:
        """Mask of the signals that joints have, (signals, joints)."""
        return np.array([[True] * len(self.robot.joints), self._takes_stiffness])

    @property
    def grid(self) -> FloatArray:
        """Times at which members are evaluated, s."""
        highest = HARMONICS * self.frequency
        return np.linspace(0.0, self.duration, 1 + round(SAMPLES_PER_PERIOD * highest * self.duration))

    def member(self, numbers: FloatArray, share: float) -> Trajectory:
        """Return a trajectory of the family.

        Args:
            numbers: parameters of the member, in the `shape` of the design.
            share: share of the specified amplitudes, 0 to 1; 0 is nearly at rest.

        Raises:
            ImpossibleError: no stiffness carries the motion.
        """
        moved, stiffened = numbers
        position = self._position(moved, share)
        profiles: dict[str, Profile] = {}
        if any(self._takes_stiffness):
            profiles[STIFFNESS.key] = self._stiffness(stiffened, position, share)
        times = UniformTimes(self.duration, RATE)
        trajectory = Trajectory(times, position, profiles, name=f"{self.robot.name}-excitation")
        return set_uncommanded_dampers(trajectory, self.robot)

    @property
    def _takes_stiffness(self) -> list[bool]:
        return [STIFFNESS.key in joint.actuator.commanded for joint in self.robot.joints]

    def _position(self, numbers: FloatArray, share: float) -> Sinusoids:
        raw = self._raw(POSITION, numbers)
        rows = raw.at(self.grid)
        low, high = rows[0].min(axis=1), rows[0].max(axis=1)
        speed = np.abs(rows[1]).max(axis=1)
        room = self.allowed.highest - self.allowed.lowest
        scale = share * _range_share(numbers) * np.minimum(room / (high - low), self.allowed.speed / speed)
        return _placed(raw, numbers, scale, (self.allowed.lowest, self.allowed.highest), (low, high))

    def _stiffness(self, numbers: FloatArray, position: Sinusoids, share: float) -> Sinusoids:
        """Return the stiffness within the range that carries the motion at all times."""
        lowest, highest = self._corridors(position)
        raw = self._raw(STIFFNESS, numbers)
        rows = raw.at(self.grid)
        low, high = rows[0].min(axis=1), rows[0].max(axis=1)
        highest = lowest + share * (highest - lowest)  # softer for smaller shares: preload requires torque
        scale = _range_share(numbers) * (highest - lowest) / (high - low)
        return _placed(raw, numbers, scale, (lowest, highest), (low, high))

    def _corridors(self, position: Sinusoids) -> tuple[FloatArray, FloatArray]:
        """Return the stiffness range that is admissible at all times, NaN for joints without stiffness."""
        motion = self._motion(position)
        commanded = {**motion.variables(), **link_torques_along(self.robot, motion)}
        ends = np.full((2, len(self.robot.joints)), np.nan)
        for index, takes in enumerate(self._takes_stiffness):
            if takes:
                ends[:, index] = self._corridor(index, command_of(index, commanded))
        return ends[0], ends[1]

    def _corridor(self, index: int, command: Command) -> tuple[float, float]:
        joint = self.robot.joints[index]
        scale = {STIFFNESS.key: np.ones_like(command.q)}
        found = admissible_stiffness(joint, command._replace(commanded=scale), MARGIN)
        lowest, highest = float(found.low.max()), float(found.high.min())
        if highest > SPREAD * lowest > 0:
            highest = USUAL_STIFFENING * lowest
        lowest = max(lowest, LEAST_SHARE * highest)
        pad = MARGIN * max(abs(each) for each in (*joint.limits.stiffness, 0.0) if np.isfinite(each))
        lowest, highest = lowest + pad, highest - pad
        if not 0 < lowest < highest < np.inf:
            raise ImpossibleError(f"{joint.name} has no stiffness that carries the motion all the time")
        return lowest, highest

    def _motion(self, position: Sinusoids) -> Motion:
        times = UniformTimes(self.duration, RATE)
        return set_uncommanded_dampers(Trajectory(times, position, {}, name=""), self.robot).at(self.grid)

    def _raw(self, signal: Signal, numbers: FloatArray) -> Sinusoids:
        """Return the sums before scaling and offset, also for joints that do not have the signal."""
        amplitudes = numbers[:, : 2 * HARMONICS].T / np.repeat(np.arange(1, HARMONICS + 1), 2)[:, None]
        return Sinusoids(
            signal=signal,
            span=(0.0, self.duration),
            cycles=self.frequency * self.duration,
            offset=(0.0,) * len(self.robot.joints),
            sine=tuple(map(tuple, amplitudes[0::2].tolist())),
            cosine=tuple(map(tuple, amplitudes[1::2].tolist())),
            ramp=RAMP,
        )


def _range_share(numbers: FloatArray) -> FloatArray:
    """Return the used share of the allowed range, (joints,), which is 1 for a parameter of zero."""
    return np.exp(-np.abs(numbers[:, -2]) / 2)


def _placed(
    raw: Sinusoids,
    numbers: FloatArray,
    scale: FloatArray,
    room: tuple[FloatArray, FloatArray],
    extent: tuple[FloatArray, FloatArray],
) -> Sinusoids:
    """Return the sums scaled, offset within the remaining range, and rounded to `DIGITS`."""
    lowest, highest = room[0] - scale * extent[0], room[1] - scale * extent[1]
    offset = (lowest + highest + np.tanh(numbers[:, -1]) * (highest - lowest)) / 2
    sine, cosine = (
        tuple(tuple(map(_short_value, row)) for row in scale * np.array(rows))
        for rows in (raw.sine, raw.cosine)
    )
    return replace(raw, offset=tuple(map(_short_value, offset)), sine=sine, cosine=cosine)


def _short_value(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


BISECTIONS = 6
"""Bisections of the share of a motion that limits allow, to 1.6 %."""

ROUNDED = 1e-3
"""Shortfall of the relative clearance that rounding in the file, and extremes between samples, may cause."""


class Member(NamedTuple):
    """A member of a family that keeps all limits of its robot at the times of its design's grid.

    Attributes:
        design: family of the member.
        numbers: parameters of the member.
        trajectory: excitation.
        block: results of inverse dynamics on the grid.
        value: merit, the larger the better; NaN until it is computed.
    """

    design: ExcitationFamily
    numbers: FloatArray
    trajectory: Trajectory
    block: Block
    value: float = math.nan


def feasible(design: ExcitationFamily, numbers: FloatArray) -> Member | None:
    """Return the member of a family, scaled down as far as the limits require.

    Return None if it violates a limit even nearly at rest.
    """
    found = _feasible_member(design, numbers, 1.0)
    if found is not None:
        return found
    kept, broken = 0.0, 1.0
    for _ in range(BISECTIONS):
        share = (kept + broken) / 2
        smaller = _feasible_member(design, numbers, share)
        if smaller is None:
            broken = share
        else:
            kept, found = share, smaller
    return found


def least_clearances(design: ExcitationFamily, block: Block) -> FloatArray:
    """Return the smallest relative distance of each `watched` quantity from its bounds."""
    return np.asarray(clearances(watched(design), block).min(axis=1, initial=np.inf))


def watched(design: ExcitationFamily) -> list[Bounded]:
    """Return the bounded quantities of a robot, without dampers, which stay at their minimum."""
    quantities = bounded_quantities(design.robot)
    return [each for each in quantities if Flag.DAMPING_LIMIT not in each.bits]


def _feasible_member(design: ExcitationFamily, numbers: FloatArray, share: float) -> Member | None:
    try:
        trajectory = design.member(numbers, share)
    except ImpossibleError:
        return None
    block = compute_block(design.robot, trajectory.at(design.grid))
    if (least_clearances(design, block) < MARGIN - ROUNDED).any():
        return None
    return Member(design, numbers, trajectory, block)


def obstacle(design: ExcitationFamily, numbers: FloatArray) -> str:
    """Return the reason why a member is infeasible even nearly at rest, as a clause."""
    try:
        trajectory = design.member(numbers, 0.0)
    except ImpossibleError as error:
        return str(error)
    gaps = least_clearances(design, compute_block(design.robot, trajectory.at(design.grid)))
    quantity = watched(design)[int(gaps.argmin())]
    motor = "" if quantity.limit is None else quantity.limit.flag.quantity_of(quantity.limit.motor)
    return f"{quantity.joint.name} comes too near to the bounds of its {motor or 'stiffness'} at rest already"
