"""Demands of trajectories on each motor and each spring of a robot, independent of its motors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, Self

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.antagonistic import Antagonistic
from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.transmission import JointVariables
from vsacli.analysis.run import Run
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.flags import Flag, has_flag
from vsacli.base.json_records import Published, named
from vsacli.base.variables import Block
from vsacli.dynamics.dampers import parallel_damper_torques
from vsacli.robot.model import Robot
from vsacli.studies.sizing.catalog import shaft_signals
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Peak(Published):
    """The largest absolute value of a quantity, and its time; NaN if the quantity never exists.

    Attributes:
        value: largest absolute value.
        trajectory: name of the trajectory.
        time: time in the trajectory, s.
    """

    value: float = math.nan
    trajectory: str = ""
    time: float = math.nan

    @classmethod
    def of(cls, values: FloatArray, time: FloatArray, trajectory: str) -> Self:
        """Return the peak of the finite values, (samples,)."""
        magnitudes = np.where(np.isfinite(values), np.abs(values), -1.0)
        index = int(magnitudes.argmax())
        return (
            cls(float(magnitudes[index]), trajectory, float(time[index])) if magnitudes[index] >= 0 else cls()
        )

    def or_larger(self, other: Self) -> Self:
        """Return the larger of two peaks."""
        return self if self.value >= other.value or math.isnan(other.value) else other


@dataclass(frozen=True, eq=False)
class MotorDemand:
    """The demand on a motor on the joint side of its gear, at all feasible samples; (samples,).

    Attributes:
        joint, joint_type: name and type of the joint.
        number: number of the motor, 1 or 2.
        trajectories: names of the trajectories.
        run: index of each sample's trajectory.
        time: time of each sample in its trajectory, s.
        weight: weight of each sample in means over time, s.
        velocity, acceleration: velocity and acceleration of the motor.
        load: torque of springs, damper and coupled rotor against the motor.
        torque: torque of the motor in the robot file.
    """

    joint: str
    joint_type: str
    number: int
    trajectories: tuple[str, ...]
    run: IndexArray = field(repr=False)
    time: FloatArray = field(repr=False)
    weight: FloatArray = field(repr=False)
    velocity: FloatArray = field(repr=False)
    acceleration: FloatArray = field(repr=False)
    load: FloatArray = field(repr=False)
    torque: FloatArray = field(repr=False)

    @property
    def name(self) -> str:
        """Name of the motor."""
        return f"{self.joint} {self.number}"

    def peak(self, values: FloatArray) -> Peak:
        """Return the largest absolute value of values, (samples,)."""
        index = int(np.abs(values).argmax())
        return Peak(
            float(abs(values[index])), self.trajectories[int(self.run[index])], float(self.time[index])
        )

    def rms(self, values: FloatArray) -> float:
        """Return the rms over time of values, (samples,)."""
        return float(np.sqrt(self.mean(values * values)))

    @cached_property
    def signals(self) -> FloatArray:
        """Seven signals of which the torque on a shaft is a linear combination, (7, samples)."""
        return shaft_signals(self.velocity, self.acceleration, self.load)

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the mean over time along the last axis; over samples if no two consecutive ones exist."""
        weight = self.weight if self.weight.any() else np.ones_like(self.weight)
        return np.asarray(values @ weight / weight.sum())

    @cached_property
    def moments(self) -> FloatArray:
        """Means over time of products of the signals, (7, 7), from which mean squares of torques follow."""
        return self.mean(self.signals[:, None] * self.signals)

    @cached_property
    def top_speed(self) -> float:
        """Largest speed."""
        return float(np.abs(self.velocity).max(initial=0.0))


@dataclass(frozen=True)
class SpringDemand(Published):
    """The demand on a spring.

    Attributes:
        joint, joint_type: name and type of the joint.
        spring: name of the spring.
        energy: largest energy, J.
        torque: largest |torque|, N m (N).
        deflection: largest |deflection|, rad (m).
        max_deflection: limit of the deflection in the robot file; infinite without one.
    """

    joint: str
    joint_type: str
    spring: str
    energy: Peak
    torque: Peak
    deflection: Peak
    max_deflection: float

    shape: ClassVar = named("joint", "spring", "energy", "torque", "deflection", "max_deflection", "share")

    @property
    def share(self) -> float:
        """Used share of the admissible deflection; NaN without a limit."""
        return self.deflection.value / self.max_deflection if math.isfinite(self.max_deflection) else math.nan


def _spring_loads(
    actuator: Actuator, of_joint: JointVariables
) -> Iterator[tuple[str, float, FloatArray, FloatArray, FloatArray]]:
    """Yield name, largest admissible deflection, energy, torque and deflection of springs of a joint.

    Those of a mechanism are taken together: their deflection is that between motor 1 and link.
    """
    phi, limits = of_joint.phi, actuator.max_deflections
    if isinstance(actuator, Antagonistic):
        springs = [("spring 1", phi[0], limits[0]), ("spring 2", phi[1], limits[1])]
        springs.append(("coupling", phi[0] - phi[1], math.inf))
        for element, (name, deflection, limit) in zip(actuator.spring_elements, springs, strict=False):
            law = element.law
            yield name, limit, law.energy(deflection), law.torque(deflection), deflection
    elif actuator.sprung:
        yield "springs", limits[0], of_joint.elastic_energy, of_joint.tau_transmission[0], phi[0]


