"""What would mend a task: each kind of change by itself, and the combinations worth choosing from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple, Self

from vsacli.base.flags import NEAR_SINGULAR_MARGIN, check_near_singular
from vsacli.dynamics.internal_motion import damped_joints, refuse_damped_transmissions
from vsacli.dynamics.inverse import fitted
from vsacli.robot.model import Robot
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.combination import Combination, least_change
from vsacli.studies.remedies.combined_search import CombinedSearch
from vsacli.studies.remedies.recorded_limits import RecordedLimits
from vsacli.studies.remedies.slow_down import smallest_slow_down
from vsacli.studies.remedies.suggestions import NotPossible, Remedy, Suggestions
from vsacli.studies.remedies.task import Task
from vsacli.trajectory.trajectory import Trajectory

AS_IT_IS = Combination(1.0, {}, {}, 0.0)

SIMPLER_SHARE = 1.05
"""How much larger a remedy with fewer kinds of change may be and still be worth more."""

STRICTER = (0.0, 0.001, 0.01)
"""Shares by which the rule is stricter, one after the other: what has the margin at the steps may fall short
of it between them, by up to 0.8 % of itself where this was first seen."""

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
        if not asked.confirms(as_it_is):
            refuse_damped_transmissions(robot, trajectory, "suggestions")
        return Suggestions(near_singular)
    if not acceptance.refused_joints(trajectory).any() and asked.confirms(as_it_is):
        return Suggestions(near_singular)
    if reasons := acceptance.position_reasons(trajectory):
        none = NotPossible(reasons)
        return Suggestions(near_singular, none, none, none)
    for share in STRICTER:
        found = _Found.of(replace(asked, acceptance=acceptance.stricter(share)))
        chosen, failed = _worth_choosing(found.remedies, asked)
        if not failed:
            break
    return Suggestions(
        near_singular,
        slow_down=_part(found.slower, "slow_down", failed),
        stiffness_offset=_part(found.offset, "stiffness_offset", failed),
        stiffness_profile=_part(found.profile, "stiffness_profile", failed),
        remedies=tuple(chosen),
    )


class _Found(NamedTuple):
    """What a search finds: each kind of change by itself, and what may take several."""

    slower: Remedy | NotPossible
    offset: Remedy | NotPossible
    profile: Remedy | NotPossible
    combined: list[Remedy]

    @classmethod
    def of(cls, task: Task) -> Self:
        """What mends a task at its steps."""
        return cls(
            _attempt(lambda: task.with_constants(_slow_down(task))),
            _attempt(lambda: task.with_constants(task.constants())),
            _attempt(lambda: task.with_profiles(AS_IT_IS)),
            list(_combined(task)),
        )

    @property
    def remedies(self) -> list[Remedy]:
        """All of them."""
        alone = [each for each in (self.slower, self.offset, self.profile) if isinstance(each, Remedy)]
        return [*alone, *self.combined]


def _slow_down(task: Task) -> Combination:
    factor = smallest_slow_down(task.acceptance, task.trajectory)
    return Combination(factor, {}, {}, task.cost.of_factor(factor))


def _attempt(find: Callable[[], Remedy]) -> Remedy | NotPossible:
    try:
        return find()
    except ImpossibleError as error:
        return NotPossible(error.reasons)


def _part(found: Remedy | NotPossible, name: str, failed: Sequence[Remedy]) -> Any:
    """The only change of a remedy, or why there is none."""
    if isinstance(found, NotPossible):
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


def _worth_choosing(candidates: Iterable[Remedy], task: Task) -> tuple[list[Remedy], list[Remedy]]:
    """Those that a run confirms and no simpler one makes superfluous, with another preload last.

    Returns:
        These, and those that a run does not confirm, since they fall short between the steps.
    """
    chosen: list[Remedy] = []
    failed: list[Remedy] = []
    for remedy in sorted(candidates, key=lambda each: (len(each.kinds), each.size)):
        if not any(_superfluous(remedy, beside) for beside in chosen):
            (chosen if task.confirms(remedy) else failed).append(remedy)
    return sorted(chosen, key=lambda each: (each.preload is not None, each.size)), failed


def _superfluous(remedy: Remedy, beside: Remedy) -> bool:
    """Whether a remedy has nothing for it that another one, no more complicated, has not."""
    if beside.kinds < remedy.kinds:
        return beside.size <= SIMPLER_SHARE * remedy.size
    faster = remedy.longer < FASTER_SHARE * beside.longer
    return beside.kinds == remedy.kinds and beside.size <= remedy.size and not faster
