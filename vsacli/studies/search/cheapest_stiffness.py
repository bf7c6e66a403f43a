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
    return [] if vary == TIMING else joints_with_stiffness(robot)


def check_timing_varies(vary: str) -> None:
    """Check that the timing varies, as minimizing the time requires.

    Raises:
        InputError: only the stiffness varies.
    """
    if vary == STIFFNESS.key:
        raise InputError.one(f"time needs --vary {TIMING} or {BOTH}, not {vary}")


def joints_with_stiffness(robot: Robot) -> list[int]:
    """Return the indices of the joints whose stiffness is commanded.

    Raises:
        InputError: no joint has a stiffness to choose.
    """
    joint_indices = [
        index for index, joint in enumerate(robot.joints) if STIFFNESS.key in joint.actuator.commanded
    ]
    if not joint_indices:
        raise InputError.one(f"no joint of {robot.name} has a stiffness to choose")
    return joint_indices


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


def refused_times(optimum: Optimum, trajectory: Trajectory) -> FloatArray | None:
    """Return times since the start, s, at which a run misses margin or limits, also between samples.

    None means that it keeps them; an empty array means that only the self-check fails.
    """
    run = PreparedRun(optimum.robot, trajectory)
    return verify(Acceptance(optimum.robot, optimum.min_margin), run).refused


MIN_SUBDIVISIONS = 2
"""Subdivisions of each sampling interval in a load without further instants."""

MIN_CHECK_INSTANTS = 3000
"""Smallest number of instants of a period at which bounds are checked: with 8 for each piece of the spline, a
search along 15 sampling intervals was refused between its instants five times."""


def cheapest_stiffness(
    optimum: Optimum,
    trajectory: Trajectory,
    criterion: Criterion,
    seed: int,
    progress: Callable[[int], object],
) -> Optimum:
    """Return the best stiffness of all joints, confirmed by a run."""
    search = CheapestStiffness(
        Acceptance(optimum.robot, optimum.min_margin), trajectory, criterion, seed, progress
    )
    try:
        profiles = search.confirmed(optimum)
    except ImpossibleError as error:
        return replace(optimum, reasons=error.reasons)
    return replace(optimum, joints=search.optima(profiles), trajectory=profiles.trajectory)


