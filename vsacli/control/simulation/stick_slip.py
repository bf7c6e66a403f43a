"""Sticking and sliding of motors with sharp friction: where its direction changes in a run."""

from __future__ import annotations

import math

import numpy as np

from vsacli.actuators.friction import FrictionLaws, direction_of
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.control.simulation.closed_loop import ClosedLoop

LONGEST_HELD = 0.01
"""s; the longest step while a motor is held, and so how long it may break loose unnoticed, to be held again:
what holds it changes without anything that moves, by which the integration chooses its steps."""


class Switch:
    """A motor that stops, or that its friction cannot hold any longer: an event of `solve_ivp`."""

    terminal = True
    direction = -1.0

    def __init__(self, sliding: StickSlip, motor: int) -> None:
        self._sliding, self._motor = sliding, motor

    def __call__(self, time: float, vector: FloatArray) -> float:
        """Velocity of the slide, or friction that is left to hold the motor; zero where it switches."""
        return float(self._sliding.distances(time, vector)[self._motor])

    def passed(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the state in which the run goes on."""
        return self._sliding.switched(time, vector, self._motor)


class StickSlip:
    """Keeps `slip` of a closed loop: from one switch to the next its equations of motion are smooth.

    A motor slides one way until its velocity is zero. There it is held until that takes more than its
    friction, which may be at once: then it slides, back or on.

    Args:
        loop: the robot under its controller.
        laws: friction of its motors.

    Attributes:
        switches: one for each motor with sharp friction.
    """

    def __init__(self, loop: ClosedLoop, laws: FrictionLaws) -> None:
        self._loop, self._laws = loop, laws
        self._velocity = loop.packing.motor_velocities
        self.switches = [Switch(self, motor) for motor in np.flatnonzero(laws.sharp).tolist()]
        self._known: tuple[float, FloatArray, FloatArray, FloatArray] | None = None

    @property
    def longest_step(self) -> float:
        """Longest step in which no switch is missed, s."""
        return LONGEST_HELD if np.any(self._slip == 0) else math.inf

    def start(self, time: float, vector: FloatArray) -> FloatArray:
        """Begin in a state; returns it with the motors that rest at no velocity at all."""
        direction = direction_of(vector[self._velocity])
        self._loop.slip = np.where(self._laws.sharp, direction, np.nan)
        self.settle(time, vector)
        return self._stopped(vector, self._laws.sharp & (direction == 0))

    def switched(self, time: float, vector: FloatArray, motor: int) -> FloatArray:
        """Return the state after a motor stopped, or broke loose, with the new directions of friction."""
        slip, chosen = self._slip, np.arange(len(self._slip)) == motor
        stops = slip[motor] != 0
        holding = self._friction(time, vector) - self._laws.offset
        self._loop.slip = np.where(chosen, 0.0 if stops else np.sign(holding), slip)
        state = self._stopped(vector, chosen) if stops else vector
        self.settle(time, state)
        return state

    def distances(self, time: float, vector: FloatArray) -> FloatArray:
        """Return for each motor, (motors,), a distance that falls to zero at its next switch.

        All switches ask for it in the same state, one after the other.
        """
        slip = self._slip
        if self._known is not None:
            known_time, known_vector, known_slip, distances = self._known
            if known_time == time and known_vector is vector and known_slip is slip:
                return distances
        distances = self._distances(time, vector, slip)
        self._known = time, vector, slip, distances
        return distances

    def _distances(self, time: float, vector: FloatArray, slip: FloatArray) -> FloatArray:
        friction = self._friction(time, vector) - self._laws.offset
        left = np.fmin(self._laws.forward - friction, self._laws.backward + friction)
        return np.where(slip == 0, left, slip * vector[self._velocity])

    @property
    def _slip(self) -> FloatArray:
        assert self._loop.slip is not None
        return self._loop.slip

    def _stopped(self, vector: FloatArray, motors: BoolArray) -> FloatArray:
        stopped = vector.copy()
        stopped[self._velocity[motors]] = 0.0
        return stopped

    def settle(self, time: float, vector: FloatArray) -> None:
        """Let those motors slide, one after the other, that friction cannot hold under the torques of now."""
        while True:
            beyond = self._laws.beyond(self._friction(time, vector)) * (self._slip == 0)
            if not beyond.any():
                return
            motor = int(np.argmin(np.where(beyond != 0, self.distances(time, vector), np.inf)))
            slip = self._slip.copy()
            slip[motor] = beyond[motor]
            self._loop.slip = slip

    def _friction(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the friction of all motors, (motors,); arbitrary where none is held."""
        if not np.any(self._slip[self._laws.sharp] == 0):
            return self._laws.offset
        loop, phase = self._loop, self._loop.packing.unpack(vector)
        friction = loop.response(time, phase, loop.demand(time, vector), self._slip).friction
        assert friction is not None
        return friction


def sliding(loop: ClosedLoop) -> StickSlip | None:
    """Return the friction of a robot with sharp laws; None if it has none."""
    laws = loop.plant.drivetrain.friction
    return None if laws is None or not laws.sharp.any() else StickSlip(loop, laws)
