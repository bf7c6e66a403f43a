"""Stick and slip of motors with sharp friction: events at which a motor stops, or breaks loose."""

from __future__ import annotations

import math

import numpy as np

from vsacli.actuators.friction import FrictionLaws, sign_of_motion
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.control.simulation.closed_loop import ClosedLoop

LONGEST_HELD = 0.01
"""Longest step while a motor is held, s, and so the longest time for which it may break loose unnoticed. The
integration chooses its steps by the state, but holding friction changes while nothing moves."""


class Switch:
    """An event: a motor stops, or its friction can no longer hold it."""

    def __init__(self, sliding: StickSlip, motor: int) -> None:
        self._sliding, self._motor = sliding, motor

    def __call__(self, time: float, vector: FloatArray) -> float:
        """Return the sliding velocity, or the reserve of friction that holds the motor; zero at the event."""
        return float(self._sliding.distances(time, vector)[self._motor])

    def state_after_switch(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the state after the event."""
        return self._sliding.switch_motor(time, vector, self._motor)


class StickSlip:
    """Stick and slip of the motors of a closed loop, whose `slip` it updates.

    Between two switches the equations of motion are smooth. A motor slides in one direction until its
    velocity is zero. It is then held until the torque to hold it exceeds its friction, possibly at once; then
    it slides again, in either direction.

    Args:
        loop: robot under its controller.
        laws: friction of its motors.

    Attributes:
        switches: events, one for each motor with sharp friction.
    """

    def __init__(self, loop: ClosedLoop, laws: FrictionLaws) -> None:
        self._loop, self._laws = loop, laws
        self._velocity_indices = loop.packing.motor_velocities
        self.switches = [Switch(self, motor) for motor in np.flatnonzero(laws.sharp).tolist()]
        self._cached: tuple[float, FloatArray, FloatArray, FloatArray] | None = None

    @property
    def longest_step(self) -> float:
        """Longest step of the integration, s; see `LONGEST_HELD`."""
        return LONGEST_HELD if np.any(self._slip == 0) else math.inf

    def start(self, time: float, vector: FloatArray) -> FloatArray:
        """Initialize the directions in a state; return it with exactly zero velocity of motors at rest."""
        direction = sign_of_motion(vector[self._velocity_indices])
        self._loop.slip = np.where(self._laws.sharp, direction, np.nan)
        self.release_motors(time, vector)
        return self._with_zero_velocity(vector, self._laws.sharp & (direction == 0))

    def switch_motor(self, time: float, vector: FloatArray, motor: int) -> FloatArray:
        """Return the state after a motor stopped, or broke loose, with the new directions of friction."""
        slip, is_motor = self._slip, np.arange(len(self._slip)) == motor
        stops = slip[motor] != 0
        holding = self._friction(time, vector) - self._laws.offset
        self._loop.slip = np.where(is_motor, 0.0 if stops else np.sign(holding), slip)
        state = self._with_zero_velocity(vector, is_motor) if stops else vector
        self.release_motors(time, state)
        return state

    def distances(self, time: float, vector: FloatArray) -> FloatArray:
        """Return for each motor, (motors,), a distance that falls to zero at its next switch.

        The last result is kept, since all switches need it in the same state, one after the other.
        """
        slip = self._slip
        if self._cached is not None:
            cached_time, cached_vector, cached_slip, distances = self._cached
            if cached_time == time and cached_vector is vector and cached_slip is slip:
                return distances
        distances = self._distances(time, vector, slip)
        self._cached = time, vector, slip, distances
        return distances

    def _distances(self, time: float, vector: FloatArray, slip: FloatArray) -> FloatArray:
        friction = self._friction(time, vector) - self._laws.offset
        reserve = np.fmin(self._laws.forward - friction, self._laws.backward + friction)
        return np.where(slip == 0, reserve, slip * vector[self._velocity_indices])

    @property
    def _slip(self) -> FloatArray:
        assert self._loop.slip is not None
        return self._loop.slip

    def _with_zero_velocity(self, vector: FloatArray, motors: BoolArray) -> FloatArray:
        state = vector.copy()
        state[self._velocity_indices[motors]] = 0.0
        return state

    def release_motors(self, time: float, vector: FloatArray) -> None:
        """Release held motors, one after the other, that friction cannot hold under the present torques."""
        while True:
            breakaway = self._laws.direction_beyond(self._friction(time, vector)) * (self._slip == 0)
            if not breakaway.any():
                return
            motor = int(np.argmin(np.where(breakaway != 0, self.distances(time, vector), np.inf)))
            slip = self._slip.copy()
            slip[motor] = breakaway[motor]
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
    """Return the stick and slip of a robot; None if no motor has sharp friction."""
    laws = loop.plant.drivetrain.friction
    return None if laws is None or not laws.sharp.any() else StickSlip(loop, laws)
