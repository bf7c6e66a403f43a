"""The smallest uniform slow-down after which every step is accepted."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import evenly
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError, smallest_confirmed
from vsacli.studies.remedies.kept_rate import rate_of
from vsacli.studies.remedies.motions import Passage, joined
from vsacli.trajectory.trajectory import Trajectory

FACTOR_DENOMINATOR = 10_000
"""Factors are whole multiples of 1/FACTOR_DENOMINATOR where recorded stamps are not even: steps get further
apart."""

WHOLE = 1e-9
"""Relative difference from a whole number of steps that is rounding."""

LARGEST_FACTOR = 1000
"""Up to which slow-downs are tried; beyond, the units of the trajectory are more likely to be wrong."""

WATCHED_STEPS = 1000
"""Steps that the scan looks at to begin with, and how many a refused confirmation may add."""

FIRST_STEPS = 20
"""How many of them are tried at many factors before the scan, and how many of those refused even at rest."""

FACTORS_AT_ONCE = 64
"""Factors that are tried at once."""


class Factors(NamedTuple):
    """The factors of slow-downs that are tried: those with a whole number of steps at the rate of the task.

    A controller has one rate; what lasts 577.74 of its periods ends between two of them.

    Attributes:
        denominator: numbers stand for themselves over this: steps of the task, which need not be whole.
    """

    denominator: float

    @classmethod
    def of(cls, trajectory: Trajectory) -> Factors:
        """Those of a task."""
        rate = rate_of(trajectory)
        return cls(float(FACTOR_DENOMINATOR) if rate is None else trajectory.duration * rate)

    @property
    def first(self) -> int:
        """The number that stands for no slow-down."""
        return round(self.denominator) if self._whole else math.floor(self.denominator)

    @property
    def last(self) -> int:
        """The number of the largest factor."""
        return math.floor(LARGEST_FACTOR * self.denominator)

    @property
    def _whole(self) -> bool:
        return math.isclose(self.denominator, round(self.denominator), rel_tol=WHOLE)

    def factor(self, number: int) -> float:
        """What a number stands for."""
        denominator = round(self.denominator) if self._whole else self.denominator
        return 1.0 if number == self.first else number / denominator


def smallest_slow_down(acceptance: Acceptance, trajectory: Trajectory) -> float:
    """The smallest factor by which position, stiffness and wrench must be stretched together in time.

    It is found by a scan upward in steps of 1 %, then bisection to one step, and confirmed on all steps of
    the stretched trajectory.

    Args:
        acceptance: the rule, and the robot.
        trajectory: one that is refused as it is.

    Raises:
        ImpossibleError: with the reason.
    """
    steps = acceptance.watched(trajectory, WATCHED_STEPS)
    at_rest = steps.slowed(math.inf)
    refused = np.flatnonzero(np.any(acceptance.refused(at_rest), axis=1))
    few = np.union1d(evenly(len(steps.factor), FIRST_STEPS), refused[evenly(len(refused), FIRST_STEPS)])
    factors = Factors.of(trajectory)
    number = _scan_start(acceptance, steps.select(few), factors)
    if number is not None:
        candidates = SlowDownCandidates(acceptance, trajectory, steps)
        number = smallest_confirmed(candidates, number, factors.last)
    if number is not None:
        return factors.factor(number)
    if refused.size:
        reasons = "; ".join(acceptance.reasons(at_rest))
        raise ImpossibleError(f"even at rest, under gravity alone, {reasons}")
    raise ImpossibleError(f"not even one by a factor {LARGEST_FACTOR} does")


def _scan_start(acceptance: Acceptance, few: Passage, factors: Factors) -> int | None:
    """A number up to which the scan would find one of a few steps refused; None if it always would.

    It tries many factors at once, which costs hardly more than one of them.
    """
    numbers = [factors.first]
    while numbers[-1] < factors.last:
        numbers.append(min(numbers[-1] + _stride(numbers[-1]), factors.last))
    for start in range(0, len(numbers), FACTORS_AT_ONCE):
        tried = numbers[start : start + FACTORS_AT_ONCE]
        refused = acceptance.refused(joined(few.slowed(factors.factor(number)) for number in tried))
        accepted = np.flatnonzero(~refused.reshape(len(tried), -1).any(axis=1))
        if accepted.size:
            return numbers[max(start + int(accepted[0]) - 1, 0)]
    return None


class SlowDownCandidates:
    """Stretching by the factors of a task, judged at watched steps; see `Candidates`."""

    def __init__(self, acceptance: Acceptance, trajectory: Trajectory, watched: Passage) -> None:
        self._acceptance, self._trajectory, self._watched = acceptance, trajectory, watched
        self._factors = Factors.of(trajectory)

    def stride(self, number: int) -> int:
        """One percent."""
        return _stride(number)

    def accepts(self, number: int) -> bool:
        """Whether every watched step is accepted."""
        return not self._acceptance.refused(self._watched.slowed(self._factors.factor(number))).any()

    def confirms(self, number: int) -> bool:
        """Whether every step is accepted; those of the first block with others are watched from now on."""
        factor = self._factors.factor(number)
        for passage in self._acceptance.passages(self._trajectory.stretched(factor), factor):
            steps = np.flatnonzero(np.any(self._acceptance.refused(passage), axis=1))
            if steps.size:
                further = passage.select(steps[evenly(len(steps), WATCHED_STEPS)])
                self._watched = joined([self._watched, further.slowed(1 / factor)])
                return False
        return True


def _stride(number: int) -> int:
    return math.ceil(number / 100)
