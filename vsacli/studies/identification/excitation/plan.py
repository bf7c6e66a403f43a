"""A plan of an experiment: the excitation by which the numbers of a robot can be told best.

The search takes the best of random members of all families, then improves it by an evolution strategy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vsacli.analysis.minima import clearances
from vsacli.analysis.run import Run
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.variables import Block
from vsacli.documents.fields import LARGEST
from vsacli.robot.model import Robot
from vsacli.studies.identification.excitation.family import (
    MARGIN,
    Allowed,
    Design,
    Member,
    allowed,
    feasible,
    obstacle,
    watched,
)
from vsacli.studies.identification.excitation.fisher import (
    USUAL_NOISE,
    Information,
    Noise,
    executed,
    predicted_errors,
)
from vsacli.studies.identification.excitation.plan_report import ActiveLimit, Excitation, Usefulness
from vsacli.studies.search.acceptance import ImpossibleError
from vsacli.trajectory.trajectory import Trajectory

STARTS = 60
"""Random members, in turn of each family."""

STEPS = 540
"""Steps of the strategy.

On the paper's arm these made standard errors 30 % smaller than those of the best start, on average; 240 steps
left them 10 % larger, and searches with other seeds differ by 5 %.
"""

FIRST_STEP = 0.5
"""Standard deviation of the first change, of numbers whose own is 1."""

GROWTH = 1.5
"""Factor of the next change after a success; after a failure its fourth root less: the one-fifth rule."""

LEAST_STEP = 0.02
"""Below, changes are lost; the strategy begins anew with large ones."""


def search(
    designs: Sequence[Design],
    value: Callable[[Member], float],
    seed: int,
    progress: Callable[[int], object] = lambda _: None,
) -> Member | None:
    """Return the best member of some families that is found; None if no member is feasible.

    The (1+1) evolution strategy with the one-fifth success rule (H.-G. Beyer, H.-P. Schwefel, "Evolution
    strategies", Natural Computing 1 (2002)), each step of one signal of one joint. With as many trials from
    the same starts, `scipy.optimize.differential_evolution` left standard errors 25 % larger with the paper's
    arm and 6 % with one joint, the same with two; `dual_annealing` hardly improved the starts.

    Args:
        designs: the families.
        value: of a member, the larger the better.
        seed: of the random numbers; the same one finds the same.
        progress: is told how many further members were tried.
    """
    random = np.random.default_rng(seed)
    best: Member | None = None
    for start in range(STARTS):
        design = designs[start % len(designs)]
        best = _better(best, design, random.standard_normal(design.shape), value) or best
        progress(1)
    if best is None:
        return None
    step, places = FIRST_STEP, np.argwhere(best.design.counts)
    for _ in range(STEPS):
        numbers = best.numbers.copy()
        signal, joint = random.choice(places)
        numbers[signal, joint] += step * random.standard_normal(numbers.shape[-1])
        better = _better(best, best.design, numbers, value)
        step *= GROWTH if better else GROWTH**-0.25
        step = step if step > LEAST_STEP else FIRST_STEP
        best = better or best
        progress(1)
    return best


def _better(
    best: Member | None, design: Design, numbers: FloatArray, value: Callable[[Member], float]
) -> Member | None:
    """Return the member with these numbers; None if it is not feasible, or no better than the best."""
    member = feasible(design, numbers)
    if member is None:
        return None
    worth = value(member)
    if best is not None and not worth > best.value:
        return None
    return member._replace(value=worth)


FREQUENCIES = (0.05, 0.1, 0.2)
"""Lowest harmonics tried, Hz: at five harmonics motions are of 1 Hz at most, well within the low-pass of
recordings, and below the resonance of arms of robots."""

SHORTEST = 5.0
"""Duration, s: one period of the fastest family."""

EXAMPLES = 4
"""Members that show which parameters no motion distinguishes."""

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
        noise: standard deviations of sensor readings, for which standard errors are predicted: of positions
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
    middle = None
    if own is not None:
        q = executed(robot, own).q
        middle = np.asarray((q.min(axis=0) + q.max(axis=0)) / 2)
    bounds = allowed(robot, middle)
    designs = [Design(robot, bounds, duration, each) for each in FREQUENCIES if each * duration >= 1]
    information = Information(robot, [each.block for each in _examples(designs, seed)])
    found = search(designs, lambda member: information.worth(member.block), seed, progress)
    assert found is not None, "its first starts are the examples"
    return _excitation(found, information, own, bounds, Noise(*noise), seed)


TRIALS = STARTS + STEPS
"""Motions that a plan tries."""


def _examples(designs: list[Design], seed: int) -> list[Member]:
    """Members of the families.

    Raises:
        ImpossibleError: none is feasible.
    """
    random = np.random.default_rng(seed)
    found: list[Member] = []
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
    found: Member,
    information: Information,
    own: Trajectory | None,
    bounds: Allowed,
    noise: Noise,
    seed: int,
) -> Excitation:
    """Return the excitation, checked by a run of its own."""
    design, trajectory, block = found.design, found.trajectory, found.block
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
    """Return the usefulness of a motion, with standard errors unless it is too short for them."""
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
