"""Minima of margins and of distances to limits between the samples of a run.

A run computes samples of a trajectory that is a function of time. Around each local minimum of a clearance
that may come near its bound, the inverse dynamics is computed at further times until the minimum is known.
The nearest sample receives the flags that hold there.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.analysis.minima import (
    DECISIVE_FLAGS,
    MINIMUM_ACCURACY,
    ROUNDING,
    Brackets,
    SampledFunctions,
    Sides,
    bounded_quantities,
    find_brackets,
    narrow_brackets,
)
from vsacli.base.arrays import FLAG_TYPE, AnyArray, BoolArray, FlagArray, FloatArray, IndexArray
from vsacli.base.variables import Block
from vsacli.dynamics.limits import Finding

if TYPE_CHECKING:
    from vsacli.analysis.run_dynamics import RunDynamics
    from vsacli.analysis.run_uncertainty import RunUncertainty

NEAR_CLEARANCE = 0.1
"""Relative clearance below which a minimum is searched for."""

MAX_MINIMA = 1000
"""Largest number of minima of one quantity that are refined; the lowest ones are always included."""

SCAN_TIMES = 500
"""Number of times at which a run with fewer samples is scanned, a third of those of its self-check: such
samples may be so coarse that none of them shows a minimum."""

SAMPLES_ONLY = "derivatives are given at the samples, so that what lies between the samples is not known"


class Minima(NamedTuple):
    """Minima between the samples of a block.

    Attributes:
        block: Variables of the minimum's own joint at each minimum, as of a robot with one joint; a row each.
        variant: Variant of the robot, by index.
        quantity: Quantity that has the minimum, by index in those of its variant.
        joint: Joint of the quantity, by index.
        clearance: Clearance at the minimum.
        step: Nearest sample, by index in the block.
    """

    block: Block
    variant: IndexArray
    quantity: IndexArray
    joint: IndexArray
    clearance: FloatArray
    step: IndexArray

    def where(self, mask: BoolArray) -> Minima:
        """Return a selection of the minima."""
        return Minima(
            self.block.taken(mask),
            self.variant[mask],
            self.quantity[mask],
            self.joint[mask],
            self.clearance[mask],
            self.step[mask],
        )

    def mark(self, flags: FlagArray) -> None:
        """Set the flags of the minima in those of the samples, (samples, joints), at the nearest sample."""
        np.bitwise_or.at(flags, (self.step, self.joint), self.block.flags[:, 0])

    def of_joint(self, index: int) -> Block:
        """Return a joint's variables at its minima, in its column; the columns before are views of it."""
        joint_minima = self.block.taken(self.joint == index)
        return joint_minima.replaced(
            **{
                name: np.broadcast_to(array, (len(array), index + 1, *array.shape[2:]))
                for name, array in _joint_variables(joint_minima).items()
            }
        )


