"""Standard errors that an identification will have, by a record that is drawn before there is one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.errors import InputError
from vsacli.base.json_records import Published
from vsacli.base.variables import Block
from vsacli.dynamics.inverse import compute_block, fitted
from vsacli.robot.model import Robot
from vsacli.studies.identification.excitation.design import RATE
from vsacli.studies.identification.identification import WORDS, solutions
from vsacli.studies.identification.identification_report import Number
from vsacli.studies.identification.motors.unknowns import with_friction
from vsacli.studies.identification.records.bandwidth import bandwidth_of
from vsacli.studies.identification.records.signals import Signals, conditioned
from vsacli.studies.identification.system_reports import numbers_of
from vsacli.trajectory.trajectory import Trajectory

POSITION_NOISE = 2e-5
"""Rad (m), of the last step of an encoder with 16 bits."""

RECORDS = 3
"""That are drawn, each with a noise of its own. A number that may not be negative and comes out at zero is
held there, which makes standard errors of others smaller, of some by a third: so their mean is taken."""

TORQUE_SHARE = 0.005
"""Noise of a motor's torque over the largest of it, where nobody says more: as of measured currents."""


class Noise(NamedTuple):
    """Standard deviations of what sensors read, joint side of the gears.

    Attributes:
        position: of joints and motors, rad (m).
        torque: of motors, N m (N); None is a share of the largest torque of each.
    """

    position: float = POSITION_NOISE
    torque: float | None = None

    def __str__(self) -> str:
        share = f"{100 * TORQUE_SHARE:g} % of the largest one of each motor"
        torques = share if self.torque is None else f"{self.torque:g} N m (N)"
        return f"{self.position:g} rad (m) in positions, and {torques} in torques"


USUAL_NOISE = Noise()


@dataclass(frozen=True)
class Told(Published):
    """A number that an identification looks for.

    Attributes:
        path: to it, from the robot; or the name of a base parameter.
        unit: of it.
        value: by the robot file.
        standard_error: predicted, NaN if it cannot be told.
    """

    path: str
    unit: str
    value: float
    standard_error: float


def predicted_errors(robot: Robot, trajectory: Trajectory, noise: Noise, seed: int) -> tuple[Told, ...]:
    """What an identification from one record of a motion will tell, if the robot is as its file says.

    Args:
        robot: the robot.
        trajectory: which it executes, recorded at its rate, but at no more than that of excitations.
        noise: of the sensors.
        seed: of the noise.

    Raises:
        InputError: the robot cannot execute it, or it is too short.
    """
    block, random = executed(robot, trajectory), np.random.default_rng(seed)
    drawn = [_identified(robot, noisy_record(robot, block, noise, random)) for _ in range(RECORDS)]
    errors = np.array([[each.standard_error for each in numbers] for numbers in drawn])
    told = np.isfinite(errors)
    variances = np.where(told, errors, 0.0) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.sqrt(variances.sum(axis=0) / told.sum(axis=0))
    mean[2 * told.sum(axis=0) < RECORDS] = np.nan
    return tuple(
        Told(each.path, each.unit, each.before, float(error))
        for each, error in zip(drawn[0], mean, strict=True)
    )


def _identified(robot: Robot, record: Signals) -> list[Number]:
    """All numbers, by a record of all joints."""
    joints = range(len(robot.joints))
    systems = solutions(with_friction(robot, joints), joints, WORDS, [record])
    return [number for system in systems for number in numbers_of(system)]


def noisy_record(robot: Robot, block: Block, noise: Noise, random: np.random.Generator) -> Signals:
    """What would be recorded of a motion, ready for equations."""
    q, theta = (each + noise.position * random.standard_normal(each.shape) for each in (block.q, block.theta))
    for index, joint in enumerate(robot.joints):
        if not joint.actuator.sprung:
            theta[:, index, 0] = q[:, index]
    largest = TORQUE_SHARE * np.abs(block.tau_motor).max(axis=0)
    torque = largest if noise.torque is None else noise.torque
    tau_motor = block.tau_motor + torque * random.standard_normal(block.tau_motor.shape)
    return conditioned(block.time, q, theta, tau_motor, bandwidth_of(block.time, q, theta))


def executed(robot: Robot, trajectory: Trajectory) -> Block:
    """Inverse dynamics along a trajectory, from time zero on.

    Raises:
        InputError: the robot cannot execute it.
    """
    steps = min(trajectory.samples - 1, round(trajectory.duration * RATE))
    elapsed = np.linspace(0.0, trajectory.duration, steps + 1)
    block = compute_block(robot, fitted(robot, trajectory).from_zero().at(elapsed))
    motors = [joint.actuator.motor_count for joint in robot.joints]
    torques = [block.tau_motor[:, index, :count] for index, count in enumerate(motors)]
    if not all(np.isfinite(each).all() for each in torques):
        raise InputError.one(f"the robot cannot execute {trajectory.name}, see vsacli check-feasibility")
    return block
