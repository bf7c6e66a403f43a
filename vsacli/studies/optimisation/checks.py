"""What can be optimised, and whether a run confirms what was found."""

from __future__ import annotations

from collections.abc import Sequence

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import STIFFNESS
from vsacli.robot.model import Robot
from vsacli.studies.optimisation.criteria import CRITERIA, Criterion
from vsacli.studies.optimisation.optimum import Optimum
from vsacli.studies.remedies.acceptance import Acceptance
from vsacli.studies.remedies.suggestions import Remedy
from vsacli.studies.remedies.task import Task
from vsacli.trajectory.trajectory import Trajectory

TIME, TIMING, BOTH = "time", "timing", "both"
"""What is minimised, and what varies, where it is not the stiffness alone."""


def varied_joints(robot: Robot, vary: str) -> list[int]:
    """The joints whose stiffness varies, by index.

    Raises:
        InputError: there are none, although it is to vary, or there is no such word.
    """
    if vary not in (STIFFNESS.key, TIMING, BOTH):
        raise InputError.one(f"what varies must be 'stiffness', {TIMING!r} or {BOTH!r}, not {vary!r}")
    return [] if vary == TIMING else chosen_joints(robot)


def check_timing_varies(vary: str) -> None:
    """Refuse to minimise the time where the timing does not vary.

    Raises:
        InputError: it does not.
    """
    if vary == STIFFNESS.key:
        raise InputError.one(f"time is what {TIMING!r} varies for, or {BOTH!r}, not {vary!r}")


def chosen_joints(robot: Robot) -> list[int]:
    """The joints whose stiffness is commanded, by index.

    Raises:
        InputError: there are none.
    """
    chosen = [index for index, joint in enumerate(robot.joints) if STIFFNESS.key in joint.actuator.commanded]
    if not chosen:
        raise InputError.one(f"no joint of {robot.name} has a stiffness to choose")
    return chosen


def checked_criterion(robot: Robot, name: str, joints: Sequence[int]) -> Criterion:
    """What is minimised, if it can be computed for joints, by index.

    Raises:
        InputError: it cannot, or there is no such criterion.
    """
    if name not in CRITERIA:
        raise InputError.one(f"what is minimised must be one of {', '.join(CRITERIA)}, not {name!r}")
    criterion = CRITERIA[name]()
    for index in joints:
        criterion.check(robot.joints[index])
    return criterion


def falls_short(what: Optimum, trajectory: Trajectory) -> FloatArray | None:
    """Return times since the start, s, at which a run misses margin or limits; None if it keeps them.

    Between the steps, too; empty if it is the self-check alone that fails.
    """
    task = Task(Acceptance(what.robot, what.margin), trajectory)
    return task.falls_short(Remedy(0.0, what.robot, trajectory))
