"""The stiffness profile of one joint that minimizes a cost along a fixed motion.

Cost and bounds are functions of the stiffness and its derivatives at each instant. An interior-point method
starts from several smooth profiles inside the attainable range and refines the best with finer splines, as
long as these lower the cost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.reach import OfJoint
from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.flags import MIN_MARGIN
from vsacli.base.signals import STIFFNESS
from vsacli.compute.duals import Dual
from vsacli.dynamics.drive import driven_by
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.joint import Joint
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, Range, checked_range
from vsacli.studies.search.criteria import (
    ENDS_OF_CORRIDOR,
    Criterion,
    Scale,
    limit_bounds,
    limit_names,
    made_to_carry,
    smoothed_minimum,
    trapezoidal,
)
from vsacli.studies.search.interior_point import FIRST_GAP, WARM_GAP, Minimum, minimize
from vsacli.studies.search.loads import Load
from vsacli.studies.search.separable import Group, SeparableProblem, interior, missed_instants
from vsacli.studies.search.splines import SplineSpace

CLEARANCE = 1e-6
"""Relative distance that a profile keeps from each bound, so that rounding does not cross it."""

OF_MOTORS = ("phi", "dtheta", "tau_motor", "current", "voltage")
"""Limited variables that depend on the stiffness."""


class FixedMotion:
    """The `Functions` of a stiffness and its first two derivatives, and of a level if the cost is one.

    Args:
        joint: joint whose stiffness varies.
        load: load of the joint at all instants.
        admissible: admissible stiffness at these instants.
        criterion: objective.
        scale: scale of the cost.
        reserve: required clearance to the limits of the motors, as a share of each.
    """

    def __init__(
        self,
        joint: Joint,
        load: Load,
        admissible: Range,
        criterion: Criterion,
        scale: Scale,
        reserve: float = 0.0,
    ) -> None:
        self.joint, self.load, self.admissible = joint, load, admissible
        self.criterion, self.scale, self._clearance = criterion, scale, CLEARANCE + reserve
        self.stiffness = float(np.median(load.command.commanded[STIFFNESS.key]))
        self._carrying = made_to_carry(joint, STIFFNESS.orders, moving_corridor=False)
        self._limits = [check for check in limit_checks(joint) if check.variable in OF_MOTORS]

    @property
    def bound_names(self) -> list[str]:
        """Names of the first bounds; the bounds after these belong to levels."""
        return [*ENDS_OF_CORRIDOR, *limit_names(self._limits)]

    @property
    def further_bounds(self) -> int:
        """Number of bounds after the two of the stiffness itself."""
        return len(self.bound_names) - 2 + self.criterion.bound_count(self.joint)

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Return integrands of the cost, and bounds; see `Functions`."""
        driven = self.driven(rows[: STIFFNESS.orders], instants)
        level = rows[STIFFNESS.orders] if self.criterion.levels else None
        asked = (self.joint, driven, level, self.scale)
        low, high = (row[instants] for row in self.admissible)
        size = self.stiffness
        bounds = [(low - rows[0]) / size + CLEARANCE, (rows[0] - high) / size + CLEARANCE]
        bounds += limit_bounds(self._limits, driven, self._clearance)
        return list(self.criterion.integrands(*asked)), [*bounds, *self.criterion.bounds(*asked)]

    def driven(self, rows: Sequence[Dual] | FloatArray, instants: IndexArray) -> OfJoint:
        """Return the variables of the motors for a stiffness and its derivatives."""
        load = self.load.at(instants).command
        commanded: dict[str, Any] = {**load.commanded, **dict(zip(STIFFNESS.names, rows, strict=True))}
        joint = self._carrying if isinstance(rows[0], Dual) else self.joint
        with np.errstate(all="ignore"):  # a step of the search may leave the attainable range
            return driven_by(joint, load._replace(commanded=commanded), MIN_MARGIN)


INSIDE = 1e-3
"""Relative distance that a start keeps from the ends of the admissible range, if possible."""

DRAWN, LEVELS = 2, 6
"""Number of random targets, and of the random levels that each of them interpolates."""


class _Distance:
    """The `Functions` of the squared distance from a target stiffness, within bounds."""

    def __init__(self, target: FloatArray, within: Range, size: float) -> None:
        self._target, self._within, self._size = target, within, size

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Dual | FloatArray], list[Dual | FloatArray]]:
        """Return the square of the distance, and the excess over the bounds."""
        low, high = (row[instants] for row in self._within)
        missed = (rows[0] - self._target[instants]) / self._size
        return [missed * missed], [(low - rows[0]) / self._size, (rows[0] - high) / self._size]


