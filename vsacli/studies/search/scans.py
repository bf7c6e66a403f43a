"""The smallest accepted slow-down or stiffness offset, by scan and bisection.

Each candidate is an integer that stands for a value on a grid, so that the printed value is the confirmed
one. A scan checks some watched samples; a candidate that they accept is confirmed on all samples, and some of
the samples that refuse it are watched from then on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from vsacli.base.arrays import IndexArray, evenly
from vsacli.base.texts import significant
from vsacli.base.units import STIFFNESS
from vsacli.robot.joint import Joint
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, checked_range
from vsacli.studies.search.changed_motion import rate_of
from vsacli.studies.search.loads import Load, TaskSamples, concatenate_task_samples
from vsacli.trajectory.trajectory import Trajectory


class Candidates(Protocol):
    """Integers that stand for changes of growing size, checked at watched samples or at all."""

    def stride(self, number: int) -> int:
        """Return the step of the scan from a refused number, at least 1."""

    def accepts(self, number: int) -> bool:
        """Return whether the change is accepted at the watched samples."""

    def confirms(self, number: int) -> bool:
        """Return whether the change is accepted at all samples; watch some that refuse it from now on."""


def smallest_confirmed(candidates: Candidates, start: int, stop: int) -> int | None:
    """Return the smallest accepted number from `start` to `stop` that all samples confirm, or None."""
    number: int | None = start if start <= stop else None
    while number is not None:
        number = _smallest_accepted(candidates, number, stop)
        if number is not None and candidates.confirms(number):
            break
    return number


def _smallest_accepted(candidates: Candidates, start: int, stop: int) -> int | None:
    """Scan up in strides to the first accepted number, then bisect down to the last refused one.

    An accepted number between two refused strides can be missed.
    """
    refused, number = start - 1, start
    while not candidates.accepts(number):
        if number == stop:
            return None
        refused, number = number, min(number + candidates.stride(number), stop)
    while number - refused > 1:
        middle = (number + refused) // 2
        if candidates.accepts(middle):
            number = middle
        else:
            refused = middle
    return number


FACTOR_DENOMINATOR = 10_000
"""Grid of the factors, in units of 1/FACTOR_DENOMINATOR, if recorded time stamps are uneven."""

WHOLE = 1e-9
"""Relative difference up to which a number of sampling intervals is an integer but for rounding."""

LARGEST_FACTOR = 1000
"""Largest factor that is tried; beyond it, wrong units in the trajectory are more likely."""

WATCHED_STEPS = 1000
"""Samples that a scan watches at first, and the most that a refused confirmation adds."""

FIRST_STEPS = 20
"""Samples that are checked at many candidates before the scan, and as many that are refused even at rest."""

FACTORS_AT_ONCE = 64
"""Factors evaluated in one call."""


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
    def last(self) -> int:
        """Number of the largest factor."""
        return math.floor(LARGEST_FACTOR * self.denominator)

    @property
    def _whole(self) -> bool:
        return math.isclose(self.denominator, round(self.denominator), rel_tol=WHOLE)

    def factor(self, number: int) -> float:
        """Return the factor that a number stands for."""
        denominator = round(self.denominator) if self._whole else self.denominator
        return 1.0 if number == self.first else number / denominator


def smallest_slow_down(acceptance: Acceptance, trajectory: Trajectory) -> float:
    """Return the smallest factor by which position, stiffness and wrench must be stretched together in time.

    A scan upward in strides of 1 % is followed by bisection to adjacent numbers and by a check of all samples
    of the stretched trajectory.

    Args:
        acceptance: acceptance rule, which includes the robot.
        trajectory: trajectory with refused samples.

    Raises:
        ImpossibleError: no factor is accepted; the error has the reason.
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


def _scan_start(acceptance: Acceptance, few: TaskSamples, factors: Factors) -> int | None:
    """Return a number below which a scan finds one of a few samples refused; None if every number is refused.

    Many factors are evaluated in one call, which costs hardly more than a single one.
    """
    numbers = [factors.first]
    while numbers[-1] < factors.last:
        numbers.append(min(numbers[-1] + _stride(numbers[-1]), factors.last))
    for start in range(0, len(numbers), FACTORS_AT_ONCE):
        tried = numbers[start : start + FACTORS_AT_ONCE]
        refused = acceptance.refused(
            concatenate_task_samples(few.slowed(factors.factor(number)) for number in tried)
        )
        accepted = np.flatnonzero(~refused.reshape(len(tried), -1).any(axis=1))
        if accepted.size:
            return numbers[max(start + int(accepted[0]) - 1, 0)]
    return None


