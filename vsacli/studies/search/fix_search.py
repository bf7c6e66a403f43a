"""Fixes of an infeasible task: each kind of change alone, combinations to choose from, and the causes.

A search finds changes that samples accept; a run confirms each one, and instants at which it fails count as
samples of the next search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np

from vsacli.analysis.variant_groups import PreparedRun
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
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, verify, verify_fix
from vsacli.studies.search.combined import CombinedSearch, least_change, smallest_slow_down
from vsacli.studies.search.cutting_planes import lowest_offset, smallest_offset, transitions_between_levels
from vsacli.studies.search.fix_report import NOT_CONFIRMED, SIMILAR, Fix, Fixes, NotPossible, in_order
from vsacli.studies.search.loads import Load
from vsacli.studies.search.recorded_limits import RecordedLimits
from vsacli.studies.search.task import AS_IT_IS, Combination, Task
from vsacli.trajectory.times import RecordedTimes
from vsacli.trajectory.trajectory import Trajectory

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

        joint_fixes = fixes(
            robot.without_tool_limits(robot.limited_tools), trajectory, min_margin, progress=progress
        )
        return with_stiff_tools(robot, trajectory, joint_fixes)
    task = Task(Acceptance(robot, min_margin, RecordedLimits(trajectory)), trajectory)
    damped = damped_joints(robot, trajectory)
    if damped or not task.refused_loads:
        verification = verify(task.acceptance, PreparedRun(robot, trajectory))
        if verification.refused is None:
            return Fixes(min_margin)
        if damped:
            refuse_damped_transmissions(robot, trajectory, "fixes")
        task = replace(task, acceptance=replace(task.acceptance, between=verification.refused))
    causes = _causes(task)
    with progress(len(SEARCHES)) as bar:
        searches = Countdown(bar.update, len(SEARCHES))
        candidates = _search_fixes(task, causes, searches)
        if not candidates.chosen and any(cause.fixable for cause in causes.values()):
            for index, cause in causes.items():
                fixable = cause.fixable and bool(_fixes_of_joint(task, index, SEARCHES))
                causes[index] = replace(cause, fixable=fixable)
            candidates = _search_fixes(task, causes, searches)
        searches.finish()
    return Fixes(
        min_margin,
        **{name: candidates.change(name) for name in ALONE},
        causes=tuple(causes.values()),
        fixes=tuple(in_order(candidates.chosen)),
    )


@dataclass
class _CandidateFixes:
    """Results of searches, and which of their fixes runs have confirmed or refused.

    Attributes:
        results: fixes that samples accept, by name of the search, or the reasons for none.
        confirmed: fixes that a run confirmed, with its findings.
        refused: fixes that a run refused between samples.
    """

    results: dict[str, list[Fix] | NotPossible] = field(default_factory=dict)
    confirmed: list[Fix] = field(default_factory=list)
    refused: list[Fix] = field(default_factory=list)

    @property
    def chosen(self) -> list[Fix]:
        """Fixes that no run has refused, and that no simpler one makes superfluous."""
        chosen: list[Fix] = []
        results = (result for result in self.results.values() if isinstance(result, list))
        for fix in sorted(chain(*results), key=lambda fix: (len(fix.kinds), fix.size)):
            if fix not in self.refused and not any(_is_superfluous(fix, simpler) for simpler in chosen):
                chosen.append(next((known for known in self.confirmed if known == fix), fix))
        return chosen

    def search(self, task: Task, names: Iterable[str], progress: Countdown) -> None:
        """Search for fixes where there is no result yet, or for further ones where some were refused."""
        for name in names:
            result = self.results.get(name)
            if isinstance(result, NotPossible):
                continue
            remaining = [fix for fix in result or () if fix not in self.refused]
            if result is None or len(remaining) < len(result):
                try:
                    self.results[name] = remaining + list(SEARCHES[name](task))
                except ImpossibleError as error:
                    self.results[name] = remaining or NotPossible(error.reasons)
                progress.count()

    def confirm(self, acceptance: Acceptance) -> FloatArray | None:
        """Run the chosen fixes; return the instants at which some were refused, or None if none was."""
        instants: list[FloatArray] = []
        while pending := [fix for fix in self.chosen if fix not in self.confirmed]:
            for fix, refused in (verify_fix(acceptance, fix) for fix in pending):
                (self.confirmed if refused is None else self.refused).append(fix)
                instants += [] if refused is None else [refused]
        return np.concatenate(instants) if instants else None

    def change(self, name: str) -> Any:
        """Return the only change of the fix that a search of `ALONE` found, or the reasons for none."""
        result = self.results.get(name)
        if not isinstance(result, list):
            return result
        return NotPossible((NOT_CONFIRMED,)) if result[0] in self.refused else getattr(result[0], name)


def _search_fixes(task: Task, causes: Mapping[int, Finding], searches: Countdown) -> _CandidateFixes:
    """Search for fixes of all joints that can be fixed."""
    hopeless = frozenset(index for index, cause in causes.items() if not cause.fixable)
    if hopeless == causes.keys():
        reasons = NotPossible(tuple(map(str, causes.values())))
        return _CandidateFixes({name: reasons for name in ALONE if name != "transition"})
    fixable_task = replace(task, acceptance=replace(task.acceptance, ignored=hopeless))
    candidates = _search_and_confirm(fixable_task, SEARCHES, searches)
    # new samples between the recorded ones may exceed a position limit that these keep, at any speed
    lacks_fix = not candidates.chosen or (
        _slows_down(candidates.refused) and not _slows_down(candidates.chosen)
    )
    if lacks_fix and isinstance(task.trajectory.times, RecordedTimes):
        at_samples = _search_and_confirm(replace(fixable_task, keeps_rate=False), SEARCHES, searches)
        return at_samples if at_samples.chosen else candidates
    return candidates


def _slows_down(fixes: Iterable[Fix]) -> bool:
    return any(fix.longer > 0 for fix in fixes)


def _search_and_confirm(task: Task, names: Iterable[str], progress: Countdown) -> _CandidateFixes:
    """Run searches; repeat those whose fix a run refuses, with the refused instants as samples."""
    candidates, has_transitions = _CandidateFixes(), bool(transitions_between_levels(task.trajectory))
    names = [name for name in names if has_transitions or name != "transition"]

    def attempt(rule: Acceptance) -> tuple[_CandidateFixes, FloatArray | None]:
        candidates.search(replace(task, acceptance=rule), names, progress)
        return candidates, candidates.confirm(task.acceptance)

    task.acceptance.confirmed(attempt)
    return candidates


def _constant_fixes(task: Task) -> Iterator[Fix]:
    search = CombinedSearch(task)
    combinations = search.smallest(), search.fastest()
    return (task.with_constants(found) for found in combinations if found is not None)


def _profile_fixes(task: Task) -> Iterator[Fix]:
    search = CombinedSearch(task, least_change)
    profiles = list(_fixes_with_profiles(task, search.smallest(), search.fastest()))
    yield from profiles or _fixes_with_profiles(task, CombinedSearch(task).smallest())


def _branch_fixes(task: Task) -> Iterator[Fix]:
    search = CombinedSearch(task, branches=True)
    combination = search.smallest() if search.exchangeable else None
    if combination is not None and combination.branches:
        yield task.with_constants(combination)


def _fixes_with_profiles(task: Task, *combinations: Combination | None) -> Iterator[Fix]:
    """Yield fixes with profiles at the slow-downs of these combinations, where profiles are found."""
    combinations_by_factor = {
        combination.factor: combination
        for combination in combinations
        if combination is not None and combination.factor > 1
    }
    for combination in combinations_by_factor.values():
        with suppress(ImpossibleError):
            yield task.with_profiles(combination)


_Search = Callable[[Task], Iterable[Fix]]
"""Search for fixes of a task that its samples accept; raises ImpossibleError if there are none."""

ALONE = ("slow_down", "stiffness_offset", "stiffness_profile", "transition")
"""Names of the searches for one kind of change, those of the kinds in `Fixes`."""

SEARCHES: Mapping[str, _Search] = {
    "slow_down": lambda task: [task.with_constants(smallest_slow_down(task))],
    "stiffness_offset": lambda task: [task.with_constants(task.constants())],
    "stiffness_profile": lambda task: [task.with_profiles(AS_IT_IS)],
    "transition": lambda task: [task.with_transition()],
    "constants": _constant_fixes,
    "profiles": _profile_fixes,
    "branches": _branch_fixes,
}
"""Searches by name; those that are not `ALONE` may combine several kinds of change."""


def _is_superfluous(fix: Fix, simpler: Fix) -> bool:
    """Return whether another fix with the same or fewer kinds of change makes this one superfluous."""
    if simpler.kinds < fix.kinds:
        return simpler.size <= SIMILAR * fix.size
    is_faster = fix.longer < FASTER_SHARE * simpler.longer
    return simpler.kinds == fix.kinds and simpler.size <= fix.size and not is_faster


def _causes(task: Task) -> dict[int, Finding]:
    """Return the worst violation of each refused joint, with advice, by index."""
    rest_loads = task.acceptance.watched_at_rest(task.trajectory).loads(task.acceptance.robot)
    loads = task.refused_loads.items()
    return {index: _cause(task, index, load, rest_loads[index]) for index, load in loads}


def _fixes_of_joint(task: Task, index: int, names: Iterable[str]) -> list[Fix]:
    """Return fixes of one joint by some searches, with the other joints ignored."""
    other_joints = frozenset(range(len(task.acceptance.robot.joints))) - {index}
    joint_task = replace(task, acceptance=replace(task.acceptance, ignored=other_joints))
    return _search_and_confirm(joint_task, names, Countdown(lambda _: None, 0)).chosen


def _cause(task: Task, index: int, load: Load, rest_load: Load) -> Finding:
    """Return the worst violation at rest, or else in motion, with advice; fixable unless known not to be."""
    acceptance, joint = task.acceptance, task.acceptance.robot.joints[index]
    loads = load.at(load.steps), load  # violations at samples come first
    position_violation, worst_violation = (
        next(filter(None, (find(joint, part) for part in loads)), None)
        for find in (acceptance.beyond_position, acceptance.worst)
    )
    if position_violation is not None:
        advice = "timing and stiffness have no effect on that: change the path or the limit"
        return replace(position_violation, advice=advice, fixable=False)
    rest_violation = acceptance.worst(joint, rest_load)
    if rest_violation is None:
        first_time = float(load.time[acceptance.refused_steps(joint, load).argmax()])
        return worst_violation or Finding(
            Flag.NOT_FINITE.label, first_time, math.nan, math.nan, "", joint=joint.name
        )
    rest_violation = replace(rest_violation, at_rest=True)
    if "stiffness" not in joint.actuator.commanded:
        advice = "no slower motion helps, and it has no stiffness to choose"
    else:
        try:
            smallest_offset(acceptance, joint, rest_load)
            return replace(rest_violation, advice=_constant_fix_text(task, index, load))
        except ImpossibleError:
            limit_clause = _limit_clause(acceptance, joint, rest_load)
            advice = f"no slower motion and no constant stiffness helps{limit_clause}"
    return replace(rest_violation, advice=advice, fixable=bool(_fixes_of_joint(task, index, SEARCHES)))


def _constant_fix_text(task: Task, index: int, load: Load) -> str:
    """Return the constant stiffness that fixes a joint, as a run confirms, or the constant addition to it."""
    fixes_alone = _fixes_of_joint(task, index, ["stiffness_offset"])
    if not (fixes_alone and fixes_alone[0].stiffness_offset):
        return "neither a slower motion nor another constant stiffness helps alone"
    joint, commanded_stiffness = task.acceptance.robot.joints[index], load.command.commanded["stiffness"]
    offset = fixes_alone[0].stiffness_offset.by_joint[joint.name]
    if commanded_stiffness.min() == commanded_stiffness.max():
        change_text = (
            f"a stiffness of {'at least' if offset > 0 else 'at most'} {commanded_stiffness[0] + offset:.10g}"
        )
    else:
        change_text = f"{'an increase' if offset > 0 else 'a decrease'} of {abs(offset):.10g}"
    return f"no slower motion helps, {change_text} {STIFFNESS.unit(joint.type)} does"


def _limit_clause(acceptance: Acceptance, joint: Joint, rest_load: Load) -> str:
    """Return, as a clause, the limit that the softest admissible constant exceeds; "" if there is none."""
    try:
        offset = lowest_offset(acceptance, joint, rest_load)
    except ImpossibleError:
        return ""
    violation = acceptance.worst(joint, rest_load.changed(offset))
    if violation is None:
        return ""
    commanded_stiffness, unit = rest_load.command.commanded["stiffness"], STIFFNESS.unit(joint.type)
    if commanded_stiffness.min() == commanded_stiffness.max():
        min_stiffness = significant(commanded_stiffness[0] + offset, toward=math.inf)
        return f", since with {min_stiffness} {unit}, the least it may have, {violation.text}"
    verb, extent = ("raised", "as little as") if offset > 0 else ("lowered", "as far as")
    return (
        f", since {verb} by {abs(offset):.4g} {unit} throughout, {extent} its minimum permits, "
        f"{violation.text}"
    )