class BestProfiles(NamedTuple):
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
        self._joints = joints_with_stiffness(acceptance.robot)
        self._bars = {index: Countdown(progress, SEARCHES) for index in self._joints}
        at_rest, loads = rests(trajectory), joint_loads(acceptance.robot, trajectory, self._joints)
        self._periods = {
            index: 0 if at_rest else periods(load) for index, load in zip(self._joints, loads, strict=True)
        }

    def confirmed(self, optimum: Optimum) -> BestProfiles:
        """Search until a run of the result keeps every limit between its samples as well.

        Raises:
            ImpossibleError: nothing was found; the error has the reason of each joint.
        """

        def attempt(rule: Acceptance) -> tuple[BestProfiles, FloatArray | None]:
            profiles = self.best(rule)
            return profiles, refused_times(optimum, profiles.trajectory)

        found, is_confirmed = self._acceptance.confirmed(attempt)
        if not is_confirmed:
            raise ImpossibleError("a profile within all limits at the samples exceeds one between them")
        return found

    def best(self, acceptance: Acceptance) -> BestProfiles:
        """Return the best profiles under a rule, whose instants between samples count for every joint.

        Raises:
            ImpossibleError: nothing was found; the error has the reason of each joint.
        """
        robot, reasons = acceptance.robot, list(self._other_joint_violations())
        loads = joint_loads(robot, self._trajectory, self._joints, between=self._instants_between(acceptance))
        best_profiles: dict[int, OptimizedStiffness] = {}
        constant_profiles: dict[int, OptimizedStiffness | None] = {}
        for index, load in zip(self._joints, loads, strict=True):
            try:
                constant_profiles[index], best_profiles[index] = self._best_profiles_of_joint(
                    acceptance, index, load
                )
            except ImpossibleError as error:
                reasons += error.reasons
        if reasons:
            raise ImpossibleError(*reasons)
        optimized_trajectory = copy(as_one_function(self._with_stiffness(best_profiles)))
        optimized_trajectory.name = as_name(f"{self._trajectory.name}-{self._criterion.name}")
        return BestProfiles(best_profiles, constant_profiles, optimized_trajectory)

    def optima(self, profiles: BestProfiles) -> dict[str, JointOptimum]:
        """Return the result of each joint, by name, with costs computed by runs."""
        joints = self._acceptance.robot.joints
        constant_profiles = {index: each for index, each in profiles.constant.items() if each is not None}
        trajectories = self._trajectory, self._with_stiffness(constant_profiles), profiles.trajectory
        criteria = {index: self._joint_criterion(index) for index in self._joints}
        costs_by_trajectory = [run_costs(self._acceptance.robot, each, criteria) for each in trajectories]
        optima = {}
        for index, profile in profiles.best.items():
            before, constant, after = (costs[index] for costs in costs_by_trajectory)
            optima[joints[index].name] = JointOptimum(
                before=before,
                constant=constant if index in constant_profiles else math.nan,
                after=after,
                unit=self._criterion.quantity.unit(joints[index].type),
                found=profile.found,
                starts=profile.starts,
                agreeing=profile.agreeing,
                bounding=profile.bounding,
            )
        return optima

    def _other_joint_violations(self) -> Sequence[str]:
        """Return the violations of joints without a stiffness to choose, as clauses."""
        robot = self._acceptance.robot
        other_joints = [index for index in range(len(robot.joints)) if index not in self._joints]
        loads = joint_loads(robot, self._trajectory, other_joints)
        reasons = [
            self._acceptance.reason(robot.joints[index], load)
            for index, load in zip(other_joints, loads, strict=True)
        ]
        return [reason for reason in reasons if reason]

    def _instants_between(self, acceptance: Acceptance) -> FloatArray:
        """Return instants between samples: dense ones if samples are few, and those of the rule.

        They are times since the start, s. Only the first period of a periodic load is optimized, so instants
        of later periods are also mapped to the first.
        """
        trajectory, period_counts = self._trajectory, {max(count, 1) for count in self._periods.values()}
        min_period_intervals, max_period_intervals = (
            (trajectory.samples - 1) // count for count in (max(period_counts), min(period_counts))
        )
        elapsed_samples = trajectory.times.block(0, max_period_intervals + 1) - trajectory.start
        subdivisions, dense_instants = math.ceil(MIN_CHECK_INSTANTS / min_period_intervals), np.empty(0)
        if subdivisions > MIN_SUBDIVISIONS and trajectory.known_between:
            dense_instants = (
                elapsed_samples[:-1, None]
                + np.diff(elapsed_samples)[:, None] * np.arange(1, subdivisions) / subdivisions
            ).ravel()
        first_period_instants = [
            np.mod(acceptance.between, trajectory.duration / count) for count in period_counts
        ]
        return np.unique(np.concatenate([dense_instants, acceptance.between, *first_period_instants]))

    def _joint_criterion(self, index: int) -> Criterion:
        return type(self._criterion)(repeating=self._periods[index] > 0)

    def _best_profiles_of_joint(
        self, acceptance: Acceptance, index: int, load: Load
    ) -> tuple[OptimizedStiffness | None, OptimizedStiffness]:
        """Return the best constant, if there is one, and the best profile of a joint over one period."""
        last_interval = (self._trajectory.samples - 1) // max(self._periods[index], 1)
        sample_indices = np.arange(len(load.time))[load.steps][: last_interval + 1]
        period_load = replace(load.at(slice(sample_indices[-1] + 1)), steps=sample_indices)
        search = StiffnessSearch(
            acceptance,
            acceptance.robot.joints[index],
            period_load,
            self._joint_criterion(index),
            SplineSpace.periodic if self._periods[index] else SplineSpace.at_rest,
            self._seed,
            self._bars[index].count,
        )
        profiles = search.best_constant(), search.best()
        self._bars[index].finish()
        return profiles

    def _with_stiffness(self, profiles: Mapping[int, OptimizedStiffness]) -> Trajectory:
        """Return the motion with other stiffness profiles, given by joint index."""
        commanded = self._trajectory.block(0, self._trajectory.samples).commanded
        changes = {}
        for index, profile in profiles.items():
            rows = profile.rows[:, profile.steps]
            repeated_rows = np.tile(rows[:, :-1], max(self._periods[index], 1))
            commanded_rows = np.stack([commanded[name][:, index] for name in STIFFNESS.names])
            changes[index] = np.concatenate([repeated_rows, rows[:, -1:]], axis=1) - commanded_rows
        return with_changed_stiffness(self._trajectory, changes)
