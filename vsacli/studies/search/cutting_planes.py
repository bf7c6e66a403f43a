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
from vsacli.studies.search.fixed_text import step_transitions
from vsacli.studies.search.loads import Instants, Load, TaskSamples, concatenate_task_samples
from vsacli.studies.search.path_commands import PathCommands, Speeds
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.curves.steps import PiecewiseProfile, profile_of_levels
from vsacli.trajectory.trajectory import Trajectory

FACTOR_SEARCH_SAMPLES = 100
"""Samples with which a search over slow-downs begins, and the most that a check at all samples adds."""

OFFSET_SEARCH_SAMPLES = 10
"""Samples of the same kind for a search over constants or transition times."""

RANGE_TOLERANCE = 1e-6
"""Relative difference up to which the ends of attainable ranges are equal but for rounding."""

REFINED_NUMBERS = 16
"""Number of integers that are tried at once between a refused and an accepted one."""

SCAN_STRIDE = 0.01
"""Relative stride of a scan."""

ROWS_AT_ONCE = 10_000
"""Samples evaluated in one call, which costs hardly more than that of a few. With one number a call, fixes of
motions with a motor that no constant helps took 4 to 25 times as long."""

MAX_STIFFNESS_RATIO = 100
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
        last_refused = numbers[0] - 1
        for number, accepted in zip(numbers, accepts(numbers), strict=False):
            if accepted:
                break
            last_refused = number
        else:
            return None
        if number - last_refused == 1:
            return number
        numbers = np.unique(np.linspace(last_refused + 1, number, REFINED_NUMBERS).astype(np.intp)).tolist()
    return None


def smallest_accepted(
    refuse: Callable[[Sequence[int], IndexArray], Iterator[BoolArray]], samples: int, numbers: Sequence[int]
) -> int | None:
    """Return the smallest number that all samples accept, or None.

    Args:
        refuse: yields masks of the samples with given indices that refuse some numbers, each (numbers,
            samples), together for all numbers in turn.
        samples: number of samples.
        numbers: ascending numbers to scan, see `first_accepted`.
    """
    few_indices = evenly(samples, OFFSET_SEARCH_SAMPLES)

    def accepts(tried: Sequence[int]) -> Iterator[bool]:
        for masks in refuse(tried, few_indices):
            yield from np.all(~masks, axis=1)

    while (number := first_accepted(accepts, numbers)) is not None:
        (refused,) = np.nonzero(next(refuse([number], np.arange(samples)))[0])
        if not refused.size:
            break
        few_indices = np.union1d(few_indices, refused[evenly(len(refused), OFFSET_SEARCH_SAMPLES)])
    return number


def scanned_numbers(first: int, last: int, share: float, base: float = 0.0) -> list[int]:
    """Return integers from the first to the last whose sums with a base differ by a share; or none."""
    if first > last:
        return []
    start, stop = abs(base + first), abs(base + last)
    exponents = np.arange(math.ceil(abs(math.log(stop / start)) / math.log1p(share)))
    scaled_numbers = start * (1 + share) ** (exponents if stop > start else -exponents)
    numbers = np.rint(np.abs(scaled_numbers - abs(base))).astype(np.intp)
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
    raised = _smallest_offset_of_sign(acceptance, joint, load, 1, (low, high))
    max_size = -low if raised is None else min(-low, raised)
    lowered = _smallest_offset_of_sign(acceptance, joint, load, -1, (-high, max_size))
    offsets = [offset for offset in (raised, lowered) if offset is not None]
    if offsets:
        return min(offsets, key=abs)
    nearest_offset = min(max(low, 0.0), high)
    reason = acceptance.reason(joint, load.changed(nearest_offset))
    offset_clause = f"with {nearest_offset:+.6g}" if nearest_offset else "as it is"
    raise ImpossibleError(f"none keeps every limit of {joint.name}; {offset_clause}, {reason}")