def targets(asked: FloatArray, admissible: Range, time: FloatArray, seed: int) -> Iterator[FloatArray]:
    """Yield targets for starts: the command, the lower end of the range, constants, random profiles."""
    highest = float(admissible.low.max())
    generator = np.random.default_rng(seed)
    yield asked
    yield 1.05 * admissible.low
    yield np.full_like(time, 1.05 * highest)
    yield np.full_like(time, 2 * highest)
    places = np.linspace(time[0], time[-1], LEVELS)
    for _ in range(DRAWN):
        yield admissible.low * np.interp(time, places, generator.uniform(1.0, 2.0, LEVELS))


def nearest_profile(
    space: SplineSpace, time: FloatArray, target: FloatArray, admissible: Range
) -> FloatArray | None:
    """Return the coefficients of the admissible spline nearest to a target, (shapes,), or None."""
    size = float(np.median(admissible.low))
    clearance = np.minimum(INSIDE * size, (admissible.high - admissible.low) / 4)
    within = Range(admissible.low + clearance, admissible.high - clearance)
    group = Group(
        functions=_Distance(target, within, size),
        instants=np.arange(len(time)),
        basis=space.basis(time, 1),
        unknowns=np.arange(space.size),
        weights=trapezoidal(time)[None] / (time[-1] - time[0]),
        there=np.isfinite(np.stack(within)),
        scales=np.array([size]),
    )
    problem = SeparableProblem([group])
    start = interior(problem, space.fitted(time, np.clip(target, *within)))
    return None if start is None else minimize(problem, start).unknowns


INSTANTS_PER_PIECE = 8
"""Instants per piece of the spline at which the cost is integrated and bounds are kept."""

FIRST_PIECES = 12
"""Pieces of the splines for the several starts."""

MOST_PIECES = 96
"""Largest number of pieces after repeated halving."""

WORTH_HALVING = 1e-3
"""Relative decrease of the cost by halving the pieces above which they are halved again."""

SAME_COST = 1e-4
"""Relative difference of costs up to which two starts reached the same optimum."""

MOST_ROUNDS = 12
"""Limit on rounds that add instants of violated bounds; one or two are usual, seven were needed once."""

SAME_LEVEL = 1e-5
"""Share of a level by which values may exceed it at some instants: a tenth of `SAME_COST`."""

FIRST_LEVEL = 1.05
"""Initial level, as a multiple of the largest value that it bounds."""

ACTIVE = 1e-3
"""Relative distance from a bound below which it is active."""


@dataclass(frozen=True, eq=False)
class Profile:
    """An optimized stiffness over the instants of a load.

    Attributes:
        rows: stiffness with its first two derivatives at the instants of the load, (3, instants),
            N m/rad (N/m) per s^k.
        steps: indices of the instants that are samples of the trajectory.
        found: whether the conditions for a local optimum hold.
        starts: number of starts of the search.
        agreeing: number of starts that reached this optimum.
        bounding: share of the time during which each bound is active, by name of the bound.
    """

    rows: FloatArray = field(repr=False)
    steps: IndexArray | slice = field(repr=False)
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, float]

    @property
    def at_steps(self) -> FloatArray:
        """Rows at the samples of the trajectory only, (3, samples)."""
        return self.rows[:, self.steps]


Spaces = Callable[[tuple[float, float], int, FloatArray], SplineSpace]
"""Function (span, number of pieces, times at which pieces may begin and end) that returns the splines."""


class _Attempt(NamedTuple):
    """A minimum among the splines of a space, and the instants at which its bounds were kept."""

    space: SplineSpace
    minimum: Minimum
    instants: IndexArray

    def in_space(self, space: SplineSpace, time: FloatArray) -> FloatArray:
        """Return the coefficients of the profile in another space, (shapes,)."""
        return space.fitted(time, self.space.basis(time, 1)[0] @ self.minimum.unknowns[: self.space.size])


