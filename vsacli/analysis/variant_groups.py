"""Numbers of a robot that can be rows of the kernel, and runs that can be one batch.

A number can be a row if it enters elementwise arithmetic alone. One that decides which operations there are,
or goes into tables computed before, cannot: NumPy refuses an array where a single value is needed. Results
with rows are compared with those of constants nevertheless, lest one enter silently in another way.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from vsacli.analysis.batch import is_alone
from vsacli.analysis.run_dynamics import RunDynamics
from vsacli.base.arrays import AnyArray
from vsacli.base.variables import Block
from vsacli.documents.record_values import with_numbers
from vsacli.dynamics.inverse import adapt_trajectory
from vsacli.dynamics.variants import Variants, shared_structure
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.trajectory.trajectory import Trajectory

CHANGE = 1e-3
"""Relative change of a number, or its value instead of zero, by which it is tried as a row; twice as much in
the other of two robots."""

TRIAL_TIMES = 4
"""Number of times along a trajectory at which numbers are tried; more than one, so that rows are arrays."""

AGREEMENT = 1e-13
"""Largest deviation of a trial, relative to the peak of a variable: constants 0 and 1 are folded."""

BATCH_SAMPLES = 2**16
"""Largest number of samples in the batch of several runs, which are in memory together: 50 MB for three
joints, 130 MB for seven. Half as many take 10 % longer."""

ROW_ERRORS = (ValueError, TypeError, AttributeError, NotImplementedError, IndexError)
"""Errors where an array is in the place of a single value."""


def numbers_as_rows(
    robot: Robot, trajectory: Trajectory, candidates: Sequence[Parameter]
) -> tuple[Parameter, ...]:
    """Return those of some numbers of a robot that can be rows of its kernel, together.

    Args:
        robot: Robot.
        trajectory: Motion to try them with.
        candidates: Numbers of the robot, limits included.
    """
    trajectory = adapt_trajectory(robot, trajectory)
    return () if is_alone(robot, trajectory) else tuple(_extend_rows(robot, trajectory, [], candidates))


def _extend_rows(
    robot: Robot, trajectory: Trajectory, rows: Sequence[Parameter], candidates: Sequence[Parameter]
) -> Sequence[Parameter]:
    """Return rows and those of the candidates that can be rows with them, found by halving."""
    if _can_be_rows(robot, trajectory, [*rows, *candidates]):
        return [*rows, *candidates]
    if len(candidates) == 1:
        return rows
    for candidates_half in (candidates[: len(candidates) // 2], candidates[len(candidates) // 2 :]):
        rows = _extend_rows(robot, trajectory, rows, candidates_half)
    return rows


def _can_be_rows(robot: Robot, trajectory: Trajectory, numbers: Sequence[Parameter]) -> bool:
    """Return whether results with these numbers as rows agree with those of constants."""
    with suppress(*ROW_ERRORS), np.errstate(all="ignore"):
        robots = tuple(
            with_numbers(
                robot,
                numbers,
                [number.value * (1 + change) if number.value else change for number in numbers],
            )
            for change in (CHANGE, 2 * CHANGE)
        )
        rows = _at_trial_times(Variants(robots, robots[0], tuple(numbers)), trajectory)
        constants = [_at_trial_times(Variants.of_one(variant), trajectory) for variant in robots]
        return all(
            _blocks_agree(rows.taken(slice(index, None, 2)), block) for index, block in enumerate(constants)
        )
    return False


def _at_trial_times(variants: Variants, trajectory: Trajectory) -> Block:
    """Return the variables of variants at some times of a trajectory, the variants at each time in turn."""
    variant_count = len(variants)
    times = trajectory.start + trajectory.duration * (np.arange(TRIAL_TIMES) + 0.5) / TRIAL_TIMES
    dynamics = RunDynamics(variants, [trajectory] * variant_count)
    return dynamics.at(np.repeat(times, variant_count), np.tile(np.arange(variant_count), TRIAL_TIMES))


def _blocks_agree(block: Block, other_block: Block) -> bool:
    """Return whether the variables of two blocks differ by less than `AGREEMENT` of their peaks."""
    return all(
        np.allclose(array, getattr(other_block, name), rtol=0, atol=AGREEMENT * _peak(array), equal_nan=True)
        for name, array in block.arrays().items()
    )


def _peak(array: AnyArray) -> float:
    return float(np.max(np.abs(array), where=np.isfinite(array), initial=0.0))


class PreparedRun(NamedTuple):
    """A robot and its trajectory."""

    robot: Robot
    trajectory: Trajectory


def batches(runs: Sequence[PreparedRun], varied: Sequence[Parameter]) -> Iterator[tuple[Variants, list[int]]]:
    """Yield the variants of each batch of runs, and the indices of their runs.

    Robots of a batch are equal except for varied numbers; their motions have equal numbers of samples and the
    same signals. Which runs are in a batch has no effect on the results of any.

    Args:
        runs: Runs in any order.
        varied: Numbers that are rows of the kernel, see `numbers_as_rows`.
    """
    groups: dict[tuple[Robot, tuple[Parameter, ...], Hashable, int | None], list[int]] = {}
    for index, run in enumerate(runs):
        structure_and_rows = None if is_alone(*run) else shared_structure(run.robot, varied)
        structure, rows = structure_and_rows or (run.robot, ())
        key = structure, rows, _motion_key(run.trajectory), index if structure_and_rows is None else None
        groups.setdefault(key, []).append(index)
    for (structure, rows, *_), run_indices in groups.items():
        runs_per_batch = max(1, BATCH_SAMPLES // runs[run_indices[0]].trajectory.samples)
        for start in range(0, len(run_indices), runs_per_batch):
            batch_indices = run_indices[start : start + runs_per_batch]
            yield (
                Variants(tuple(runs[index].robot for index in batch_indices), structure, rows),
                batch_indices,
            )


def _motion_key(trajectory: Trajectory) -> Hashable:
    """Return what trajectories of a batch have in common."""
    frame = None if trajectory.wrench is None else trajectory.wrench.frame
    return trajectory.samples, frame, tuple(trajectory.commanded), trajectory.known_between
