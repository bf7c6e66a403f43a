"""Inverse dynamics along a trajectory: the one place that walks over time, block by block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.drift import DriftTally
from vsacli.feasibility import NEAR_SINGULAR, check_near_singular, has
from vsacli.flags import Flag
from vsacli.following import Following
from vsacli.report import Report
from vsacli.robot import Antagonistic, Robot
from vsacli.self_check import DRIFT_BOUND, SPRING_BOUND, SelfCheck, ladder, spring_residual
from vsacli.steps import check_fit, compute_block
from vsacli.tally import JointTally
from vsacli.trajectory import Trajectory
from vsacli.variables import Block

BLOCK_SAMPLES = 8192
"""Steps computed at a time: enough to hide the interpreter, few enough to bound the memory."""


class Run:
    """One pass over a trajectory: iterate it for the blocks, then ask it for the report.

    Args:
        robot: the robot.
        trajectory: what it is asked to do.
        stop_on_infeasible: end with the first infeasible step, as the paper's algorithm does.
        near_singular: margin below which a step is near-singular.
        following: deflections to use, by `follow`, instead of the root of (14) at each step.
        block_samples: steps in a block; results do not depend on it.

    Raises:
        InputError: the margin is none, or the trajectory does not fit the robot.
    """

    def __init__(
        self,
        robot: Robot,
        trajectory: Trajectory,
        *,
        stop_on_infeasible: bool = False,
        near_singular: float = NEAR_SINGULAR,
        following: Following | None = None,
        block_samples: int = BLOCK_SAMPLES,
    ) -> None:
        check_near_singular(near_singular)
        check_fit(robot, trajectory)
        self.robot = robot
        self.trajectory = trajectory
        self._stop_on_infeasible = stop_on_infeasible
        self._near_singular = near_singular
        self._block_samples = block_samples
        self._following = following
        self._tallies = [JointTally(joint, index) for index, joint in enumerate(robot.joints)]
        self._drifts = [] if following is None else _drift_tallies(robot, following)
        self._spring_residual = 0.0
        self._samples = 0

    def __iter__(self) -> Iterator[Block]:
        for start in range(0, self.trajectory.samples, self._block_samples):
            stop = min(start + self._block_samples, self.trajectory.samples)
            motion = self.trajectory.block(start, stop)
            followed = None if self._following is None else self._following.at(motion.time)
            block = compute_block(self.robot, motion, self._near_singular, followed)
            infeasible = has(block.flags, Flag.INFEASIBLE).any(axis=1)
            if self._stop_on_infeasible and infeasible.any():
                block = _shortened(block, int(infeasible.argmax()) + 1)
                self._add(block)
                yield block
                return
            self._add(block)
            yield block

    def _add(self, block: Block) -> None:
        self._samples += len(block.time)
        self._spring_residual = float(np.maximum(self._spring_residual, spring_residual(self.robot, block)))
        for tally in self._tallies:
            tally.add(block)
        for drift in self._drifts:
            drift.add(block)

    def report(self) -> Report:
        """The verdict on the blocks so far, with the self-check of the whole."""
        return Report(
            robot=self.robot.name,
            trajectory=self.trajectory.name,
            samples=self._samples,
            duration=self.trajectory.duration,
            complete=self._samples == self.trajectory.samples,
            warnings=(*self.robot.warnings, *self.trajectory.warnings),
            self_check=self._self_check(),
            joints=tuple(tally.report() for tally in self._tallies),
            drifts=tuple(drift.report() for drift in self._drifts),
        )

    def _self_check(self) -> SelfCheck:
        """Followed deflections satisfy (14) up to their drift, the rest is held to the same bound."""
        bound = SPRING_BOUND if self._following is None else DRIFT_BOUND
        return SelfCheck(self._spring_residual, ladder(self.robot, self.trajectory), bound)


@dataclass(frozen=True)
class Result(Block):
    """Every variable over the whole trajectory, and the report on it."""

    report: Report = field(kw_only=True)
    joint_names: tuple[str, ...] = field(kw_only=True)


def inverse_dynamics(
    robot: Robot,
    trajectory: Trajectory,
    *,
    stop_on_infeasible: bool = False,
    following: Following | None = None,
) -> Result:
    """Motor torques that execute a motion and a stiffness profile, VSA-NEA (36)-(74).

    Pure: prints nothing, writes nothing.

    Args:
        robot: the robot, from `load_robot` or built in Python.
        trajectory: for this robot, from `load_trajectory` or `Trajectory.from_samples`.
        stop_on_infeasible: end with the first infeasible step.
        following: deflections to use, by `follow`, instead of the root of (14) at each step.

    Returns:
        Every variable of `vsacli.variables.Block` over (samples, joints[, 2]); `report` holds the verdict.

    Raises:
        InputError: the trajectory has another number of joints than the robot, or no stiffness for a joint
            that needs one.
    """
    run = Run(robot, trajectory, stop_on_infeasible=stop_on_infeasible, following=following)
    return Result(**_joined(list(run)), report=run.report(), joint_names=robot.joint_names)


def _drift_tallies(robot: Robot, following: Following) -> list[DriftTally]:
    pairs = zip(robot.joints, following.stops, strict=True)
    return [
        DriftTally(joint, joint.actuator, index, stop)
        for index, (joint, stop) in enumerate(pairs)
        if isinstance(joint.actuator, Antagonistic)
    ]


def _shortened(block: Block, samples: int) -> Block:
    return Block(**{name: array[:samples] for name, array in block.arrays().items()})


def _joined(blocks: list[Block]) -> dict[str, npt.NDArray[Any]]:
    """Blocks one after the other, samples contiguous."""
    rows = [{name: np.moveaxis(array, 0, -1) for name, array in block.arrays().items()} for block in blocks]
    return {
        name: np.moveaxis(np.concatenate([row[name] for row in rows], axis=-1), -1, 0) for name in rows[0]
    }
