"""Optimization of the stiffness, the timing or both for least cost or least time, within all limits.

`optimize` chooses the search: stiffness along a fixed motion, cheapest timing, or fastest timing. A run
confirms each result; instants at which it fails count in the next search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import MIN_MARGIN, check_min_margin
from vsacli.base.progress import Countdown
from vsacli.base.texts import as_name
from vsacli.base.units import ENERGY
from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import adapt_trajectory
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.changed_motion import reads_back, with_raised_stiffness
from vsacli.studies.search.cheapest_stiffness import (
    BOTH,
    SEARCHES,
    TIME,
    TIMING,
    CheapestStiffness,
    cheapest_stiffness,
    check_timing_varies,
    checked_criterion,
    joints_with_stiffness,
    refused_times,
    varied_joints,
)
from vsacli.studies.search.combined import CombinedSearch
from vsacli.studies.search.criteria import Criterion, Scale, commanded_cost_scale, run_costs
from vsacli.studies.search.loads import Ends, joint_loads
from vsacli.studies.search.optimum import JointOptimum, Optimum, TimingOptimum, TotalCost
from vsacli.studies.search.paced_motion import (
    MIN_CHECK_INSTANTS,
    PacedJoint,
    PacedMotion,
    checked_instants,
    path_at,
    retimed,
)
from vsacli.studies.search.paced_search import CheapestPaceSearch, PacedSearch
from vsacli.studies.search.splines import Pacing
from vsacli.studies.search.task import Combination, Task
from vsacli.studies.search.timing_search import NoStartError, TimingSearch
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


def optimize(
    robot: Robot,
    trajectory: Trajectory,
    minimize: str = "torque",
    vary: str = "stiffness",
    *,
    min_margin: float = MIN_MARGIN,
    seed: int = 0,
    progress: Callable[[int], object] = lambda _: None,
) -> Optimum:
    """Return the stiffness or timing of least cost or least time, within all limits.

    A stiffness profile is four times continuously differentiable. Its first two derivatives are zero at both
    ends; for a periodic motion, the profile is periodic instead. A timing changes the pace along the same
    path, with the same duration unless the time is minimized. The result is a local optimum.

    Args:
        robot: robot that executes the motion.
        trajectory: motion to improve.
        minimize: "torque" (rms of the motor torques), "energy" (positive motor work), "copper_loss" (heat in
            the windings) or "peak" (of the motor torques), for each joint separately, or for all joints
            together if the timing varies; or "time".
        vary: "stiffness", "timing" or "both"; for "time" one of the latter two.
        min_margin: margin min(sigma - lower, upper - sigma)/sigma required of every sample.
        seed: seed of the random starts.
        progress: function to call with the number of further searches done; `searches` gives the total.

    Raises:
        InputError: the trajectory is not for the robot, a required parameter is missing, a tool has a
            `min_stiffness`, or `minimize` and `vary` cannot be combined.
    """
    trajectory = adapt_trajectory(robot, trajectory)
    check_min_margin(min_margin)
    refuse_damped_transmissions(robot, trajectory, "optimizations")
    _refuse_limits_of_tools(robot)
    varied = varied_joints(robot, vary)
    warnings = (*robot.warnings, *trajectory.warnings)
    optimum = Optimum(robot, trajectory.name, minimize, "duration", vary, min_margin, warnings=warnings)
    optimum = replace(optimum, admissible=refused_times(optimum, trajectory) is None)
    if minimize == TIME:
        check_timing_varies(vary)
        return optimize_timing(optimum, trajectory, varied, seed, progress)
    varies_timing = vary in (TIMING, BOTH)
    criterion = checked_criterion(robot, minimize, range(len(robot.joints)) if varies_timing else varied)
    optimum = replace(optimum, words=criterion.words)
    if varies_timing:
        return cheapest_pace(optimum, trajectory, criterion, varied, seed, progress)
    return cheapest_stiffness(optimum, trajectory, criterion, seed, progress)


def _refuse_limits_of_tools(robot: Robot) -> None:
    """Raise an error if a tool has a smallest stiffness, which no search here keeps.

    Raises:
        InputError: with the names of the tools.
    """
    if robot.limited_tools:
        names = ", ".join(robot.limited_tools)
        raise InputError.one(
            f"optimizations do not keep the min_stiffness of tools ({names}); leave it out, and give the "
            "joints that move them a lower bound by limits.stiffness, which is kept; check-feasibility "
            "--fixes of the optimized motion may help as well"
        )


def searches(robot: Robot, minimize: str, vary: str) -> int:
    """Return the number of searches that an optimization is expected to report as progress."""
    timing_searches = SEARCHES * (vary in (TIMING, BOTH))
    return timing_searches + (
        0 if minimize == TIME or vary == TIMING else SEARCHES * len(joints_with_stiffness(robot))
    )


MAX_REFINED_SAMPLES = 4 * MIN_CHECK_INSTANTS
"""Number of samples up to which the sampling of a result is refined."""

ADDED_MARGIN = 0.02
"""Additional margin with which the slow-down is found from which a search starts."""

_Search = TypeVar("_Search", bound=PacedSearch)


def optimize_timing(
    optimum_so_far: Optimum,
    trajectory: Trajectory,
    varied: Sequence[int],
    seed: int,
    progress: Callable[[int], object],
) -> Optimum:
    """Return the fastest timing, with the stiffness of the joints `varied` (indices), confirmed by runs.

    If no slow-down makes the commanded stiffness feasible, the search starts from the smallest slow-down
    with constant changes of the stiffness.
    """
    bar, ends = Countdown(progress, SEARCHES), _motion_ends(optimum_so_far, trajectory)
    try:
        try:
            uniform, pacing, fastest = _fastest_timing(
                optimum_so_far, trajectory, ends, varied, seed, bar.count
            )
        except NoStartError:
            if not varied:
                raise
            path = with_raised_stiffness(
                trajectory, _smallest_confirmed_slow_down(optimum_so_far, trajectory).constants
            )
            _, pacing, fastest = _fastest_timing(optimum_so_far, path, ends, varied, seed, bar.count)
            uniform = math.nan
    except ImpossibleError as error:
        return replace(optimum_so_far, reasons=error.reasons)
    bar.finish()
    optimum = TimingOptimum(
        before=trajectory.duration,
        uniform=uniform,
        after=fastest.duration,
        found=pacing.found,
        starts=pacing.starts,
        agreeing=pacing.agreeing,
        bounding=pacing.bounding,
    )
    return replace(optimum_so_far, timing=optimum, trajectory=fastest, pace=pacing.pace(max(ends.periods, 1)))


def _fastest_timing(
    optimum: Optimum,
    path: Trajectory,
    ends: Ends,
    varied: Sequence[int],
    seed: int,
    progress: Callable[[], None],
) -> tuple[float, Pacing, Trajectory]:
    """Return the duration of the fastest uniform timing, the fastest timing, and the motion with it."""
    search, pacing, fastest = _search_until_confirmed(
        optimum, path, ends, lambda rule: TimingSearch(rule, path, ends, varied, seed, progress)
    )
    return search.uniform, pacing, fastest


def cheapest_pace(
    optimum: Optimum,
    trajectory: Trajectory,
    criterion: Criterion,
    varied: Sequence[int],
    seed: int,
    progress: Callable[[int], object],
) -> Optimum:
    """Return the timing of least cost at the commanded duration, confirmed by runs.

    If the stiffness of joints varies as well, the search starts from the best stiffness at the commanded
    timing. If no stiffness is feasible there, the fastest motion is searched, from the smallest feasible
    slow-down. If it lasts no longer than commanded, the search for least cost starts from it; otherwise the
    motion is slowed down by that factor.
    """
    ends = _motion_ends(optimum, trajectory)
    criterion = type(criterion)(repeating=ends.periods > 0)

    def along(path: Trajectory, near: Pacing | None = None, slow_down: float = 1.0) -> Optimum:
        bar = Countdown(progress, SEARCHES)

        def search(rule: Acceptance) -> CheapestPaceSearch:
            duration = path.duration / max(ends.periods, 1)
            motion = PacedMotion(optimum.robot, path, checked_instants(path, duration, rule.between))
            costed = _joints_with_costs(
                rule, motion, criterion, _cost_scales(optimum, criterion, trajectory, path), varied
            )
            return CheapestPaceSearch(motion, costed, varied, ends, seed, bar.count, near)

        _, pacing, cheapest = _search_until_confirmed(optimum, path, ends, search)
        bar.finish()
        joints = _joint_costs(optimum.robot, criterion, pacing, trajectory, cheapest)
        return replace(
            optimum,
            joints=joints,
            together=_total_cost(criterion, joints),
            slow_down=slow_down,
            trajectory=cheapest,
            pace=_pace_of_unchanged_path(pacing.pace(max(ends.periods, 1)), slow_down),
        )

    try:
        if not varied:
            return along(trajectory)
        stiffness = CheapestStiffness(
            Acceptance(optimum.robot, optimum.min_margin), trajectory, criterion, seed, progress
        )
        try:
            return along(stiffness.confirmed(optimum).trajectory)
        except ImpossibleError:
            slow_down_fix = _smallest_confirmed_slow_down(optimum, trajectory)
        path = with_raised_stiffness(trajectory, slow_down_fix.constants)
        _, near, fastest = _fastest_timing(
            optimum, path, ends, varied, seed, Countdown(progress, SEARCHES).count
        )
        if fastest.duration <= path.duration:
            return along(path, near)
        return along(path.stretched(slow_down_fix.factor), slow_down=slow_down_fix.factor)
    except ImpossibleError as error:
        return replace(optimum, reasons=error.reasons)


def _pace_of_unchanged_path(pace: BSpline[np.float64], factor: float) -> BSpline[np.float64]:
    """Return a pace along a slowed-down path as a pace along the unchanged path."""
    return pace if factor == 1 else type(pace)(pace.t / factor, factor * pace.c, pace.k)


def _motion_ends(optimum: Optimum, trajectory: Trajectory) -> Ends:
    return Ends.of(trajectory, joint_loads(optimum.robot, trajectory, list(range(len(optimum.robot.joints)))))


def _smallest_confirmed_slow_down(optimum: Optimum, trajectory: Trajectory) -> Combination:
    """Return the smallest slow-down at which constant stiffness changes keep every limit, and the changes.

    Raises:
        ImpossibleError: no slow-down was found.
    """
    min_margin = optimum.min_margin + ADDED_MARGIN * (1 - optimum.min_margin)
    combination = CombinedSearch(Task(Acceptance(optimum.robot, min_margin), trajectory)).fastest()
    if combination is None:
        raise ImpossibleError("no slow-down keeps every limit with any constant change of the stiffness")
    return combination


def _search_until_confirmed(
    optimum: Optimum, path: Trajectory, ends: Ends, search_by: Callable[[Acceptance], _Search]
) -> tuple[_Search, Pacing, Trajectory]:
    """Search until a run of the result keeps every limit between its samples as well.

    Args:
        optimum: optimum with robot and margin.
        path: motion along the path, as commanded.
        ends: ends of the motion.
        search_by: function that makes a search from a rule, whose `between` are values of s on the path.

    Returns:
        Last search, its result, and the motion with that timing.

    Raises:
        ImpossibleError: nothing was found, or runs of all results fail between samples.
    """
    period_count = max(ends.periods, 1)

    def attempt(rule: Acceptance) -> tuple[tuple[_Search, Pacing, Trajectory], FloatArray | None]:
        search = search_by(rule)
        result = search.best()
        best, short = _retime_and_check(optimum, path, result, period_count)
        if short is not None:
            short = np.mod(
                path_at(short, result.pace(period_count), path.duration), path.duration / period_count
            )
        return (search, result, best), short

    result, is_confirmed = Acceptance(optimum.robot, optimum.min_margin).confirmed(attempt)
    if not is_confirmed:
        raise ImpossibleError("a motion within all limits at some instants exceeds one between them")
    return result


def _retime_and_check(
    optimum: Optimum, path: Trajectory, pacing: Pacing, period_count: int
) -> tuple[Trajectory, FloatArray | None]:
    """Return the motion at a pace, and the instants at which a run of it fails, or None.

    Samples have the rate of the path, or a multiple if a file would not describe the motion between them.
    """
    name = as_name(f"{optimum.asked}-{optimum.minimized}")
    parts = 1
    while True:
        retimed_motion = retimed(path, pacing.pace(period_count), pacing.stiffness(period_count), name, parts)
        is_last = 2 * parts * path.samples > MAX_REFINED_SAMPLES
        if is_last or reads_back(retimed_motion):
            refused_instants = refused_times(optimum, retimed_motion)
            if is_last or refused_instants is None:
                return retimed_motion, refused_instants
        parts *= 2


def _joints_with_costs(
    rule: Acceptance,
    motion: PacedMotion,
    criterion: Criterion,
    cost_scales: Sequence[float],
    varied: Sequence[int],
) -> list[PacedJoint]:
    """Return the joints with their shares of the cost, which is about 1 for the motion of `cost_scales`."""
    if criterion.relative:
        share = 1 / len(cost_scales)
    else:
        share, cost_scales = 1.0, [math.fsum(cost_scales)] * len(cost_scales)
    duration = float(motion.s[-1])
    return [
        PacedJoint(
            motion,
            index,
            rule.min_margin,
            criterion,
            Scale(size, duration),
            share,
            rule.reserve,
            varied=index in varied,
        )
        for index, size in enumerate(cost_scales)
    ]


def _cost_scales(optimum: Optimum, criterion: Criterion, *motions: Trajectory) -> list[float]:
    """Return the scale of each joint's cost, from the first motion along which it is finite."""
    cost_scales = np.full(len(optimum.robot.joints), np.nan)
    for motion in motions:
        loads = joint_loads(optimum.robot, motion, list(range(len(cost_scales))))
        pairs = zip(optimum.robot.joints, loads, strict=True)
        motion_scales = np.array([commanded_cost_scale(joint, load, criterion) for joint, load in pairs])
        cost_scales = np.where(np.isfinite(cost_scales), cost_scales, motion_scales)
    return [size if math.isfinite(size) and size > 0 else 1.0 for size in cost_scales.tolist()]


