"""Design of experiments: the excitation that identifies the parameters of a robot best.

The search selects the best of random members of all families, then improves it by an evolution strategy.
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
from vsacli.dynamics.limits import Finding
from vsacli.robot.model import Robot
from vsacli.studies.identification.excitation.family import (
    MARGIN,
    Allowed,
    ExcitationFamily,
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
from vsacli.studies.identification.excitation.plan_report import Excitation, Usefulness
from vsacli.studies.search.acceptance import ImpossibleError
from vsacli.trajectory.trajectory import Trajectory

STARTS = 60
"""Number of random members, taken from the families in turn."""

STEPS = 540
"""Number of steps of the strategy.

On the paper's arm these reduced the standard errors of the best start by 30 % on average; with 240 steps they
were 10 % larger, and searches with other seeds differ by 5 %.
"""

FIRST_STEP = 0.5
"""Standard deviation of the first change of parameters whose own standard deviation is 1."""

GROWTH = 1.5
"""Factor on the step size after a success; its fourth root divides it after a failure (one-fifth rule)."""

LEAST_STEP = 0.02
"""Step size below which changes have no effect and the strategy restarts with `FIRST_STEP`."""


def search_families(
    designs: Sequence[ExcitationFamily],
    value: Callable[[Member], float],
    seed: int,
    progress: Callable[[int], object] = lambda _: None,
) -> Member | None:
    """Return the best member of several families that is found; None if no start is feasible.

    The method is the (1+1) evolution strategy with the one-fifth success rule (H.-G. Beyer, H.-P. Schwefel,
    "Evolution strategies", Natural Computing 1 (2002)); each step changes one signal of one joint. With the
    same number of trials from the same starts, `scipy.optimize.differential_evolution` gave 25 % larger
    standard errors for the paper's arm, 6 % larger for one joint, and the same for two; `dual_annealing`
    hardly improved the starts.

    Args:
        designs: families to search.
        value: function that returns the merit of a member, the larger the better.
        seed: seed of the random numbers; equal seeds give equal results.
        progress: function to call with the number of further members tried.
    """
    random = np.random.default_rng(seed)
    best: Member | None = None
    for start in range(STARTS):
        design = designs[start % len(designs)]
        best = _better_member(best, design, random.standard_normal(design.shape), value) or best
        progress(1)
    if best is None:
        return None
    step, places = FIRST_STEP, np.argwhere(best.design.counts)
    for _ in range(STEPS):
        numbers = best.numbers.copy()
        signal, joint = random.choice(places)
        numbers[signal, joint] += step * random.standard_normal(numbers.shape[-1])
        better = _better_member(best, best.design, numbers, value)
        step *= GROWTH if better else GROWTH**-0.25
        step = step if step > LEAST_STEP else FIRST_STEP
        best = better or best
        progress(1)
    return best


def _better_member(
    best: Member | None, design: ExcitationFamily, numbers: FloatArray, value: Callable[[Member], float]
) -> Member | None:
    """Return the member with given parameters; None if it is infeasible or no better than `best`."""
    member = feasible(design, numbers)
    if member is None:
        return None
    worth = value(member)
    if best is not None and not worth > best.value:
        return None
    return member._replace(value=worth)


FREQUENCIES = (0.05, 0.1, 0.2)
"""Lowest harmonics of the families, Hz: five harmonics reach at most 1 Hz, well within the low-pass filter of
recordings and below the resonances of robot arms."""

SHORTEST, LONGEST = 5.0, 3600.0
"""Shortest duration, s: one period of the fastest family; and longest one, since the plan is in memory."""

EXAMPLES = 4
"""Number of members that determine which parameters no motion distinguishes."""

DRAWN = 10
"""Largest number of random members per family for these examples."""

ACTIVE = 0.02
"""Relative clearance beyond `MARGIN` up to which a limit is active."""


def plan_excitation(
    robot: Robot,
    own: Trajectory | None = None,
    *,
    duration: float = 20.0,
    noise: tuple[float, float | None] = USUAL_NOISE,
    seed: int = 0,
    progress: Callable[[int], object] = lambda _: None,
) -> Excitation:
    """Plan a motion, with a stiffness profile, that identifies the parameters of a robot.

    The motion consists of sums of sinusoids (Swevers et al., IEEE Transactions on Robotics and Automation 13,
    1997) within all limits, from rest to rest, with the largest determinant of the information matrix found.

    Args:
        robot: robot with the parameters known so far.
        own: user's motion to compare with; joints without position limits move about its middle.
        duration: duration, s.
        noise: standard deviations of sensor readings for the predicted standard errors: of joint and motor
            positions, rad (m), and of motor torques, N m (N), on the joint side of the gears; None means
            0.5 % of the largest torque of each motor.
        seed: seed of the search and of the noise.
        progress: function to call with the number of further motions tried, of `TRIALS` in all.

    Raises:
        InputError: the duration is too short, the noise is out of range, or the robot cannot execute the
            user's motion.
        ImpossibleError: no excitation is feasible.
    """
    if not SHORTEST <= duration <= LONGEST:
        raise InputError.one(f"the duration must be from {SHORTEST:g} to {LONGEST:g} s, not {duration:g} s")
    for each in noise:
        if each is not None and not 0 <= each <= LARGEST:
            raise InputError.one(f"the sensor noise must be from 0 to {LARGEST:g}, not {each:g}")
    middle = None
    if own is not None:
        q = executed(robot, own).q
        middle = np.asarray((q.min(axis=0) + q.max(axis=0)) / 2)
    bounds = allowed(robot, middle)
    designs = [
        ExcitationFamily(robot, bounds, duration, each) for each in FREQUENCIES if each * duration >= 1
    ]
    information = Information(robot, [each.block for each in _random_members(designs, seed)])
    found = search_families(designs, lambda member: information.worth(member.block), seed, progress)
    assert found is not None, "its first starts are the examples"
    return _excitation(found, information, own, bounds, Noise(*noise), seed)


TRIALS = STARTS + STEPS
"""Number of motions that a plan tries."""


def _random_members(designs: list[ExcitationFamily], seed: int) -> list[Member]:
    """Return random feasible members of the families.

    Raises:
        ImpossibleError: no member is feasible.
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
    """Return the excitation with the report of a run along it."""
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


def _active(design: ExcitationFamily, block: Block) -> tuple[Finding, ...]:
    quantities = watched(design)
    gaps = clearances(quantities, block)
    return tuple(
        quantity.at(block, int(of_quantity.argmin()))
        for quantity, of_quantity in zip(quantities, gaps, strict=True)
        if of_quantity.min() < MARGIN + ACTIVE
    )
