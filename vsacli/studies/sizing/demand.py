"""What trajectories ask of each motor and each spring of a robot, whichever motors those are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.analysis.run import Run
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.flags import Flag, has
from vsacli.base.json_records import Published
from vsacli.base.variables import Block
from vsacli.dynamics.dampers import motor_torques
from vsacli.robot.model import Robot
from vsacli.studies.sizing.motor_demand import MotorDemand
from vsacli.studies.sizing.spring_demand import SpringDemand, SpringPeaks
from vsacli.trajectory.trajectory import Trajectory

UNDONE = Flag.INFEASIBLE | Flag.SINGULAR | Flag.INTERNAL_INSTABILITY | Flag.NOT_FINITE
"""Steps that have no motor torque, or none that a machine could follow."""

MOVED = ("time", "velocity", "acceleration", "load", "torque")


@dataclass(frozen=True)
class Outcome(Published):
    """A run that was sized for.

    Attributes:
        trajectory: its name.
        duration: s.
        verdict: on the run with the motors of the robot file.
        left_out: steps that some joint cannot do; what they would ask is not known.
        samples: steps in all.
    """

    trajectory: str
    duration: float
    verdict: str
    left_out: int
    samples: int


class Demand(NamedTuple):
    """What trajectories ask of a robot."""

    outcomes: tuple[Outcome, ...]
    motors: tuple[MotorDemand, ...]
    springs: tuple[SpringDemand, ...]


def demanded(
    robot: Robot, trajectories: Sequence[Trajectory], progress: Callable[[int], object] = lambda _: None
) -> Demand:
    """Run all trajectories, and keep what does not depend on the motors.

    Args:
        robot: the robot.
        trajectories: what it is to do, one after the other.
        progress: is told how many further steps are done.

    Raises:
        InputError: a trajectory does not fit the robot.
    """
    springs = SpringPeaks(robot)
    parts: list[dict[str, FloatArray]] = []
    outcomes = []
    for name, trajectory in zip(_told_apart([each.name for each in trajectories]), trajectories, strict=True):
        run = Run(robot, trajectory)
        blocks, left_out = [], 0
        for block in run:
            blocks.append(_moved(robot, block))
            springs.add(block, name)
            left_out += int(np.count_nonzero(np.any(has(block.flags, UNDONE), axis=1)))
            progress(len(block.time))
        parts.append({name: np.concatenate([each[name] for each in blocks]) for name in MOVED})
        verdict = run.report().verdict
        outcomes.append(Outcome(name, trajectory.duration, verdict, left_out, len(parts[-1]["time"])))
    names = tuple(outcome.trajectory for outcome in outcomes)
    return Demand(tuple(outcomes), tuple(_motors(robot, parts, names)), springs.report())


def _told_apart(names: Sequence[str]) -> Iterator[str]:
    """Names with a number behind those that were there already."""
    for index, name in enumerate(names):
        earlier = names[:index].count(name)
        yield f"{name} ({earlier + 1})" if earlier else name


def _moved(robot: Robot, block: Block) -> dict[str, FloatArray]:
    """Motion of the motors and their loads at the steps of a block, (samples, joints, 2)."""
    load = block.tau_spring.copy()
    for index, joint in enumerate(robot.joints):
        if joint.damper_at("transmission"):
            load[:, index] += motor_torques(joint, block.of_joint(index))[0].T
        if joint.actuator.coupled_rotors:
            load[:, index] += joint.actuator.coupled_rotors * block.ddtheta[:, index, ::-1]
    load[has(block.flags, UNDONE)] = np.nan
    of_motors = (block.dtheta, block.ddtheta, load, block.tau_motor)
    return dict(zip(MOVED, (block.time, *(each.copy() for each in of_motors)), strict=True))


def _motors(
    robot: Robot, parts: Sequence[dict[str, FloatArray]], names: tuple[str, ...]
) -> Iterator[MotorDemand]:
    for index, joint in enumerate(robot.joints):
        for side in range(min(SIDES, joint.actuator.motor_count)):
            kept = [_kept(part, index, side) for part in parts]
            runs = [np.full(len(each["time"]), number) for number, each in enumerate(kept)]
            together = {name: np.concatenate([each[name] for each in kept]) for name in kept[0]}
            yield MotorDemand(joint.name, joint.type, side + 1, names, np.concatenate(runs), **together)


def _kept(part: dict[str, FloatArray], index: int, side: int) -> dict[str, FloatArray]:
    """What one trajectory asks of a motor, with the weights of its steps, where it can be done."""
    of_motor = {name: values if values.ndim == 1 else values[:, index, side] for name, values in part.items()}
    known: BoolArray = np.all(np.isfinite([of_motor[name] for name in MOVED]), axis=0)
    intervals = np.where(known[:-1] & known[1:], np.diff(of_motor["time"]), 0.0)
    weight = (np.append(intervals, 0.0) + np.append(0.0, intervals)) / 2
    return {name: values[known] for name, values in {**of_motor, "weight": weight}.items()}
