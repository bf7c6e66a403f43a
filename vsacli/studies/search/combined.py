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
from vsacli.studies.search.cutting_planes import FEW, SAME_RANGE, Required, first_accepted, scanned_numbers
from vsacli.studies.search.loads import TaskSamples
from vsacli.studies.search.task import Combination, Task
from vsacli.trajectory.trajectory import Trajectory

FACTOR_DENOMINATOR = 10_000
"""Grid of the factors, in units of 1/FACTOR_DENOMINATOR, if recorded time stamps are uneven."""

WHOLE = 1e-9
"""Relative difference up to which a number of sampling intervals is an integer but for rounding."""

LARGEST_FACTOR = 1000
"""Largest factor that is tried; beyond it, wrong units in the trajectory are more likely."""

STRIDES = ((3.0, 0.01), (30.0, 0.05), (LARGEST_FACTOR, 0.2))
"""Pairs of a factor and the relative stride of the scan up to it: fine strides for small slow-downs."""

FINER = 7
"""Number of factors that are tried at once between the neighbors of the best one."""

MOST_ROUNDS = 20
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
        return round(self.denominator) if self._whole else math.floor(self.denominator)

    @property
    def _whole(self) -> bool:
        return math.isclose(self.denominator, round(self.denominator), rel_tol=WHOLE)

    def factor(self, number: int) -> float:
        """Return the factor that a number stands for."""
        denominator = round(self.denominator) if self._whole else self.denominator
        return 1.0 if number == self.first else number / denominator

    def scanned(self) -> list[int]:
        """Return the numbers of the factors that a search tries first."""
        ends = [self.first, *(math.floor(factor * self.denominator) for factor, _ in STRIDES)]
        pieces = zip(ends, ends[1:], STRIDES, strict=False)
        return sorted({n for low, high, (_, share) in pieces for n in scanned_numbers(low, high, share)})


Form = Callable[[Required], FloatArray]
"""Change of a joint's stiffness that margin, stiffness and deflection limits require, (factors, samples);
infinite where none suffices."""


def unchanged(required: Required) -> FloatArray:
    """Return an impossible change, since the stiffness is kept."""
    return np.full_like(required.asked, np.inf)


def constant_change(required: Required) -> FloatArray:
    """Return the smallest constant addition."""
    (low, high), asked = required.admissible, required.asked
    rise = np.max(low - asked, axis=1, keepdims=True)
    fall = np.min(high - asked, axis=1, keepdims=True)
    possible = rise <= fall + SAME_RANGE * np.abs(asked).max()
    return np.where(possible, np.clip(0.0, rise, fall), np.inf) + np.zeros_like(asked)


