"""The fastest, or the cheapest, pace of a motion: all joints share it, so that they are searched together."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.texts import as_name
from vsacli.base.units import ENERGY
from vsacli.robot.model import Robot
from vsacli.studies.optimisation.cheapest_pace import CheapestPaceSearch
from vsacli.studies.optimisation.checks import falls_short
from vsacli.studies.optimisation.countdown import Countdown
from vsacli.studies.optimisation.criteria import Criterion, Scale
from vsacli.studies.optimisation.divided_steps import reads_back
from vsacli.studies.optimisation.joint_by_joint import CheapestStiffness
from vsacli.studies.optimisation.joint_costs import asked_size, run_costs
from vsacli.studies.optimisation.optimum import JointOptimum, Optimum, TimingOptimum, TotalCost
from vsacli.studies.optimisation.paced_joints import PacedJoint
from vsacli.studies.optimisation.paced_motion import PacedMotion
from vsacli.studies.optimisation.paced_search import LOOKED_AT, PacedSearch, instants_of
from vsacli.studies.optimisation.paced_splines import Pacing
from vsacli.studies.optimisation.periods import Ends
from vsacli.studies.optimisation.retimed import path_at, retimed
from vsacli.studies.optimisation.timing import NoStartError, TimingSearch
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.admissible_stiffness import joint_loads
from vsacli.studies.remedies.changed_stiffness import with_raised_stiffness
from vsacli.studies.remedies.combination import Combination
from vsacli.studies.remedies.combined_search import CombinedSearch
from vsacli.studies.remedies.smallest_changes import STRICTER
from vsacli.studies.remedies.task import Task
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

MOST_DIVIDED = 4 * LOOKED_AT
"""Steps up to which those of a result are divided."""

ROOM = 0.02
"""Share of the stiffness by which a search that has to slow down begins further inside the corridor."""

_Search = TypeVar("_Search", bound=PacedSearch)


def fastest(
    what: Optimum, trajectory: Trajectory, varied: Sequence[int], seed: int, progress: Callable[[int], object]
) -> Optimum:
    """The fastest pace, and the stiffness of joints that varies, by index, confirmed by runs.

    If no slow-down makes the stiffness as commanded feasible, the search begins from the smallest slow-down
    with other constants.
    """
    bar, ends = Countdown(progress), _ends(what, trajectory)
    try:
        try:
            uniform, found, best = _fastest(what, trajectory, ends, varied, seed, bar.count)
        except NoStartError:
            if not varied:
                raise
            path = with_raised_stiffness(trajectory, _smallest_slow_down(what, trajectory).constants)
            _, found, best = _fastest(what, path, ends, varied, seed, bar.count)
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


def _fastest(
    what: Optimum,
    path: Trajectory,
    ends: Ends,
    varied: Sequence[int],
    seed: int,
    progress: Callable[[], None],
) -> tuple[float, Pacing, Trajectory]:
    """The duration of the fastest uniform motion, the fastest pace, and the motion at it."""
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
    """The pace with which a motion costs least in its duration, confirmed by runs.

    Where the stiffness of joints, by index, varies as well, the search begins with that which is best at the
    pace as commanded. If there is none, the search for the fastest motion begins with the smallest slow-down
    for which there is one. If that motion takes no longer than commanded, it is where the search for the
    cheapest one begins; else the motion is slowed down so much.
    """
    ends = _ends(what, trajectory)
    criterion = type(criterion)(repeating=ends.periods > 0)

    def along(path: Trajectory, near: Pacing | None = None, slow_down: float = 1.0) -> Optimum:
        bar = Countdown(progress)

        def search(rule: Acceptance) -> CheapestPaceSearch:
            duration = path.duration / max(ends.periods, 1)
            motion = PacedMotion(what.robot, path, instants_of(path, duration, rule.between))
            costed = _costed(rule, motion, criterion, _sizes(what, criterion, trajectory, path), varied)
            return CheapestPaceSearch(motion, costed, varied, ends, seed, bar.count, near)

        _, found, best = _confirmed(what, path, ends, search)
        bar.finish()
        joints = _joints(what.robot, criterion, found, trajectory, best)
        return replace(
            what,
            joints=joints,
            together=_together(criterion, joints),
            slow_down=slow_down,
            trajectory=best,
            pace=_of_faster(found.pace(max(ends.periods, 1)), slow_down),
        )

    try:
        if not varied:
            return along(trajectory)
        stiffness = CheapestStiffness(
            Acceptance(what.robot, what.margin), trajectory, criterion, seed, progress
        )
        try:
            return along(stiffness.confirmed(what).trajectory)
        except ImpossibleError:
            slower = _smallest_slow_down(what, trajectory)
        path = with_raised_stiffness(trajectory, slower.constants)
        _, near, quickest = _fastest(what, path, ends, varied, seed, Countdown(progress).count)
        if quickest.duration <= path.duration:
            return along(path, near)
        return along(path.stretched(slower.factor), slow_down=slower.factor)
    except ImpossibleError as error:
        return replace(what, reasons=error.reasons)


def _of_faster(pace: BSpline[np.float64], factor: float) -> BSpline[np.float64]:
    """A pace along a path that was slowed down by a factor, as one along the path as it was."""
    return pace if factor == 1 else type(pace)(pace.t / factor, factor * pace.c, pace.k)


def _ends(what: Optimum, trajectory: Trajectory) -> Ends:
    return Ends.of(trajectory, joint_loads(what.robot, trajectory, list(range(len(what.robot.joints)))))


def _smallest_slow_down(what: Optimum, trajectory: Trajectory) -> Combination:
    """The smallest slow-down with which other constants than commanded keep every limit, and these.

    Raises:
        ImpossibleError: there is none.
    """
    margin = what.margin + ROOM * (1 - what.margin)
    found = CombinedSearch(Task(Acceptance(what.robot, margin), trajectory)).fastest()
    if found is None:
        raise ImpossibleError("no slow-down keeps every limit with any constant change of the stiffness")
    return found


def _confirmed(
    what: Optimum, path: Trajectory, ends: Ends, search_by: Callable[[Acceptance], _Search]
) -> tuple[_Search, Pacing, Trajectory]:
    """Search until a run of what was found keeps every limit between its steps as well.

    Args:
        what: robot and margin.
        path: of the motion.
        ends: of the motion.
        search_by: a search by a rule, whose instants between steps are places on the path.

    Returns:
        The last search, what it found, and the motion at that pace.

    Raises:
        ImpossibleError: nothing was found, or a run falls short between its steps whatever is tried.
    """
    acceptance, count = Acceptance(what.robot, what.margin), max(ends.periods, 1)
    for share in STRICTER:
        search = search_by(acceptance.stricter(share))
        found = search.best()
        best, short = _retimed(what, path, found, count)
        if short is None:
            return search, found, best
        places = np.mod(path_at(short, found.pace(count), path.duration), path.duration / count)
        acceptance = replace(acceptance, between=np.union1d(acceptance.between, places))
    raise ImpossibleError("what keeps every limit at some instants exceeds one between them")


def _retimed(
    what: Optimum, path: Trajectory, found: Pacing, count: int
) -> tuple[Trajectory, FloatArray | None]:
    """The motion at a pace, and when a run of it falls short, if it does.

    At its own rate if its samples say what lies between them; else at a multiple of it.
    """
    name = as_name(f"{what.asked}-{what.minimised}")
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
    """The joints with their share in the cost, which is about one for the motion these sizes are of."""
    if criterion.relative:
        share = 1 / len(sizes)
    else:
        share, sizes = 1.0, [math.fsum(sizes)] * len(sizes)
    duration = float(motion.s[-1])
    return [
        PacedJoint(
            motion,
            index,
            rule.near_singular,
            criterion,
            Scale(size, duration),
            share,
            rule.reserve,
            varied=index in varied,
        )
        for index, size in enumerate(sizes)
    ]


def _sizes(what: Optimum, criterion: Criterion, *motions: Trajectory) -> list[float]:
    """Scales of the cost of each joint, from the first motion along which it is finite."""
    sizes = np.full(len(what.robot.joints), np.nan)
    for motion in motions:
        loads = joint_loads(what.robot, motion, list(range(len(sizes))))
        pairs = zip(what.robot.joints, loads, strict=True)
        found = np.array([asked_size(joint, load, criterion) for joint, load in pairs])
        sizes = np.where(np.isfinite(sizes), sizes, found)
    return [size if math.isfinite(size) and size > 0 else 1.0 for size in sizes.tolist()]


def _joints(
    robot: Robot, criterion: Criterion, found: Pacing, asked: Trajectory, best: Trajectory
) -> dict[str, JointOptimum]:
    """What each joint costs before and after, by name."""
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


def _together(criterion: Criterion, joints: Mapping[str, JointOptimum]) -> TotalCost:
    """What all joints cost together."""
    if not criterion.relative:
        before, after = (
            criterion.together([getattr(each, when) for each in joints.values()])
            for when in ("before", "after")
        )
        return TotalCost(before, after, ENERGY.unit("revolute"))
    shares = [each.after / each.before if each.before else 1.0 for each in joints.values()]
    after = criterion.together(shares)
    return TotalCost(math.nan if math.isnan(after) else 1.0, after, "")