class StiffnessSearch:
    """A search for the best stiffness profile of one joint.

    Args:
        acceptance: acceptance rule for every sample.
        joint: joint whose stiffness can be chosen.
        load: load of the joint. Pieces of splines begin and end at its samples, so that the spline is equal
            to the quintic by which a file with derivatives describes the time between two samples.
        criterion: objective.
        spaces: splines among which to search.
        seed: seed of the random starts.
        progress: function to call after each inner search, about ten in all.

    Raises:
        ImpossibleError: no stiffness keeps the margin and the limits of stiffness and deflection.
    """

    def __init__(
        self,
        acceptance: Acceptance,
        joint: Joint,
        load: Load,
        criterion: Criterion,
        spaces: Spaces,
        seed: int,
        progress: Callable[[], None],
    ) -> None:
        self._admissible = checked_range(acceptance, joint, load)
        if np.any(self._admissible.low > self._admissible.high):
            raise ImpossibleError(f"attainable range and limits leave {joint.name} no stiffness")
        self._joint, self._load, self._criterion = joint, load, criterion
        self._spaces, self._seed, self._progress = spaces, seed, progress
        self._span = float(load.time[0]), float(load.time[-1])
        self._steps = load.time[load.steps]
        self._most = min(MOST_PIECES, len(self._steps) - 1)
        self._whole = FixedMotion(joint, load, self._admissible, criterion, Scale(), acceptance.reserve)

    def best(self) -> Profile:
        """Return the best profile found from several starts.

        Raises:
            ImpossibleError: no profile was found.
        """
        pieces, starts = self._starts()
        space = self._space(pieces)
        self._scale_by(space, starts[0])
        kept: list[tuple[_Attempt, FloatArray]] = []
        for start in starts:
            # most starts reach the same optimum, where the same instants are needed to keep the bounds
            attempt = self._attempt(space, pieces, start, known=kept[-1][0].instants if kept else None)
            if attempt is not None:
                kept.append((attempt, start))
        if not kept:
            raise ImpossibleError(
                f"no profile that was tried keeps every limit of the motors of {self._joint.name}"
            )
        best, start = min(kept, key=lambda pair: pair[0].minimum.cost)
        least = best.minimum.cost
        agreeing = sum(attempt.minimum.cost <= least + SAME_COST * abs(least) for attempt, _ in kept)
        return self._profile(self._refined(best, pieces, start), len(starts), agreeing)

    def best_constant(self) -> Profile | None:
        """Return the best constant as a profile; None if no constant keeps all bounds."""
        space = SplineSpace.constant(self._span)
        start = nearest_profile(space, self._load.time, self._asked, self._admissible)
        if start is None:
            return None
        self._scale_by(space, start)
        found = self._attempt(space, FIRST_PIECES, start)
        return None if found is None else self._profile(found, 1, 1)

    @property
    def _asked(self) -> FloatArray:
        return self._load.command.commanded[STIFFNESS.key]

    def _space(self, pieces: int) -> SplineSpace:
        return self._spaces(self._span, pieces, self._steps)

    def _starts(self) -> tuple[int, list[FloatArray]]:
        """Return the smallest number of pieces with admissible splines, and such splines as starts."""
        time, coarsest = self._load.time, min(FIRST_PIECES, self._most)
        chosen = evenly(len(time), INSTANTS_PER_PIECE * MOST_PIECES)
        admissible = Range(*(row[chosen] for row in self._admissible))
        wanted = [target[chosen] for target in targets(self._asked, self._admissible, time, self._seed)]
        for pieces in self._finer_than(coarsest // 2):
            space = self._space(pieces)
            found = [nearest_profile(space, time[chosen], target, admissible) for target in wanted]
            if starts := [amounts for amounts in found if amounts is not None]:
                return pieces, starts
        raise ImpossibleError(
            f"what {self._joint.name} may have is too narrow, or changes too fast, for a smooth profile"
        )

    def _finer_than(self, pieces: int) -> Iterator[int]:
        """Yield numbers of pieces, each twice the previous one, up to the largest allowed."""
        while pieces < self._most:
            pieces = min(max(2 * pieces, 1), self._most)
            yield pieces

    def _scale_by(self, space: SplineSpace, amounts: FloatArray) -> None:
        """Scale the cost by the cost of a profile."""
        every = np.arange(len(self._load.time))
        driven = self._whole.driven(space.basis(self._load.time, STIFFNESS.orders) @ amounts, every)
        size = self._criterion.size(self._joint, driven, self._load.time)
        self._whole.scale = Scale(size, self._span[1] - self._span[0], self._criterion.smoothings[0])

    def _attempt(
        self,
        space: SplineSpace,
        pieces: int,
        start: FloatArray,
        nearby: _Attempt | None = None,
        known: IndexArray | None = None,
    ) -> _Attempt | None:
        """Search from a start, adding instants until all bounds are kept; return None if that fails.

        Args:
            space: space of the splines.
            pieces: number of pieces of a spline.
            start: coefficients of an admissible spline.
            nearby: minimum among coarser splines from which to continue.
            known: instants that another search needed.
        """
        instants = evenly(len(self._load.time), INSTANTS_PER_PIECE * pieces + 1)
        if known is not None:
            instants = np.union1d(instants, known)
        every = self._group(space, np.arange(len(self._load.time)))
        inside = unknowns = self._with_level(every, start)
        if nearby is not None:
            instants = np.union1d(instants, nearby.instants)
            unknowns = self._with_level(every, nearby.in_space(space, self._load.time))
        gap = FIRST_GAP if nearby is None else WARM_GAP
        for _ in range(MOST_ROUNDS):
            problem = SeparableProblem([self._group(space, instants)])
            begun = interior(problem, unknowns, inside)
            if begun is None:
                return None
            found, gap = smoothed_minimum(problem, begun, gap, [self._whole]), WARM_GAP
            self._progress()
            missed = self._missed(every, found.unknowns)
            if not missed.size:
                return _Attempt(space, found, instants)
            instants = np.union1d(instants, missed)
            unknowns = self._with_level(every, found.unknowns[: space.size])
        return None

    def _group(self, space: SplineSpace, instants: IndexArray) -> Group:
        """Return cost and bounds at some instants as a group of the separable problem."""
        time = self._load.time[instants]
        basis, levels = space.basis(time, STIFFNESS.orders), self._criterion.levels
        if levels:
            of_levels = np.zeros((levels, *basis.shape[1:]))
            alone = np.zeros((len(basis) + levels, len(time), levels))
            alone[len(basis) :] = np.eye(levels)[:, None]
            basis = np.concatenate([np.concatenate([basis, of_levels]), alone], axis=2)
        natural = self._whole.stiffness / (space.piece ** np.arange(STIFFNESS.orders))
        low, high = (row[instants] for row in self._admissible)
        further = np.ones((self._whole.further_bounds, len(time)), dtype=bool)
        return Group(
            functions=self._whole,
            instants=instants,
            basis=basis,
            unknowns=np.arange(basis.shape[2]),
            weights=self._criterion.weights(time),
            there=np.concatenate([np.isfinite([low, high]), further]),
            scales=np.append(natural, np.ones(levels)),
        )

    def _with_level(self, every: Group, start: FloatArray) -> FloatArray:
        """Return a start with a level appended that bounds its values, if the cost is a level."""
        if not self._criterion.levels:
            return start
        driven = self._whole.driven((every.basis[:-1, :, :-1] @ start), every.instants)
        level = self._criterion.of(self._joint, driven, self._load.time) / self._whole.scale.cost
        return np.append(start, FIRST_LEVEL * level)

    def _missed(self, every: Group, unknowns: FloatArray) -> IndexArray:
        """Return the instants to add because bounds are violated there."""
        missed = every.bounds(every.rows(unknowns)) - CLEARANCE
        missed[len(self._whole.bound_names) :] -= SAME_LEVEL
        return missed_instants(missed)

    def _refined(self, best: _Attempt, pieces: int, start: FloatArray) -> _Attempt:
        """Return the attempt refined with finer pieces, as long as these lower the cost."""
        coarse = best.space
        for finer_pieces in self._finer_than(pieces):
            space = self._space(finer_pieces)
            inside = space.fitted(self._load.time, coarse.basis(self._load.time, 1)[0] @ start)
            finer = self._attempt(space, finer_pieces, inside, best)
            if finer is None or finer.minimum.cost > best.minimum.cost:
                break
            gained, best = best.minimum.cost - finer.minimum.cost, finer
            if gained <= WORTH_HALVING * abs(best.minimum.cost):
                break
        return best

    def _profile(self, attempt: _Attempt, starts: int, agreeing: int) -> Profile:
        amounts = attempt.minimum.unknowns[: attempt.space.size]
        rows = attempt.space.basis(self._load.time, STIFFNESS.orders) @ amounts
        return Profile(
            rows=rows,
            steps=self._load.steps,
            found=attempt.minimum.found,
            starts=starts,
            agreeing=agreeing,
            bounding=self._bounding(rows),
        )

    def _bounding(self, rows: FloatArray) -> dict[str, float]:
        """Return the share of the time during which each bound is active, by name of the bound."""
        every = np.arange(len(self._load.time))
        _, bounds = self._whole((*rows, *[0.0 * rows[0]] * self._criterion.levels), every)
        shares = [float(np.mean(bound > -ACTIVE)) for bound in bounds]
        return {name: share for name, share in zip(self._whole.bound_names, shares, strict=False) if share}