class SlowDownCandidates:
    """Stretching by the factors of a task; see `Candidates`."""

    def __init__(self, acceptance: Acceptance, trajectory: Trajectory, watched: TaskSamples) -> None:
        self._acceptance, self._trajectory, self._watched = acceptance, trajectory, watched
        self._factors = Factors.of(trajectory)

    def stride(self, number: int) -> int:
        """Return 1 % of the number."""
        return _stride(number)

    def accepts(self, number: int) -> bool:
        """See `Candidates.accepts`."""
        return not self._acceptance.refused(self._watched.slowed(self._factors.factor(number))).any()

    def confirms(self, number: int) -> bool:
        """See `Candidates.confirms`; the samples to watch come from the first block with refused ones."""
        factor = self._factors.factor(number)
        for part in self._acceptance.parts(self._trajectory.stretched(factor), factor):
            steps = np.flatnonzero(np.any(self._acceptance.refused(part), axis=1))
            if steps.size:
                further = part.select(steps[evenly(len(steps), WATCHED_STEPS)])
                self._watched = concatenate_task_samples([self._watched, further.slowed(1 / factor)])
                return False
        return True


def _stride(number: int) -> int:
    return math.ceil(number / 100)


LARGEST_RATIO = 100
"""Largest ratio by which an offset may change the stiffness of a joint if nothing else bounds it."""

OFFSETS_AT_ONCE = 64
"""Offsets evaluated in one call, which costs hardly more than a single one."""

FEWEST_STEPS = 5
"""Samples that are checked first at offsets far from the bound of the range."""

OFFSET_DIGITS = 4
"""Decimal places of an offset after the leading digit of the stiffness: the grid of printed values."""

ROUNDING = 1e-9
"""Relative increase of a stiffness that keeps its margin in spite of rounding."""

GRID_ROUNDING = 1e-6
"""Share of the grid spacing by which a bound may miss a number; far below the tolerance of any limit."""


def smallest_offset(acceptance: Acceptance, joint: Joint, load: Load) -> float:
    """Return the constant closest to zero that fixes a joint, N m/rad (N/m).

    The attainable range and the limits of stiffness and deflection bound it directly; for the limits of the
    motors a scan outward in strides of 1 % of the stiffness is followed by bisection.

    Args:
        acceptance: acceptance rule.
        joint: joint with at least one refused sample.
        load: load of the joint at all samples.

    Raises:
        ImpossibleError: no constant is accepted; the error has the reason.
    """
    low, high = _offset_bounds(acceptance, joint, load)
    raised = OffsetCandidates(acceptance, joint, load, sign=1).smallest(low, high)
    most = -low if raised is None else min(-low, raised)
    lowered = OffsetCandidates(acceptance, joint, load, sign=-1).smallest(-high, most)
    found = [offset for offset in (raised, lowered) if offset is not None]
    if found:
        return min(found, key=abs)
    nearest = min(max(low, 0.0), high)
    reason = acceptance.reason(joint, load.changed(nearest))
    with_it = f"with {nearest:+.6g}" if nearest else "as it is"
    raise ImpossibleError(f"none keeps every limit of {joint.name}; {with_it}, {reason}")


def lowest_offset(acceptance: Acceptance, joint: Joint, load: Load) -> float:
    """Return the constant that makes a joint as soft as load and stiffness limits admit, N m/rad (N/m).

    Raises:
        ImpossibleError: no stiffness fixes the joint.
    """
    asked = load.command.commanded["stiffness"]
    rise = checked_range(acceptance, joint, load).low - asked
    hardest = int(rise.argmax())
    return float(rise[hardest] + ROUNDING * (asked[hardest] + rise[hardest]))


def _offset_bounds(acceptance: Acceptance, joint: Joint, load: Load) -> tuple[float, float]:
    """Return the offsets that attainable range, stiffness limits and deflection limits admit."""
    admissible = checked_range(acceptance, joint, load)
    asked = load.command.commanded["stiffness"]
    rise, fall = admissible.low - asked, admissible.high - asked
    first, last = int(rise.argmax()), int(fall.argmin())
    if rise[first] > fall[last]:
        unit = STIFFNESS.unit(joint.type)
        raise ImpossibleError(
            f"none takes {joint.name} from {asked[first]:.6g} to at least "
            f"{significant(admissible.low[first], toward=math.inf)} {unit} at t = {load.time[first]:.3f} s "
            f"and from {asked[last]:.6g} to at most "
            f"{significant(admissible.high[last], toward=-math.inf)} {unit} at t = {load.time[last]:.3f} s"
        )
    return float(rise[first]), float(fall[last])


