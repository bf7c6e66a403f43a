"""Runs of robots whose numbers are drawn from their tolerances: what first order leaves out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag, has
from vsacli.base.json_records import Published, named
from vsacli.dynamics.inverse import compute_block, fitted, usual_block
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.studies.sensitivities.tolerances import Tolerance
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class MonteCarlo(Published):
    """What became of the robots that were drawn.

    Attributes:
        drawn: how many.
        refused: how many of those are no robots: a mass below zero, say.
        lost: share of the others that have an infeasible or singular step, by joint.
        torque: largest standard deviation of a motor torque among those that have none, by joint, N m (N);
            NaN where fewer than two have none.
    """

    drawn: int
    refused: int
    lost: dict[str, float]
    torque: dict[str, float]

    shape: ClassVar = named("drawn", "refused", "lost", "torque")


def monte_carlo(
    robot: Robot,
    trajectory: Trajectory,
    chosen: Sequence[Parameter],
    tolerances: Sequence[Tolerance | None],
    runs: int,
    *,
    seed: int = 0,
    progress: Callable[[int], None] = lambda _: None,
) -> MonteCarlo:
    """Run perturbed robots over a trajectory.

    Args:
        robot: the robot.
        trajectory: for this robot.
        chosen: its numbers.
        tolerances: of those, None for what is exact.
        runs: how many robots are drawn.
        seed: of the draws.
        progress: is told how many further robots are done.

    Raises:
        InputError: the tolerances are so large that all that were drawn are no robots.
    """
    trajectory, random = fitted(robot, trajectory), np.random.default_rng(seed)
    sums = _Sums(trajectory.samples, len(robot.joints))
    refused = 0
    for _ in range(runs):
        drawn = {
            str(each): each.value + tolerance.drawn(random)
            for each, tolerance in zip(chosen, tolerances, strict=True)
            if tolerance is not None
        }
        try:
            sums.add(*_run(robot.replace(drawn), trajectory))
        except InputError as error:
            refused += 1
            if refused == runs:
                raise InputError.one(
                    f"none of {runs} drawn robots is one, choose smaller tolerances: {error}"
                ) from None
        progress(1)
    return MonteCarlo(
        drawn=runs,
        refused=refused,
        lost=dict(zip(robot.joint_names, sums.lost.tolist(), strict=True)),
        torque=dict(zip(robot.joint_names, sums.deviation.tolist(), strict=True)),
    )


def _run(robot: Robot, trajectory: Trajectory) -> tuple[FloatArray, BoolArray]:
    """tau_motor, (samples, joints, 2), and which joints have a step that cannot be done, (joints,)."""
    size = usual_block(len(robot.joints))
    blocks = [
        compute_block(robot, trajectory.block(start, start + size))
        for start in range(0, trajectory.samples, size)
    ]
    lost = np.any([has(block.flags, Flag.INFEASIBLE | Flag.SINGULAR).any(axis=0) for block in blocks], axis=0)
    return np.concatenate([block.tau_motor for block in blocks]), lost


class _Sums:
    """Means and variances of motor torques over robots, by Welford's recurrence."""

    def __init__(self, samples: int, joints: int) -> None:
        self._lost = np.zeros(joints)
        self._runs, self._count = 0, np.zeros(joints)
        self._mean, self._squares = np.zeros((2, samples, joints, 2))

    def add(self, torque: FloatArray, lost: BoolArray) -> None:
        """Merge a robot; joints that have lost a step do not count."""
        self._runs += 1
        self._lost += lost
        self._count += ~lost
        kept = ~lost[None, :, None] & np.isfinite(torque)
        change = np.where(kept, torque - self._mean, 0.0)
        self._mean += change / np.maximum(self._count, 1)[:, None]
        self._squares += change * np.where(kept, torque - self._mean, 0.0)

    @property
    def lost(self) -> FloatArray:
        """Share of the robots, (joints,)."""
        return self._lost / max(self._runs, 1)

    @property
    def deviation(self) -> FloatArray:
        """Largest over steps and motors, (joints,); NaN where fewer than two robots have torques."""
        variance = self._squares / np.maximum(self._count - 1, 1)[:, None]
        largest = np.sqrt(variance.max(axis=(0, 2), initial=0.0))
        return np.asarray(np.where(self._count > 1, largest, np.nan))
