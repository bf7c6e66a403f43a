"""Excitation trajectories of a family: sums of sinusoids for position and stiffness, from rest to rest.

`allowed` gives the range of each joint: the limits of the robot, cautious ones where it has none. A
`Design` makes members of its family from numbers, and `feasible` makes each as small as the limits of
torques, currents and the like require.
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
from vsacli.dynamics.inverse import command_of, compute_block, elastic_torques
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import ImpossibleError, admissible_stiffness
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.devices import with_devices
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.times import UniformTimes
from vsacli.trajectory.trajectory import Trajectory

MARGIN = 0.05
"""Relative distance that an excitation keeps from each limit and from the ends of stiffness corridors, as far
as a robot that is not known yet may be off; the paper's own example keeps 6 % from its corridor."""

USUAL_REACH = {"revolute": np.pi / 4, "prismatic": 0.1}
"""Either way from the middle, rad and m, of joints whose range nobody gave."""

USUAL_SPEED = {"revolute": 1.0, "prismatic": 0.25}
"""Rad/s and m/s of joints whose velocity has no limit; 0.25 m/s is the reduced speed of ISO 10218-1."""

USUAL_STIFFENING = 2.0
"""Largest stiffness over the least that carries the load, where nothing else bounds it."""

SPREAD = 100.0
"""Ratio of both ends of a corridor from which on the upper one bounds nothing: a four-bar comes to 1e9."""


class Allowed(NamedTuple):
    """Bounds of all joints, the margins taken off.

    Attributes:
        lowest, highest: positions, (joints,), rad (m).
        speed: largest velocity either way, (joints,), rad/s (m/s).
        assumptions: where the robot has no limit, one sentence each.
    """

    lowest: FloatArray
    highest: FloatArray
    speed: FloatArray
    assumptions: tuple[str, ...]


def allowed(robot: Robot, middle: FloatArray | None = None) -> Allowed:
    """Return the allowed ranges of a robot's joints.

    Args:
        robot: the robot.
        middle: about which joints move whose range is not known, (joints,); zero if None.
    """
    about = np.zeros(len(robot.joints)) if middle is None else middle
    words = "zero" if middle is None else "its middle in the motion given"
    ranges = np.array([_range(joint, float(each)) for joint, each in zip(robot.joints, about, strict=True)])
    limits = np.array([min(map(abs, joint.limits.velocity)) for joint in robot.joints])
    usual = [USUAL_SPEED[joint.type] for joint in robot.joints]
    speeds = np.where(np.isfinite(limits), limits, usual)
    lowest, highest = ranges.T
    return Allowed(lowest, highest, (1 - MARGIN) * speeds, tuple(_assumptions(robot, words)))


def _range(joint: Joint, middle: float) -> tuple[float, float]:
    """Positions; an end that is not limited lies as far off the middle, or the other end, as is usual."""
    lower, upper = joint.limits.position
    reach = USUAL_REACH[joint.type]
    if not np.isfinite(lower):
        lower = min(middle, upper - reach) - reach
    if not np.isfinite(upper):
        upper = max(middle, lower + reach) + reach
    pad = MARGIN * max(abs(lower), abs(upper))
    return lower + pad, upper - pad


def _assumptions(robot: Robot, middle: str) -> Iterator[str]:
    """One clause for all joints that lack the same."""
    places: dict[str, list[str]] = {}
    for joint in robot.joints:
        for lacking in _lacking(joint, middle):
            places.setdefault(lacking, []).append(joint.name)
    for lacking, names in places.items():
        yield f"no {lacking}: {', '.join(names)}"


def _lacking(joint: Joint, middle: str) -> Iterator[str]:
    """Missing limits of a joint, each with its assumption."""
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
"""Share of the largest stiffness that it does not fall below where springs may go slack."""

HARMONICS = 5
"""Harmonics of each signal of a joint, as in Swevers et al. (1997)."""

RATE = 1000.0
"""Samples per second of the trajectory, and so of the recording that is planned for."""

RAMP = 0.1
"""Share of the duration in which the sums rise from rest, and fall to it."""

SAMPLES_PER_PERIOD = 24
"""Samples per period of the highest harmonic, where limits are watched and information is summed: an
extreme lies at most 0.9 % of an amplitude beyond such samples, within `MARGIN`."""

DIGITS = 4
"""Significant ones of amplitudes and offsets, as the file has them."""