class OffsetCandidates:
    """Constants of one sign on a decimal grid; see `Candidates`."""

    def __init__(self, acceptance: Acceptance, joint: Joint, load: Load, sign: int) -> None:
        self._acceptance, self._joint, self._load, self._sign = acceptance, joint, load, sign
        self._softest = float(load.command.commanded["stiffness"].min())
        self._exponent = math.floor(math.log10(self._softest)) - OFFSET_DIGITS
        self._watched = evenly(len(load.time), WATCHED_STEPS)

    def value(self, number: int) -> float:
        """Return the constant that a number stands for: the double nearest to the decimal fraction."""
        return float(f"{self._sign * number}e{self._exponent}")

    def smallest(self, low: float, high: float) -> float | None:
        """Return the accepted constant closest to zero between two bounds on its size, or None."""
        unit = 10.0**self._exponent
        ratio = LARGEST_RATIO - 1 if self._sign > 0 else 1 - 1 / LARGEST_RATIO
        start = math.ceil(max(low, 0.0) / unit - GRID_ROUNDING)
        stop = math.floor(min(high, ratio * self._softest) / unit + GRID_ROUNDING)
        if start > stop:
            return None
        if self.confirms(start):  # mostly, since few motions come near the limits of the motors
            return self.value(start)
        near = self._scan_start(start, stop)
        number = None if near is None else smallest_confirmed(self, near, stop)
        return None if number is None else self.value(number)

    def _scan_start(self, start: int, stop: int) -> int | None:
        """Return a number below which a scan finds a watched sample refused; None if every number is refused.

        A few samples are checked first; watched ones that refuse a number which the few accept are added.
        """
        few = np.union1d(self._watched[evenly(len(self._watched), FIRST_STEPS)], self._hardest(start))
        numbers = list(self._strides(start, stop))
        first = 0
        while (first := self._first_accepted(numbers, first, few)) < len(numbers):
            refused = self._refused(self._load.at(self._watched), numbers[first])
            if not refused.size:
                return numbers[max(first - 1, 0)]
            few = np.union1d(few, self._watched[refused[evenly(len(refused), FIRST_STEPS)]])
        return None

    def _hardest(self, number: int) -> IndexArray:
        """Return at most `FIRST_STEPS` of the watched samples that refuse a number, by index."""
        refused = self._watched[self._refused(self._load.at(self._watched), number)]
        return refused[evenly(len(refused), FIRST_STEPS)]

    def _strides(self, start: int, stop: int) -> Iterator[int]:
        """Yield the numbers that the scan checks."""
        number = start
        while number < stop:
            yield number
            number += self.stride(number)
        if start <= stop:
            yield stop

    def _first_accepted(self, numbers: Sequence[int], first: int, steps: IndexArray) -> int:
        """Return the index, from `first` on, of a number that these samples accept, or len(numbers)."""
        near = np.arange(first, min(first + OFFSETS_AT_ONCE, len(numbers)))
        accepted = self._accepted(numbers, near, steps)
        far = np.arange(first + OFFSETS_AT_ONCE, len(numbers))
        if not accepted.size and far.size:  # mostly refused, too: a few samples tell
            far = self._accepted(numbers, far, steps[evenly(len(steps), FEWEST_STEPS)])
        for begin in range(0, len(far), OFFSETS_AT_ONCE):
            if accepted.size:
                break
            accepted = self._accepted(numbers, far[begin : begin + OFFSETS_AT_ONCE], steps)
        return int(accepted[0]) if accepted.size else len(numbers)

    def _accepted(self, numbers: Sequence[int], tried: IndexArray, steps: IndexArray) -> IndexArray:
        """Return the indices, among those tried, of the numbers that these samples accept."""
        load = self._load.at(np.tile(steps, len(tried)))
        values = np.repeat([self.value(numbers[index]) for index in tried], len(steps))
        refused = self._acceptance.refused_steps(self._joint, load.changed(values))
        return tried[~refused.reshape(len(tried), -1).any(axis=1)]

    def stride(self, number: int) -> int:
        """Return 1 % of the changed stiffness."""
        return math.ceil((self._softest / 10.0**self._exponent + max(self._sign * number, 0)) / 100)

    def accepts(self, number: int) -> bool:
        """See `Candidates.accepts`."""
        return not self._refused(self._load.at(self._watched), number).size

    def confirms(self, number: int) -> bool:
        """See `Candidates.confirms`."""
        refused = self._refused(self._load, number)
        self._watched = np.union1d(self._watched, refused[evenly(len(refused), WATCHED_STEPS)])
        return not refused.size

    def _refused(self, load: Load, number: int) -> IndexArray:
        changed = load.changed(self.value(number))
        return np.flatnonzero(self._acceptance.refused_steps(self._joint, changed))
