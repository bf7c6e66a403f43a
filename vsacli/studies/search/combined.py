"""Search over slow-down, stiffness and branch together, for the combination of least size.

The factor of the slow-down determines the link torques, and with these the attainable range and the limits of
a joint do not depend on the other joints. So the search is one-dimensional, over the factor; at each factor,
joints are fixed one by one, at few samples. Some of those that refuse the smallest combination join these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, evenly
from vsacli.studies.search.acceptance import ImpossibleError
from vsacli.studies.search.changed_motion import rate_of
from vsacli.studies.search.cutting_planes import (
    FACTOR_SEARCH_SAMPLES,
    RANGE_TOLERANCE,
    Required,
    first_accepted,
    scanned_numbers,
)
from vsacli.studies.search.loads import TaskSamples
from vsacli.studies.search.task import Combination, Task
from vsacli.trajectory.trajectory import Trajectory

FACTOR_DENOMINATOR = 10_000
"""Grid of the factors, in units of 1/FACTOR_DENOMINATOR, if recorded time stamps are uneven."""

INTEGER_TOLERANCE = 1e-9
"""Relative difference up to which a number of sampling intervals is an integer but for rounding."""

LARGEST_FACTOR = 1000
"""Largest factor that is tried; beyond it, wrong units in the trajectory are more likely."""

STRIDES = ((3.0, 0.01), (30.0, 0.05), (LARGEST_FACTOR, 0.2))
"""Pairs of a factor and the relative stride of the scan up to it: fine strides for small slow-downs."""

FACTORS_PER_REFINEMENT = 7
"""Number of factors that are tried at once between the neighbors of the best one."""

MAX_ROUNDS = 20
"""Limit on rounds that add samples refusing a combination that the few accept; two or three are usual."""

BRANCH_GAIN = 0.9
"""Share of a joint's size below which the other branch must bring it to be preferred."""


class Factors(NamedTuple):
    """The factors of slow-downs: those with an integer number of sampling intervals at the rate of the task.

    A controller has one rate; a motion of 577.74 of its periods would end between two of them.

    Attributes:
        denominator: sampling intervals of the task, not necessarily an integer; number n stands for the
            factor n/denominator.
    """

    denominator: float

    @classmethod
    def of(cls, trajectory: Trajectory) -> Factors:
        """Return the factors of a task."""
        rate = rate_of(trajectory)
        return cls(float(FACTOR_DENOMINATOR) if rate is None else trajectory.duration * rate)

    @property
    def first(self) -> int:
        """Number that stands for no slow-down."""
        return round(self.denominator) if self._has_integer_denominator else math.floor(self.denominator)

    @property
    def _has_integer_denominator(self) -> bool:
        return math.isclose(self.denominator, round(self.denominator), rel_tol=INTEGER_TOLERANCE)

    def factor(self, number: int) -> float:
        """Return the factor that a number stands for."""
        denominator = round(self.denominator) if self._has_integer_denominator else self.denominator
        return 1.0 if number == self.first else number / denominator

    def scanned(self) -> list[int]:
        """Return the numbers of the factors that a search tries first."""
        bounds = [self.first, *(math.floor(factor * self.denominator) for factor, _ in STRIDES)]
        pieces = zip(bounds, bounds[1:], STRIDES, strict=False)
        return sorted({n for low, high, (_, share) in pieces for n in scanned_numbers(low, high, share)})


Form = Callable[[Required], FloatArray]
"""Change of a joint's stiffness that margin, stiffness and deflection limits require, (factors, samples);
infinite where none suffices."""


def unchanged(required: Required) -> FloatArray:
    """Return an impossible change, since the stiffness is kept."""
    return np.full_like(required.asked, np.inf)


def constant_change(required: Required) -> FloatArray:
    """Return the smallest constant addition."""
    (low, high), commanded = required.admissible, required.asked
    min_change = np.max(low - commanded, axis=1, keepdims=True)
    max_change = np.min(high - commanded, axis=1, keepdims=True)
    possible = min_change <= max_change + RANGE_TOLERANCE * np.abs(commanded).max()
    return np.where(possible, np.clip(0.0, min_change, max_change), np.inf) + np.zeros_like(commanded)


