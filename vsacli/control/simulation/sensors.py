"""Sensors of positions and motor torques: their noise, and the quantization of encoders."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.simulation_variables import measured
from vsacli.control.simulation.closed_loop import Phase
from vsacli.documents.fields import LARGEST
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

MOST_BITS = 48
"""Most bits of an encoder; with more, its steps come near the resolution of double precision."""


@dataclass(frozen=True)
class Sensors:
    """The accuracy of measured positions and torques.

    Attributes:
        position: standard deviation of the positions of joints and motors, joint side of the gear, rad (m).
        torque: standard deviation of the motor torques, joint side of the gear, N m (N).
        encoder_bits: bits of encoders, which have 2**bits steps per turn, at the joint and on the shaft of
            each motor whose gear ratio is known; in the position limits of a prismatic joint otherwise. None
            for encoders that do not round.
        seed: seed of the noise.

    Raises:
        InputError: a deviation is negative or not finite, or bits or seed are out of range.
    """

    position: float = 0.0
    torque: float = 0.0
    encoder_bits: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        for noise in (self.position, self.torque):
            if not 0 <= noise <= LARGEST:
                raise InputError.one(f"the sensor noise must be from 0 to {LARGEST:g}, not {noise:g}")
        if self.encoder_bits is not None and not 1 <= self.encoder_bits <= MOST_BITS:
            raise InputError.one(f"an encoder must have 1 to {MOST_BITS} bits, not {self.encoder_bits}")
        if self.seed < 0:
            raise InputError.one(f"the seed must be zero or positive, not {self.seed}")


NOISE_BLOCK = 2048
"""Samples whose noise is drawn at a time."""


class _NoiseRows:
    """Rows of normally distributed noise, drawn when they are needed, and kept until `drop_rows`.

    Args:
        random: generator whose next `samples` * `columns` numbers are the noise; it is advanced beyond them.
        samples: number of rows.
        columns: length of a row.
        deviation: standard deviation.
    """

    def __init__(self, random: np.random.Generator, samples: int, columns: int, deviation: float) -> None:
        self._random, self._deviation = deepcopy(random), deviation
        self._first_row, self._remaining, self._rows = 0, samples, np.empty((0, columns))
        for start in range(0, samples, NOISE_BLOCK):
            random.standard_normal((min(NOISE_BLOCK, samples - start), columns))

    def __getitem__(self, rows: int | slice) -> FloatArray:
        """Return a row by its index, or rows of a slice with both ends, none of them dropped before."""
        start, stop = (rows.start, rows.stop) if isinstance(rows, slice) else (rows, rows + 1)
        while self._remaining and stop > self._first_row + len(self._rows):
            noise = self._random.standard_normal((min(NOISE_BLOCK, self._remaining), self._rows.shape[1]))
            self._remaining -= len(noise)
            self._rows = np.concatenate((self._rows, self._deviation * noise))
        selected: FloatArray = self._rows[start - self._first_row : stop - self._first_row]
        return selected if isinstance(rows, slice) else selected[0]

    def drop_rows(self, stop: int) -> None:
        """Forget all rows before one."""
        self._rows = self._rows[stop - self._first_row :]
        self._first_row = stop


class Readings:
    """The readings of the sensors of a robot at each sample of a run, one block after the other.

    The noise of a sample is drawn once, so that a controller that samples positions knows exactly the
    recorded values.

    Args:
        sensors: accuracy of the sensors.
        robot: robot that has them.
        drivetrain: motors and springs of the robot.
        samples: largest number of samples of a run.

    Raises:
        InputError: an encoder is at a prismatic joint without position limits.
    """

    def __init__(self, sensors: Sensors, robot: Robot, drivetrain: Drivetrain, samples: int) -> None:
        joint_count, motor_count = len(robot.joints), len(drivetrain.joint)
        random = np.random.default_rng(sensors.seed)
        self._drivetrain = drivetrain
        self._q = _NoiseRows(random, samples, joint_count, sensors.position)
        self._theta = _NoiseRows(random, samples, motor_count, sensors.position)
        self._torque = _NoiseRows(random, samples, motor_count, sensors.torque)
        self._recorded_samples = 0
        self._q_step, self._theta_step = np.zeros(joint_count), np.zeros(motor_count)
        if sensors.encoder_bits is not None:
            turns_per_step = 0.5**sensors.encoder_bits
            self._q_step += [_encoder_range(joint) * turns_per_step for joint in robot.joints]
            self._theta_step += [
                _encoder_range(joint, motor.gear_ratio) * turns_per_step
                for joint in robot.joints
                for motor in joint.actuator.motors
            ]

    def positions(self, truth: Phase, rows: int | slice) -> tuple[FloatArray, FloatArray]:
        """Return readings of joints, (..., joints), and of all motors, (..., motors), at samples `rows`."""
        theta = self._drivetrain.of_all_motors(truth.q, truth.theta)
        return (
            _quantize(truth.q + self._q[rows], self._q_step),
            _quantize(theta + self._theta[rows], self._theta_step),
        )

    def phase(self, truth: Phase, sample: int) -> Phase:
        """Return the state that a controller reads at a sample; velocities are the true ones."""
        q, theta = self.positions(truth, sample)
        return truth._replace(q=q, theta=theta[self._drivetrain.sprung])

    def variables(self, truth: Phase, torque: FloatArray) -> dict[str, FloatArray]:
        """Return the readings of the next block by name, from its states and torques, (samples, motors)."""
        start, self._recorded_samples = self._recorded_samples, self._recorded_samples + len(torque)
        rows = slice(start, self._recorded_samples)
        q, theta = self.positions(truth, rows)
        of_joints = self._drivetrain.of_joints
        readings = {"q": q, "theta": of_joints(theta), "tau_motor": of_joints(torque + self._torque[rows])}
        for noise in (self._q, self._theta, self._torque):
            noise.drop_rows(self._recorded_samples)
        return {measured(name): values for name, values in readings.items()}


def _encoder_range(joint: Joint, gear_ratio: float | None = None) -> float:
    """Return the range that an encoder divides into steps, joint side of the gear, rad (m).

    It is a turn of a revolute joint, or of the shaft of a motor whose gear ratio is known, or the position
    limits of a prismatic joint.
    """
    if gear_ratio is not None:
        return 2 * math.pi / abs(gear_ratio)
    if joint.type == "revolute":
        return 2 * math.pi
    lower, upper = joint.limits.position
    if not math.isfinite(upper - lower):
        raise InputError.one(
            f"{joint.name}: the resolution of its encoder is unknown, since it is prismatic without position "
            "limits; give it limits.position"
        )
    return upper - lower


def _quantize(values: FloatArray, step: FloatArray) -> FloatArray:
    """Return values rounded to multiples of a step, unless that is zero."""
    multiple = np.where(step > 0, step, 1.0)
    return np.where(step > 0, multiple * np.round(values / multiple), values)
