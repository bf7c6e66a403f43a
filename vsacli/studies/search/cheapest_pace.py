"""Search for the timing of least cost at the commanded duration, with the stiffness if it varies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.search.criteria import rough_minima, smoothed_minimum
from vsacli.studies.search.interior_point import WARM_GAP, Minimum
from vsacli.studies.search.loads import Ends
from vsacli.studies.search.paced_motion import (
    CLEARANCE,
    PacedJoint,
    PacedMotion,
)
from vsacli.studies.search.paced_search import PacedSearch, Start
from vsacli.studies.search.separable import Group, SeparableProblem
from vsacli.studies.search.splines import PacedSpaces, Pacing

STIFFER = 1.0, 1.5, 2.0
"""Multiples of the first stiffness for further starts."""

DRAWN_PACES = 0.6, 1.6
"""Range of the random paces before they are scaled to the duration."""

LIFTED = 1.1
"""Factor on a stiffness from which a search starts: from an end of the attainable range, where the optimum
often is, a pendulum required more than 200 Newton steps, and from here 50."""

FIRST_LEVEL = 1.05
"""Initial level, as a multiple of the largest value that it bounds."""


class CheapestPaceSearch(PacedSearch):
    """A search for the timing of least cost at the commanded duration.

    Args:
        motion: motion along the path.
        joints: cost and bounds of each joint.
        varied: indices of the joints whose stiffness varies as well.
        ends: ends of the motion.
        seed: seed of the random starts.
        progress: function to call after each search.
        near: pace and stiffness near which to start, scaled to the duration, if the path is infeasible as
            commanded.
    """

    pieces = (12, 24, 48)
    same_cost = 1e-3
    worth = 1e-3
    timed = False
    nothing_kept = "no pace that was tried keeps every limit at all instants within the duration"

    def __init__(
        self,
        motion: PacedMotion,
        joints: Sequence[PacedJoint],
        varied: Sequence[int],
        ends: Ends,
        seed: int,
        progress: Callable[[], None],
        near: Pacing | None = None,
    ) -> None:
        super().__init__(motion, joints, varied, seed, progress)
        self._ends, self._near = ends, near

    def _spaces(self, pieces: int) -> PacedSpaces:
        return PacedSpaces.of(self._span, pieces, self._varied, self._ends).lasting_as_commanded()

    def _starts(self, spaces: PacedSpaces) -> Sequence[Start]:
        """Return the commanded pace with several stiffnesses, and random paces with the first of these."""
        asked = {joint: LIFTED * self._motion.stiffness(joint) for joint in self._varied}
        even = np.ones_like(self._s)
        if self._near is not None:
            even, asked = self._lasting(self._near.pace()(self._s)), self._near.stiffness_at(self._s)
        first = self._levelled(spaces, spaces.fitted(self._s, even, asked))
        inside = first if self._kept(spaces, first) else None
        stiffer = [
            {joint: multiple * row for joint, row in asked.items()}
            for multiple in (STIFFER if self._varied else (1.0,))
        ]
        wanted = [spaces.fitted(self._s, even, stiffness) for stiffness in stiffer]
        wanted += [
            spaces.fitted(self._s, self._lasting(even * drawn), asked) for drawn in self._drawn(*DRAWN_PACES)
        ]
        return [(self._levelled(spaces, unknowns), inside) for unknowns in wanted]

    def _lasting(self, pace: FloatArray) -> FloatArray:
        """Return a pace scaled to the commanded duration, (instants,)."""
        return pace * (self._span[1] / np.trapezoid(pace, self._s))

    def _refined_start(self, spaces: PacedSpaces, rows: Mapping[int | None, FloatArray]) -> Start:
        stiffness = {key: LIFTED * row for key, row in rows.items() if key is not None}
        return self._levelled(spaces, spaces.fitted(self._s, rows[None], stiffness)), None

    def _kept(self, spaces: PacedSpaces, unknowns: FloatArray) -> bool:
        every = SeparableProblem(self._groups(spaces, np.arange(len(self._s))))
        ((_, bounds),) = every.values([unknowns])
        return bool(np.all(bounds < 0))

    def _levelled(self, spaces: PacedSpaces, unknowns: FloatArray) -> FloatArray:
        """Return unknowns with a level appended that bounds its values, if the cost is a level."""
        if not self._joints[0].criterion.levels:
            return unknowns
        without = np.append(unknowns, 0.0)
        _, *groups = self._groups(spaces, np.arange(len(self._s)))
        over = [
            group.bounds(group.rows(without))[len(joint.bound_names) :]
            for joint, group in zip(self._joints, groups, strict=True)
        ]
        return np.append(unknowns, FIRST_LEVEL * float(np.nan_to_num(np.concatenate(over)).max()))

    def _minima(
        self, problem: SeparableProblem, starts: Sequence[FloatArray], gap: float
    ) -> Sequence[Minimum]:
        if gap > WARM_GAP:
            return rough_minima(problem, starts, self._joints, gap)
        return [smoothed_minimum(problem, start, gap, self._joints) for start in starts]

    def _accepted(self, _spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        ((_, bounds),) = SeparableProblem(every).values([found.unknowns])
        return found if np.all(bounds <= CLEARANCE / 2) else None
