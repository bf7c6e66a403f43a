"""What would mend a task: each kind of change by itself, and the combinations worth choosing from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import Any

from vsacli.base.flags import NEAR_SINGULAR_MARGIN, check_near_singular
from vsacli.dynamics.inverse import check_fit
from vsacli.robot.model import Robot
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.combination import Combination, least_change
from vsacli.studies.remedies.combined_search import CombinedSearch
from vsacli.studies.remedies.slow_down import smallest_slow_down
from vsacli.studies.remedies.suggestions import NotPossible, Remedy, Suggestions
from vsacli.studies.remedies.task import Task
from vsacli.trajectory.trajectory import Trajectory

AS_IT_IS = Combination(1.0, {}, {}, 0.0)

SIMPLER_SHARE = 1.05
"""How much larger a remedy with fewer kinds of change may be and still be worth more."""

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
        InputError: the trajectory is not for the robot, or `near_singular` is no possible margin.
        TypeError: robot or trajectory is none.
    """
    check_fit(robot, trajectory)
    check_near_singular(near_singular)
    acceptance = Acceptance(robot, near_singular)
    if not acceptance.refused_joints(trajectory).any():
        return Suggestions(near_singular)
    if reasons := acceptance.position_reasons(trajectory):
        none = NotPossible(reasons)
        return Suggestions(near_singular, none, none, none)
    task = Task(acceptance, trajectory)
    slower = _attempt(lambda: task.with_constants(_slow_down(task)))
    offset = _attempt(lambda: task.with_constants(task.constants()))
    profile = _attempt(lambda: task.with_profiles(AS_IT_IS))
    alone = [found for found in (slower, offset, profile) if isinstance(found, Remedy)]
    return Suggestions(
        near_singular,
        slow_down=_part(slower, "slow_down"),
        stiffness_offset=_part(offset, "stiffness_offset"),
        stiffness_profile=_part(profile, "stiffness_profile"),
        remedies=tuple(_worth_choosing([*alone, *_combined(task)], task)),
    )


def _slow_down(task: Task) -> Combination:
    factor = smallest_slow_down(task.acceptance, task.trajectory)
    return Combination(factor, {}, {}, task.cost.of_factor(factor))


def _attempt(find: Callable[[], Remedy]) -> Remedy | NotPossible:
    try:
        return find()
    except ImpossibleError as error:
        return NotPossible(error.reasons)


def _part(found: Remedy | NotPossible, name: str) -> Any:
    """The only change of a remedy, or why there is none."""
    return found if isinstance(found, NotPossible) else getattr(found, name)


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


def _worth_choosing(candidates: Iterable[Remedy], task: Task) -> list[Remedy]:
    """Those that a run confirms and no simpler one makes superfluous; with another preload last."""
    chosen: list[Remedy] = []
    for remedy in sorted(candidates, key=lambda each: (len(each.kinds), each.size)):
        if not any(_superfluous(remedy, beside) for beside in chosen) and task.confirms(remedy):
            chosen.append(remedy)
    return sorted(chosen, key=lambda each: (each.preload is not None, each.size))


def _superfluous(remedy: Remedy, beside: Remedy) -> bool:
    """Whether a remedy has nothing for it that another one, no more complicated, has not."""
    if beside.kinds < remedy.kinds:
        return beside.size <= SIMPLER_SHARE * remedy.size
    faster = remedy.longer < FASTER_SHARE * beside.longer
    return beside.kinds == remedy.kinds and beside.size <= remedy.size and not faster
