"""The smallest uniform slow-down after which every step is accepted."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import evenly
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError, smallest_confirmed
from vsacli.studies.remedies.motions import Passage, evenly_chosen, joined
from vsacli.trajectory.trajectory import Trajectory

FACTOR_DENOMINATOR = 10_000
"""Factors are whole multiples of 1/FACTOR_DENOMINATOR, so that the printed one is the confirmed one."""

LARGEST_FACTOR = 1000
"""Up to which slow-downs are tried; beyond, the units of the trajectory are more likely to be wrong."""

WATCHED_STEPS = 1000
"""Steps that the scan looks at to begin with, and how many a refused confirmation may add."""

FIRST_STEPS = 20
"""How many of them are tried at many factors before the scan, and how many of those refused even at rest."""

FACTORS_AT_ONCE = 64
"""Factors that are tried at once."""


def smallest_slow_down(acceptance: Acceptance, trajectory: Trajectory) -> float:
    """The smallest factor by which position, stiffness and wrench must be stretched together in time.

    It is found by a scan upward in steps of 1 %, then bisection to 1e-4, and confirmed on all steps of the
    stretched trajectory.

    Args:
        acceptance: the rule, and the robot.
        trajectory: one that is refused as it is.

    Raises:
        ImpossibleError: with the reason.
    """
    steps = evenly_chosen(trajectory, WATCHED_STEPS)
    at_rest = steps.slowed(math.inf)
    refused = np.flatnonzero(np.any(acceptance.refused(at_rest), axis=1))
    few = np.union1d(evenly(len(steps.factor), FIRST_STEPS), refused[evenly(len(refused), FIRST_STEPS)])
    number = _scan_start(acceptance, steps.select(few))
    if number is not None:
        candidates = SlowDownCandidates(acceptance, trajectory, steps)
        number = smallest_confirmed(candidates, number, LARGEST_FACTOR * FACTOR_DENOMINATOR)
    if number is not None:
        return number / FACTOR_DENOMINATOR
    if refused.size:
        reasons = "; ".join(acceptance.reasons(at_rest))
        raise ImpossibleError(f"even at rest, under gravity alone, {reasons}")
    raise ImpossibleError(f"not even one by a factor {LARGEST_FACTOR} does")


def _scan_start(acceptance: Acceptance, few: Passage) -> int | None:
    """A number up to which the scan would find one of a few steps refused; None if it always would.

    It tries many factors at once, which costs hardly more than one of them.
    """
    numbers = [FACTOR_DENOMINATOR]
    while numbers[-1] < LARGEST_FACTOR * FACTOR_DENOMINATOR:
        numbers.append(min(numbers[-1] + _stride(numbers[-1]), LARGEST_FACTOR * FACTOR_DENOMINATOR))
    for start in range(0, len(numbers), FACTORS_AT_ONCE):
        tried = numbers[start : start + FACTORS_AT_ONCE]
        refused = acceptance.refused(joined(few.slowed(number / FACTOR_DENOMINATOR) for number in tried))
        accepted = np.flatnonzero(~refused.reshape(len(tried), -1).any(axis=1))
        if accepted.size:
            return numbers[max(start + int(accepted[0]) - 1, 0)]
    return None


class SlowDownCandidates:
    """Stretching by number / FACTOR_DENOMINATOR, judged at watched steps; see `Candidates`."""

    def __init__(self, acceptance: Acceptance, trajectory: Trajectory, watched: Passage) -> None:
        self._acceptance, self._trajectory, self._watched = acceptance, trajectory, watched

    def stride(self, number: int) -> int:
        """One percent."""
        return _stride(number)

    def accepts(self, number: int) -> bool:
        """Whether every watched step is accepted."""
        return not self._acceptance.refused(self._watched.slowed(number / FACTOR_DENOMINATOR)).any()

    def confirms(self, number: int) -> bool:
        """Whether every step is accepted; those of the first block with others are watched from now on."""
        factor = number / FACTOR_DENOMINATOR
        for passage in self._acceptance.passages(self._trajectory.stretched(factor), factor):
            steps = np.flatnonzero(np.any(self._acceptance.refused(passage), axis=1))
            if steps.size:
                further = passage.select(steps[evenly(len(steps), WATCHED_STEPS)])
                self._watched = joined([self._watched, further.slowed(1 / factor)])
                return False
        return True


def _stride(number: int) -> int:
    return math.ceil(number / 100)
