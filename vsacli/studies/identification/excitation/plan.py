"""A plan of an experiment: the excitation by which the numbers of a robot can be told best."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vsacli.analysis.clearances import clearances
from vsacli.analysis.run import Run
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.variables import Block
from vsacli.documents.fields import LARGEST
from vsacli.robot.model import Robot
from vsacli.studies.identification.excitation.allowed import MARGIN, Allowed, allowed
from vsacli.studies.identification.excitation.design import Design
from vsacli.studies.identification.excitation.feasible import Feasible, feasible, obstacle, watched
from vsacli.studies.identification.excitation.information import Information
from vsacli.studies.identification.excitation.plan_report import ActiveLimit, Excitation, Usefulness
from vsacli.studies.identification.excitation.predicted_errors import (
    USUAL_NOISE,
    Noise,
    executed,
    predicted_errors,
)
from vsacli.studies.identification.excitation.search import STARTS, STEPS, Found, search
from vsacli.studies.remedies.acceptance import ImpossibleError
from vsacli.trajectory.trajectory import Trajectory

FREQUENCIES = (0.05, 0.1, 0.2)
"""Of the lowest harmonics that are tried, Hz: at five harmonics motions are of 1 Hz at most, well within what
the low-pass of records lets through, and below the resonance of arms of robots."""

SHORTEST = 5.0
"""Duration, s: one period of the fastest family."""

EXAMPLES = 4
"""Members from which follows what no motion tells apart."""

DRAWN = 10
"""Members of each family that are drawn for them at most."""

ACTIVE = 0.02
"""Relative clearance beyond `MARGIN` up to which a limit keeps a motion from being larger."""


def plan_excitation(
    robot: Robot,
    own: Trajectory | None = None,
    *,
    duration: float = 20.0,
    noise: tuple[float, float | None] = USUAL_NOISE,
    seed: int = 0,
    progress: Callable[[int], object] = lambda _: None,
) -> Excitation:
    """Plan a motion, with a stiffness profile, from which the numbers of a robot can be identified.

    Sums of sinusoids (Swevers et al., IEEE Transactions on Robotics and Automation 13, 1997) within all
    limits, from rest to rest, with the largest determinant of the information matrix that a search finds.

    Args:
        robot: with the numbers that are known so far.
        own: a motion to compare with, about whose middle joints move whose range is not limited.
        duration: s.
        noise: standard deviations of what sensors read, for which standard errors are predicted: of positions
            of joints and motors, rad (m), and of motor torques, N m (N), joint side of the gears; None is
            0.5 % of the largest torque of each motor.
        seed: of the search, and of the noise.
        progress: is told how many further ones of `TRIALS` motions were tried.

    Raises:
        InputError: the duration is too short, the noise out of range, or the robot cannot execute its own
            motion.
        ImpossibleError: no excitation is feasible.
    """
    if not SHORTEST <= duration < np.inf:
        raise InputError.one(f"an excitation lasts at least {SHORTEST:g} s, not {duration:g} s")
    if not all(each is None or 0 <= each <= LARGEST for each in noise):
        raise InputError.one(f"the noise of sensors must lie between 0 and {LARGEST:g}")
    bounds = allowed(robot, None if own is None else _middle(executed(robot, own).q))
    designs = [Design(robot, bounds, duration, each) for each in FREQUENCIES if each * duration >= 1]
    information = Information(robot, [each.block for each in _examples(designs, seed)])
    found = search(designs, lambda member: information.worth(member.block), seed, progress)
    assert found is not None, "its first starts are the examples"
    return _excitation(found, information, own, bounds, Noise(*noise), seed)


def _middle(q: FloatArray) -> FloatArray:
    """Of the range of each joint, (joints,)."""
    middle: FloatArray = (q.min(axis=0) + q.max(axis=0)) / 2
    return middle


TRIALS = STARTS + STEPS
"""Motions that a plan tries."""


def _examples(designs: list[Design], seed: int) -> list[Feasible]:
    """Members of the families.

    Raises:
        ImpossibleError: none is feasible.
    """
    random = np.random.default_rng(seed)
    found: list[Feasible] = []
    obstacles = set()
    for design in designs * DRAWN:
        numbers = random.standard_normal(design.shape)
        member = feasible(design, numbers)
        if member is None:
            obstacles.add(obstacle(design, numbers))
        else:
            found.append(member)
        if len(found) == EXAMPLES:
            break
    if not found:
        raise ImpossibleError(*sorted(obstacles))
    return found


def _excitation(
    found: Found,
    information: Information,
    own: Trajectory | None,
    bounds: Allowed,
    noise: Noise,
    seed: int,
) -> Excitation:
    """What was found, checked by a run of its own."""
    design, trajectory, block = found.design, found.feasible.trajectory, found.feasible.block
    run = Run(design.robot, trajectory)
    for _ in run:
        pass
    return Excitation(
        robot=design.robot,
        trajectory=trajectory,
        report=run.report(),
        seed=seed,
        noise=str(noise),
        planned=_usefulness(information, design.robot, trajectory, noise, seed),
        own=None if own is None else _usefulness(information, design.robot, own, noise, seed),
        structural=information.structural,
        active=_active(design, block),
        assumptions=bounds.assumptions,
    )


def _usefulness(
    information: Information, robot: Robot, trajectory: Trajectory, noise: Noise, seed: int
) -> Usefulness:
    """What a motion tells, with standard errors unless it is too short for them."""
    conditions = information.conditions(executed(robot, trajectory))
    try:
        return Usefulness(conditions, predicted_errors(robot, trajectory, noise, seed))
    except InputError as error:
        return Usefulness(conditions, reason=str(error))


def _active(design: Design, block: Block) -> tuple[ActiveLimit, ...]:
    quantities = watched(design)
    gaps = clearances(quantities, block)
    return tuple(
        ActiveLimit(quantity.joint.name, quantity.at(block, int(of_quantity.argmin())))
        for quantity, of_quantity in zip(quantities, gaps, strict=True)
        if of_quantity.min() < MARGIN + ACTIVE
    )
