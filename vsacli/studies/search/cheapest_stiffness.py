"""The stiffness of least cost along a fixed motion; there, joints can be optimized one by one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsacli.analysis.variant_groups import PreparedRun
from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.progress import Countdown
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import as_name
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, verify
from vsacli.studies.search.changed_motion import as_one_function, with_changed_stiffness
from vsacli.studies.search.criteria import CRITERIA, Criterion, run_costs
from vsacli.studies.search.loads import Load, joint_loads, periods, rests
from vsacli.studies.search.optimum import JointOptimum, Optimum
from vsacli.studies.search.splines import SplineSpace
from vsacli.studies.search.stiffness import OptimizedStiffness, StiffnessSearch
from vsacli.trajectory.trajectory import Trajectory

SEARCHES = 10
"""Largest number of inner searches of a joint: a constant, several starts, finer and finer splines."""

TIME, TIMING, BOTH = "time", "timing", "both"
"""Words for minimizing the time, and for varying the timing or both timing and stiffness."""


def varied_joints(robot: Robot, vary: str) -> list[int]:
    """Return the indices of the joints whose stiffness varies.

    Raises:
        InputError: `vary` is unknown, or the stiffness is to vary and no joint has one to choose.
    """
    if vary not in (STIFFNESS.key, TIMING, BOTH):
        raise InputError.one(f"must be stiffness, {TIMING} or {BOTH}, not {vary!r}")
    return [] if vary == TIMING else chosen_joints(robot)


def check_timing_varies(vary: str) -> None:
    """Check that the timing varies, as minimizing the time requires.

    Raises:
        InputError: only the stiffness varies.
    """
    if vary == STIFFNESS.key:
        raise InputError.one(f"time needs --vary {TIMING} or {BOTH}, not {vary}")


def chosen_joints(robot: Robot) -> list[int]:
    """Return the indices of the joints whose stiffness is commanded.

    Raises:
        InputError: no joint has a stiffness to choose.
    """
    chosen = [index for index, joint in enumerate(robot.joints) if STIFFNESS.key in joint.actuator.commanded]
    if not chosen:
        raise InputError.one(f"no joint of {robot.name} has a stiffness to choose")
    return chosen


def checked_criterion(robot: Robot, name: str, joints: Sequence[int]) -> Criterion:
    """Return the criterion of a name, after a check that it can be computed for the joints.

    Raises:
        InputError: the name is unknown, or a joint lacks a parameter.
    """
    if name not in CRITERIA:
        raise InputError.one(f"unknown objective {name!r}{did_you_mean(name, CRITERIA)}")
    criterion = CRITERIA[name]()
    for index in joints:
        criterion.check(robot.joints[index])
    return criterion


def falls_short(what: Optimum, trajectory: Trajectory) -> FloatArray | None:
    """Return times since the start, s, at which a run misses margin or limits, also between samples.

    None means that it keeps them; an empty array means that only the self-check fails.
    """
    run = PreparedRun(what.robot, trajectory)
    return verify(Acceptance(what.robot, what.min_margin), run).refused


HALVES = 2
"""Subdivisions of each sampling interval in a load without further instants."""

LOOKED_AT = 3000
"""Smallest number of instants of a period at which bounds are checked: with 8 for each piece of the spline, a
search along 15 sampling intervals was refused between its instants five times."""


def cheapest_stiffness(
    what: Optimum,
    trajectory: Trajectory,
    criterion: Criterion,
    seed: int,
    progress: Callable[[int], object],
) -> Optimum:
    """Return the best stiffness of all joints, confirmed by a run."""
    search = CheapestStiffness(Acceptance(what.robot, what.min_margin), trajectory, criterion, seed, progress)
    try:
        found = search.confirmed(what)
    except ImpossibleError as error:
        return replace(what, reasons=error.reasons)
    return replace(what, joints=search.optima(found), trajectory=found.trajectory)


class Found(NamedTuple):
    """The best profiles and best constants, by joint index, and the trajectory with the best profiles."""

    best: dict[int, OptimizedStiffness]
    constant: dict[int, OptimizedStiffness | None]
    trajectory: Trajectory


class CheapestStiffness:
    """A search for the best stiffness of all joints.

    Args:
        acceptance: acceptance rule for every sample.
        trajectory: motion, which is kept.
        criterion: objective.
        seed: seed of the random starts.
        progress: function to call with the number of further searches that are done.
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
        self._bars = {index: Countdown(progress, SEARCHES) for index in self._joints}
        rest, loads = rests(trajectory), joint_loads(acceptance.robot, trajectory, self._joints)
        self._periods = {
            index: 0 if rest else periods(load) for index, load in zip(self._joints, loads, strict=True)
        }

    def confirmed(self, what: Optimum) -> Found:
        """Search until a run of the result keeps every limit between its samples as well.

        Raises:
            ImpossibleError: nothing was found; the error has the reason of each joint.
        """

        def attempt(rule: Acceptance) -> tuple[Found, FloatArray | None]:
            found = self.best(rule)
            return found, falls_short(what, found.trajectory)

        found, kept = self._acceptance.confirmed(attempt)
        if not kept:
            raise ImpossibleError("a profile within all limits at the samples exceeds one between them")
        return found

    def best(self, acceptance: Acceptance) -> Found:
        """Return the best profiles under a rule, whose instants between samples count for every joint.

        Raises:
            ImpossibleError: nothing was found; the error has the reason of each joint.
        """
        robot, reasons = acceptance.robot, list(self._reasons_of_others())
        loads = joint_loads(robot, self._trajectory, self._joints, between=self._between(acceptance))
        best: dict[int, OptimizedStiffness] = {}
        constant: dict[int, OptimizedStiffness | None] = {}
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
        """Return the result of each joint, by name, with costs computed by runs."""
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
        """Return the violations of joints without a stiffness to choose, as clauses."""
        robot = self._acceptance.robot
        others = [index for index in range(len(robot.joints)) if index not in self._joints]
        loads = joint_loads(robot, self._trajectory, others)
        reasons = [
            self._acceptance.reason(robot.joints[index], load)
            for index, load in zip(others, loads, strict=True)
        ]
        return [reason for reason in reasons if reason]

    def _between(self, acceptance: Acceptance) -> FloatArray:
        """Return instants between samples: dense ones if samples are few, and those of the rule.

        They are times since the start, s. Only the first period of a periodic load is optimized, so instants
        of later periods are also mapped to the first.
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

    def _of_joint(
        self, acceptance: Acceptance, index: int, load: Load
    ) -> tuple[OptimizedStiffness | None, OptimizedStiffness]:
        """Return the best constant, if there is one, and the best profile of a joint over one period."""
        last = (self._trajectory.samples - 1) // max(self._periods[index], 1)
        steps = np.arange(len(load.time))[load.steps][: last + 1]
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

    def _with_stiffness(self, profiles: Mapping[int, OptimizedStiffness]) -> Trajectory:
        """Return the motion with other stiffness profiles, given by joint index."""
        commanded = self._trajectory.block(0, self._trajectory.samples).commanded
        changes = {}
        for index, profile in profiles.items():
            rows = profile.rows[:, profile.steps]
            repeated = np.tile(rows[:, :-1], max(self._periods[index], 1))
            asked = np.stack([commanded[name][:, index] for name in STIFFNESS.names])
            changes[index] = np.concatenate([repeated, rows[:, -1:]], axis=1) - asked
        return with_changed_stiffness(self._trajectory, changes)