class SpringPeaks:
    """The largest loads of springs over trajectories; `add` their blocks."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._demands: dict[tuple[str, str], SpringDemand] = {}

    def add(self, block: Block, trajectory: str) -> None:
        """Include a block of a trajectory."""
        for index, joint in enumerate(self._robot.joints):
            for name, limit, *load in _spring_loads(joint.actuator, JointVariables.of(block.of_joint(index))):
                energy, torque, deflection = (Peak.of(values, block.time, trajectory) for values in load)
                new = SpringDemand(joint.name, joint.type, name, energy, torque, deflection, limit)
                key = joint.name, name
                self._demands[key] = _with_larger_peaks(self._demands.get(key, new), new)

    def report(self) -> tuple[SpringDemand, ...]:
        """Return the demand on each spring."""
        return tuple(self._demands.values())


def _with_larger_peaks(one: SpringDemand, other: SpringDemand) -> SpringDemand:
    """Return the demand with the larger of each peak."""
    return replace(
        one,
        energy=one.energy.or_larger(other.energy),
        torque=one.torque.or_larger(other.torque),
        deflection=one.deflection.or_larger(other.deflection),
    )


UNDONE = Flag.INFEASIBLE | Flag.SINGULAR | Flag.INTERNAL_INSTABILITY | Flag.NOT_FINITE
"""Flags of samples without a motor torque, or with one that no machine could follow."""

MOVED = ("time", "velocity", "acceleration", "load", "torque")


@dataclass(frozen=True)
class Outcome(Published):
    """A run along one of the trajectories.

    Attributes:
        trajectory: name of the trajectory.
        duration: duration, s.
        verdict: verdict on the run with the motors of the robot file.
        left_out: number of samples with `UNDONE` flags, whose demand is unknown.
        samples: total number of samples.
    """

    trajectory: str
    duration: float
    verdict: str
    left_out: int
    samples: int


class Demand(NamedTuple):
    """The demands of trajectories on a robot."""

    outcomes: tuple[Outcome, ...]
    motors: tuple[MotorDemand, ...]
    springs: tuple[SpringDemand, ...]


def demanded(
    robot: Robot, trajectories: Sequence[Trajectory], progress: Callable[[int], object] = lambda _: None
) -> Demand:
    """Run all trajectories, and keep the values that do not depend on the motors.

    Args:
        robot: robot to size.
        trajectories: trajectories, executed one after the other.
        progress: function to call with the number of further samples that are done.

    Raises:
        InputError: a trajectory does not fit the robot.
    """
    springs = SpringPeaks(robot)
    parts: list[dict[str, FloatArray]] = []
    outcomes = []
    for name, trajectory in zip(
        _distinguished([each.name for each in trajectories]), trajectories, strict=True
    ):
        run = Run(robot, trajectory)
        blocks, left_out = [], 0
        for block in run:
            blocks.append(_motor_motion(robot, block))
            springs.add(block, name)
            left_out += int(np.count_nonzero(np.any(has_flag(block.flags, UNDONE), axis=1)))
            progress(len(block.time))
        parts.append({name: np.concatenate([each[name] for each in blocks]) for name in MOVED})
        verdict = run.findings().verdict
        outcomes.append(Outcome(name, trajectory.duration, verdict, left_out, len(parts[-1]["time"])))
    names = tuple(outcome.trajectory for outcome in outcomes)
    return Demand(tuple(outcomes), tuple(_motors(robot, parts, names)), springs.report())


def _distinguished(names: Sequence[str]) -> Iterator[str]:
    """Yield the names, with a number appended to repeated ones."""
    for index, name in enumerate(names):
        earlier = names[:index].count(name)
        yield f"{name} ({earlier + 1})" if earlier else name


def _motor_motion(robot: Robot, block: Block) -> dict[str, FloatArray]:
    """Return motion, loads and torques of the motors in a block, (samples, joints, 2)."""
    load = block.tau_transmission.copy()
    for index, joint in enumerate(robot.joints):
        if joint.damper_at("transmission"):
            load[:, index] += parallel_damper_torques(joint, JointVariables.of(block.of_joint(index)))[0].T
        if joint.actuator.coupled_rotors:
            load[:, index] += joint.actuator.coupled_rotors * block.ddtheta[:, index, ::-1]
    load[has_flag(block.flags, UNDONE)] = np.nan
    of_motors = (block.dtheta, block.ddtheta, load, block.tau_motor)
    return dict(zip(MOVED, (block.time, *(each.copy() for each in of_motors)), strict=True))


def _motors(
    robot: Robot, parts: Sequence[dict[str, FloatArray]], names: tuple[str, ...]
) -> Iterator[MotorDemand]:
    for index, joint in enumerate(robot.joints):
        for side in range(min(SIDES, joint.actuator.motor_count)):
            kept = [_feasible_demand(part, index, side) for part in parts]
            runs = [np.full(len(each["time"]), number) for number, each in enumerate(kept)]
            together = {name: np.concatenate([each[name] for each in kept]) for name in kept[0]}
            yield MotorDemand(joint.name, joint.type, side + 1, names, np.concatenate(runs), **together)


def _feasible_demand(part: dict[str, FloatArray], index: int, side: int) -> dict[str, FloatArray]:
    """Return the demand of one trajectory on a motor at feasible samples, with their weights."""
    of_motor = {name: values if values.ndim == 1 else values[:, index, side] for name, values in part.items()}
    known: BoolArray = np.all(np.isfinite([of_motor[name] for name in MOVED]), axis=0)
    intervals = np.where(known[:-1] & known[1:], np.diff(of_motor["time"]), 0.0)
    weight = (np.append(intervals, 0.0) + np.append(0.0, intervals)) / 2
    return {name: values[known] for name, values in {**of_motor, "weight": weight}.items()}