class MinimaSearch:
    """A search for minima between the samples of the runs of a batch, while their blocks pass.

    Several runs pass in a single block, one after the other.

    Args:
        dynamics: Inverse dynamics along the trajectories.
        min_margin: Margin that is flagged.
        uncertainty: Uncertainty of recorded signals, which corrects flags of limits; None without any.

    Attributes:
        quantities: Quantities with bounds of each variant.
        notes: Reason why the search is impossible, if it is: a sentence.
    """

    def __init__(
        self, dynamics: RunDynamics, min_margin: float, uncertainty: RunUncertainty | None = None
    ) -> None:
        trajectory = dynamics.trajectories[0]
        self.quantities = [bounded_quantities(robot) for robot in dynamics.variants.robots]
        quantities = self.quantities[0]
        self.notes = () if trajectory.known_between else (SAMPLES_ONLY,)
        self._dynamics, self._sample_count, self._uncertainty = dynamics, trajectory.samples, uncertainty
        self._joint_count, self._variant_count = len(dynamics.robot.joints), len(dynamics.trajectories)
        self._joint_of_quantity = np.array([quantity.joint_index for quantity in quantities], dtype=np.intp)
        self._bits = np.array([quantity.bits for quantity in quantities], dtype=FLAG_TYPE)
        self._sides = Sides(self.quantities, min_margin)
        self._lowest = [np.empty(0)] * len(self._sides.quantity)
        self._lowest_at_samples = np.full(len(self._sides.quantity), np.inf)
        self._lowest_between: list[dict[int, tuple[float, Finding]]] = [
            {} for _ in range(self._variant_count)
        ]
        self._pending_minima: list[Minima] = []
        self._released = 0
        has_minima = not self.notes and bool(quantities)
        self._scans = has_minima and trajectory.samples < SCAN_TIMES
        self._searches = has_minima and not self._scans
        self._sides_over_time: SampledFunctions | None = None
        self._searched_until = 0.0 if self._searches else math.inf

    def search_around(self, block: Block) -> None:
        """Look around each sample of the next block as computed, as far as the next sample is known."""
        if self._scans:
            self._scan(block)
            self._scans = False
        elif self._searches:
            times_and_values = (
                self._times_by_side(block.time),
                self._values_by_side(self._sides.values(block)),
            )
            previous = self._sides_over_time
            self._sides_over_time = (
                SampledFunctions(0, *times_and_values).opened()
                if previous is None
                else previous.last(2).followed_by(*times_and_values)
            )
            is_last = self._sides_over_time.stop == self._sample_count
            self._search(
                self._sides_over_time.closed() if is_last else self._sides_over_time, self._sides_over_time
            )
            self._searched_until = math.inf if is_last else self._sides_over_time.stop - 1

    def is_complete_for(self, samples: int) -> bool:
        """Return whether minima around this many further samples are known.

        The two samples after them must have been seen, since a minimum around the first of these two may be
        nearest to the last of the block.
        """
        return self._released + samples < self._searched_until

    def nearest(self, block: Block) -> list[Minima]:
        """Return the minima between samples that are nearest to those of the next block."""
        next_released, nearest, remaining = self._released + len(block.time), [], []
        for minima in self._pending_minima:
            is_inside = minima.step < next_released
            if is_inside.any():
                nearest.append(minima.where(is_inside)._replace(step=minima.step[is_inside] - self._released))
            if not is_inside.all():
                remaining.append(minima.where(~is_inside))
        self._pending_minima, self._released = remaining, next_released
        return nearest

    def add(self, minima: Minima, variant: int = 0) -> None:
        """Merge minima of samples that are part of the run of a variant into its report."""
        least_between = self._lowest_between[variant]
        for quantity_index in set(minima.quantity.tolist()):
            quantity_minima, quantity = (
                minima.where(minima.quantity == quantity_index),
                self.quantities[variant][quantity_index],
            )
            lowest = int(quantity_minima.clearance.argmin())
            clearance = float(quantity_minima.clearance[lowest])
            if clearance < least_between.get(quantity_index, (math.inf,))[0]:
                worst = quantity.at(quantity_minima.of_joint(quantity.joint_index), lowest, between=True)
                least_between[quantity_index] = clearance, worst

    def reports(self, variant: int = 0) -> list[dict[str, Finding]]:
        """Return for each joint the clearances that are lower between the samples than at any of them."""
        reports: list[dict[str, Finding]] = [{} for _ in range(self._joint_count)]
        if not self._lowest_between[variant]:
            return reports
        sample_clearances, sides = np.full(len(self.quantities[0]), np.inf), self._sides
        variant_sides = np.arange(sides.count) + variant * sides.count
        np.minimum.at(
            sample_clearances,
            sides.quantity[: sides.count],
            sides.clearance(variant_sides, self._lowest_at_samples[variant_sides]),
        )
        ascending = sorted(self._lowest_between[variant].items(), reverse=True, key=lambda entry: entry[1][0])
        for quantity_index, (
            clearance,
            worst,
        ) in ascending:  # both motors have one kind: the lower one overwrites
            if clearance < sample_clearances[quantity_index]:
                reports[self._joint_of_quantity[quantity_index]][worst.kind] = worst
        return reports

    def _values_by_side(self, values: FloatArray) -> FloatArray:
        """Return values of sides at the samples of one variant after the other, (sides of all, samples)."""
        by_variant = values.reshape(self._sides.count, self._variant_count, -1)
        return by_variant.swapaxes(0, 1).reshape(len(self._sides.quantity), by_variant.shape[-1])

    def _times_by_side(self, time: FloatArray) -> FloatArray:
        """Return the times of samples for the sides of all variants, (sides of all, samples)."""
        return np.repeat(time.reshape(self._variant_count, -1), self._sides.count, axis=0)

    def _scan(self, block: Block) -> None:
        """Search whole runs of few samples, at the same number of times from each sample to the next."""
        sample_times, sample_values = self._whole_run_values(block)
        times_per_interval = -(-SCAN_TIMES // (self._sample_count - 1))
        fractions = np.arange(1, times_per_interval) / times_per_interval
        between_times = sample_times[:, :-1, None] + np.diff(sample_times)[..., None] * fractions
        variant = np.repeat(np.arange(self._variant_count), between_times[0].size)
        between_values = self._values_by_side(self._values_at(between_times.ravel(), variant))
        time = self._times_by_side(_interleaved(sample_times, between_times.reshape(self._variant_count, -1)))
        sides = SampledFunctions(0, time, _interleaved(sample_values, between_values))
        self._search(
            sides.opened().closed(), SampledFunctions(0, self._times_by_side(sample_times), sample_values)
        )

    def _whole_run_values(self, first: Block) -> tuple[FloatArray, FloatArray]:
        """Return the times of all samples, (variants, samples), and the values of sides there.

        The first block has them all, unless blocks are shorter than a short run.
        """
        times, values = first.time, self._sides.values(first)
        if len(times) < self._sample_count * self._variant_count:
            times = self._dynamics.trajectories[0].times.block(0, self._sample_count)
            values = self._values_at(times, np.zeros(self._sample_count, dtype=np.intp))
        return times.reshape(self._variant_count, -1), self._values_by_side(values)

    def _values_at(self, time: FloatArray, variant: IndexArray) -> FloatArray:
        """Return the values of all sides of the variant of each time, (sides, times)."""
        return np.hstack([self._sides.values(block) for _, block in self._dynamics.blocks_at(time, variant)])

    def _search(self, sampled: SampledFunctions, steps: SampledFunctions) -> None:
        """Find the minima where values are known, and keep those lower than the samples around them.

        Of those that hardly differ from the samples, minima with a further flag that decides are kept.
        """
        self._lowest_at_samples = np.minimum(self._lowest_at_samples, steps.value.min(axis=1))
        sides = self._sides
        minima = narrow_brackets(
            self._select_candidates(find_brackets(sampled), steps), self._evaluate, sides.critical
        )
        side, time, value = minima.function, minima.time[:, 1], minima.value[:, 1]
        next_index = np.clip(steps.indices_of(side, time), 1, steps.time.shape[-1] - 1)
        lower_neighbor = np.minimum(*(steps.value[side, index] for index in (next_index - 1, next_index)))
        tolerance = MINIMUM_ACCURACY * np.abs(value - sides.critical[side]) + ROUNDING * sides.size[side]
        is_lower = value < lower_neighbor - np.where(np.isfinite(value), tolerance, 0.0)
        is_kept = is_lower & (sides.clearance(side, value) <= NEAR_CLEARANCE)
        further_flags = sides.beyond(side, value) & ~sides.beyond(side, lower_neighbor)
        is_kept |= further_flags[:, :DECISIVE_FLAGS].any(axis=1)
        if is_kept.any():
            previous_time, next_time = (steps.times(side, index) for index in (next_index - 1, next_index))
            nearest_index = next_index - (time - previous_time < next_time - time)
            self._add_minima(minima.where(is_kept), steps.first + nearest_index[is_kept])

    def _select_candidates(self, candidates: Brackets, steps: SampledFunctions) -> Brackets:
        """Return the brackets that may have the lowest minima of each side so far, between samples.

        A minimum is kept if it may have more flags than the middle time, or if it may be the lowest.
        """
        middle_time, side, sides = candidates.time[:, 1], candidates.function, self._sides
        index = np.clip(steps.indices_of(side, middle_time), 0, steps.time.shape[-1] - 1)
        is_sample = steps.times(side, index) == middle_time
        threshold = np.maximum(
            sides.next_flag_values(side, candidates.value[:, 1]), self._lowest_at_samples[side]
        )
        with np.errstate(invalid="ignore"):  # inf - inf next to an infinite clearance
            fall_bound = candidates.fall_bound
            expected = candidates.value[:, 1] - np.where(np.isfinite(fall_bound), fall_bound, 0.0)
        is_near = ~(expected > threshold) & ~(sides.clearance(side, expected) > NEAR_CLEARANCE)
        is_wanted = (candidates.unresolved(sides.critical) | ~is_sample) & is_near
        candidates, expected = candidates.where(is_wanted), expected[is_wanted]
        is_selected = np.zeros(len(candidates.function), dtype=bool)
        for side_index in set(candidates.function.tolist()):
            on_side = candidates.function == side_index
            self._lowest[side_index] = np.sort(np.append(self._lowest[side_index], expected[on_side]))[
                :MAX_MINIMA
            ]
            is_selected[on_side] = expected[on_side] <= self._lowest[side_index][-1]
        return candidates.where(is_selected)

    def _add_minima(self, minima: Brackets, steps: IndexArray) -> None:
        """Keep the variables at minima, with the flags of the minimal quantities, for the nearest sample."""
        clearance = self._sides.clearance(minima.function, minima.value[:, 1])
        variants, quantities = np.divmod(self._sides.quantity[minima.function], len(self.quantities[0]))
        steps = steps + self._sample_count * variants
        for part, block in self._dynamics.blocks_at(minima.time[:, 1], variants):
            quantity = quantities[part]
            joint = self._joint_of_quantity[quantity]
            judged_block = block if self._uncertainty is None else self._uncertainty.judged(block)
            at_minima = np.arange(len(joint)), joint, np.newaxis
            variables = {name: array[at_minima] for name, array in _joint_variables(judged_block).items()}
            variables["flags"] &= self._bits[quantity, None]
            rows = variants[part], quantity, joint, clearance[part], steps[part]
            self._pending_minima.append(Minima(judged_block.replaced(**variables), *rows))

    def _evaluate(self, side: IndexArray, times: FloatArray) -> FloatArray:
        """Return the values of sides (n,) at times of their own, (n, times)."""
        variant, wanted_side = np.divmod(np.repeat(side, times.shape[1]), self._sides.count)
        values = [
            self._sides.values(block)[wanted_side[part], np.arange(len(block.time))]
            for part, block in self._dynamics.blocks_at(times.ravel(), variant)
        ]
        return np.concatenate(values).reshape(times.shape)


def _interleaved(sample_values: FloatArray, between_values: FloatArray) -> FloatArray:
    """Return values at steps, each followed by those between it and the next one, (rows, all)."""
    rows = len(sample_values)
    by_interval = between_values.reshape(rows, sample_values.shape[1] - 1, -1)
    all_but_last = np.concatenate((sample_values[:, :-1, None], by_interval), axis=2).reshape(rows, -1)
    return np.hstack((all_but_last, sample_values[:, -1:]))


def _joint_variables(block: Block) -> dict[str, AnyArray]:
    """Return the variables of joints, by name."""
    return {name: array for name, array in block.arrays().items() if "joint" in block.declared[name].dims}
