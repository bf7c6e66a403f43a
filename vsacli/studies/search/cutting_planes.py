"""Searches at few samples: what these require at many slow-downs, constants and transition times they accept.

The smallest change that few samples accept is checked at all samples, and some of those that refuse it join
the few, until none does. Numbers are integers that stand for values on a grid, so that the printed value is
the confirmed one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.transmission import Command
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import significant
from vsacli.robot.joint import Joint
from vsacli.studies.search.acceptance import (
    Acceptance,
    ImpossibleError,
    Range,
    admissible_stiffness,
    checked_range,
)
from vsacli.studies.search.changed_motion import with_stiffness
from vsacli.studies.search.fix_report import branch_path
from vsacli.studies.search.fixed_text import changes_of_steps
from vsacli.studies.search.loads import Instants, Load, TaskSamples, concatenate_task_samples
from vsacli.studies.search.path_commands import PathCommands, Speeds
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.curves.steps import PiecewiseProfile, profile_of_levels
from vsacli.trajectory.trajectory import Trajectory

FEW = 100
"""Samples with which a search over slow-downs begins, and the most that a check at all samples adds."""

FEWEST = 10
"""Samples of the same kind for a search over constants or transition times."""

SAME_RANGE = 1e-6
"""Relative difference up to which the ends of attainable ranges are equal but for rounding."""

SECTIONS = 16
"""Number of integers that are tried at once between a refused and an accepted one."""

SHARE = 0.01
"""Relative stride of a scan."""

LARGEST_RATIO = 100
"""Largest ratio by which an offset may change the stiffness of a joint if nothing else bounds it."""

OFFSET_DIGITS = 4
"""Decimal places of an offset after the leading digit of the stiffness: the grid of printed values."""

TRANSITION_DIGITS = 3
"""Decimal places of a transition after its leading digit: the grid of printed values."""

ROUNDING = 1e-9
"""Relative increase of a stiffness that keeps its margin, or of a time that is kept, in spite of rounding."""

GRID_ROUNDING = 1e-6
"""Share of the grid spacing by which a bound may miss a number; far below the tolerance of any limit."""


def first_accepted(accepts: Callable[[Sequence[int]], Iterable[bool]], numbers: Sequence[int]) -> int | None:
    """Return the first of ascending numbers that is accepted, then that of the integers just below; or None.

    An accepted integer between two refused numbers can be missed.

    Args:
        accepts: returns, for each number in turn, whether it is accepted.
        numbers: numbers to scan.
    """
    while numbers:
        refused = numbers[0] - 1
        for number, accepted in zip(numbers, accepts(numbers), strict=False):
            if accepted:
                break
            refused = number
        else:
            return None
        if number - refused == 1:
            return number
        numbers = np.unique(np.linspace(refused + 1, number, SECTIONS).astype(np.intp)).tolist()
    return None


def smallest_accepted(
    refuse: Callable[[int, IndexArray], BoolArray], samples: int, numbers: Sequence[int]
) -> int | None:
    """Return the smallest number that all samples accept, or None.

    Args:
        refuse: returns a mask of the samples with given indices that refuse a number.
        samples: number of samples.
        numbers: ascending numbers to scan, see `first_accepted`.
    """
    few = evenly(samples, FEWEST)

    def accepts(tried: Sequence[int]) -> Iterator[bool]:
        return (not refuse(number, few).any() for number in tried)

    while (number := first_accepted(accepts, numbers)) is not None:
        (refused,) = np.nonzero(refuse(number, np.arange(samples)))
        if not refused.size:
            break
        few = np.union1d(few, refused[evenly(len(refused), FEWEST)])
    return number


def scanned_numbers(first: int, last: int, share: float, base: float = 0.0) -> list[int]:
    """Return integers from the first to the last whose sums with a base differ by a share; or none."""
    if first > last:
        return []
    start, stop = abs(base + first), abs(base + last)
    steps = np.arange(math.ceil(abs(math.log(stop / start)) / math.log1p(share)))
    sums = start * (1 + share) ** (steps if stop > start else -steps)
    numbers = np.rint(np.abs(sums - abs(base))).astype(np.intp)
    return [int(number) for number in np.unique([first, *numbers, last])]


def smallest_offset(acceptance: Acceptance, joint: Joint, load: Load) -> float:
    """Return the constant closest to zero that fixes a joint, N m/rad (N/m).

    The attainable range and the limits of stiffness and deflection bound it directly; for the limits of the
    motors, constants are scanned outward in strides of 1 % of the stiffness.

    Args:
        acceptance: acceptance rule.
        joint: joint with at least one refused sample.
        load: load of the joint at all samples.

    Raises:
        ImpossibleError: no constant is accepted; the error has the reason.
    """
    low, high = _offset_bounds(acceptance, joint, load)
    raised = _smallest_of_sign(acceptance, joint, load, 1, (low, high))
    most = -low if raised is None else min(-low, raised)
    lowered = _smallest_of_sign(acceptance, joint, load, -1, (-high, most))
    offsets = [offset for offset in (raised, lowered) if offset is not None]
    if offsets:
        return min(offsets, key=abs)
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
        unit = units.STIFFNESS.unit(joint.type)
        raise ImpossibleError(
            f"none takes {joint.name} from {asked[first]:.6g} to at least "
            f"{significant(admissible.low[first], toward=math.inf)} {unit} at t = {load.time[first]:.3f} s "
            f"and from {asked[last]:.6g} to at most "
            f"{significant(admissible.high[last], toward=-math.inf)} {unit} at t = {load.time[last]:.3f} s"
        )
    return float(rise[first]), float(fall[last])


def _smallest_of_sign(
    acceptance: Acceptance, joint: Joint, load: Load, sign: int, bounds: tuple[float, float]
) -> float | None:
    """Return the accepted constant of a sign that is closest to zero, with bounds on its size; or None."""
    softest = float(load.command.commanded["stiffness"].min())
    exponent = math.floor(math.log10(softest)) - OFFSET_DIGITS
    unit, ratio = 10.0**exponent, LARGEST_RATIO - 1 if sign > 0 else 1 - 1 / LARGEST_RATIO

    def offset(number: int) -> float:
        return float(f"{sign * number}e{exponent}")  # nearest to the decimal fraction

    def refuse(number: int, steps: IndexArray) -> BoolArray:
        return acceptance.refused_steps(joint, load.at(steps).changed(offset(number)))

    first = math.ceil(max(bounds[0], 0.0) / unit - GRID_ROUNDING)
    last = math.floor(min(bounds[1], ratio * softest) / unit + GRID_ROUNDING)
    number = smallest_accepted(
        refuse, len(load.time), scanned_numbers(first, last, SHARE, sign * softest / unit)
    )
    return None if number is None else offset(number)


def transitions_between_levels(trajectory: Trajectory) -> list[RestToRest]:
    """Return the transitions between levels of the stiffness; none if it is another curve."""
    stiffness = trajectory.commanded[STIFFNESS.key]
    return (changes_of_steps(stiffness) or []) if isinstance(stiffness, PiecewiseProfile) else []


def smallest_transition(acceptance: Acceptance, trajectory: Trajectory) -> tuple[float, float, Trajectory]:
    """Return the commanded transition time, the shortest accepted longer one, s, and the trajectory with it.

    Each transition begins as commanded.

    Args:
        acceptance: acceptance rule, which includes the robot.
        trajectory: trajectory that has `transitions_between_levels`.

    Raises:
        ImpossibleError: no transition that ends before the next one begins is accepted.
    """
    changes = transitions_between_levels(trajectory)
    limits = [*(change.span[0] for change in changes[1:]), trajectory.duration]
    shortest = min(change.span[1] - change.span[0] for change in changes)
    longest = min(limit - change.span[0] for change, limit in zip(changes, limits, strict=True))
    exponent = math.floor(math.log10(shortest)) - TRANSITION_DIGITS
    first, last = (math.floor(end / 10.0**exponent * (1 + ROUNDING)) for end in (shortest, longest))
    elapsed = trajectory.times.block(0, trajectory.samples) - trajectory.start
    instants = np.union1d(elapsed, acceptance.between)

    def length(number: int) -> float:
        return min(float(f"{number}e{exponent}"), longest)

    def refuse(number: int, places: IndexArray) -> BoolArray:
        longer = _with_transitions(trajectory, changes, limits, length(number))
        refused: BoolArray = np.any(acceptance.refused(TaskSamples.between(longer, instants[places])), axis=1)
        return refused

    number = smallest_accepted(refuse, len(instants), scanned_numbers(first + 1, last, SHARE))
    if number is None:
        raise ImpossibleError(f"none of up to {longest:.4g} s does; then the next change begins")
    return shortest, length(number), _with_transitions(trajectory, changes, limits, length(number))


def _with_transitions(
    trajectory: Trajectory, changes: Sequence[RestToRest], limits: Sequence[float], length: float
) -> Trajectory:
    """Return the trajectory with transitions of a length, s; each ends at its limit at the latest."""
    levels = [changes[0].start, *(change.end for change in changes)]
    spans = [
        (change.span[0], min(change.span[0] + length, limit))
        for change, limit in zip(changes, limits, strict=True)
    ]
    profile = profile_of_levels(STIFFNESS, (0.0, trajectory.duration), changes[0].degree, levels, spans)
    return with_stiffness(trajectory, profile)


class Required(NamedTuple):
    """The stiffness that a joint requires at samples, slowed down by several factors.

    Attributes:
        joint: joint, perhaps on the other branch.
        load: load at all samples with the first factor, then with the next.
        asked: commanded stiffness, (factors, samples).
        refused: whether any sample is refused with this stiffness, (factors,).
        admissible: admissible stiffness, (factors, samples); none where the path is too fast.
    """

    joint: Joint
    load: Load
    asked: FloatArray
    refused: BoolArray
    admissible: Range


class FewSamples:
    """A few samples of a task, with the stiffness that they require at any factor of the slow-down.

    Args:
        acceptance: acceptance rule.
        samples: unchanged samples.
        impossible: joints by index, branch and factor that no constant fixes; also valid with further samples
            or a stricter rule. More are added. Without them, fixes take 2.1 times as long where motors
            have limits.

    Attributes:
        samples: unchanged samples.
        required: function `_compute_required` with its results, without which fixes of a 3R below its minimum
            stiffness take 1.2 times as long.
    """

    def __init__(
        self, acceptance: Acceptance, samples: TaskSamples, impossible: set[tuple[int, str, float]]
    ) -> None:
        self._acceptance, self.samples, self._impossible = acceptance, samples, impossible
        self._path = PathCommands(acceptance.robot, samples.motion)
        self.required = cache(self._compute_required)
        self._constants: dict[tuple[int, str, float], float] = {}

    def with_further(self, samples: TaskSamples) -> FewSamples:
        """Return these samples with further ones."""
        together = concatenate_task_samples([self.samples, samples])
        return FewSamples(self._acceptance, together, self._impossible)

    @cached_property
    def branches(self) -> list[dict[str, Joint]]:
        """The joints by branch, "" for the unchanged one; the other branch only where it differs."""
        robot = self._acceptance.robot
        choices = [{"": joint} for joint in robot.joints]
        for index, (joint, load) in enumerate(zip(robot.joints, self._loads((1.0,)), strict=True)):
            branch = joint.actuator.opposite_branch
            if branch is not None:
                exchanged = robot.replace(branch_path(robot, index), branch).joints[index]
                if not _mirror_images(joint.actuator, exchanged.actuator, load.command):
                    choices[index][branch] = exchanged
        return choices

    def _loads(self, factors: tuple[float, ...]) -> list[Load]:
        """Return the load of each joint at all samples with the first factor, then with the next."""
        time, count = self.samples.motion.time, len(self.samples.motion.time)
        factor = np.repeat(factors, count)
        instants = Instants(np.tile(time, len(factors)), factor)
        commands = self._path.at(Speeds.even(factor), np.tile(np.arange(count), len(factors)))
        return [Load(instants.time, command, instants) for command in commands]

    def _compute_required(self, index: int, branch: str, factors: tuple[float, ...]) -> Required:
        """Return the stiffness that a joint on a branch requires."""
        joint = self.branches[index][branch] if branch else self._acceptance.robot.joints[index]
        load, shape = self._loads(factors)[index], (len(factors), -1)
        asked = load.command.commanded.get(STIFFNESS.key, np.zeros_like(load.time))
        refused = np.any(self._acceptance.refused_steps(joint, load).reshape(shape), axis=1)
        admissible = Range(*np.full((2, len(asked)), np.nan))
        if refused.any() and STIFFNESS.key in joint.actuator.commanded:
            admissible = admissible_stiffness(joint, load.command, self._acceptance.min_margin)
            admissible.low[self._acceptance.beyond_path(joint, load)] = np.nan
        ranges = Range(*(end.reshape(shape) for end in admissible))
        return Required(joint, load, asked.reshape(shape), refused, ranges)

    def constant(self, index: int, branch: str, factors: tuple[float, ...], place: int) -> float:
        """Return the smallest constant that fixes a joint at one of the factors; infinite if none does."""
        key, count = (index, branch, factors[place]), len(self.samples.factor)
        if key not in self._constants and key not in self._impossible:
            required = self.required(index, branch, factors)
            load = required.load.at(slice(place * count, (place + 1) * count))
            try:
                self._constants[key] = smallest_offset(self._acceptance, required.joint, load)
            except ImpossibleError:
                self._impossible.add(key)
        return self._constants.get(key, math.inf)


def _mirror_images(one: Actuator, other: Actuator, command: Command) -> bool:
    """Return whether the branches of an actuator are mirror images, as those of equal springs are."""
    if len(set(one.motors)) > 1 or len(set(one.max_deflections)) > 1:
        return False
    asked = command.tau_e, command.commanded["stiffness"], command.q
    first, second = one.solve(*asked), other.solve(*asked)
    pairs = (first.lower, second.lower), (first.upper, second.upper)
    return all(np.allclose(here, there, rtol=SAME_RANGE, equal_nan=True) for here, there in pairs)
