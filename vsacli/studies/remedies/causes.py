"""Why each joint keeps a task from being possible, in a sentence each, and which joints nothing helps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from vsacli.base.units import STIFFNESS
from vsacli.robot.joint import Joint
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError, Trouble
from vsacli.studies.remedies.combination import AS_IT_IS
from vsacli.studies.remedies.combined_search import CombinedSearch
from vsacli.studies.remedies.longer_transition import has_transitions
from vsacli.studies.remedies.motions import Load
from vsacli.studies.remedies.slow_down import WATCHED_STEPS
from vsacli.studies.remedies.stiffness_offset import lowest_offset, smallest_offset
from vsacli.studies.remedies.suggestions import Cause
from vsacli.studies.remedies.task import Task


def causes(task: Task) -> Iterator[tuple[int, Cause]]:
    """Index and cause of each joint with a step that is not accepted."""
    acceptance = task.acceptance
    refused = np.flatnonzero(acceptance.refused_joints(task.trajectory)).tolist()
    steps = acceptance.watched(task.trajectory, WATCHED_STEPS)
    moving, resting = (passage.loads(acceptance.robot) for passage in (steps, steps.slowed(math.inf)))
    beyond = acceptance.beyond_position(task.trajectory)
    for index in refused:
        joint = acceptance.robot.joints[index]
        if index in beyond:
            text = f"{_what(beyond[index])}: no timing and no stiffness changes that, another path does"
            yield index, Cause(joint.name, text, fixable=False)
        else:
            text, hopeful = _text(acceptance, joint, moving[index], resting[index])
            yield index, Cause(joint.name, text, fixable=hopeful or is_fixable(task, index))


def is_fixable(task: Task, index: int) -> bool:
    """Whether a joint by itself can be fixed, by any kind of change."""
    others = frozenset(range(len(task.acceptance.robot.joints))) - {index}
    alone = replace(task, acceptance=replace(task.acceptance, ignored=others))
    if CombinedSearch(alone, preloads=True).smallest() is not None:
        return True
    with suppress(ImpossibleError):
        alone.with_profiles(AS_IT_IS)
        return True
    with suppress(ImpossibleError):
        return has_transitions(task.trajectory) and bool(alone.with_transition())
    return False


def _text(acceptance: Acceptance, joint: Joint, moving: Load, resting: Load) -> tuple[str, bool]:
    """The cause, and whether it is sure that something helps."""
    at_rest = acceptance.trouble(joint, resting)
    if at_rest is None:
        worst = acceptance.trouble(joint, moving)
        return ("falls short between the steps" if worst is None else _what(worst)), True
    if "stiffness" not in joint.actuator.commanded:
        why = "no slower motion helps, and it has no stiffness to choose"
        return f"{_what(at_rest, resting=True)}: {why}", False
    try:
        offset = smallest_offset(acceptance, joint, resting)
    except ImpossibleError:
        why = f"no slower motion and no constant stiffness helps{_in_the_way(acceptance, joint, resting)}"
        return f"{_what(at_rest, resting=True)}: {why}", False
    return (
        f"{_what(at_rest, resting=True)}: no slower motion helps, {_stiffness(joint, resting, offset)}",
        True,
    )


def _in_the_way(acceptance: Acceptance, joint: Joint, resting: Load) -> str:
    """The limit that the softest constant stiffness exceeds, in a clause; empty if there is none."""
    try:
        offset = lowest_offset(acceptance, joint, resting)
    except ImpossibleError:
        return ""
    trouble = acceptance.trouble(joint, resting.changed(offset))
    if trouble is None:
        return ""
    asked, unit = resting.command.commanded["stiffness"], STIFFNESS.unit(joint.type)
    constant = asked.min() == asked.max()
    least = f"{asked[0] + offset:.4g} {unit}" if constant else f"{offset:+.4g} {unit}"
    return f", since with {least}, the least it may have, {_what(trouble)}"


def _what(trouble: Trouble, *, resting: bool = False) -> str:
    """What is beyond which bound, and when."""
    when = f"at t = {trouble.time:.3f} s" + (", even at rest" if resting else "")
    if math.isnan(trouble.bound):
        return f"its springs cannot carry the elastic torque {when}"
    side = "below" if trouble.value < trouble.bound else "above"
    shown = f"{trouble.bound:.4g}"
    bound = f"the {shown} its load allows" if trouble.of_load else f"its limit of {shown}"
    return f"{trouble.whose} is {trouble.value:.4g} {trouble.unit} {when}, {side} {bound}"


def _stiffness(joint: Joint, resting: Load, offset: float) -> str:
    """Which stiffness helps at rest."""
    asked, unit = resting.command.commanded["stiffness"], STIFFNESS.unit(joint.type)
    if asked.min() == asked.max():
        relation = "at least" if offset > 0 else "at most"
        return f"a stiffness of {relation} {asked[0] + offset:.6g} {unit} does"
    relation = "higher" if offset > 0 else "lower"
    return f"a stiffness {relation} by {abs(offset):.6g} {unit} does"
