"""The fastest, or the cheapest, pace of a motion: all joints share it, so that they are searched together."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from vsacli.base.errors import InputError
from vsacli.base.texts import as_name
from vsacli.base.units import ENERGY
from vsacli.robot.model import Robot
from vsacli.studies.optimisation.cheapest_pace import CheapestPaceSearch
from vsacli.studies.optimisation.checks import falls_short
from vsacli.studies.optimisation.countdown import Countdown
from vsacli.studies.optimisation.criteria import Criterion, Scale
from vsacli.studies.optimisation.joint_by_joint import CheapestStiffness
from vsacli.studies.optimisation.joint_costs import asked_size, run_costs
from vsacli.studies.optimisation.optimum import JointOptimum, Optimum, TimingOptimum, TotalCost
from vsacli.studies.optimisation.paced_joints import PacedJoint
from vsacli.studies.optimisation.paced_motion import PacedMotion
from vsacli.studies.optimisation.paced_search import instants_of
from vsacli.studies.optimisation.paced_splines import Pacing
from vsacli.studies.optimisation.periods import periods, rests
from vsacli.studies.optimisation.retimed import retimed
from vsacli.studies.optimisation.timing import TimingSearch
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.admissible_stiffness import joint_loads
from vsacli.studies.remedies.motions import Load
from vsacli.trajectory.trajectory import Trajectory

BETWEEN = 10
"""Times the steps of a run that confirms a pace between them."""


def fastest(
    what: Optimum, trajectory: Trajectory, varied: Sequence[int], seed: int, progress: Callable[[int], object]
) -> Optimum:
    """The fastest pace, and the stiffness of joints that varies, by index, confirmed by runs."""
    bar = Countdown(progress)
    search = TimingSearch(what.robot, trajectory, what.margin, varied, seed, bar.count)
    try:
        found = search.best()
        best = _confirmed(what, trajectory, found)
    except ImpossibleError as error:
        return replace(what, reasons=error.reasons)
    bar.finish()
    optimum = TimingOptimum(
        before=trajectory.duration,
        uniform=search.uniform,
        after=best.duration,
        found=found.found,
        starts=found.starts,
        agreeing=found.agreeing,
        bounding=found.bounding,
    )
    return replace(what, timing=optimum, trajectory=best, pace=found.pace())


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
    pace as commanded.

    Raises:
        InputError: the motion neither rests at its ends nor repeats itself.
    """
    every = list(range(len(what.robot.joints)))
    loads = joint_loads(what.robot, trajectory, every)
    count = _periods(trajectory, loads)
    criterion = type(criterion)(repeating=count > 0)
    path = trajectory
    try:
        if varied:
            acceptance = Acceptance(what.robot, what.margin)
            stiffness = CheapestStiffness(acceptance, trajectory, criterion, seed, progress)
            path = stiffness.confirmed(what).trajectory
        bar = Countdown(progress)
        motion = PacedMotion(what.robot, path, instants_of(path, path.duration / max(count, 1)))
        costed = _costed(what, motion, criterion, loads)
        search = CheapestPaceSearch(motion, costed, varied, count > 0, seed, bar.count)
        found = search.best()
        best = _confirmed(what, path, found, max(count, 1))
    except ImpossibleError as error:
        return replace(what, reasons=error.reasons)
    bar.finish()
    joints = _joints(what.robot, criterion, found, trajectory, best)
    together, pace = _together(criterion, joints), found.pace(max(count, 1))
    return replace(what, joints=joints, together=together, trajectory=best, pace=pace)


def _periods(trajectory: Trajectory, loads: Sequence[Load]) -> int:
    """How often the load of all joints repeats itself; 0 if the motion rests at its ends."""
    if rests(trajectory):
        return 0
    count = math.gcd(*map(periods, loads)) if all(map(periods, loads)) else 0
    if not count:
        raise InputError.one(
            f"{trajectory.name} begins or ends in motion, and another timing would change how fast; vary the "
            "stiffness, or let it begin and end at rest, sinusoids by a ramp, or end as it begins"
        )
    return count


def _costed(
    what: Optimum, motion: PacedMotion, criterion: Criterion, loads: Sequence[Load]
) -> list[PacedJoint]:
    """The joints with their share in the cost, which is about one for these loads."""
    pairs = zip(what.robot.joints, loads, strict=True)
    sizes = [asked_size(joint, load, criterion) for joint, load in pairs]
    sizes = [size if math.isfinite(size) and size > 0 else 1.0 for size in sizes]
    if criterion.relative:
        share = 1 / len(sizes)
    else:
        share, sizes = 1.0, [math.fsum(sizes)] * len(sizes)
    duration = float(motion.s[-1])
    return [
        PacedJoint(motion, index, what.margin, criterion, Scale(size, duration), share)
        for index, size in enumerate(sizes)
    ]


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
    return TotalCost(1.0, criterion.together(shares), "")


def _confirmed(what: Optimum, path: Trajectory, found: Pacing, count: int = 1) -> Trajectory:
    """The motion at a pace, if a run keeps margin and limits, and one with ten times as many steps.

    Raises:
        ImpossibleError: they do not.
    """
    name = as_name(f"{what.asked}-{what.minimised}")
    best, between = (
        retimed(path, found.pace(count), found.stiffness(count), name, refined) for refined in (1, BETWEEN)
    )
    if not (falls_short(what, best) is None and falls_short(what, between) is None):
        raise ImpossibleError("what keeps every limit at some instants exceeds one between them")
    return best
