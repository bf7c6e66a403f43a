"""Information of a motion on the parameters of its robot: Fisher information, predicted standard errors.

`Information` compares motions by the slopes of the identification equations only. `predicted_errors`
simulates noisy recordings of one motion and identifies the robot from them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.json_records import Published
from vsacli.base.variables import Block
from vsacli.dynamics.inverse import adapt_trajectory, compute_block
from vsacli.robot.model import Robot
from vsacli.studies.identification.conditioning import ConditionedRecording, Filter, bandwidth_of, conditioned
from vsacli.studies.identification.excitation.family import RATE
from vsacli.studies.identification.identification import WORDS, solutions
from vsacli.studies.identification.identification_report import numbers_of
from vsacli.studies.identification.identification_text import Number
from vsacli.studies.identification.independence import Independence, in_words, independence
from vsacli.studies.identification.link_equations import link_system
from vsacli.studies.identification.motor_equations import GROUPS, MotorSystem, unknowns, with_friction
from vsacli.studies.identification.regressor import link_parameter_names
from vsacli.trajectory.trajectory import Trajectory

ALL_PASS = Filter(bandwidth=np.inf, sections=np.array([[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]]), stride=1, reach=0)
"""Filter for motions without noise."""

TOLERANCE = 1e-6
"""Relative distance of a column from the span of others above which some motion identifies its unknown:
rounding leaves 1e-12 for dependent columns."""


CONDITION = 20.0
"""Largest condition number without a penalty. On the paper's arm, staying below it increased standard errors
by 0 to 1.5 %; without a penalty, one search in three ended at 30 or more, which amplifies model errors."""


class Information:
    """The information of motions on the parameters of a robot.

    The motors and springs of each joint form one system of equations, the links of all joints another one.
    There, rows are divided by the rms torque of their joint, since the torques of a wrist are far smaller
    than those of a base.

    Args:
        robot: robot to identify.
        examples: motions that determine which parameters no motion distinguishes, and the size of torques.

    Attributes:
        structural: parameters that no motion identifies, as clauses.
    """

    def __init__(self, robot: Robot, examples: Sequence[Block]) -> None:
        self._robot = robot = with_friction(robot, range(len(robot.joints)))
        motors = (
            MotorSystem(robot, index, chosen)
            for index, joint in enumerate(robot.joints)
            if joint.actuator.sprung and (chosen := unknowns(robot, index, GROUPS))
        )
        self._links = link_system(robot, GROUPS)
        self._systems = (*motors, self._links)
        torques = np.concatenate([block.tau_e for block in examples])
        self._sizes = np.sqrt(np.mean(torques**2, axis=0))
        systems = zip(*map(self._slopes, examples), strict=True)
        splits = [independence(np.concatenate(slopes), TOLERANCE) for slopes in systems]
        self._kept = [each.kept for each in splits]
        self.structural = tuple(self._unidentifiable(splits))

    def _unidentifiable(self, splits: Sequence[Independence]) -> Iterator[str]:
        """Yield clauses on the parameters that no motion identifies."""
        for system, split in zip(self._systems, splits, strict=True):
            own = system.names
            if split.nothing.size:
                yield ", ".join(own[at] for at in split.nothing)
            for place, kept in enumerate(split.kept):
                others = np.flatnonzero(split.shares[place])
                if others.size:
                    terms = [(int(split.dropped[at]), float(split.shares[place, at])) for at in others]
                    yield f"more than {in_words([(int(kept), 1.0), *terms], own)}"
        of_links = link_parameter_names(self._robot)
        silent = np.flatnonzero(~self._links.base.shares.any(axis=0))
        if silent.size:
            yield ", ".join(of_links[at] for at in silent)

    def _slopes(self, block: Block) -> Iterator[FloatArray]:
        """Yield the slopes of the equations of each system by its unknowns, (rows, unknowns)."""
        signals = exact_signals(block)
        for system in self._systems:
            slopes = system.of_record(system.before, signals).slopes
            if system is self._links:
                sizes = np.repeat(self._sizes, len(block.time))  # joint by joint
                slopes = slopes / np.where(sizes > 0, sizes, 1.0)[:, None]
            yield slopes

    def worth(self, block: Block) -> float:
        """Return the information of a motion minus a penalty for poorly conditioned equations.

        The information is the log determinant of the information matrix per row, divided by twice the number
        of unknowns (D-optimality). Comparisons do not depend on the units of the unknowns; an increase by 1
        means that standard errors are smaller by a factor e on average.
        """
        separable = [slopes for _, slopes in self._separable(block)]
        excess = sum(max(0.0, math.log(_condition(slopes) / CONDITION)) for slopes in separable)
        grams = (slopes.T @ slopes / len(slopes) for slopes in separable)
        logarithms = sum(float(np.linalg.slogdet(each).logabsdet) / 2 for each in grams)
        return logarithms / sum(map(len, self._kept)) - excess

    def conditions(self, block: Block) -> dict[str, float]:
        """Return the condition number of each system by title; its columns are divided by their norms."""
        return {name: _condition(slopes) for name, slopes in self._separable(block)}

    def _separable(self, block: Block) -> Iterator[tuple[str, FloatArray]]:
        """Yield the title and the slopes by distinguishable unknowns of each system that has any."""
        for kept, system, slopes in zip(self._kept, self._systems, self._slopes(block), strict=True):
            if kept.size:
                yield system.title, slopes[:, kept]


def _condition(slopes: FloatArray) -> float:
    norms = np.linalg.norm(slopes, axis=0)
    if not norms.all():
        return np.inf
    return float(np.linalg.cond(slopes / norms))


def exact_signals(block: Block) -> ConditionedRecording:
    """Return a motion as a recording without noise."""
    motion = {name: getattr(block, name) for name in ("time", "q", "dq", "ddq", "theta", "dtheta", "ddtheta")}
    return ConditionedRecording(**motion, tau_motor=block.tau_motor, rate=np.nan, filter=ALL_PASS)


POSITION_NOISE = 2e-5
"""Standard deviation of positions, rad (m), about the quantization noise of a 16-bit encoder."""

RECORDS = 3
"""Number of simulated recordings, each with its own noise.