def lowest_offset(acceptance: Acceptance, joint: Joint, load: Load) -> float:
    """Return the constant that makes a joint as soft as load and stiffness limits admit, N m/rad (N/m).

    Raises:
        ImpossibleError: no stiffness fixes the joint.
    """
    commanded_stiffness = load.command.commanded["stiffness"]
    min_offset = checked_range(acceptance, joint, load).low - commanded_stiffness
    index = int(min_offset.argmax())
    return float(min_offset[index] + ROUNDING * (commanded_stiffness[index] + min_offset[index]))


def _offset_bounds(acceptance: Acceptance, joint: Joint, load: Load) -> tuple[float, float]:
    """Return the offsets that attainable range, stiffness limits and deflection limits admit."""
    admissible = checked_range(acceptance, joint, load)
    commanded_stiffness = load.command.commanded["stiffness"]
    min_offset, max_offset = admissible.low - commanded_stiffness, admissible.high - commanded_stiffness
    rise_index, fall_index = int(min_offset.argmax()), int(max_offset.argmin())
    if min_offset[rise_index] > max_offset[fall_index]:
        unit = units.STIFFNESS.unit(joint.type)
        raise ImpossibleError(
            f"none takes {joint.name} from {commanded_stiffness[rise_index]:.6g} to at least "
            f"{significant(admissible.low[rise_index], toward=math.inf)} {unit} at t = "
            f"{load.time[rise_index]:.3f} s and from {commanded_stiffness[fall_index]:.6g} to at most "
            f"{significant(admissible.high[fall_index], toward=-math.inf)} {unit} at t = "
            f"{load.time[fall_index]:.3f} s"
        )
    return float(min_offset[rise_index]), float(max_offset[fall_index])


