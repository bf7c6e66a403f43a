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
    chosen_joints,
    falls_short,
    varied_joints,
)
from vsacli.studies.search.combined import CombinedSearch
from vsacli.studies.search.criteria import Criterion, Scale, asked_size, run_costs
from vsacli.studies.search.loads import Ends, joint_loads
from vsacli.studies.search.optimum import JointOptimum, Optimum, TimingOptimum, TotalCost
from vsacli.studies.search.paced_motion import (
    LOOKED_AT,
    PacedJoint,
    PacedMotion,
    instants_of,
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
    what = Optimum(robot, trajectory.name, minimize, "duration", vary, min_margin, warnings=warnings)
    what = replace(what, admissible=falls_short(what, trajectory) is None)
    if minimize == TIME:
        check_timing_varies(vary)
        return optimize_timing(what, trajectory, varied, seed, progress)
    shared = vary in (TIMING, BOTH)
    criterion = checked_criterion(robot, minimize, range(len(robot.joints)) if shared else varied)
    what = replace(what, words=criterion.words)
    if shared:
        return cheapest_pace(what, trajectory, criterion, varied, seed, progress)
    return cheapest_stiffness(what, trajectory, criterion, seed, progress)


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
    of_pace = SEARCHES * (vary in (TIMING, BOTH))
    return of_pace + (0 if minimize == TIME or vary == TIMING else SEARCHES * len(chosen_joints(robot)))


MOST_DIVIDED = 4 * LOOKED_AT
"""Number of samples up to which the sampling of a result is refined."""

ROOM = 0.02
"""Additional margin with which the slow-down is found from which a search starts."""

_Search = TypeVar("_Search", bound=PacedSearch)


def optimize_timing(
    what: Optimum, trajectory: Trajectory, varied: Sequence[int], seed: int, progress: Callable[[int], object]
) -> Optimum:
    """Return the fastest timing, with the stiffness of the joints `varied` (indices), confirmed by runs.

    If no slow-down makes the commanded stiffness feasible, the search starts from the smallest slow-down
    with constant changes of the stiffness.
    """
    bar, ends = Countdown(progress, SEARCHES), _loads_at_ends(what, trajectory)
    try:
        try:
            uniform, found, best = _fastest_timing(what, trajectory, ends, varied, seed, bar.count)
        except NoStartError:
            if not varied:
                raise
            path = with_raised_stiffness(
                trajectory, _smallest_confirmed_slow_down(what, trajectory).constants
            )
            _, found, best = _fastest_timing(what, path, ends, varied, seed, bar.count)
            uniform = math.nan
    except ImpossibleError as error:
        return replace(what, reasons=error.reasons)
    bar.finish()
    optimum = TimingOptimum(
        before=trajectory.duration,
        uniform=uniform,
        after=best.duration,
        found=found.found,
        starts=found.starts,
        agreeing=found.agreeing,
        bounding=found.bounding,
    )
    return replace(what, timing=optimum, trajectory=best, pace=found.pace(max(ends.periods, 1)))


def _fastest_timing(
    what: Optimum,
    path: Trajectory,
    ends: Ends,
    varied: Sequence[int],
    seed: int,
    progress: Callable[[], None],
) -> tuple[float, Pacing, Trajectory]:
    """Return the duration of the fastest uniform timing, the fastest timing, and the motion with it."""
    search, found, best = _confirmed(
        what, path, ends, lambda rule: TimingSearch(rule, path, ends, varied, seed, progress)
    )
    return search.uniform, found, best


def cheapest_pace(
    what: Optimum,
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
    ends = _loads_at_ends(what, trajectory)
    criterion = type(criterion)(repeating=ends.periods > 0)

    def along(path: Trajectory, near: Pacing | None = None, slow_down: float = 1.0) -> Optimum:
        bar = Countdown(progress, SEARCHES)

        def search(rule: Acceptance) -> CheapestPaceSearch:
            duration = path.duration / max(ends.periods, 1)
            motion = PacedMotion(what.robot, path, instants_of(path, duration, rule.between))
            costed = _costed(rule, motion, criterion, _cost_scales(what, criterion, trajectory, path), varied)
            return CheapestPaceSearch(motion, costed, varied, ends, seed, bar.count, near)

        _, found, best = _confirmed(what, path, ends, search)
        bar.finish()
        joints = _joint_costs(what.robot, criterion, found, trajectory, best)
        return replace(
            what,
            joints=joints,
            together=_total_cost(criterion, joints),
            slow_down=slow_down,
            trajectory=best,
            pace=_of_faster(found.pace(max(ends.periods, 1)), slow_down),
        )

    try:
        if not varied:
            return along(trajectory)
        stiffness = CheapestStiffness(
            Acceptance(what.robot, what.min_margin), trajectory, criterion, seed, progress
        )
        try:
            return along(stiffness.confirmed(what).trajectory)
        except ImpossibleError:
            slower = _smallest_confirmed_slow_down(what, trajectory)
        path = with_raised_stiffness(trajectory, slower.constants)
        _, near, quickest = _fastest_timing(
            what, path, ends, varied, seed, Countdown(progress, SEARCHES).count
        )
        if quickest.duration <= path.duration:
            return along(path, near)
        return along(path.stretched(slower.factor), slow_down=slower.factor)
    except ImpossibleError as error:
        return replace(what, reasons=error.reasons)


def _of_faster(pace: BSpline[np.float64], factor: float) -> BSpline[np.float64]:
    """Return a pace along a slowed-down path as a pace along the unchanged path."""
    return pace if factor == 1 else type(pace)(pace.t / factor, factor * pace.c, pace.k)


def _loads_at_ends(what: Optimum, trajectory: Trajectory) -> Ends:
    return Ends.of(trajectory, joint_loads(what.robot, trajectory, list(range(len(what.robot.joints)))))


def _smallest_confirmed_slow_down(what: Optimum, trajectory: Trajectory) -> Combination:
    """Return the smallest slow-down at which constant stiffness changes keep every limit, and the changes.

    Raises:
        ImpossibleError: no slow-down was found.
    """
    min_margin = what.min_margin + ROOM * (1 - what.min_margin)
    found = CombinedSearch(Task(Acceptance(what.robot, min_margin), trajectory)).fastest()
    if found is None:
        raise ImpossibleError("no slow-down keeps every limit with any constant change of the stiffness")
    return found


def _confirmed(
    what: Optimum, path: Trajectory, ends: Ends, search_by: Callable[[Acceptance], _Search]
) -> tuple[_Search, Pacing, Trajectory]:
    """Search until a run of the result keeps every limit between its samples as well.

    Args:
        what: optimum with robot and margin.
        path: motion along the path, as commanded.
        ends: ends of the motion.
        search_by: function that makes a search from a rule, whose `between` are values of s on the path.

    Returns:
        Last search, its result, and the motion with that timing.

    Raises:
        ImpossibleError: nothing was found, or runs of all results fail between samples.
    """
    count = max(ends.periods, 1)

    def attempt(rule: Acceptance) -> tuple[tuple[_Search, Pacing, Trajectory], FloatArray | None]:
        search = search_by(rule)
        found = search.best()
        best, short = _retime_and_check(what, path, found, count)
        if short is not None:
            short = np.mod(path_at(short, found.pace(count), path.duration), path.duration / count)
        return (search, found, best), short

    found, kept = Acceptance(what.robot, what.min_margin).confirmed(attempt)
    if not kept:
        raise ImpossibleError("a motion within all limits at some instants exceeds one between them")
    return found


def _retime_and_check(
    what: Optimum, path: Trajectory, found: Pacing, count: int
) -> tuple[Trajectory, FloatArray | None]:
    """Return the motion at a pace, and the instants at which a run of it fails, or None.

    Samples have the rate of the path, or a multiple if a file would not describe the motion between them.
    """
    name = as_name(f"{what.asked}-{what.minimized}")
    parts = 1
    while True:
        best = retimed(path, found.pace(count), found.stiffness(count), name, parts)
        last = 2 * parts * path.samples > MOST_DIVIDED
        if last or reads_back(best):
            short = falls_short(what, best)
            if last or short is None:
                return best, short
        parts *= 2


def _costed(
    rule: Acceptance, motion: PacedMotion, criterion: Criterion, sizes: Sequence[float], varied: Sequence[int]
) -> list[PacedJoint]:
    """Return the joints with their shares of the cost, which is about 1 for the motion of `sizes`."""
    if criterion.relative:
        share = 1 / len(sizes)
    else:
        share, sizes = 1.0, [math.fsum(sizes)] * len(sizes)
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
        for index, size in enumerate(sizes)
    ]


def _cost_scales(what: Optimum, criterion: Criterion, *motions: Trajectory) -> list[float]:
    """Return the scale of each joint's cost, from the first motion along which it is finite."""
    sizes = np.full(len(what.robot.joints), np.nan)
    for motion in motions:
        loads = joint_loads(what.robot, motion, list(range(len(sizes))))
        pairs = zip(what.robot.joints, loads, strict=True)
        found = np.array([asked_size(joint, load, criterion) for joint, load in pairs])
        sizes = np.where(np.isfinite(sizes), sizes, found)
    return [size if math.isfinite(size) and size > 0 else 1.0 for size in sizes.tolist()]


def _joint_costs(
    robot: Robot, criterion: Criterion, found: Pacing, asked: Trajectory, best: Trajectory
) -> dict[str, JointOptimum]:
    """Return the costs of each joint before and after, by name."""
    criteria = dict.fromkeys(range(len(robot.joints)), criterion)
    before, after = (run_costs(robot, each, criteria) for each in (asked, best))
    return {
        joint.name: JointOptimum(
            before=before[index],
            constant=math.nan,
            after=after[index],
            unit=criterion.quantity.unit(joint.type),
            found=found.found,
            starts=found.starts,
            agreeing=found.agreeing,
            bounding=found.bounding.get(joint.name, {}),
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
    shares = [each.after / each.before if each.before else 1.0 for each in joints.values()]
    after = criterion.together(shares)
    return TotalCost(math.nan if math.isnan(after) else 1.0, after, "")
