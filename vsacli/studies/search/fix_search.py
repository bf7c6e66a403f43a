"""Fixes of an infeasible task: each kind of change alone, combinations to choose from, and the causes.

A search finds changes that samples accept; a run confirms each one, and instants at which it fails count as
samples of the next search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.flags import MIN_MARGIN, Flag, check_min_margin
from vsacli.base.progress import Countdown, Progress, unseen
from vsacli.base.texts import significant
from vsacli.base.units import STIFFNESS
from vsacli.dynamics.internal_motion import damped_joints, refuse_damped_transmissions
from vsacli.dynamics.inverse import adapt_trajectory
from vsacli.dynamics.limits import Finding
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.combined import CombinedSearch
from vsacli.studies.search.fix_report import NOT_CONFIRMED, Fix, Fixes, NotPossible
from vsacli.studies.search.loads import Load, joint_loads
from vsacli.studies.search.recorded_limits import RecordedLimits
from vsacli.studies.search.scans import (
    WATCHED_STEPS,
    lowest_offset,
    smallest_offset,
    smallest_slow_down,
)
from vsacli.studies.search.task import AS_IT_IS, Combination, Task, least_change
from vsacli.studies.search.transitions import has_transitions
from vsacli.trajectory.times import RecordedTimes
from vsacli.trajectory.trajectory import Trajectory

SIMPLER_SHARE = 1.05
"""Size ratio up to which a larger fix with fewer kinds of change is preferred."""

FASTER_SHARE = 0.8
"""Share of the extra duration of another fix below which a larger fix of the same kinds is worth offering."""


def fixes(
    robot: Robot,
    trajectory: Trajectory,
    min_margin: float = MIN_MARGIN,
    *,
    progress: Progress = unseen,
) -> Fixes:
    """Return the smallest changes after which every sample has the margin and keeps every limit.

    Slow-down, constant stiffness change, other stiffness profile and longer transition are tried alone, then
    combinations of them to choose from, also on the other branch. A run over all samples confirms each.

    Args:
        robot: robot that executes the motion.
        trajectory: commanded motion.
        min_margin: margin min(sigma - lower, upper - sigma)/sigma required of every sample.
        progress: shows the progress over the searches, one for each kind of change or combination of kinds.

    Raises:
        InputError: the trajectory is not for the robot, a transmission is damped, or `min_margin` is not a
            valid margin.
        TypeError: robot or trajectory is of another type.
    """
    trajectory = adapt_trajectory(robot, trajectory)
    check_min_margin(min_margin)
    if robot.limited_tools:
        from vsacli.studies.search.tool_fixes import with_stiff_tools

        of_joints = fixes(
            robot.without_tool_limits(robot.limited_tools), trajectory, min_margin, progress=progress
        )
        return with_stiff_tools(robot, trajectory, of_joints)
    acceptance = Acceptance(robot, min_margin, RecordedLimits(trajectory))
    asked = Task(acceptance, trajectory)
    as_it_is = Fix(0.0, robot, trajectory)
    if damped_joints(robot, trajectory):
        if asked.falls_short(as_it_is) is not None:
            refuse_damped_transmissions(robot, trajectory, "fixes")
        return Fixes(min_margin)
    if not acceptance.refused_joints(trajectory).any():
        short = asked.falls_short(as_it_is)
        if short is None:
            return Fixes(min_margin)
        asked = replace(asked, acceptance=replace(acceptance, between=short))
    found_causes = dict(causes(asked))
    with progress(len(ALONE) + len(COMBINED)) as bar:
        searches = Countdown(bar.update, len(ALONE) + len(COMBINED))
        tried = _search_fixes(asked, found_causes, searches)
        if not tried.chosen and any(cause.fixable for cause in found_causes.values()):
            found_causes = {
                index: replace(cause, fixable=cause.fixable and is_fixable(asked, index))
                for index, cause in found_causes.items()
            }
            tried = _search_fixes(asked, found_causes, searches)
        searches.finish()
    return Fixes(
        min_margin,
        **{name: tried.part(name) for name in ALONE},
        causes=tuple(found_causes.values()),
        fixes=tuple(tried.chosen),
    )


class _Tried(NamedTuple):
    """Results of searches by name, fixes to choose from, and fixes that a run refused between samples."""

    found: Mapping[str, list[Fix] | NotPossible]
    chosen: list[Fix]
    failed: list[Fix]

    def part(self, name: str) -> Any:
        """Return the only change of the fix that a search of `ALONE` found, or the reasons for none."""
        found = self.found.get(name)
        if not isinstance(found, list):
            return found
        if any(found[0] is each for each in self.failed):
            return NotPossible((NOT_CONFIRMED,))
        return getattr(found[0], name)

    @staticmethod
    def slower(candidates: Sequence[Fix]) -> bool:
        """Return whether any of the fixes slows the motion down."""
        return any(each.longer > 0 for each in candidates)


def _search_fixes(task: Task, found_causes: Mapping[int, Finding], searches: Countdown) -> _Tried:
    """Search for fixes of all joints that can be fixed."""
    hopeless = frozenset(index for index, cause in found_causes.items() if not cause.fixable)
    if hopeless == found_causes.keys():
        reasons = NotPossible(tuple(map(str, found_causes.values())))
        return _Tried({name: reasons for name in ALONE if name != "transition"}, [], [])
    asked = Task(replace(task.acceptance, ignored=hopeless), task.trajectory, task.cost)
    tried = _search_and_confirm(asked, searches)
    # new samples between the recorded ones may exceed a position limit that these keep, at any speed
    lost = not tried.chosen or (tried.slower(tried.failed) and not tried.slower(tried.chosen))
    if lost and isinstance(task.trajectory.times, RecordedTimes):
        at_samples = _search_and_confirm(replace(asked, keeps_rate=False), searches)
        return at_samples if at_samples.chosen else tried
    return tried


def _search_and_confirm(asked: Task, progress: Countdown) -> _Tried:
    """Run all searches; repeat those whose fix a run refuses, with the refused instants as samples."""
    searches = {**ALONE, **COMBINED}
    if not has_transitions(asked.trajectory):
        del searches["transition"]
    found: dict[str, list[Fix] | NotPossible] = {}
    confirmed: list[Fix] = []
    every_failed: list[Fix] = []

    def attempt(rule: Acceptance) -> tuple[_Tried, FloatArray | None]:
        task = replace(asked, acceptance=rule)
        for name in [each for each in searches if each not in found]:
            try:
                found[name] = list(searches[name](task))
            except ImpossibleError as error:
                found[name] = NotPossible(error.reasons)
            progress.count()
        by_search = {name: each for name in searches if isinstance(each := found[name], list)}
        chosen, failed, short = _worth_choosing(chain(*by_search.values()), asked, confirmed)
        every_failed.extend(failed)
        tried = _Tried(dict(found), chosen, every_failed)
        for name, own in by_search.items():
            if any(each is other for each in own for other in failed):
                del found[name]
        return tried, short if failed else None

    tried, _ = asked.acceptance.confirmed(attempt)
    return tried


def _slow_down(task: Task) -> Iterator[Fix]:
    factor = smallest_slow_down(task.acceptance, task.trajectory)
    yield task.with_constants(Combination(factor, {}, {}, task.cost.of_factor(factor)))


def _constants(task: Task) -> Iterator[Fix]:
    search = CombinedSearch(task)
    combinations = search.smallest(), search.fastest()
    return (task.with_constants(found) for found in combinations if found is not None)


def _profile_fixes(task: Task) -> Iterator[Fix]:
    least = CombinedSearch(task, least_change)
    profiles = list(_with_profiles(task, least.smallest(), least.fastest()))
    yield from profiles or _with_profiles(task, CombinedSearch(task).smallest())


def _other_branches(task: Task) -> Iterator[Fix]:
    exchanged = CombinedSearch(task, branches=True)
    found = exchanged.smallest() if exchanged.exchangeable else None
    if found is not None and found.branches:
        yield task.with_constants(found)


def _with_profiles(task: Task, *combinations: Combination | None) -> Iterator[Fix]:
    """Yield fixes with profiles at the slow-downs of these combinations, where profiles are found."""
    factors = {found.factor: found for found in combinations if found is not None and found.factor > 1}
    for found in factors.values():
        with suppress(ImpossibleError):
            yield task.with_profiles(found)


_Search = Callable[[Task], Iterable[Fix]]
"""Search for fixes of a task that its samples accept; raises ImpossibleError if there are none."""

ALONE: Mapping[str, _Search] = {
    "slow_down": _slow_down,
    "stiffness_offset": lambda task: [task.with_constants(task.constants())],
    "stiffness_profile": lambda task: [task.with_profiles(AS_IT_IS)],
    "transition": lambda task: [task.with_transition()],
}
"""Searches for one kind of change, by the name of the kind in `Fixes`."""

COMBINED: Mapping[str, _Search] = {
    "constants": _constants,
    "profiles": _profile_fixes,
    "branches": _other_branches,
}
"""Searches for fixes that may combine several kinds of change."""


def _worth_choosing(
    candidates: Iterable[Fix], task: Task, confirmed: list[Fix]
) -> tuple[list[Fix], list[Fix], FloatArray]:
    """Select the fixes that a run confirms and that no simpler fix replaces.

    Returns:
        Selected fixes, those with another branch last; fixes that a run refused between samples; and the
        instants at which it did, as times since the start of the task, s.
    """
    chosen: list[Fix] = []
    failed: list[Fix] = []
    instants = [np.empty(0)]
    for fix in sorted(candidates, key=lambda each: (len(each.kinds), each.size)):
        if not any(_superfluous(fix, beside) for beside in chosen):
            known = any(fix is each for each in confirmed)
            short = None if known else task.falls_short(fix)
            (chosen if short is None else failed).append(fix)
            instants += [] if short is None else [short]
    confirmed += chosen
    ordered = sorted(chosen, key=lambda each: (each.branch is not None, each.size))
    return ordered, failed, np.concatenate(instants)


def _superfluous(fix: Fix, beside: Fix) -> bool:
    """Return whether another fix with the same or fewer kinds of change makes this one superfluous."""
    if beside.kinds < fix.kinds:
        return beside.size <= SIMPLER_SHARE * fix.size
    faster = fix.longer < FASTER_SHARE * beside.longer
    return beside.kinds == fix.kinds and beside.size <= fix.size and not faster


def causes(task: Task) -> Iterator[tuple[int, Finding]]:
    """Yield the index of each joint with a refused sample, and the worst violation with advice."""
    acceptance = task.acceptance
    refused = np.flatnonzero(acceptance.refused_joints(task.trajectory)).tolist()
    steps = acceptance.watched(task.trajectory, WATCHED_STEPS)
    moving, resting = (part.loads(acceptance.robot) for part in (steps, steps.slowed(math.inf)))
    beyond = acceptance.beyond_position(task.trajectory)
    for index in refused:
        if index in beyond:
            advice = "timing and stiffness have no effect on that: change the path or the limit"
            yield index, replace(beyond[index], advice=advice, fixable=False)
        else:
            cause = _cause(task, index, moving[index], resting[index])
            yield index, replace(cause, fixable=cause.fixable or is_fixable(task, index))


def is_fixable(task: Task, index: int) -> bool:
    """Return whether any kind of change fixes a joint, with the other joints ignored."""
    alone = _single_joint_task(task, index)
    if CombinedSearch(alone, branches=True).possible():
        return True
    with suppress(ImpossibleError):
        alone.with_profiles(AS_IT_IS)
        return True
    with suppress(ImpossibleError):
        return has_transitions(task.trajectory) and bool(alone.with_transition())
    return False


def _single_joint_task(task: Task, index: int) -> Task:
    """Return the task with all other joints ignored."""
    others = frozenset(range(len(task.acceptance.robot.joints))) - {index}
    return Task(replace(task.acceptance, ignored=others), task.trajectory, task.cost)


def _cause(task: Task, index: int, moving: Load, resting: Load) -> Finding:
    """Return the worst violation at rest, or else in motion, with advice; fixable where that implies it."""
    acceptance, joint = task.acceptance, task.acceptance.robot.joints[index]
    at_rest = acceptance.worst(joint, resting)
    if at_rest is None:
        (whole,) = joint_loads(acceptance.robot, task.trajectory, [index])
        whole = whole.at(whole.steps)
        first = float(whole.time[acceptance.refused_steps(joint, whole).argmax()])
        unbounded = Finding(Flag.NOT_FINITE.label, first, math.nan, math.nan, "", joint=joint.name)
        return acceptance.worst(joint, moving) or acceptance.worst(joint, whole) or unbounded
    found = replace(at_rest, at_rest=True, fixable=False)
    if "stiffness" not in joint.actuator.commanded:
        return replace(found, advice="no slower motion helps, and it has no stiffness to choose")
    try:
        smallest_offset(acceptance, joint, resting)
    except ImpossibleError:
        why = f"no slower motion and no constant stiffness helps{_in_the_way(acceptance, joint, resting)}"
        return replace(found, advice=why)
    return replace(found, advice=_constant_fix_text(task, index, moving), fixable=True)


def _constant_fix_text(task: Task, index: int, moving: Load) -> str:
    """Return the constant stiffness that fixes a joint, as a run confirms, or the constant addition to it."""
    alone = _single_joint_task(task, index)

    def attempt(rule: Acceptance) -> tuple[float, FloatArray | None]:
        found = replace(alone, acceptance=rule).constants()
        return found.constants[index], alone.falls_short(alone.with_constants(found))

    confirmed = False
    with suppress(ImpossibleError):
        offset, confirmed = alone.acceptance.confirmed(attempt)
    if not confirmed:
        return "neither a slower motion nor another constant stiffness helps alone"
    joint, asked = task.acceptance.robot.joints[index], moving.command.commanded["stiffness"]
    if asked.min() == asked.max():
        does = f"a stiffness of {'at least' if offset > 0 else 'at most'} {asked[0] + offset:.10g}"
    else:
        does = f"{'an increase' if offset > 0 else 'a decrease'} of {abs(offset):.10g}"
    return f"no slower motion helps, {does} {STIFFNESS.unit(joint.type)} does"


def _in_the_way(acceptance: Acceptance, joint: Joint, resting: Load) -> str:
    """Return, as a clause, the limit that the softest admissible constant exceeds; "" if there is none."""
    try:
        offset = lowest_offset(acceptance, joint, resting)
    except ImpossibleError:
        return ""
    worst = acceptance.worst(joint, resting.changed(offset))
    if worst is None:
        return ""
    asked, unit = resting.command.commanded["stiffness"], STIFFNESS.unit(joint.type)
    constant = asked.min() == asked.max()
    least = significant(asked[0] + offset, toward=math.inf) if constant else f"{offset:+.4g}"
    return f", since with {least} {unit}, the least it may have, {worst.text}"