@dataclass(frozen=True)
class Design:
    """A family of excitations of a robot; its members are told apart by numbers about zero.

    For each signal and joint these are sine and cosine of each harmonic, divided by its number, so that all
    have about the same speed; then how much of the room is taken, and where in it.

    Attributes:
        robot: the robot.
        allowed: ranges of its joints.
        duration: s.
        frequency: of the lowest harmonic, Hz.
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
        """Parameters that count, (signals, joints)."""
        return np.array([[True] * len(self.robot.joints), self._takes_stiffness])

    @property
    def grid(self) -> FloatArray:
        """Times at which members are looked at, s."""
        highest = HARMONICS * self.frequency
        return np.linspace(0.0, self.duration, 1 + round(SAMPLES_PER_PERIOD * highest * self.duration))

    def member(self, numbers: FloatArray, share: float) -> Trajectory:
        """Return a trajectory of the family.

        Args:
            numbers: of the `shape`.
            share: 0 to 1, of the position and stiffness that the numbers ask for; 0 is nearly at rest.

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
        return with_devices(trajectory, self.robot)

    @property
    def _takes_stiffness(self) -> list[bool]:
        return [STIFFNESS.key in joint.actuator.commanded for joint in self.robot.joints]

    def _position(self, numbers: FloatArray, share: float) -> Sinusoids:
        raw = self._raw(POSITION, numbers)
        rows = raw.at(self.grid)
        low, high = rows[0].min(axis=1), rows[0].max(axis=1)
        speed = np.abs(rows[1]).max(axis=1)
        room = self.allowed.highest - self.allowed.lowest
        scale = share * _reach(numbers) * np.minimum(room / (high - low), self.allowed.speed / speed)
        return _placed(raw, numbers, scale, (self.allowed.lowest, self.allowed.highest), (low, high))

    def _stiffness(self, numbers: FloatArray, position: Sinusoids, share: float) -> Sinusoids:
        """Within the part that carries the motion."""
        lowest, highest = self._corridors(position)
        raw = self._raw(STIFFNESS, numbers)
        rows = raw.at(self.grid)
        low, high = rows[0].min(axis=1), rows[0].max(axis=1)
        highest = lowest + share * (highest - lowest)  # the less, the softer: preload takes torque, too
        scale = _reach(numbers) * (highest - lowest) / (high - low)
        return _placed(raw, numbers, scale, (lowest, highest), (low, high))

    def _corridors(self, position: Sinusoids) -> tuple[FloatArray, FloatArray]:
        """Least and largest stiffness of each joint that will do all the time; NaN where it takes none."""
        motion = self._motion(position)
        commanded = {**motion.variables(), **elastic_torques(self.robot, motion)}
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
        return with_devices(Trajectory(times, position, {}, name=""), self.robot).at(self.grid)

    def _raw(self, signal: Signal, numbers: FloatArray) -> Sinusoids:
        """Return the sums before they are placed; of joints that do not take the signal as well."""
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


def _reach(numbers: FloatArray) -> FloatArray:
    """Share of the room that is taken, (joints,): all at zero."""
    share: FloatArray = np.exp(-np.abs(numbers[:, -2]) / 2)
    return share


def _placed(
    raw: Sinusoids,
    numbers: FloatArray,
    scale: FloatArray,
    room: tuple[FloatArray, FloatArray],
    extent: tuple[FloatArray, FloatArray],
) -> Sinusoids:
    """Return the sums scaled, and moved to a place in the room that they leave; digits as a file has them."""
    lowest, highest = room[0] - scale * extent[0], room[1] - scale * extent[1]
    offset = (lowest + highest + np.tanh(numbers[:, -1]) * (highest - lowest)) / 2
    sine, cosine = (
        tuple(tuple(map(_digits, row)) for row in scale * np.array(rows)) for rows in (raw.sine, raw.cosine)
    )
    return replace(raw, offset=tuple(map(_digits, offset)), sine=sine, cosine=cosine)


def _digits(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


BISECTIONS = 6
"""Bisections of the share of a motion that limits allow, down to 1.6 %."""

ROUNDED = 1e-3
"""Relative clearance by which digits of a file, and what lies between samples, may miss the margin."""


class Member(NamedTuple):
    """A member of a family that keeps all limits of its robot at the times of its design's grid.

    Attributes:
        design: the family.
        numbers: of the member.
        trajectory: the excitation.
        block: all that inverse dynamics finds there.
        value: its merit, the larger the better; NaN if nobody asked.
    """

    design: Design
    numbers: FloatArray
    trajectory: Trajectory
    block: Block
    value: float = math.nan


def feasible(design: Design, numbers: FloatArray) -> Member | None:
    """Return the member of a family, made as small as limits of torques, currents and the like ask for.

    None if it keeps them not even nearly at rest.
    """
    found = _tried(design, numbers, 1.0)
    if found is not None:
        return found
    kept, broken = 0.0, 1.0
    for _ in range(BISECTIONS):
        share = (kept + broken) / 2
        smaller = _tried(design, numbers, share)
        if smaller is None:
            broken = share
        else:
            kept, found = share, smaller
    return found


def least_clearances(design: Design, block: Block) -> FloatArray:
    """Return the least relative distance of everything that is `watched` to its bounds."""
    least: FloatArray = clearances(watched(design), block).min(axis=1, initial=np.inf)
    return least


def watched(design: Design) -> list[Bounded]:
    """Return the bounded quantities that move; dampers are at their minimum."""
    quantities = bounded_quantities(design.robot)
    return [each for each in quantities if Flag.DAMPING_LIMIT not in each.bits]


def _tried(design: Design, numbers: FloatArray, share: float) -> Member | None:
    try:
        trajectory = design.member(numbers, share)
    except ImpossibleError:
        return None
    block = compute_block(design.robot, trajectory.at(design.grid))
    if (least_clearances(design, block) < MARGIN - ROUNDED).any():
        return None
    return Member(design, numbers, trajectory, block)


def obstacle(design: Design, numbers: FloatArray) -> str:
    """Return the obstacle that makes a member nearly at rest infeasible, a clause."""
    try:
        trajectory = design.member(numbers, 0.0)
    except ImpossibleError as error:
        return str(error)
    gaps = least_clearances(design, compute_block(design.robot, trajectory.at(design.grid)))
    quantity = watched(design)[int(gaps.argmin())]
    motor = "" if quantity.limit is None else quantity.limit.flag.quantity_of(quantity.limit.motor)
    return f"{quantity.joint.name} comes too near to the bounds of its {motor or 'stiffness'} at rest already"