def least_change(required: Required) -> FloatArray:
    """Return the smallest addition at each sample separately, a lower bound for every smooth profile."""
    (low, high), asked = required.admissible, required.asked
    return np.where(low <= high, np.clip(0.0, low - asked, high - asked), np.inf)


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
        self._task, self._form, self._exchanging = task, form, branches
        self._factors = Factors.of(task.trajectory)
        self._few = task.few_samples

    @property
    def exchangeable(self) -> bool:
        """Whether the other branch of some joint makes a difference."""
        return any(len(choices) > 1 for choices in self._few.branches)

    def smallest(self) -> Combination | None:
        """Return the combination of least size, confirmed at all samples if its changes are constants."""
        return self._confirmed(self._smallest)

    def fastest(self) -> Combination | None:
        """Return the combination with the least slow-down, confirmed in the same way."""
        return self._confirmed(self._fastest)

    def _confirmed(self, choose: Callable[[], Combination | None]) -> Combination | None:
        for _ in range(MOST_ROUNDS):
            chosen = choose()
            refused = None if chosen is None or self._form is least_change else self._refused(chosen)
            if refused is None:
                return chosen
            self._few = self._few.with_further(refused)
        return None

    def _refused(self, combination: Combination) -> TaskSamples | None:
        """Return samples that refuse a combination, from the first block with any, as commanded."""
        factor, change = combination.factor, np.zeros(self._task.trajectory.joints)
        change[list(combination.constants)] = list(combination.constants.values())
        acceptance = self._task.acceptance_with(combination)
        for part in acceptance.parts(self._task.trajectory.stretched(factor), factor):
            steps = np.flatnonzero(np.any(acceptance.refused(part.stiffened(change)), axis=1))
            if steps.size:
                return part.select(steps[evenly(len(steps), FEW)]).slowed(1 / factor)
        return None

    def _fastest(self) -> Combination | None:
        """Return the combination with the first factor that has one."""

        def accepts(numbers: Sequence[int]) -> Iterator[bool]:
            scan = self._scan(numbers)
            return (self._at(scan, place) is not None for place in range(len(numbers)))

        number = first_accepted(accepts, self._factors.scanned())
        return None if number is None else self._at(self._scan([number]), 0)

    def _smallest(self) -> Combination | None:
        """Return the combination of least size, by a scan, and ever finer ones around its best factor."""
        numbers = self._factors.scanned()
        while True:
            place, best = self._best(self._scan(numbers))
            around = numbers[max(place - 1, 0) : place + 2]
            if best is None or around[-1] - around[0] < len(around):
                return best
            finer = np.linspace(around[0], around[-1], FINER).round().astype(np.intp)
            numbers = np.union1d(finer, around).tolist()

    def _best(self, scan: _Scan) -> tuple[int, Combination | None]:
        """Return the place of the smallest combination of a scan, and this combination.

        Sizes of a scan are lower bounds, without which fixes of a 3R with too low a stiffness take 4.4 times
        as long.
        """
        best, at = None, 0
        for place in np.argsort(scan.sizes, kind="stable").tolist():
            if best is not None and scan.sizes[place] >= best.size:
                break
            combination = self._at(scan, place)
            if combination is not None and (best is None or combination.size < best.size):
                best, at = combination, place
        return at, best

    def _scan(self, numbers: Sequence[int]) -> _Scan:
        """Return the least changes at the factors of numbers."""
        factors = tuple(map(self._factors.factor, numbers))
        joints: dict[int, dict[str, FloatArray]] = {}
        squares = np.square(np.subtract(factors, 1))
        for index in self._task.acceptance.counted:
            joints[index] = {
                branch: self._least_sizes(index, self._few.required(index, branch, factors))
                for branch in (self._few.branches[index] if self._exchanging else ("",))
            }
            squares += np.min([*joints[index].values()], axis=0) ** 2
        return _Scan(factors, joints, np.sqrt(squares))

    def _least_sizes(self, index: int, required: Required) -> FloatArray:
        return np.where(required.refused, self._task.relative_size(index, self._form(required)), 0.0)

    def _at(self, scan: _Scan, place: int) -> Combination | None:
        """Return the combination that the few samples accept at one of the factors, or None."""
        sizes, constants, branches = [scan.factors[place] - 1], dict[int, float](), dict[int, str]()
        for index, choices in scan.joints.items() if scan.sizes[place] < math.inf else ():
            best = math.inf
            for branch, least in choices.items():
                size, constant = self._change(index, branch, scan.factors, place, float(least[place]))
                if size < BRANCH_GAIN * best:
                    best, constants[index], branches[index] = size, constant, branch
                if not size:
                    break
            sizes.append(best)
            if best == math.inf:
                break
        size = math.hypot(*sizes)
        if not math.hypot(size, scan.sizes[place]) < math.inf:
            return None
        changed = {index: constant for index, constant in constants.items() if constant}
        exchanged = {index: branch for index, branch in branches.items() if branch}
        return Combination(scan.factors[place], changed, exchanged, size)

    def _change(
        self, index: int, branch: str, factors: tuple[float, ...], place: int, least: float
    ) -> tuple[float, float]:
        """Return size and constant of the change of a joint at one of the factors; infinite if impossible."""
        kept = not self._few.required(index, branch, factors).refused[place]
        if least == math.inf or self._form is least_change or kept:
            return least, 0.0
        constant = self._few.constant(index, branch, factors, place)
        return float(self._task.relative_size(index, np.array([constant]))), constant


def smallest_slow_down(task: Task) -> Combination:
    """Return the smallest slow-down, of position, stiffness and wrench together, that fixes a task alone.

    Raises:
        ImpossibleError: no factor is accepted; the error has the reason.
    """
    slower = CombinedSearch(task, unchanged).fastest()
    if slower is not None:
        return slower
    if reasons := task.acceptance.reasons(task.acceptance.watched_at_rest(task.trajectory)):
        raise ImpossibleError(f"even at rest, under gravity alone, {'; '.join(reasons)}")
    raise ImpossibleError(f"not even one by a factor {LARGEST_FACTOR} does")
