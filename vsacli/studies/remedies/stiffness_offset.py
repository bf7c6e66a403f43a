"""The smallest constant by which the stiffness of a joint must be shifted so that every step is accepted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import IndexArray, evenly
from vsacli.robot.joint import Joint
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError, smallest_confirmed, stiffness_text
from vsacli.studies.remedies.admissible_stiffness import checked_range
from vsacli.studies.remedies.motions import Load

LARGEST_RATIO = 100
"""How many times stiffer or softer an offset may make a joint, where nothing else bounds it."""

WATCHED_STEPS = 1000
"""Steps that the scan looks at to begin with, and how many a refused confirmation may add."""

FIRST_STEPS = 20
"""How many of them are tried at many offsets at once before the scan, and how many each look at all adds."""

OFFSETS_AT_ONCE = 64
"""Offsets that are tried at once: hardly dearer than one of them."""

OFFSET_DIGITS = 4
"""Decimal places of an offset behind the leading digit of the stiffness: so what is printed was confirmed."""

ROUNDING = 1e-9
"""Relative rise of a stiffness after which rounding leaves it no margin short."""

GRID_ROUNDING = 1e-6
"""By how much of its spacing a number may miss the grid; far less than any limit allows."""


def smallest_offset(acceptance: Acceptance, joint: Joint, load: Load) -> float:
    """The constant closest to zero that mends a joint, N m/rad (N/m).

    Where only the corridor and the limits of stiffness and deflection are at stake, its bounds are closed;
    for the limits of the motors it is a scan outward in steps of 1 % of the stiffness, then bisection.

    Args:
        acceptance: the rule.
        joint: the joint, at least one of whose steps is refused.
        load: its steps.

    Raises:
        ImpossibleError: with the reason.
    """
    low, high = _bounds(acceptance, joint, load)
    raised = OffsetCandidates(acceptance, joint, load, sign=1).smallest(low, high)
    lowered = OffsetCandidates(acceptance, joint, load, sign=-1).smallest(-high, -low)
    found = [offset for offset in (raised, lowered) if offset is not None]
    if found:
        return min(found, key=abs)
    nearest = min(max(low, 0.0), high)
    reason = acceptance.reason(joint, load.changed(nearest))
    with_it = f"with {nearest:+.6g}" if nearest else "as it is"
    raise ImpossibleError(f"none keeps every limit of {joint.name}; {with_it}, {reason}")


def lowest_offset(acceptance: Acceptance, joint: Joint, load: Load) -> float:
    """The constant with which a joint is as soft as its load and its limit of stiffness admit, N m/rad (N/m).

    Raises:
        ImpossibleError: no stiffness mends the joint.
    """
    asked = load.command.commanded["stiffness"]
    rise = checked_range(acceptance, joint, load).low - asked
    hardest = int(rise.argmax())
    return float(rise[hardest] + ROUNDING * (asked[hardest] + rise[hardest]))


def _bounds(acceptance: Acceptance, joint: Joint, load: Load) -> tuple[float, float]:
    """Smallest and largest offset that the corridor and the limits of stiffness and deflection admit."""
    admissible = checked_range(acceptance, joint, load)
    asked = load.command.commanded["stiffness"]
    rise, fall = admissible.low - asked, admissible.high - asked
    first, last = int(rise.argmax()), int(fall.argmin())
    if rise[first] > fall[last]:
        raise ImpossibleError(
            f"none takes {joint.name} from {asked[first]:.6g} to at least "
            f"{stiffness_text(joint, admissible.low[first])} at t = {load.time[first]:.3f} s "
            f"and from {asked[last]:.6g} to at most "
            f"{stiffness_text(joint, admissible.high[last])} at t = {load.time[last]:.3f} s"
        )
    return float(rise[first]), float(fall[last])


class OffsetCandidates:
    """Constants of one sign on a decimal grid, judged at watched steps; see `Candidates`."""

    def __init__(self, acceptance: Acceptance, joint: Joint, load: Load, sign: int) -> None:
        self._acceptance, self._joint, self._load, self._sign = acceptance, joint, load, sign
        self._softest = float(load.command.commanded["stiffness"].min())
        self._exponent = math.floor(math.log10(self._softest)) - OFFSET_DIGITS
        self._watched = evenly(len(load.time), WATCHED_STEPS)

    def value(self, number: int) -> float:
        """The constant that a number stands for: the double nearest to the decimal."""
        return float(f"{self._sign * number}e{self._exponent}")

    def smallest(self, low: float, high: float) -> float | None:
        """The constant closest to zero between two bounds on its size, or None."""
        unit = 10.0**self._exponent
        ratio = LARGEST_RATIO - 1 if self._sign > 0 else 1 - 1 / LARGEST_RATIO
        start = math.ceil(max(low, 0.0) / unit - GRID_ROUNDING)
        stop = math.floor(min(high, ratio * self._softest) / unit + GRID_ROUNDING)
        near = self._scan_start(start, stop)
        number = None if near is None else smallest_confirmed(self, near, stop)
        return None if number is None else self.value(number)

    def _scan_start(self, start: int, stop: int) -> int | None:
        """A number up to which the scan would find some watched step refused; None if it always would.

        Found by looking at a few steps, to which others are added as long as the watched ones refuse.
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
        """Some of the watched steps that refuse a number."""
        refused = self._watched[self._refused(self._load.at(self._watched), number)]
        return refused[evenly(len(refused), FIRST_STEPS)]

    def _strides(self, start: int, stop: int) -> Iterator[int]:
        """The numbers at which the scan looks."""
        number = start
        while number < stop:
            yield number
            number += self.stride(number)
        if start <= stop:
            yield stop

    def _first_accepted(self, numbers: Sequence[int], first: int, steps: IndexArray) -> int:
        """Index, from `first` on, of a number that these steps accept; that behind the last if none is."""
        for begin in range(first, len(numbers), OFFSETS_AT_ONCE):
            tried = numbers[begin : begin + OFFSETS_AT_ONCE]
            load = self._load.at(np.tile(steps, len(tried)))
            values = np.repeat([self.value(number) for number in tried], len(steps))
            refused = self._acceptance.refused_steps(self._joint, load.changed(values))
            accepted = np.flatnonzero(~refused.reshape(len(tried), -1).any(axis=1))
            if accepted.size:
                return begin + int(accepted[0])
        return len(numbers)

    def stride(self, number: int) -> int:
        """One percent of the stiffness."""
        return math.ceil((self._softest / 10.0**self._exponent + max(self._sign * number, 0)) / 100)

    def accepts(self, number: int) -> bool:
        """Whether every watched step is accepted."""
        return not self._refused(self._load.at(self._watched), number).size

    def confirms(self, number: int) -> bool:
        """Whether every step is accepted; steps that are not are watched from now on."""
        refused = self._refused(self._load, number)
        self._watched = np.union1d(self._watched, refused[evenly(len(refused), WATCHED_STEPS)])
        return not refused.size

    def _refused(self, load: Load, number: int) -> IndexArray:
        changed = load.changed(self.value(number))
        return np.flatnonzero(self._acceptance.refused_steps(self._joint, changed))
