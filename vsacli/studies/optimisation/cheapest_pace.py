"""The pace, and the stiffness if that varies, with which a motion costs least in the time it is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.optimisation.interior_point import Minimum
from vsacli.studies.optimisation.paced_joints import CLEARANCE, PacedJoint
from vsacli.studies.optimisation.paced_motion import PacedMotion
from vsacli.studies.optimisation.paced_search import PacedSearch, Start
from vsacli.studies.optimisation.paced_splines import PacedSpaces, Pacing
from vsacli.studies.optimisation.periods import Ends
from vsacli.studies.optimisation.separable import Group, SeparableProblem
from vsacli.studies.optimisation.smoothing import smoothed_minimum

STIFFER = 1.0, 1.5, 2.0
"""Multiples of that stiffness to begin with."""

DRAWN_PACES = 0.6, 1.6
"""Paces between which those that are drawn lie, before they are scaled to the duration."""

LIFTED = 1.1
"""Multiple of a stiffness with which a search begins: from an end of the corridor, where the best often is, a
pendulum took more than two hundred steps, and from here fifty."""

FIRST_LEVEL = 1.05
"""Multiple of what a level bounds, to begin with."""


class CheapestPaceSearch(PacedSearch):
    """A search for the pace with which a motion costs least while it takes as long as commanded.

    Args:
        motion: along the path.
        joints: cost and bounds of each.
        varied: the joints whose stiffness varies as well, by index.
        ends: of the motion.
        seed: of the starts that are drawn.
        progress: called after each search.
        near: pace and stiffness to begin near, scaled to the duration, where the path itself is infeasible.
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
        """The pace as commanded with some stiffnesses, and drawn paces with the first of these."""
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
        """A pace scaled to the duration as commanded, (instants,)."""
        scaled: FloatArray = pace * (self._span[1] / np.trapezoid(pace, self._s))
        return scaled

    def _refined_start(self, spaces: PacedSpaces, rows: Mapping[int | None, FloatArray]) -> Start:
        stiffness = {key: LIFTED * row for key, row in rows.items() if key is not None}
        return self._levelled(spaces, spaces.fitted(self._s, rows[None], stiffness)), None

    def _kept(self, spaces: PacedSpaces, unknowns: FloatArray) -> bool:
        every = SeparableProblem(self._groups(spaces, np.arange(len(self._s))))
        return bool(np.all(every.values(unknowns)[1] < 0))

    def _levelled(self, spaces: PacedSpaces, unknowns: FloatArray) -> FloatArray:
        """Unknowns with a level that bounds what it shall, if there are any."""
        if not self._joints[0].criterion.levels:
            return unknowns
        without = np.append(unknowns, 0.0)
        _, *groups = self._groups(spaces, np.arange(len(self._s)))
        over = [
            group.bounds(group.rows(without))[len(joint.bound_names) :]
            for joint, group in zip(self._joints, groups, strict=True)
        ]
        return np.append(unknowns, FIRST_LEVEL * float(np.nan_to_num(np.concatenate(over)).max()))

    def _minimum(self, problem: SeparableProblem, start: FloatArray, gap: float) -> Minimum:
        return smoothed_minimum(problem, start, gap, self._joints)

    def _accepted(self, _spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        _, bounds = SeparableProblem(every).values(found.unknowns)
        return found if np.all(bounds <= CLEARANCE / 2) else None
