"""The cheapest stiffness along a fixed motion, along which joints do not depend on each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import as_name
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.changed_motion import as_one_function, with_changed_stiffness
from vsacli.studies.search.criteria import CRITERIA, Criterion, run_costs
from vsacli.studies.search.loads import Load, joint_loads, periods, rests
from vsacli.studies.search.optimum import JointOptimum, Optimum
from vsacli.studies.search.splines import SplineSpace
from vsacli.studies.search.stiffness import Profile, StiffnessSearch
from vsacli.studies.search.suggestions import Remedy
from vsacli.studies.search.task import Task
from vsacli.trajectory.trajectory import Trajectory

SEARCHES = 10
"""Searches of a joint: a constant, some starts, finer and finer splines; not all of them may be needed."""


class Countdown:
    """Tells of searches as they are done, of `SEARCHES` in all whatever their number."""

    def __init__(self, progress: Callable[[int], object]) -> None:
        self._progress, self._left = progress, SEARCHES

    def count(self) -> None:
        """One is done."""
        if self._left:
            self._left -= 1
            self._progress(1)

    def finish(self) -> None:
        """All are."""
        self._progress(self._left)
        self._left = 0


TIME, TIMING, BOTH = "time", "timing", "both"
"""Words for minimizing the time, and for varying more than the stiffness."""


def varied_joints(robot: Robot, vary: str) -> list[int]:
    """Return the joints whose stiffness varies, by index.

    Raises:
        InputError: there are none, although it is to vary, or there is no such word.
    """
    if vary not in (STIFFNESS.key, TIMING, BOTH):
        raise InputError.one(f"what varies must be 'stiffness', {TIMING!r} or {BOTH!r}, not {vary!r}")
    return [] if vary == TIMING else chosen_joints(robot)


def check_timing_varies(vary: str) -> None:
    """Refuse to minimise the time where the timing does not vary.

    Raises:
        InputError: it does not.
    """
    if vary == STIFFNESS.key:
        raise InputError.one(f"time is what {TIMING!r} varies for, or {BOTH!r}, not {vary!r}")


def chosen_joints(robot: Robot) -> list[int]:
    """Return the joints whose stiffness is commanded, by index.

    Raises:
        InputError: there are none.
    """
    chosen = [index for index, joint in enumerate(robot.joints) if STIFFNESS.key in joint.actuator.commanded]
    if not chosen:
        raise InputError.one(f"no joint of {robot.name} has a stiffness to choose")
    return chosen


def checked_criterion(robot: Robot, name: str, joints: Sequence[int]) -> Criterion:
    """Return the criterion for joints, by index, if it can be computed.

    Raises:
        InputError: it cannot, or there is no such criterion.
    """
    if name not in CRITERIA:
        raise InputError.one(f"what is minimised must be one of {', '.join(CRITERIA)}, not {name!r}")
    criterion = CRITERIA[name]()
    for index in joints:
        criterion.check(robot.joints[index])
    return criterion


def falls_short(what: Optimum, trajectory: Trajectory) -> FloatArray | None:
    """Return times since the start, s, at which a run misses margin or limits; None if it keeps them.

    Between the steps, too; empty if it is the self-check alone that fails.
    """
    task = Task(Acceptance(what.robot, what.margin), trajectory)
    return task.falls_short(Remedy(0.0, what.robot, trajectory))


HALVES = 2
"""Parts into which a load divides each step on its own."""

LOOKED_AT = 3000
"""Instants of a period at which bounds are looked at, at least: with 8 for each piece of the spline, a search
along 15 steps fell short between them five times."""


def cheapest_stiffness(
    what: Optimum,
    trajectory: Trajectory,
    criterion: Criterion,
    seed: int,
    progress: Callable[[int], object],
) -> Optimum:
    """Return the best stiffness of all joints, confirmed by a run."""
    search = CheapestStiffness(Acceptance(what.robot, what.margin), trajectory, criterion, seed, progress)
    try:
        found = search.confirmed(what)
    except ImpossibleError as error:
        return replace(what, reasons=error.reasons)
    return replace(what, joints=search.optima(found), trajectory=found.trajectory)


class Found(NamedTuple):
    """The profiles that were found, by index of the joint, and the trajectory with the best of them."""

    best: dict[int, Profile]
    constant: dict[int, Profile | None]
    trajectory: Trajectory


class CheapestStiffness:
    """A search for the best stiffness of all joints.

    Args:
        acceptance: the rule for every step.
        trajectory: the motion.
        criterion: the minimized quantity.
        seed: of the starts that are drawn.
        progress: is told how many searches are done.
    """

    def __init__(
        self,
        acceptance: Acceptance,
        trajectory: Trajectory,
        criterion: Criterion,
        seed: int,
        progress: Callable[[int], object],
    ) -> None:
        self._acceptance, self._trajectory, self._criterion = acceptance, trajectory, criterion
        self._seed = seed
        self._joints = chosen_joints(acceptance.robot)
        self._bars = {index: Countdown(progress) for index in self._joints}
        rest, loads = rests(trajectory), joint_loads(acceptance.robot, trajectory, self._joints)
        self._periods = {
            index: 0 if rest else periods(load) for index, load in zip(self._joints, loads, strict=True)
        }

    def confirmed(self, what: Optimum) -> Found:
        """Search until a run of the result keeps every limit between its samples as well.

        Raises:
            ImpossibleError: with the reason of each joint for which nothing was found.
        """

        def attempt(rule: Acceptance) -> tuple[Found, FloatArray | None]:
            found = self.best(rule)
            return found, falls_short(what, found.trajectory)

        found, kept = self._acceptance.confirmed(attempt)
        if not kept:
            raise ImpossibleError("what keeps every limit at the steps exceeds one between them")
        return found

    def best(self, acceptance: Acceptance) -> Found:
        """Search with a rule, at whose instants between the steps every profile keeps all limits as well.

        Raises:
            ImpossibleError: with the reason of each joint for which nothing was found.
        """
        robot, reasons = acceptance.robot, list(self._reasons_of_others())
        loads = joint_loads(robot, self._trajectory, self._joints, between=self._between(acceptance))
        best: dict[int, Profile] = {}
        constant: dict[int, Profile | None] = {}
        for index, load in zip(self._joints, loads, strict=True):
            try:
                constant[index], best[index] = self._of_joint(acceptance, index, load)
            except ImpossibleError as error:
                reasons += error.reasons
        if reasons:
            raise ImpossibleError(*reasons)
        changed = copy(as_one_function(self._with_stiffness(best)))
        changed.name = as_name(f"{self._trajectory.name}-{self._criterion.name}")
        return Found(best, constant, changed)

    def optima(self, found: Found) -> dict[str, JointOptimum]:
        """Return the result for each joint, by name, with the costs of runs."""
        joints = self._acceptance.robot.joints
        constants = {index: each for index, each in found.constant.items() if each is not None}
        trajectories = self._trajectory, self._with_stiffness(constants), found.trajectory
        criteria = {index: self._criterion_of(index) for index in self._joints}
        runs = [run_costs(self._acceptance.robot, each, criteria) for each in trajectories]
        optima = {}
        for index, profile in found.best.items():
            before, constant, after = (costs[index] for costs in runs)
            optima[joints[index].name] = JointOptimum(
                before=before,
                constant=constant if index in constants else math.nan,
                after=after,
                unit=self._criterion.quantity.unit(joints[index].type),
                found=profile.found,
                starts=profile.starts,
                agreeing=profile.agreeing,
                bounding=profile.bounding,
            )
        return optima

    def _reasons_of_others(self) -> Sequence[str]:
        """Return the trouble of joints without a stiffness to choose."""
        robot = self._acceptance.robot
        others = [index for index in range(len(robot.joints)) if index not in self._joints]
        loads = joint_loads(robot, self._trajectory, others)
        reasons = [
            self._acceptance.reason(robot.joints[index], load)
            for index, load in zip(others, loads, strict=True)
        ]
        return [reason for reason in reasons if reason]

    def _between(self, acceptance: Acceptance) -> FloatArray:
        """Instants between the steps, since the start: of coarse steps many, and those of the rule.

        Of a joint whose load repeats itself the first period counts, so that instants are there as well.
        """
        trajectory, counts = self._trajectory, {max(count, 1) for count in self._periods.values()}
        shortest, longest = ((trajectory.samples - 1) // count for count in (max(counts), min(counts)))
        steps = trajectory.times.block(0, longest + 1) - trajectory.start
        parts, dense = math.ceil(LOOKED_AT / shortest), np.empty(0)
        if parts > HALVES and trajectory.known_between:
            dense = (steps[:-1, None] + np.diff(steps)[:, None] * np.arange(1, parts) / parts).ravel()
        first = [np.mod(acceptance.between, trajectory.duration / count) for count in counts]
        return np.unique(np.concatenate([dense, acceptance.between, *first]))

    def _criterion_of(self, index: int) -> Criterion:
        return type(self._criterion)(repeating=self._periods[index] > 0)

    def _of_joint(self, acceptance: Acceptance, index: int, load: Load) -> tuple[Profile | None, Profile]:
        """Return the best constant, if there is one, and the best profile over a period of a joint."""
        steps = np.arange(len(load.time))[load.steps][: self._steps_of_period(index) + 1]
        period = replace(load.at(slice(steps[-1] + 1)), steps=steps)
        search = StiffnessSearch(
            acceptance,
            acceptance.robot.joints[index],
            period,
            self._criterion_of(index),
            SplineSpace.periodic if self._periods[index] else SplineSpace.at_rest,
            self._seed,
            self._bars[index].count,
        )
        found = search.best_constant(), search.best()
        self._bars[index].finish()
        return found

    def _steps_of_period(self, index: int) -> int:
        return (self._trajectory.samples - 1) // max(self._periods[index], 1)

    def _with_stiffness(self, profiles: Mapping[int, Profile]) -> Trajectory:
        """Return the motion with other stiffness profiles of joints, by index."""
        commanded = self._trajectory.block(0, self._trajectory.samples).commanded
        changes = {}
        for index, profile in profiles.items():
            rows = profile.at_steps
            repeated = np.tile(rows[:, :-1], max(self._periods[index], 1))
            asked = np.stack([commanded[name][:, index] for name in STIFFNESS.names])
            changes[index] = np.concatenate([repeated, rows[:, -1:]], axis=1) - asked
        return with_changed_stiffness(self._trajectory, changes)
