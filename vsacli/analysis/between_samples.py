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
    DECISIVE,
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

NEAR = 0.1
"""Relative clearance below which a minimum is searched for."""

MOST = 1000
"""Largest number of minima of one quantity that are refined; the lowest ones are always included."""

SCANNED = 500
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

    def where(self, chosen: BoolArray) -> Minima:
        """Return a selection of the minima."""
        return Minima(
            self.block.taken(chosen),
            self.variant[chosen],
            self.quantity[chosen],
            self.joint[chosen],
            self.clearance[chosen],
            self.step[chosen],
        )

    def mark(self, flags: FlagArray) -> None:
        """Set the flags of the minima in those of the samples, (samples, joints), at the nearest sample."""
        np.bitwise_or.at(flags, (self.step, self.joint), self.block.flags[:, 0])

    def of_joint(self, index: int) -> Block:
        """Return a joint's variables at its minima, in its column; the columns before are views of it."""
        at_minima = self.block.taken(self.joint == index)
        return at_minima.replaced(
            **{
                name: np.broadcast_to(array, (len(array), index + 1, *array.shape[2:]))
                for name, array in _joint_variables(at_minima).items()
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
        of_one = self.quantities[0]
        self.notes = () if trajectory.known_between else (SAMPLES_ONLY,)
        self._dynamics, self._samples, self._uncertainty = dynamics, trajectory.samples, uncertainty
        self._joints, self._variants = len(dynamics.robot.joints), len(dynamics.trajectories)
        self._joint = np.array([quantity.joint_index for quantity in of_one], dtype=np.intp)
        self._bits = np.array([quantity.bits for quantity in of_one], dtype=FLAG_TYPE)
        self._sides = Sides(self.quantities, min_margin)
        self._lowest = [np.empty(0)] * len(self._sides.quantity)
        self._least_at_steps = np.full(len(self._sides.quantity), np.inf)
        self._least_between: list[dict[int, tuple[float, Finding]]] = [{} for _ in range(self._variants)]
        self._pending_minima: list[Minima] = []
        self._released = 0
        looking = not self.notes and bool(of_one)
        self._scans = looking and trajectory.samples < SCANNED
        self._searches = looking and not self._scans
        self._sides_over_time: SampledFunctions | None = None
        self._searched_until = 0.0 if self._searches else math.inf

    def search_around(self, block: Block) -> None:
        """Look around each sample of the next block as computed, as far as the next sample is known."""
        if self._scans:
            self._scan(block)
            self._scans = False
        elif self._searches:
            steps = self._times_by_side(block.time), self._by_side(self._sides.values(block))
            before = self._sides_over_time
            self._sides_over_time = (
                SampledFunctions(0, *steps).opened() if before is None else before.last(2).followed_by(*steps)
            )
            ended = self._sides_over_time.stop == self._samples
            self._search(
                self._sides_over_time.closed() if ended else self._sides_over_time, self._sides_over_time
            )
            self._searched_until = math.inf if ended else self._sides_over_time.stop - 1

    def is_complete_for(self, samples: int) -> bool:
        """Return whether minima around this many further samples are known.

        The two samples after them must have been seen, since a minimum around the first of these two may be
        nearest to the last of the block.
        """
        return self._released + samples < self._searched_until

    def nearest(self, block: Block) -> list[Minima]:
        """Return the minima between samples that are nearest to those of the next block."""
        stop, nearest, later = self._released + len(block.time), [], []
        for minima in self._pending_minima:
            inside = minima.step < stop
            if inside.any():
                nearest.append(minima.where(inside)._replace(step=minima.step[inside] - self._released))
            if not inside.all():
                later.append(minima.where(~inside))
        self._pending_minima, self._released = later, stop
        return nearest

    def add(self, minima: Minima, variant: int = 0) -> None:
        """Merge minima of samples that are part of the run of a variant into its report."""
        least_between = self._least_between[variant]
        for number in set(minima.quantity.tolist()):
            of_quantity, quantity = minima.where(minima.quantity == number), self.quantities[variant][number]
            least = int(of_quantity.clearance.argmin())
            clearance = float(of_quantity.clearance[least])
            if clearance < least_between.get(number, (math.inf,))[0]:
                worst = quantity.at(of_quantity.of_joint(quantity.joint_index), least, between=True)
                least_between[number] = clearance, worst

    def reports(self, variant: int = 0) -> list[dict[str, Finding]]:
        """Return for each joint the clearances that are lower between the samples than at any of them."""
        reports: list[dict[str, Finding]] = [{} for _ in range(self._joints)]
        if not self._least_between[variant]:
            return reports
        at_steps, sides = np.full(len(self.quantities[0]), np.inf), self._sides
        of_variant = np.arange(sides.count) + variant * sides.count
        np.minimum.at(
            at_steps,
            sides.quantity[: sides.count],
            sides.clearance(of_variant, self._least_at_steps[of_variant]),
        )
        nearest_last = sorted(
            self._least_between[variant].items(), reverse=True, key=lambda entry: entry[1][0]
        )
        for number, (clearance, worst) in nearest_last:  # both motors have one kind: the lower one overwrites
            if clearance < at_steps[number]:
                reports[self._joint[number]][worst.kind] = worst
        return reports

    def _by_side(self, values: FloatArray) -> FloatArray:
        """Return values of sides at the samples of one variant after the other, (sides of all, samples)."""
        by_variant = values.reshape(self._sides.count, self._variants, -1)
        return by_variant.swapaxes(0, 1).reshape(len(self._sides.quantity), by_variant.shape[-1])

    def _times_by_side(self, time: FloatArray) -> FloatArray:
        """Return the times of samples for the sides of all variants, (sides of all, samples)."""
        return np.repeat(time.reshape(self._variants, -1), self._sides.count, axis=0)

    def _scan(self, block: Block) -> None:
        """Search whole runs of few samples, at the same number of times from each sample to the next."""
        steps, at_steps = self._of_whole_runs(block)
        per_interval = -(-SCANNED // (self._samples - 1))
        shares = np.arange(1, per_interval) / per_interval
        further = steps[:, :-1, None] + np.diff(steps)[..., None] * shares
        variant = np.repeat(np.arange(self._variants), further[0].size)
        between = self._by_side(self._values_at(further.ravel(), variant))
        time = self._times_by_side(_interleaved(steps, further.reshape(self._variants, -1)))
        sides = SampledFunctions(0, time, _interleaved(at_steps, between))
        self._search(sides.opened().closed(), SampledFunctions(0, self._times_by_side(steps), at_steps))

    def _of_whole_runs(self, first: Block) -> tuple[FloatArray, FloatArray]:
        """Return the times of all samples, (variants, samples), and the values of sides there.

        The first block has them all, unless blocks are shorter than a short run.
        """
        times, values = first.time, self._sides.values(first)
        if len(times) < self._samples * self._variants:
            times = self._dynamics.trajectories[0].times.block(0, self._samples)
            values = self._values_at(times, np.zeros(self._samples, dtype=np.intp))
        return times.reshape(self._variants, -1), self._by_side(values)

    def _values_at(self, time: FloatArray, variant: IndexArray) -> FloatArray:
        """Return the values of all sides of the variant of each time, (sides, times)."""
        return np.hstack([self._sides.values(part) for _, part in self._dynamics.blocks_at(time, variant)])

    def _search(self, sampled: SampledFunctions, steps: SampledFunctions) -> None:
        """Find the minima where values are known, and keep those lower than the samples around them.

        Of those that hardly differ from the samples, minima with a further flag that decides are kept.
        """
        self._least_at_steps = np.minimum(self._least_at_steps, steps.value.min(axis=1))
        sides = self._sides
        minima = narrow_brackets(
            self._select_candidates(find_brackets(sampled), steps), self._evaluate, sides.critical
        )
        side, time, value = minima.function, minima.time[:, 1], minima.value[:, 1]
        after = np.clip(steps.places(side, time), 1, steps.time.shape[-1] - 1)
        at_steps = np.minimum(*(steps.value[side, place] for place in (after - 1, after)))
        noise = MINIMUM_ACCURACY * np.abs(value - sides.critical[side]) + ROUNDING * sides.size[side]
        lower = value < at_steps - np.where(np.isfinite(value), noise, 0.0)
        kept = lower & (sides.clearance(side, value) <= NEAR)
        further = sides.beyond(side, value) & ~sides.beyond(side, at_steps)
        kept |= further[:, :DECISIVE].any(axis=1)
        if kept.any():
            before, behind = (steps.times(side, place) for place in (after - 1, after))
            nearest = after - (time - before < behind - time)
            self._add_minima(minima.where(kept), steps.first + nearest[kept])

    def _select_candidates(self, candidates: Brackets, steps: SampledFunctions) -> Brackets:
        """Return the brackets that may have the lowest minima of each side so far, between samples.

        A minimum is kept if it may have more flags than the middle time, or if it may be the lowest.
        """
        middle, side, sides = candidates.time[:, 1], candidates.function, self._sides
        place = np.clip(steps.places(side, middle), 0, steps.time.shape[-1] - 1)
        at_step = steps.times(side, place) == middle
        ahead = np.maximum(sides.next_flag_values(side, candidates.value[:, 1]), self._least_at_steps[side])
        with np.errstate(invalid="ignore"):  # inf - inf next to an infinite clearance
            fall = candidates.fall_bound
            expected = candidates.value[:, 1] - np.where(np.isfinite(fall), fall, 0.0)
        near = ~(expected > ahead) & ~(sides.clearance(side, expected) > NEAR)
        wanted = (candidates.unresolved(sides.critical) | ~at_step) & near
        candidates, expected = candidates.where(wanted), expected[wanted]
        chosen = np.zeros(len(candidates.function), dtype=bool)
        for number in set(candidates.function.tolist()):
            of_side = candidates.function == number
            self._lowest[number] = np.sort(np.append(self._lowest[number], expected[of_side]))[:MOST]
            chosen[of_side] = expected[of_side] <= self._lowest[number][-1]
        return candidates.where(chosen)

    def _add_minima(self, minima: Brackets, steps: IndexArray) -> None:
        """Keep the variables at minima, with the flags of the minimal quantities, for the nearest sample."""
        clearance = self._sides.clearance(minima.function, minima.value[:, 1])
        variants, quantities = np.divmod(self._sides.quantity[minima.function], len(self.quantities[0]))
        steps = steps + self._samples * variants
        for part, block in self._dynamics.blocks_at(minima.time[:, 1], variants):
            quantity = quantities[part]
            joint = self._joint[quantity]
            judged = block if self._uncertainty is None else self._uncertainty.judged(block)
            at_minima = np.arange(len(joint)), joint, np.newaxis
            variables = {name: array[at_minima] for name, array in _joint_variables(judged).items()}
            variables["flags"] &= self._bits[quantity, None]
            rows = variants[part], quantity, joint, clearance[part], steps[part]
            self._pending_minima.append(Minima(judged.replaced(**variables), *rows))

    def _evaluate(self, side: IndexArray, times: FloatArray) -> FloatArray:
        """Return the values of sides (n,) at times of their own, (n, times)."""
        variant, wanted = np.divmod(np.repeat(side, times.shape[1]), self._sides.count)
        parts = [
            self._sides.values(block)[wanted[part], np.arange(len(block.time))]
            for part, block in self._dynamics.blocks_at(times.ravel(), variant)
        ]
        return np.concatenate(parts).reshape(times.shape)


def _interleaved(at_steps: FloatArray, between: FloatArray) -> FloatArray:
    """Return values at steps, each followed by those between it and the next one, (rows, all)."""
    rows = len(at_steps)
    inside = between.reshape(rows, at_steps.shape[1] - 1, -1)
    ahead = np.concatenate((at_steps[:, :-1, None], inside), axis=2).reshape(rows, -1)
    return np.hstack((ahead, at_steps[:, -1:]))


def _joint_variables(block: Block) -> dict[str, AnyArray]:
    """Return the variables of joints, by name."""
    return {name: array for name, array in block.arrays().items() if "joint" in block.declared[name].dims}
