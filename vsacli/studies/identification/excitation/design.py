"""Excitation trajectories of a family: sums of sinusoids for position and stiffness, from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.signals import POSITION, STIFFNESS, Signal
from vsacli.dynamics.inverse import command_of, elastic_torques
from vsacli.robot.model import Robot
from vsacli.studies.identification.excitation.allowed import MARGIN, SPREAD, USUAL_STIFFENING, Allowed
from vsacli.studies.remedies.acceptance import ImpossibleError
from vsacli.studies.remedies.admissible_stiffness import admissible_stiffness
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.devices import with_devices
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.times import UniformTimes
from vsacli.trajectory.trajectory import Trajectory

LEAST_SHARE = 0.1
"""Of the largest stiffness, which it does not fall below where springs may go slack."""

HARMONICS = 5
"""Of each signal of a joint, as in Swevers et al. (1997)."""

RATE = 1000.0
"""Samples per second of the trajectory, and so of the recording that is planned for."""

RAMP = 0.1
"""Share of the duration in which the sums rise from rest, and fall to it."""

SAMPLES_PER_PERIOD = 24
"""Of the highest harmonic, where limits are watched and information is summed: an extreme lies at most 0.9 %
of an amplitude beyond such samples, within `MARGIN`."""

DIGITS = 4
"""Significant ones of amplitudes and offsets, as the file has them."""


@dataclass(frozen=True)
class Design:
    """A family of excitations of a robot; its members are told apart by numbers about zero.

    For each signal and joint these are sine and cosine of each harmonic, divided by its number, so that all
    have about the same speed; then how much of the room is taken, and where in it.

    Attributes:
        robot: the robot.
        allowed: what its joints may do.
        duration: s.
        frequency: of the lowest harmonic, Hz.
    """

    robot: Robot
    allowed: Allowed
    duration: float
    frequency: float

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the numbers of a member: (signals, joints, numbers)."""
        return 2, len(self.robot.joints), 2 * HARMONICS + 2

    @property
    def counts(self) -> BoolArray:
        """Which numbers count, (signals, joints)."""
        return np.array([[True] * len(self.robot.joints), self._takes_stiffness])

    @property
    def grid(self) -> FloatArray:
        """Times at which members are looked at, s."""
        highest = HARMONICS * self.frequency
        return np.linspace(0.0, self.duration, 1 + round(SAMPLES_PER_PERIOD * highest * self.duration))

    def member(self, numbers: FloatArray, share: float) -> Trajectory:
        """A trajectory of the family.

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
        """Within what carries the motion."""
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
        """The sums before they are placed; of joints that do not take the signal as well."""
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
    """The sums scaled, and moved to a place in the room that they leave; digits as a file has them."""
    lowest, highest = room[0] - scale * extent[0], room[1] - scale * extent[1]
    offset = (lowest + highest + np.tanh(numbers[:, -1]) * (highest - lowest)) / 2
    sine, cosine = (_rounded(scale * np.array(rows)) for rows in (raw.sine, raw.cosine))
    return replace(raw, offset=tuple(map(_digits, offset)), sine=sine, cosine=cosine)


def _rounded(rows: FloatArray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(_digits, row)) for row in rows)


def _digits(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