def _smallest_offset_of_sign(
    acceptance: Acceptance, joint: Joint, load: Load, sign: int, bounds: tuple[float, float]
) -> float | None:
    """Return the accepted constant of a sign that is closest to zero, with bounds on its size; or None."""
    min_stiffness = float(load.command.commanded["stiffness"].min())
    exponent = math.floor(math.log10(min_stiffness)) - OFFSET_DIGITS
    unit, ratio = 10.0**exponent, MAX_STIFFNESS_RATIO - 1 if sign > 0 else 1 - 1 / MAX_STIFFNESS_RATIO

    def offset(number: int) -> float:
        return float(f"{sign * number}e{exponent}")  # nearest to the decimal fraction

    def refuse(numbers: Sequence[int], steps: IndexArray) -> Iterator[BoolArray]:
        numbers_at_once = max(1, ROWS_AT_ONCE // len(steps))
        for start in range(0, len(numbers), numbers_at_once):
            offsets = [offset(number) for number in numbers[start : start + numbers_at_once]]
            changed = load.at(np.tile(steps, len(offsets))).changed(np.repeat(offsets, len(steps)))
            yield acceptance.refused_steps(joint, changed).reshape(len(offsets), -1)

    first = math.ceil(max(bounds[0], 0.0) / unit - GRID_ROUNDING)
    last = math.floor(min(bounds[1], ratio * min_stiffness) / unit + GRID_ROUNDING)
    number = smallest_accepted(
        refuse, len(load.time), scanned_numbers(first, last, SCAN_STRIDE, sign * min_stiffness / unit)
    )
    return None if number is None else offset(number)


def transitions_between_levels(trajectory: Trajectory) -> list[RestToRest]:
    """Return the transitions between levels of the stiffness; none if it is another curve."""
    stiffness = trajectory.commanded[STIFFNESS.key]
    return (step_transitions(stiffness) or []) if isinstance(stiffness, PiecewiseProfile) else []


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
    next_starts = [*(change.span[0] for change in changes[1:]), trajectory.duration]
    min_length = min(change.span[1] - change.span[0] for change in changes)
    max_length = min(limit - change.span[0] for change, limit in zip(changes, next_starts, strict=True))
    exponent = math.floor(math.log10(min_length)) - TRANSITION_DIGITS
    first, last = (math.floor(end / 10.0**exponent * (1 + ROUNDING)) for end in (min_length, max_length))
    elapsed = trajectory.times.block(0, trajectory.samples) - trajectory.start
    instants = np.union1d(elapsed, acceptance.between)

    def length(number: int) -> float:
        return min(float(f"{number}e{exponent}"), max_length)

    def refuse(numbers: Sequence[int], places: IndexArray) -> Iterator[BoolArray]:
        for number in numbers:
            longer_transitions = _with_transitions(trajectory, changes, next_starts, length(number))
            samples = TaskSamples.between(longer_transitions, instants[places])
            yield np.any(acceptance.refused(samples), axis=1)[np.newaxis]

    number = smallest_accepted(refuse, len(instants), scanned_numbers(first + 1, last, SCAN_STRIDE))
    if number is None:
        raise ImpossibleError(f"none of up to {max_length:.4g} s does; then the next change begins")
    return min_length, length(number), _with_transitions(trajectory, changes, next_starts, length(number))


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
        all_samples = concatenate_task_samples([self.samples, samples])
        return FewSamples(self._acceptance, all_samples, self._impossible)

    @cached_property
    def branches(self) -> list[dict[str, Joint]]:
        """The joints by branch, "" for the unchanged one; the other branch only where it differs."""
        robot = self._acceptance.robot
        choices = [{"": joint} for joint in robot.joints]
        for index, (joint, load) in enumerate(zip(robot.joints, self._loads((1.0,)), strict=True)):
            branch = joint.actuator.opposite_branch
            if branch is not None:
                exchanged = robot.replace(branch_path(robot, index), branch).joints[index]
                if not _are_mirror_images(joint.actuator, exchanged.actuator, load.command):
                    choices[index][branch] = exchanged
        return choices

    def _loads(self, factors: tuple[float, ...]) -> list[Load]:
        """Return the load of each joint at all samples with the first factor, then with the next."""
        time, count = self.samples.motion.time, len(self.samples.motion.time)
        factor = np.repeat(factors, count)
        instants = Instants(np.tile(time, len(factors)), factor)
        commands = self._path.at(Speeds.uniform(factor), np.tile(np.arange(count), len(factors)))
        return [Load(instants.time, command, instants) for command in commands]

    def _compute_required(self, index: int, branch: str, factors: tuple[float, ...]) -> Required:
        """Return the stiffness that a joint on a branch requires."""
        joint = self.branches[index][branch] if branch else self._acceptance.robot.joints[index]
        load, factor_shape = self._loads(factors)[index], (len(factors), -1)
        asked = load.command.commanded.get(STIFFNESS.key, np.zeros_like(load.time))
        refused = np.any(self._acceptance.refused_steps(joint, load).reshape(factor_shape), axis=1)
        admissible = Range(*np.full((2, len(asked)), np.nan))
        if refused.any() and STIFFNESS.key in joint.actuator.commanded:
            admissible = admissible_stiffness(joint, load.command, self._acceptance.min_margin)
            admissible.low[self._acceptance.beyond_path(joint, load)] = np.nan
        ranges = Range(*(end.reshape(factor_shape) for end in admissible))
        return Required(joint, load, asked.reshape(factor_shape), refused, ranges)

    def constant(self, index: int, branch: str, factors: tuple[float, ...], factor_index: int) -> float:
        """Return the smallest constant that fixes a joint at one of the factors; infinite if none does."""
        key, count = (index, branch, factors[factor_index]), len(self.samples.factor)
        if key not in self._constants and key not in self._impossible:
            required = self.required(index, branch, factors)
            load = required.load.at(slice(factor_index * count, (factor_index + 1) * count))
            try:
                self._constants[key] = smallest_offset(self._acceptance, required.joint, load)
            except ImpossibleError:
                self._impossible.add(key)
        return self._constants.get(key, math.inf)


def _are_mirror_images(one: Actuator, other: Actuator, command: Command) -> bool:
    """Return whether the branches of an actuator are mirror images, as those of equal springs are."""
    if len(set(one.motors)) > 1 or len(set(one.max_deflections)) > 1:
        return False
    demand = command.tau_e, command.commanded["stiffness"], command.q
    solution, other_solution = one.solve(*demand), other.solve(*demand)
    range_ends = (solution.lower, other_solution.lower), (solution.upper, other_solution.upper)
    return all(
        np.allclose(value, other_value, rtol=RANGE_TOLERANCE, equal_nan=True)
        for value, other_value in range_ends
    )