A parameter that must not be negative and comes out at zero is held there, which reduces the standard errors
of others, of some by a third; therefore standard errors are averaged.
"""

TORQUE_SHARE = 0.005
"""Default noise of a motor's torque relative to its largest torque, as for measured currents."""


class Noise(NamedTuple):
    """Standard deviations of sensor readings, joint side of the gears.

    Attributes:
        position: noise of joint and motor positions, rad (m).
        torque: noise of motor torques, N m (N); None means `TORQUE_SHARE` of each motor's largest torque.
    """

    position: float = POSITION_NOISE
    torque: float | None = None

    def __str__(self) -> str:
        share = f"{100 * TORQUE_SHARE:g} % of the largest one of each motor"
        torques = share if self.torque is None else f"{self.torque:g} N m (N)"
        return f"{self.position:g} rad (m) in positions, and {torques} in torques"


USUAL_NOISE = Noise()


@dataclass(frozen=True)
class PredictedError(Published):
    """The predicted standard error of a parameter.

    Attributes:
        path: path of the parameter in the robot, or name of a base parameter.
        unit: unit of value and standard error.
        value: value in the robot file.
        standard_error: predicted standard error; NaN if unidentifiable.
    """

    path: str
    unit: str
    value: float
    standard_error: float


def predicted_errors(
    robot: Robot, trajectory: Trajectory, noise: Noise, seed: int
) -> tuple[PredictedError, ...]:
    """Return the predicted errors of an identification from one recording, for the robot as in its file.

    Args:
        robot: robot to identify.
        trajectory: executed motion, recorded at its sample rate but at most at `RATE`.
        noise: noise of the sensors.
        seed: seed of the noise.

    Raises:
        InputError: the robot cannot execute the motion, or it is too short.
    """
    block, random = executed(robot, trajectory), np.random.default_rng(seed)
    drawn = [_identified(robot, noisy_record(robot, block, noise, random)) for _ in range(RECORDS)]
    errors = np.array([[each.standard_error for each in numbers] for numbers in drawn])
    identifiable = np.isfinite(errors)
    variances = np.where(identifiable, errors, 0.0) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.sqrt(variances.sum(axis=0) / identifiable.sum(axis=0))
    mean[2 * identifiable.sum(axis=0) < RECORDS] = np.nan
    return tuple(
        PredictedError(each.path, each.unit, each.before, float(error))
        for each, error in zip(drawn[0], mean, strict=True)
    )


def _identified(robot: Robot, record: ConditionedRecording) -> list[Number]:
    """Return the results for all parameters, from a recording of all joints."""
    joints = range(len(robot.joints))
    systems = solutions(with_friction(robot, joints), joints, WORDS, [record])
    return [number for system in systems for number in numbers_of(system)]


def noisy_record(
    robot: Robot, block: Block, noise: Noise, random: np.random.Generator
) -> ConditionedRecording:
    """Return a simulated noisy recording of a motion, conditioned."""
    q, theta = (each + noise.position * random.standard_normal(each.shape) for each in (block.q, block.theta))
    for index, joint in enumerate(robot.joints):
        if not joint.actuator.sprung:
            theta[:, index, 0] = q[:, index]
    largest = TORQUE_SHARE * np.abs(block.tau_motor).max(axis=0)
    torque = largest if noise.torque is None else noise.torque
    tau_motor = block.tau_motor + torque * random.standard_normal(block.tau_motor.shape)
    return conditioned(block.time, q, theta, tau_motor, bandwidth_of(block.time, q, theta))


def executed(robot: Robot, trajectory: Trajectory) -> Block:
    """Return the inverse dynamics along a trajectory, shifted to start at time zero.

    Raises:
        InputError: the robot cannot execute the trajectory.
    """
    steps = min(trajectory.samples - 1, round(trajectory.duration * RATE))
    elapsed = np.linspace(0.0, trajectory.duration, steps + 1)
    block = compute_block(robot, adapt_trajectory(robot, trajectory).from_zero().at(elapsed))
    motors = [joint.actuator.motor_count for joint in robot.joints]
    torques = [block.tau_motor[:, index, :count] for index, count in enumerate(motors)]
    if not all(np.isfinite(each).all() for each in torques):
        raise InputError.one(f"the robot cannot execute {trajectory.name}, see vsacli check-feasibility")
    return block