def least_change(required: Required) -> FloatArray:
    """Return the smallest addition at each sample separately, a lower bound for every smooth profile."""
    (low, high), commanded = required.admissible, required.asked
    return np.where(low <= high, np.clip(0.0, low - commanded, high - commanded), np.inf)


class _Scan(NamedTuple):
    """Least changes at several factors.

    Attributes:
        factors: factors of the slow-down.
        joints: sizes of the changes of each joint that counts, (factors,), by its index and by branch; limits
            of motors add to them.
        sizes: sizes of the combinations, (factors,).
    """

    factors: tuple[float, ...]
    joints: Mapping[int, Mapping[str, FloatArray]]
    sizes: FloatArray


class CombinedSearch:
    """A search for the combination of changes that fixes a motion.

    Args:
        task: motion to fix, and acceptance rule.
        form: change of the stiffness of a joint.
        branches: whether joints may change to the other branch.
    """

    def __init__(self, task: Task, form: Form = constant_change, *, branches: bool = False) -> None:
        self._task, self._change_law, self._exchanges_branches = task, form, branches
        self._factors = Factors.of(task.trajectory)
        self._few_samples = task.few_samples

    @property
    def exchangeable(self) -> bool:
        """Whether the other branch of some joint makes a difference."""
        return any(len(choices) > 1 for choices in self._few_samples.branches)

    def smallest(self) -> Combination | None:
        """Return the combination of least size, confirmed at all samples if its changes are constants."""
        return self._confirmed(self._smallest)

    def fastest(self) -> Combination | None:
        """Return the combination with the least slow-down, confirmed in the same way."""
        return self._confirmed(self._fastest)

    def _confirmed(self, choose: Callable[[], Combination | None]) -> Combination | None:
        for _ in range(MAX_ROUNDS):
            combination = choose()
            refused_samples = (
                None
                if combination is None or self._change_law is least_change
                else self._refused_samples(combination)
            )
            if refused_samples is None:
                return combination
            self._few_samples = self._few_samples.with_further(refused_samples)
        return None

    def _refused_samples(self, combination: Combination) -> TaskSamples | None:
        """Return samples that refuse a combination, from the first block with any, as commanded."""
        factor, stiffness_change = combination.factor, np.zeros(self._task.trajectory.joints)
        stiffness_change[list(combination.constants)] = list(combination.constants.values())
        acceptance = self._task.acceptance_with(combination)
        for part in acceptance.parts(self._task.trajectory.stretched(factor), factor):
            refused_indices = np.flatnonzero(
                np.any(acceptance.refused(part.stiffened(stiffness_change)), axis=1)
            )
            if refused_indices.size:
                return part.select(
                    refused_indices[evenly(len(refused_indices), FACTOR_SEARCH_SAMPLES)]
                ).slowed(1 / factor)
        return None

    def _fastest(self) -> Combination | None:
        """Return the combination with the first factor that has one."""

        def accepts(numbers: Sequence[int]) -> Iterator[bool]:
            scan = self._scan(numbers)
            return (
                self._combination_at(scan, factor_index) is not None for factor_index in range(len(numbers))
            )

        number = first_accepted(accepts, self._factors.scanned())
        return None if number is None else self._combination_at(self._scan([number]), 0)

    def _smallest(self) -> Combination | None:
        """Return the combination of least size, by a scan, and ever finer ones around its best factor."""
        numbers = self._factors.scanned()
        while True:
            best_index, best = self._smallest_of_scan(self._scan(numbers))
            bracket = numbers[max(best_index - 1, 0) : best_index + 2]
            if best is None or bracket[-1] - bracket[0] < len(bracket):
                return best
            finer = np.linspace(bracket[0], bracket[-1], FACTORS_PER_REFINEMENT).round().astype(np.intp)
            numbers = np.union1d(finer, bracket).tolist()

    def _smallest_of_scan(self, scan: _Scan) -> tuple[int, Combination | None]:
        """Return the place of the smallest combination of a scan, and this combination.

        Sizes of a scan are lower bounds, without which fixes of a 3R with too low a stiffness take 4.4 times
        as long.
        """
        smallest, smallest_index = None, 0
        for index in np.argsort(scan.sizes, kind="stable").tolist():
            if smallest is not None and scan.sizes[index] >= smallest.size:
                break
            combination = self._combination_at(scan, index)
            if combination is not None and (smallest is None or combination.size < smallest.size):
                smallest, smallest_index = combination, index
        return smallest_index, smallest

    def _scan(self, numbers: Sequence[int]) -> _Scan:
        """Return the least changes at the factors of numbers."""
        factors = tuple(map(self._factors.factor, numbers))
        sizes_by_joint: dict[int, dict[str, FloatArray]] = {}
        squared_sizes = np.square(np.subtract(factors, 1))
        for index in self._task.acceptance.counted:
            sizes_by_joint[index] = {
                branch: self._least_sizes(index, self._few_samples.required(index, branch, factors))
                for branch in (self._few_samples.branches[index] if self._exchanges_branches else ("",))
            }
            squared_sizes += np.min([*sizes_by_joint[index].values()], axis=0) ** 2
        return _Scan(factors, sizes_by_joint, np.sqrt(squared_sizes))

    def _least_sizes(self, index: int, required: Required) -> FloatArray:
        return np.where(required.refused, self._task.relative_size(index, self._change_law(required)), 0.0)

    def _combination_at(self, scan: _Scan, factor_index: int) -> Combination | None:
        """Return the combination that the few samples accept at one of the factors, or None."""
        sizes, constants, branches = [scan.factors[factor_index] - 1], dict[int, float](), dict[int, str]()
        for index, sizes_by_branch in scan.joints.items() if scan.sizes[factor_index] < math.inf else ():
            best_size = math.inf
            for branch, min_sizes in sizes_by_branch.items():
                size, constant = self._joint_change(
                    index, branch, scan.factors, factor_index, float(min_sizes[factor_index])
                )
                if size < BRANCH_GAIN * best_size:
                    best_size, constants[index], branches[index] = size, constant, branch
                if not size:
                    break
            sizes.append(best_size)
            if best_size == math.inf:
                break
        size = math.hypot(*sizes)
        if not math.hypot(size, scan.sizes[factor_index]) < math.inf:
            return None
        constant_changes = {index: constant for index, constant in constants.items() if constant}
        exchanged_branches = {index: branch for index, branch in branches.items() if branch}
        return Combination(scan.factors[factor_index], constant_changes, exchanged_branches, size)

    def _joint_change(
        self, index: int, branch: str, factors: tuple[float, ...], factor_index: int, min_size: float
    ) -> tuple[float, float]:
        """Return size and constant of the change of a joint at one of the factors; infinite if impossible."""
        is_accepted = not self._few_samples.required(index, branch, factors).refused[factor_index]
        if min_size == math.inf or self._change_law is least_change or is_accepted:
            return min_size, 0.0
        constant = self._few_samples.constant(index, branch, factors, factor_index)
        return float(self._task.relative_size(index, np.array([constant]))), constant


def smallest_slow_down(task: Task) -> Combination:
    """Return the smallest slow-down, of position, stiffness and wrench together, that fixes a task alone.

    Raises:
        ImpossibleError: no factor is accepted; the error has the reason.
    """
    slow_down = CombinedSearch(task, unchanged).fastest()
    if slow_down is not None:
        return slow_down
    if reasons := task.acceptance.reasons(task.acceptance.watched_at_rest(task.trajectory)):
        raise ImpossibleError(f"even at rest, under gravity alone, {'; '.join(reasons)}")
    raise ImpossibleError(f"not even one by a factor {LARGEST_FACTOR} does")
