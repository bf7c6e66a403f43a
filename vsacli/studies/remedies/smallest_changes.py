"""What would mend a task: each kind of change by itself, and the combinations worth choosing from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.flags import NEAR_SINGULAR_MARGIN, check_near_singular
from vsacli.dynamics.internal_motion import damped_joints, refuse_damped_transmissions
from vsacli.dynamics.inverse import fitted
from vsacli.robot.model import Robot
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.causes import causes, is_fixable
from vsacli.studies.remedies.combination import AS_IT_IS, Combination, least_change
from vsacli.studies.remedies.combined_search import CombinedSearch
from vsacli.studies.remedies.longer_transition import has_transitions
from vsacli.studies.remedies.recorded_limits import RecordedLimits
from vsacli.studies.remedies.slow_down import smallest_slow_down
from vsacli.studies.remedies.suggestions import Cause, NotPossible, Remedy, Suggestions
from vsacli.studies.remedies.task import Task
from vsacli.trajectory.times import RecordedTimes
from vsacli.trajectory.trajectory import Trajectory

SIMPLER_SHARE = 1.05
"""How much larger a remedy with fewer kinds of change may be and still be worth more."""

STRICTER = (0.0, 0.0, 0.0, 1e-6, 1e-4, 0.01)
"""Shares by which the rule is stricter, one search after the other. What has the margin at the steps may fall
short of it between them; instants at which it does count from then on, so that two searches do as a rule."""

FASTER_SHARE = 0.8
"""Share of the extra time of a remedy that another may take to be worth its while although it is larger."""


def suggest(robot: Robot, trajectory: Trajectory, near_singular: float = NEAR_SINGULAR_MARGIN) -> Suggestions:
    """The smallest changes after which every step has the margin and keeps every limit.

    Slow-down, constant change and other profile of the stiffness each by itself; and remedies to choose from,
    which combine them, also with another preload. Each is recomputed over all steps and confirmed.

    Args:
        robot: the robot.
        trajectory: what it is asked to do.
        near_singular: the margin min(sigma - lower, upper - sigma)/sigma that every step shall have.

    Raises:
        InputError: the trajectory is not for the robot, a transmission is damped, or `near_singular` is no
            possible margin.
        TypeError: robot or trajectory is none.
    """
    trajectory = fitted(robot, trajectory)
    check_near_singular(near_singular)
    acceptance = Acceptance(robot, near_singular, RecordedLimits(trajectory))
    asked = Task(acceptance, trajectory)
    as_it_is = Remedy(0.0, robot, trajectory)
    if damped_joints(robot, trajectory):
        if asked.falls_short(as_it_is) is not None:
            refuse_damped_transmissions(robot, trajectory, "suggestions")
        return Suggestions(near_singular)
    if not acceptance.refused_joints(trajectory).any() and asked.falls_short(as_it_is) is None:
        return Suggestions(near_singular)
    found_causes = dict(causes(asked))
    tried = _tried(asked, found_causes)
    if not tried.chosen and any(cause.fixable for cause in found_causes.values()):
        found_causes = {
            index: replace(cause, fixable=cause.fixable and is_fixable(asked, index))
            for index, cause in found_causes.items()
        }
        tried = _tried(asked, found_causes)
    return Suggestions(
        near_singular,
        slow_down=_part(tried.found.slower, "slow_down", tried.failed),
        stiffness_offset=_part(tried.found.offset, "stiffness_offset", tried.failed),
        stiffness_profile=_part(tried.found.profile, "stiffness_profile", tried.failed),
        transition=_part(tried.found.transition, "transition", tried.failed),
        causes=tuple(found_causes.values()),
        remedies=tuple(tried.chosen),
    )


class _Tried(NamedTuple):
    """What a search found, which of it is worth choosing, and what falls short between the steps."""

    found: _Found
    chosen: list[Remedy]
    failed: list[Remedy]


def _tried(task: Task, found_causes: Mapping[int, Cause]) -> _Tried:
    """Search for what mends the joints that can be mended; instants at which it falls short join in."""
    hopeless = frozenset(index for index, cause in found_causes.items() if not cause.fixable)
    if hopeless == found_causes.keys():
        reasons = NotPossible(tuple(map(str, found_causes.values())))
        return _Tried(_Found(reasons, reasons, reasons, None, []), [], [])
    asked = replace(task, acceptance=replace(task.acceptance, ignored=hopeless))
    tried = _searched(asked)
    if tried.chosen or not isinstance(task.trajectory.times, RecordedTimes):
        return tried
    # steps between the samples may exceed a limit of the position that these keep, at whatever speed
    return _searched(replace(asked, keeps_rate=False))


def _searched(asked: Task) -> _Tried:
    """What is found when instants that fall short join the steps, search after search."""
    acceptance = asked.acceptance
    for share in STRICTER:
        found = _Found.of(replace(asked, acceptance=acceptance.stricter(share)))
        chosen, failed, short = _worth_choosing(found.remedies, asked)
        if not failed:
            break
        acceptance = replace(acceptance, between=np.union1d(acceptance.between, short))
    return _Tried(found, chosen, failed)


class _Found(NamedTuple):
    """What a search finds: each kind of change by itself, and what may take several."""

    slower: Remedy | NotPossible
    offset: Remedy | NotPossible
    profile: Remedy | NotPossible
    transition: Remedy | NotPossible | None
    combined: list[Remedy]

    @classmethod
    def of(cls, task: Task) -> Self:
        """What mends a task at its steps."""
        return cls(
            _attempt(lambda: task.with_constants(_slow_down(task))),
            _attempt(lambda: task.with_constants(task.constants())),
            _attempt(lambda: task.with_profiles(AS_IT_IS)),
            _attempt(task.with_transition) if has_transitions(task.trajectory) else None,
            list(_combined(task)),
        )

    @property
    def remedies(self) -> list[Remedy]:
        """All of them."""
        alone = (self.slower, self.offset, self.profile, self.transition)
        return [*(each for each in alone if isinstance(each, Remedy)), *self.combined]


def _slow_down(task: Task) -> Combination:
    factor = smallest_slow_down(task.acceptance, task.trajectory)
    return Combination(factor, {}, {}, task.cost.of_factor(factor))


def _attempt(find: Callable[[], Remedy]) -> Remedy | NotPossible:
    try:
        return find()
    except ImpossibleError as error:
        return NotPossible(error.reasons)


def _part(found: Remedy | NotPossible | None, name: str, failed: Sequence[Remedy]) -> Any:
    """The only change of a remedy, or why there is none."""
    if not isinstance(found, Remedy):
        return found
    if any(found is each for each in failed):
        return NotPossible(("what keeps every limit at the steps exceeds one between them",))
    return getattr(found, name)


def _combined(task: Task) -> Iterator[Remedy]:
    """Remedies that may take several kinds of change."""
    constant, least = CombinedSearch(task), CombinedSearch(task, least_change)
    smallest = constant.smallest()
    yield from (task.with_constants(found) for found in (smallest, constant.fastest()) if found is not None)
    profiles = list(_with_profiles(task, least.smallest(), least.fastest()))
    yield from profiles or _with_profiles(task, smallest)
    exchanged = CombinedSearch(task, preloads=True)
    found = exchanged.smallest() if exchanged.exchangeable else None
    if found is not None and found.preloads:
        yield task.with_constants(found)


def _with_profiles(task: Task, *combinations: Combination | None) -> Iterator[Remedy]:
    """The remedies with profiles that slow down as these combinations do, as far as there are any."""
    factors = {found.factor: found for found in combinations if found is not None and found.factor > 1}
    for found in factors.values():
        with suppress(ImpossibleError):
            yield task.with_profiles(found)


def _worth_choosing(
    candidates: Iterable[Remedy], task: Task
) -> tuple[list[Remedy], list[Remedy], FloatArray]:
    """Those that a run confirms and no simpler one makes superfluous, with another preload last.

    Returns:
        These; those that a run does not confirm, since they fall short between the steps; and when these do,
        as times since the start of the task, s.
    """
    chosen: list[Remedy] = []
    failed: list[Remedy] = []
    instants = [np.empty(0)]
    for remedy in sorted(candidates, key=lambda each: (len(each.kinds), each.size)):
        if not any(_superfluous(remedy, beside) for beside in chosen):
            short = task.falls_short(remedy)
            (chosen if short is None else failed).append(remedy)
            instants += [] if short is None else [short]
    ordered = sorted(chosen, key=lambda each: (each.preload is not None, each.size))
    return ordered, failed, np.concatenate(instants)


def _superfluous(remedy: Remedy, beside: Remedy) -> bool:
    """Whether a remedy has nothing for it that another one, no more complicated, has not."""
    if beside.kinds < remedy.kinds:
        return beside.size <= SIMPLER_SHARE * remedy.size
    faster = remedy.longer < FASTER_SHARE * beside.longer
    return beside.kinds == remedy.kinds and beside.size <= remedy.size and not faster