def _joint_costs(
    robot: Robot, criterion: Criterion, pacing: Pacing, commanded: Trajectory, optimized: Trajectory
) -> dict[str, JointOptimum]:
    """Return the costs of each joint before and after, by name."""
    criteria = dict.fromkeys(range(len(robot.joints)), criterion)
    costs_before, costs_after = (run_costs(robot, each, criteria) for each in (commanded, optimized))
    return {
        joint.name: JointOptimum(
            before=costs_before[index],
            constant=math.nan,
            after=costs_after[index],
            unit=criterion.quantity.unit(joint.type),
            found=pacing.found,
            starts=pacing.starts,
            agreeing=pacing.agreeing,
            bounding=pacing.bounding.get(joint.name, {}),
        )
        for index, joint in enumerate(robot.joints)
    }


def _total_cost(criterion: Criterion, joints: Mapping[str, JointOptimum]) -> TotalCost:
    if not criterion.relative:
        before, after = (
            criterion.together([getattr(each, when) for each in joints.values()])
            for when in ("before", "after")
        )
        return TotalCost(before, after, ENERGY.unit("revolute"))
    ratios = [each.after / each.before if each.before else 1.0 for each in joints.values()]
    after = criterion.together(ratios)
    return TotalCost(math.nan if math.isnan(after) else 1.0, after, "")
