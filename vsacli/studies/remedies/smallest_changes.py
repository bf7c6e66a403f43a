"""The smallest changes after which a motion is possible: a slow-down, a stiffness offset, another profile."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.flags import NEAR_SINGULAR_MARGIN, check_near_singular
from vsacli.base.units import STIFFNESS
from vsacli.dynamics.inverse import check_fit
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.admissible_stiffness import Load, joint_loads
from vsacli.studies.remedies.slow_down import smallest_slow_down
from vsacli.studies.remedies.stiffness_offset import smallest_offset
from vsacli.studies.remedies.stiffness_profile import Change, nearest_change, with_changed_stiffness
from vsacli.studies.remedies.suggestions import (
    JointChange,
    NotPossible,
    Offset,
    SlowDown,
    StiffnessOffset,
    StiffnessProfile,
    Suggestions,
)
from vsacli.trajectory.trajectory import Trajectory

_Found = TypeVar("_Found", float, Change)

STEPS = slice(None, None, 2)
"""The instants of a load that are steps."""


def suggest(robot: Robot, trajectory: Trajectory, near_singular: float = NEAR_SINGULAR_MARGIN) -> Suggestions:
    """The smallest changes, each by itself, after which every step has the margin and keeps every limit.

    Each is recomputed over all steps and confirmed.

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
    refused = np.flatnonzero(acceptance.refused_joints(trajectory)).tolist()
    if not refused:
        return Suggestions(near_singular)
    loads = dict(zip(refused, joint_loads(robot, trajectory, refused), strict=True))
    offsets = {joint: _offset(acceptance, joint, load) for joint, load in loads.items()}
    changes = {joint: _change(acceptance, joint, load, offsets[joint]) for joint, load in loads.items()}
    return Suggestions(
        near_singular,
        slow_down=_slow_down(acceptance, trajectory),
        stiffness_offset=_stiffness_offset(acceptance, trajectory, offsets),
        stiffness_profile=_stiffness_profile(acceptance, trajectory, changes),
    )


def _offset(acceptance: Acceptance, joint: int, load: Load) -> float | ImpossibleError:
    try:
        return smallest_offset(acceptance, acceptance.robot.joints[joint], load.at(STEPS))
    except ImpossibleError as error:
        return error


def _change(
    acceptance: Acceptance, joint: int, load: Load, offset: float | ImpossibleError
) -> Change | ImpossibleError:
    constant = None if isinstance(offset, ImpossibleError) else offset
    try:
        return nearest_change(acceptance, acceptance.robot.joints[joint], load, constant)
    except ImpossibleError as error:
        return error


def _slow_down(acceptance: Acceptance, trajectory: Trajectory) -> SlowDown | NotPossible:
    try:
        return SlowDown(smallest_slow_down(acceptance, trajectory), trajectory.duration)
    except ImpossibleError as error:
        return NotPossible((str(error),))


def _stiffness_offset(
    acceptance: Acceptance, trajectory: Trajectory, offsets: Mapping[int, float | ImpossibleError]
) -> StiffnessOffset | NotPossible:
    found, reasons = _parted(offsets)
    if reasons:
        return NotPossible(reasons)
    constants = {joint: np.array([[offset], [0], [0]]) for joint, offset in found.items()}
    _confirmed(acceptance, trajectory, constants)
    return StiffnessOffset(
        tuple(
            Offset(joint.name, found.get(index, 0.0), STIFFNESS.unit(joint.type))
            for index, joint in enumerate(acceptance.robot.joints)
            if "stiffness" in joint.actuator.commanded
        )
    )


def _stiffness_profile(
    acceptance: Acceptance, trajectory: Trajectory, changes: Mapping[int, Change | ImpossibleError]
) -> StiffnessProfile | NotPossible:
    found, reasons = _parted(changes)
    if reasons:
        return NotPossible(reasons)
    fixed = _confirmed(
        acceptance, trajectory, {joint: change.rows[:, STEPS] for joint, change in found.items()}
    )
    return StiffnessProfile(
        tuple(_summary(acceptance.robot.joints[joint], change) for joint, change in found.items()), fixed
    )


def _parted(outcomes: Mapping[int, _Found | ImpossibleError]) -> tuple[dict[int, _Found], tuple[str, ...]]:
    """What was found for joints by index, and the reasons where nothing was."""
    found = {joint: each for joint, each in outcomes.items() if not isinstance(each, ImpossibleError)}
    reasons = tuple(str(each) for each in outcomes.values() if isinstance(each, ImpossibleError))
    return found, reasons


def _confirmed(
    acceptance: Acceptance, trajectory: Trajectory, changes: Mapping[int, FloatArray]
) -> Trajectory:
    """The trajectory with changed stiffness, after all of its steps have been recomputed."""
    fixed = with_changed_stiffness(trajectory, changes)
    refused = acceptance.refused_joints(fixed)
    assert not refused.any(), "a change that was accepted joint by joint is not confirmed"
    return fixed


def _summary(joint: Joint, change: Change) -> JointChange:
    largest = int(np.abs(change.rows[0]).argmax())
    return JointChange(
        joint=joint.name,
        largest=float(change.rows[0, largest]),
        time=float(change.time[largest]),
        rms=change.rms,
        unit=STIFFNESS.unit(joint.type),
    )
