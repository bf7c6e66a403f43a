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
        quantity: Quantity that has the minimum, by index in `MinimaSearch.quantities`.
        joint: Joint of the quantity, by index.
        clearance: Clearance at the minimum.
        step: Nearest sample, by index in the block.
    """

    block: Block
    quantity: IndexArray
    joint: IndexArray
    clearance: FloatArray
    step: IndexArray

    def where(self, chosen: BoolArray) -> Minima:
        """Return a selection of the minima."""
        return Minima(
            self.block.taken(chosen),
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
    """A search for minima between the samples of a run, while its blocks pass.

    Args:
        dynamics: Inverse dynamics along the trajectory of the run.
        min_margin: Margin that is flagged.
        uncertainty: Uncertainty of recorded signals, which corrects flags of limits; None without any.

    Attributes:
        quantities: Quantities with bounds.
        notes: Reason why the search is impossible, if it is: a sentence.
    """

    def __init__(
        self, dynamics: RunDynamics, min_margin: float, uncertainty: RunUncertainty | None = None
    ) -> None:
        trajectory = dynamics.trajectory
        self.quantities = bounded_quantities(dynamics.robot)
        self.notes = () if trajectory.known_between else (SAMPLES_ONLY,)
        self._dynamics, self._trajectory, self._uncertainty = dynamics, trajectory, uncertainty
        self._joints = len(dynamics.robot.joints)
        self._joint = np.array([quantity.joint_index for quantity in self.quantities], dtype=np.intp)
        self._bits = np.array([quantity.bits for quantity in self.quantities], dtype=FLAG_TYPE)
        self._sides = Sides(self.quantities, min_margin)
        self._lowest = [np.empty(0)] * len(self._sides.quantity)
        self._least_at_steps = np.full(len(self._sides.quantity), np.inf)
        self._least_between: dict[int, tuple[float, Finding]] = {}
        self._pending_minima: list[Minima] = []
        self._released = 0
        looking = not self.notes and bool(self.quantities)
        self._scans = looking and trajectory.samples < SCANNED
        self._searches = looking and not self._scans
        self._sides_over_time: SampledFunctions | None = None
        self._searched_until = 0.0 if self._searches else math.inf

    def search_around(self, block: Block) -> None:
        """Look around each sample of the next block as computed, as far as the next sample is known."""
        if self._scans:
            self._scan()
            self._scans = False
        elif self._searches:
            steps = block.time, self._sides.values(block)
            before = self._sides_over_time
            self._sides_over_time = (
                SampledFunctions(0, *steps).opened() if before is None else before.last(2).followed_by(*steps)
            )
            ended = self._sides_over_time.stop == self._trajectory.samples
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

    def add(self, minima: Minima) -> None:
        """Merge minima of samples that are part of the run into the report."""
        for number in set(minima.quantity.tolist()):
            of_quantity, quantity = minima.where(minima.quantity == number), self.quantities[number]
            least = int(of_quantity.clearance.argmin())
            clearance = float(of_quantity.clearance[least])
            if clearance < self._least_between.get(number, (math.inf,))[0]:
                worst = quantity.at(of_quantity.of_joint(quantity.joint_index), least, between=True)
                self._least_between[number] = clearance, worst

    def reports(self) -> list[dict[str, Finding]]:
        """Return for each joint the clearances that are lower between the samples than at any of them."""
        reports: list[dict[str, Finding]] = [{} for _ in range(self._joints)]
        at_steps, sides = np.full(len(self.quantities), np.inf), self._sides
        every = np.arange(len(sides.quantity))
        np.minimum.at(at_steps, sides.quantity, sides.clearance(every, self._least_at_steps))
        nearest_last = sorted(self._least_between.items(), reverse=True, key=lambda entry: entry[1][0])
        for number, (clearance, worst) in nearest_last:  # both motors have one kind: the lower one overwrites
            if clearance < at_steps[number]:
                reports[self._joint[number]][worst.kind] = worst
        return reports

    def _scan(self) -> None:
        """Search a whole run of few samples, at the same number of times from each sample to the next."""
        steps = self._trajectory.times.block(0, self._trajectory.samples)
        per_interval = -(-SCANNED // (len(steps) - 1))
        time = np.append(
            steps[:-1, None] + np.diff(steps)[:, None] * np.arange(per_interval) / per_interval, steps[-1]
        )
        values = [self._sides.values(block) for _, block in self._dynamics.blocks_at(time)]
        sides = SampledFunctions(0, time, np.hstack(values))
        self._search(sides.opened().closed(), SampledFunctions(0, steps, sides.value[:, ::per_interval]))

    def _search(self, sampled: SampledFunctions, steps: SampledFunctions) -> None:
        """Find the minima where values are known, and keep those lower than the samples around them.

        Of those that hardly differ from the samples, minima with a further flag that decides are kept.
        """
        self._least_at_steps = np.minimum(self._least_at_steps, steps.value.min(axis=1))
        sides = self._sides
        minima = narrow_brackets(
            self._select_candidates(find_brackets(sampled), steps.time), self._evaluate, sides.critical
        )
        side, time, value = minima.function, minima.time[:, 1], minima.value[:, 1]
        after = np.clip(np.searchsorted(steps.time, time), 1, len(steps.time) - 1)
        at_steps = np.minimum(*(steps.value[side, place] for place in (after - 1, after)))
        noise = MINIMUM_ACCURACY * np.abs(value - sides.critical[side]) + ROUNDING * sides.size[side]
        lower = value < at_steps - np.where(np.isfinite(value), noise, 0.0)
        kept = lower & (sides.clearance(side, value) <= NEAR)
        further = sides.beyond(side, value) & ~sides.beyond(side, at_steps)
        kept |= further[:, :DECISIVE].any(axis=1)
        if kept.any():
            nearest = after - (time - steps.time[after - 1] < steps.time[after] - time)
            self._add_minima(minima.where(kept), steps.first + nearest[kept])

    def _select_candidates(self, candidates: Brackets, steps: FloatArray) -> Brackets:
        """Return the brackets that may have the lowest minima of each side so far, between samples.

        A minimum is kept if it may have more flags than the middle time, or if it may be the lowest.
        """
        middle, side, sides = candidates.time[:, 1], candidates.function, self._sides
        at_step = steps[np.clip(np.searchsorted(steps, middle), 0, len(steps) - 1)] == middle
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
        for part, block in self._dynamics.blocks_at(minima.time[:, 1]):
            quantity = self._sides.quantity[minima.function[part]]
            joint = self._joint[quantity]
            judged = block if self._uncertainty is None else self._uncertainty.judged(block)
            at_minima = np.arange(len(joint)), joint, np.newaxis
            variables = {name: array[at_minima] for name, array in _joint_variables(judged).items()}
            variables["flags"] &= self._bits[quantity, None]
            rows = quantity, joint, clearance[part], steps[part]
            self._pending_minima.append(Minima(judged.replaced(**variables), *rows))

    def _evaluate(self, side: IndexArray, times: FloatArray) -> FloatArray:
        """Return the values of sides (n,) at times of their own, (n, times)."""
        wanted = np.repeat(side, times.shape[1])
        parts = [
            self._sides.values(block)[wanted[part], np.arange(len(block.time))]
            for part, block in self._dynamics.blocks_at(times.ravel())
        ]
        return np.concatenate(parts).reshape(times.shape)


def _joint_variables(block: Block) -> dict[str, AnyArray]:
    """Return the variables of joints, by name."""
    return {name: array for name, array in block.arrays().items() if "joint" in block.declared[name].dims}
