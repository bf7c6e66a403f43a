"""The stiffness profile of one joint that minimizes a cost along a fixed motion.

Cost and bounds are functions of the stiffness and its derivatives at each instant. An interior-point method
starts from several smooth profiles inside the attainable range and refines the best with finer splines, as
long as these lower the cost.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.motor import SHAFT
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
    ROUGH_GAP,
    SMOOTHINGS,
    Criterion,
    Scale,
    limit_bounds,
    limit_names,
    made_to_carry,
    rough_minima,
    smoothed_minimum,
    trapezoidal,
)
from vsacli.studies.search.interior_point import WARM_GAP, Minimum, minimize
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
        self.smoothings = SMOOTHINGS if _has_sharp_friction(joint) else criterion.smoothings
        self._speed = math.sqrt(float(np.mean(load.command.dq**2))) or 1.0
        self._smoothed: dict[float, tuple[Joint, Joint]] = {}
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
        plain, carrying = self._joints(self.scale.smoothing)
        commanded: dict[str, Any] = {**load.commanded, **dict(zip(STIFFNESS.names, rows, strict=True))}
        joint = carrying if isinstance(rows[0], Dual) else plain
        with np.errstate(all="ignore"):  # a step of the search may leave the attainable range
            return driven_by(joint, load._replace(commanded=commanded), MIN_MARGIN)

    def costs_of_constants(self, constants: FloatArray, instants: IndexArray) -> FloatArray:
        """Return the cost of each constant, (constants,); infinite if a motor exceeds a limit."""
        asked, still = np.repeat(constants, len(instants)), np.zeros(len(constants) * len(instants))
        driven = self.driven([asked, still, still], np.tile(instants, len(constants)))
        excess = np.max([still - 1, *limit_bounds(self._limits, driven, self._clearance)], axis=0)
        kept = np.all(excess.reshape(len(constants), -1) < 0, axis=1)
        time, costs = self.load.time[instants], np.full(len(constants), np.inf)
        for number in np.flatnonzero(kept).tolist():
            part = slice(number * len(instants), (number + 1) * len(instants))
            own = {name: variable[..., part] for name, variable in driven.items()}
            costs[number] = self.criterion.of(self.joint, own, time)
        return np.where(np.isnan(costs), np.inf, costs)

    def _joints(self, smoothing: float) -> tuple[Joint, Joint]:
        """Return the joint with its sharp friction smoothed, and a copy that carries derivatives."""
        if smoothing not in self._smoothed:
            width = smoothing * self._speed
            joint = _with_friction_of(self.joint, width) if _has_sharp_friction(self.joint) else self.joint
            carrying = made_to_carry(joint, STIFFNESS.orders, moving_corridor=False)
            self._smoothed[smoothing] = joint, carrying
        return self._smoothed[smoothing]


def _has_sharp_friction(joint: Joint) -> bool:
    return any(motor.friction is not None and motor.friction.sharp for motor in joint.actuator.motors)


def _with_friction_of(joint: Joint, width: float) -> Joint:
    """Return a joint whose motors' friction changes its sign over a width of their velocity at the joint.

    A sharp change would make a sum over instants jump wherever a motor stops at another one.
    """
    motors = []
    for motor in joint.actuator.motor:  # type: ignore[attr-defined]  # of all that have a stiffness to choose
        ratio = abs(motor.gear_ratio or 1.0) if motor.side == SHAFT else 1.0
        friction = motor.friction and replace(motor.friction, width=max(motor.friction.width, ratio * width))
        motors.append(replace(motor, friction=friction))
    return replace(joint, actuator=replace(joint.actuator, motor=tuple(motors)))  # type: ignore[call-arg]


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
    basis: FloatArray, time: FloatArray, target: FloatArray, admissible: Range
) -> FloatArray | None:
    """Return the coefficients of the admissible spline nearest to a target, (shapes,), or None.

    Args:
        basis: splines per unit of each coefficient, (instants, shapes).
        time: instants, (instants,) in s.
        target: target, (instants,).
        admissible: range in which the spline must lie at the instants.
    """
    size = float(np.median(admissible.low))
    clearance = np.minimum(INSIDE * size, (admissible.high - admissible.low) / 4)
    within = Range(admissible.low + clearance, admissible.high - clearance)
    fitted: FloatArray = np.linalg.lstsq(basis, np.clip(target, *within), rcond=None)[0]
    near = basis @ fitted
    if np.all((within.low < near) & (near < within.high)):
        return fitted
    group = Group(
        functions=_Distance(target, within, size),
        instants=np.arange(len(time)),
        basis=basis[None],
        unknowns=np.arange(basis.shape[1]),
        weights=trapezoidal(time)[None] / (time[-1] - time[0]),
        there=np.isfinite(np.stack(within)),
        scales=np.array([size]),
    )
    problem = SeparableProblem([group])
    start = interior(problem, fitted)
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

CLOSE_COST = 1e-2
"""Relative difference of costs with bounds at some instants up to which all bounds may change the order."""

MOST_ROUNDS = 12
"""Limit on rounds that add instants of violated bounds; one or two are usual, seven were needed once."""

SAME_LEVEL = 1e-5
"""Share of a level by which values may exceed it at some instants: a tenth of `SAME_COST`."""

GRID, SAME_CONSTANT = 33, 1e-6
"""Constants that are compared at once, and the relative width of their range at which the search ends."""

STIFFEST = 100.0
"""Largest constant that is tried, as a multiple of the smallest admissible one."""

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
    """A minimum among the splines of a space, the instants at which its bounds were kept, and its start."""

    space: SplineSpace
    minimum: Minimum
    instants: IndexArray
    start: FloatArray

    def reaches(self, other: _Attempt, share: float = SAME_COST) -> bool:
        """Return whether the cost is that of another attempt but for a share of it, or lower."""
        return self.minimum.cost <= other.minimum.cost + share * abs(other.minimum.cost)


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
        self._bases: dict[SplineSpace, FloatArray] = {}
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
        roughly = self._roughly(space, evenly(len(self._load.time), INSTANTS_PER_PIECE * pieces + 1), starts)
        for rough in self._in_order(roughly):
            levels = self._refined(rough, pieces)
            best = self._completed_one_of(levels)
            if best is not None:
                if len(self._whole.smoothings) > 1:  # the smoothed cost of finer splines may mislead
                    kept = [best, *filter(self._keeps_all, levels[:-1])]
                    best = min(kept, key=self._unsmoothed_cost)
                agreeing = sum(each.reaches(rough) and rough.reaches(each) for each in roughly)
                return self._profile(best, len(starts), agreeing)
        raise ImpossibleError(
            f"no profile that was tried keeps every limit of the motors of {self._joint.name}"
        )

    def best_constant(self) -> Profile | None:
        """Return the best constant as a profile; None if no constant keeps all bounds."""
        space, stiffness = SplineSpace.constant(self._span), self._whole.stiffness
        low = float(self._admissible.low.max()) + CLEARANCE * stiffness
        high = min(float(self._admissible.high.min()) - CLEARANCE * stiffness, STIFFEST * low)
        if low >= high:
            return None
        self._scale_by(space, np.array([low]))
        every = self._group(space, np.arange(len(self._load.time)))
        instants = evenly(len(self._load.time), INSTANTS_PER_PIECE * FIRST_PIECES + 1)
        for _ in range(MOST_ROUNDS):
            found = self._zoomed(low, high, instants)
            self._progress()
            if found is None:
                return None
            constant, cost = found
            unknowns = np.array([constant, cost / self._whole.scale.cost])[: 1 + self._criterion.levels]
            missed = np.setdiff1d(self._missed(every, unknowns), instants)
            if not missed.size:
                minimum = Minimum(unknowns, cost / self._whole.scale.cost, found=True)
                return self._profile(_Attempt(space, minimum, instants, unknowns[:1]), 1, 1)
            instants = np.union1d(instants, missed)
        return None

    def _zoomed(self, low: float, high: float, instants: IndexArray) -> tuple[float, float] | None:
        """Return the best constant between two and its cost, with bounds at some instants; None without any."""
        best, grid = None, np.geomspace(low, high, GRID)
        while best is None or grid[-1] - grid[0] > SAME_CONSTANT * best[0]:
            costs = self._whole.costs_of_constants(grid, instants)
            at = int(costs.argmin())
            if costs[at] == np.inf:
                return best
            if best is None or costs[at] <= best[1]:
                best = float(grid[at]), float(costs[at])
            grid = np.geomspace(grid[max(at - 1, 0)], grid[min(at + 1, GRID - 1)], GRID)
        return best

    def _roughly(
        self, space: SplineSpace, instants: IndexArray, starts: Sequence[FloatArray]
    ) -> list[_Attempt]:
        """Return the minima that starts lead to if bounds are kept at some instants only, best first."""
        every = self._group(space, np.arange(len(self._load.time)))
        problem = SeparableProblem([self._group(space, instants)])
        begun: list[tuple[FloatArray, FloatArray]] = []
        for start in starts:
            inside = self._with_level(every, start)
            unknowns = interior(problem, inside, inside)
            if unknowns is not None:
                begun.append((start, unknowns))
        found = rough_minima(problem, [unknowns for _, unknowns in begun], [self._whole])
        self._progress()
        attempts = [
            _Attempt(space, minimum, instants, start)
            for (start, _), minimum in zip(begun, found, strict=True)
        ]
        return sorted(attempts, key=lambda each: each.minimum.cost)

    def _keeps_all(self, attempt: _Attempt) -> bool:
        """Return whether an attempt keeps all bounds at all instants."""
        every = self._group(attempt.space, np.arange(len(self._load.time)))
        return not self._missed(every, attempt.minimum.unknowns).size

    def _unsmoothed_cost(self, attempt: _Attempt) -> float:
        """Return the cost over all instants without smoothing."""
        rows = self._basis(attempt.space) @ attempt.minimum.unknowns[: attempt.space.size]
        driven = self._whole.driven(rows, np.arange(len(self._load.time)))
        return self._criterion.of(self._joint, driven, self._load.time)

    def _in_order(self, roughly: Sequence[_Attempt]) -> Iterator[_Attempt]:
        """Yield different minima that keep bounds at some instants, the best with all bounds first.

        Bounds at further instants only raise a cost: a start that is worse without them is not completed.
        """
        different: list[_Attempt] = []
        for rough in roughly:
            if not any(rough.reaches(other) for other in different):
                different.append(rough)
        close = [each for each in different if each.reaches(different[0], CLOSE_COST)]
        if len(close) > 1:
            costs = [self._cost_with_all_bounds(each) for each in close]
            close = [close[index] for index in np.argsort(costs, kind="stable")]
        yield from close
        yield from different[len(close) :]

    def _cost_with_all_bounds(self, rough: _Attempt) -> float:
        found = self._completed(rough)
        return np.inf if found is None else found.minimum.cost

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
            basis = self._basis(space)[0, chosen]
            found = [nearest_profile(basis, time[chosen], target, admissible) for target in wanted]
            if starts := [amounts for amounts in found if amounts is not None]:
                return pieces, starts
        raise ImpossibleError(
            f"what {self._joint.name} may have is too narrow, or changes too fast, for a smooth profile"
        )

    def _basis(self, space: SplineSpace) -> FloatArray:
        """Return the shapes with two derivatives at all instants, (3, instants, shapes), computed once."""
        if space not in self._bases:
            self._bases[space] = space.basis(self._load.time, STIFFNESS.orders)
        return self._bases[space]

    def _fitted(self, space: SplineSpace, values: FloatArray) -> FloatArray:
        """Return the coefficients of the spline nearest to values at all instants, (shapes,)."""
        fitted: FloatArray = np.linalg.lstsq(self._basis(space)[0], values, rcond=None)[0]
        return fitted

    def _finer_than(self, pieces: int) -> Iterator[int]:
        """Yield numbers of pieces, each twice the previous one, up to the largest allowed."""
        while pieces < self._most:
            pieces = min(max(2 * pieces, 1), self._most)
            yield pieces

    def _scale_by(self, space: SplineSpace, amounts: FloatArray) -> None:
        """Scale the cost by the cost of a profile."""
        every = np.arange(len(self._load.time))
        driven = self._whole.driven(self._basis(space) @ amounts, every)
        size = self._criterion.size(self._joint, driven, self._load.time)
        self._whole.scale = Scale(size, self._span[1] - self._span[0], self._whole.smoothings[0])

    def _completed(self, attempt: _Attempt, *, accurate: bool = False) -> _Attempt | None:
        """Return an attempt that keeps all bounds at all instants, or None.

        Args:
            attempt: minimum with bounds at some instants, to which those where it violates bounds are added.
            accurate: whether the minimum is searched to the last barrier.
        """
        space, found, instants, start = attempt
        every = self._group(space, np.arange(len(self._load.time)))
        inside = self._with_level(every, start)
        searched = not accurate
        for _ in range(MOST_ROUNDS):
            missed, unknowns, gap = self._missed(every, found.unknowns), found.unknowns, ROUGH_GAP
            if searched and not missed.size:
                return _Attempt(space, found, instants, start)
            if missed.size:
                instants, gap = np.union1d(instants, missed), WARM_GAP
                unknowns = self._with_level(every, unknowns[: space.size])
            problem = SeparableProblem([self._group(space, instants)])
            begun = interior(problem, unknowns, inside) if missed.size else unknowns
            if begun is None:
                return None
            if accurate:
                found = smoothed_minimum(problem, begun, gap, [self._whole])
            else:
                (found,) = rough_minima(problem, [begun], [self._whole], gap)
            searched = True
            self._progress()
        return None

    def _completed_one_of(self, attempts: Sequence[_Attempt]) -> _Attempt | None:
        """Return the last attempt that keeps all bounds once they count, searched to the last barrier."""
        for attempt in reversed(attempts):
            rough = self._completed(attempt)
            if rough is not None:
                found = self._completed(rough, accurate=True)
                better = found is not None and (found.minimum.found or not rough.minimum.found)
                return found if better or found is not None and not rough.reaches(found) else rough
        return None

    def _group(self, space: SplineSpace, instants: IndexArray) -> Group:
        """Return cost and bounds at some instants as a group of the separable problem."""
        time = self._load.time[instants]
        basis, levels = self._basis(space)[:, instants], self._criterion.levels
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

    def _refined(self, coarse: _Attempt, pieces: int) -> list[_Attempt]:
        """Return the attempt, and those with finer pieces as long as these lower the cost.

        Bounds are kept at some instants, among them those at which the coarser splines violate them.
        """
        time, found = self._load.time, [coarse]
        inside = self._basis(coarse.space)[0] @ coarse.start
        for finer_pieces in self._finer_than(pieces):
            best, space = found[-1], self._space(finer_pieces)
            every = self._group(best.space, np.arange(len(time)))
            needed = np.union1d(best.instants, self._missed(every, best.minimum.unknowns))
            instants = np.union1d(evenly(len(time), INSTANTS_PER_PIECE * finer_pieces + 1), needed)
            finer = self._near(space, instants, best, self._fitted(space, inside))
            # of equal costs, that at more instants is the more accurate one
            if finer is None or not finer.reaches(best, WORTH_HALVING):
                break
            found.append(finer)
            gained = best.minimum.cost - finer.minimum.cost
            if gained + ROUGH_GAP <= WORTH_HALVING * abs(finer.minimum.cost):
                break
        return found

    def _near(
        self, space: SplineSpace, instants: IndexArray, coarse: _Attempt, start: FloatArray
    ) -> _Attempt | None:
        """Return a minimum among finer splines near one among coarser splines, or None."""
        every = self._group(space, np.arange(len(self._load.time)))
        problem = SeparableProblem([self._group(space, instants)])
        profile = self._basis(coarse.space)[0] @ coarse.minimum.unknowns[: coarse.space.size]
        near = self._with_level(every, self._fitted(space, profile))
        begun = interior(problem, near, self._with_level(every, start))
        if begun is None:
            return None
        (found,) = rough_minima(problem, [begun], [self._whole], WARM_GAP)
        self._progress()
        return _Attempt(space, found, instants, start)

    def _profile(self, attempt: _Attempt, starts: int, agreeing: int) -> Profile:
        amounts = attempt.minimum.unknowns[: attempt.space.size]
        rows = self._basis(attempt.space) @ amounts
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
