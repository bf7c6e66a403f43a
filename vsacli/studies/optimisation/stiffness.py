"""The stiffness profile of one joint with which a cost is least, along a fixed motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.robot.joint import Joint
from vsacli.studies.optimisation.criteria import Criterion, Scale
from vsacli.studies.optimisation.fixed_motion import CLEARANCE, FixedMotion
from vsacli.studies.optimisation.interior_point import FIRST_GAP, WARM_GAP, Minimum
from vsacli.studies.optimisation.separable import Group, SeparableProblem, interior
from vsacli.studies.optimisation.smoothing import smoothed_minimum
from vsacli.studies.optimisation.spline_space import SplineSpace
from vsacli.studies.optimisation.starts import nearest_profile, targets
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.admissible_stiffness import Range, checked_range
from vsacli.studies.remedies.motions import Load
from vsacli.studies.remedies.nearest_spline import peaks

INSTANTS_PER_PIECE = 8
"""Instants of a piece of the spline at which the cost is summed up and bounds are kept."""

FIRST_PIECES = 12
"""Pieces of the splines with which several starts are tried."""

MOST_PIECES = 96
"""Pieces up to which they are halved, as long as that pays."""

WORTH_HALVING = 1e-3
"""Share of the cost by which halving the pieces must lower it to be done again."""

SAME_COST = 1e-4
"""Relative difference of costs up to which two starts came to the same optimum."""

MOST_ROUNDS = 12
"""Rounds of adding instants at which bounds are missed; one or two are usual, seven were needed."""

SAME_LEVEL = 1e-5
"""Share of a level by which what it bounds may exceed it at some instants: a tenth of `SAME_COST`."""

FIRST_LEVEL = 1.05
"""Multiple of what a level bounds, to begin with."""

ACTIVE = 1e-3
"""How near a bound, relative to it, a profile runs along it."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A stiffness over the instants of a load.

    Attributes:
        rows: stiffness, rate and second derivative at the instants of the load, (3, instants), N m/rad (N/m)
            per s^k.
        steps: which of these instants are steps.
        found: whether the conditions for a local optimum hold.
        starts: of how many different profiles the search began.
        agreeing: from how many of them it came to this optimum.
        bounding: share of the time at which each bound holds it back, by its name.
    """

    rows: FloatArray = field(repr=False)
    steps: IndexArray | slice = field(repr=False)
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, float]

    @property
    def at_steps(self) -> FloatArray:
        """The rows at the steps alone, (3, steps)."""
        return self.rows[:, self.steps]


Spaces = Callable[[tuple[float, float], int, FloatArray], SplineSpace]
"""The splines over a span of so many pieces, which begin and end at some of these times."""


class _Attempt(NamedTuple):
    """A minimum among the splines of a space, and the instants at which its bounds were kept."""

    space: SplineSpace
    minimum: Minimum
    instants: IndexArray

    def in_space(self, space: SplineSpace, time: FloatArray) -> FloatArray:
        """The same profile in another space, (shapes,)."""
        return space.fitted(time, self.space.basis(time, 1)[0] @ self.minimum.unknowns[: self.space.size])


class StiffnessSearch:
    """A search for the best stiffness profile of one joint.

    Args:
        acceptance: the rule for every step.
        joint: whose stiffness can be chosen.
        load: what it carries. Pieces of splines begin and end at its steps, so that the quintic between two
            steps with given derivatives, which a file describes, is the spline itself.
        criterion: what is minimised.
        spaces: among which splines is searched.
        seed: of the starts that are drawn.
        progress: called after each of its searches, about ten in all.

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
            raise ImpossibleError(f"corridor and limits leave {joint.name} no stiffness")
        self._joint, self._load, self._criterion = joint, load, criterion
        self._spaces, self._seed, self._progress = spaces, seed, progress
        self._span = float(load.time[0]), float(load.time[-1])
        self._steps = load.time[load.steps]
        self._most = min(MOST_PIECES, len(self._steps) - 1)
        self._whole = FixedMotion(joint, load, self._admissible, criterion, Scale(), acceptance.reserve)

    def best(self) -> Profile:
        """The best profile that is found from several starts.

        Raises:
            ImpossibleError: none was found.
        """
        pieces, starts = self._starts()
        space = self._space(pieces)
        self._scale_by(space, starts[0])
        kept: list[tuple[_Attempt, FloatArray]] = []
        for start in starts:
            # most starts come to the same optimum, where bounds are missed at the same instants
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
        """The best constant; None if no constant keeps all bounds."""
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
        """The pieces of splines of which some lie within what is admissible, and these."""
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
        """Numbers of pieces, each twice as large as the one before, up to the most that there may be."""
        while pieces < self._most:
            pieces = min(max(2 * pieces, 1), self._most)
            yield pieces

    def _scale_by(self, space: SplineSpace, amounts: FloatArray) -> None:
        """Scale the cost by that of a profile."""
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
        """Search from a start, with as many instants as it takes; None if nothing keeps all bounds.

        Args:
            space: of the splines.
            pieces: of each.
            start: amounts of the shapes, within what is admissible.
            nearby: a minimum among coarser splines, from which the search goes on.
            known: instants that another search took.
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
        """Cost and bounds at some instants."""
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
        """A start with a level that bounds what it shall, if there are any."""
        if not self._criterion.levels:
            return start
        driven = self._whole.driven((every.basis[:-1, :, :-1] @ start), every.instants)
        level = self._criterion.of(self._joint, driven, self._load.time) / self._whole.scale.cost
        return np.append(start, FIRST_LEVEL * level)

    def _missed(self, every: Group, unknowns: FloatArray) -> IndexArray:
        """The worst instant of each stretch at which any bound is missed."""
        missed = every.bounds(every.rows(unknowns)) - CLEARANCE
        missed[len(self._whole.bound_names) :] -= SAME_LEVEL
        return np.unique(np.concatenate([peaks(row) for row in missed]))

    def _refined(self, best: _Attempt, pieces: int, start: FloatArray) -> _Attempt:
        """The same with finer pieces, as long as these lower the cost."""
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
        """Share of the time during which the profile runs along a bound, by the name of the bound."""
        every = np.arange(len(self._load.time))
        _, bounds = self._whole((*rows, *[0.0 * rows[0]] * self._criterion.levels), every)
        shares = [float(np.mean(bound > -ACTIVE)) for bound in bounds]
        return {name: share for name, share in zip(self._whole.bound_names, shares, strict=False) if share}
