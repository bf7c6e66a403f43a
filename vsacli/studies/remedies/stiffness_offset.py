"""The smallest constant by which the stiffness of a joint must be shifted so that every step is accepted."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import IndexArray, evenly
from vsacli.robot.joint import Joint
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError, smallest_confirmed, stiffness_text
from vsacli.studies.remedies.admissible_stiffness import Load, checked_range

LARGEST_RATIO = 100
"""How many times stiffer or softer an offset may make a joint, where nothing else bounds it."""

WATCHED_STEPS = 1000
"""Steps that the scan looks at to begin with, and how many a refused confirmation may add."""

OFFSET_DIGITS = 4
"""Decimal places of an offset behind the leading digit of the stiffness: so what is printed was confirmed."""

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
    reason = acceptance.reason(joint, load.time, load.changed(nearest).command)
    with_it = f"with {nearest:+.6g}" if nearest else "as it is"
    raise ImpossibleError(f"none keeps every limit of {joint.name}; {with_it}, {reason}")


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
        number = smallest_confirmed(self, start, stop)
        return None if number is None else self.value(number)

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
        command = load.changed(self.value(number)).command
        return np.flatnonzero(self._acceptance.refused_commands(self._joint, command))
