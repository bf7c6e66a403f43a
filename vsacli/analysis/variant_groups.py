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

NOT_ROWS = (ValueError, TypeError, AttributeError, NotImplementedError, IndexError)
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
    return () if is_alone(robot, trajectory) else tuple(_with_rows(robot, trajectory, [], candidates))


def _with_rows(
    robot: Robot, trajectory: Trajectory, rows: Sequence[Parameter], candidates: Sequence[Parameter]
) -> Sequence[Parameter]:
    """Return rows and those of the candidates that can be rows with them, found by halving."""
    if _can_be_rows(robot, trajectory, [*rows, *candidates]):
        return [*rows, *candidates]
    if len(candidates) == 1:
        return rows
    for half in (candidates[: len(candidates) // 2], candidates[len(candidates) // 2 :]):
        rows = _with_rows(robot, trajectory, rows, half)
    return rows


def _can_be_rows(robot: Robot, trajectory: Trajectory, numbers: Sequence[Parameter]) -> bool:
    """Return whether results with these numbers as rows agree with those of constants."""
    with suppress(*NOT_ROWS), np.errstate(all="ignore"):
        robots = tuple(
            with_numbers(
                robot, numbers, [each.value * (1 + change) if each.value else change for each in numbers]
            )
            for change in (CHANGE, 2 * CHANGE)
        )
        rows = _at_trial_times(Variants(robots, robots[0], tuple(numbers)), trajectory)
        constants = [_at_trial_times(Variants.of_one(each), trajectory) for each in robots]
        return all(_agree(rows.taken(slice(place, None, 2)), each) for place, each in enumerate(constants))
    return False


def _at_trial_times(variants: Variants, trajectory: Trajectory) -> Block:
    """Return the variables of variants at some times of a trajectory, the variants at each time in turn."""
    count = len(variants)
    times = trajectory.start + trajectory.duration * (np.arange(TRIAL_TIMES) + 0.5) / TRIAL_TIMES
    dynamics = RunDynamics(variants, [trajectory] * count)
    return dynamics.at(np.repeat(times, count), np.tile(np.arange(count), TRIAL_TIMES))


def _agree(one: Block, other: Block) -> bool:
    """Return whether the variables of two blocks differ by less than `AGREEMENT` of their peaks."""
    return all(
        np.allclose(array, getattr(other, name), rtol=0, atol=AGREEMENT * _peak(array), equal_nan=True)
        for name, array in one.arrays().items()
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
        shared = None if is_alone(*run) else shared_structure(run.robot, varied)
        structure, rows = shared or (run.robot, ())
        key = structure, rows, _motion_key(run.trajectory), index if shared is None else None
        groups.setdefault(key, []).append(index)
    for (structure, rows, *_), members in groups.items():
        together = max(1, BATCH_SAMPLES // runs[members[0]].trajectory.samples)
        for first in range(0, len(members), together):
            chosen = members[first : first + together]
            yield Variants(tuple(runs[index].robot for index in chosen), structure, rows), chosen


def _motion_key(trajectory: Trajectory) -> Hashable:
    """Return what trajectories of a batch have in common."""
    frame = None if trajectory.wrench is None else trajectory.wrench.frame
    return trajectory.samples, frame, tuple(trajectory.commanded), trajectory.known_between
