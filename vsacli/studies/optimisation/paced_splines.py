"""A pace along a path, and the splines among which it is looked for, with those of stiffness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.studies.optimisation.spline_space import SplineSpace

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


@dataclass(frozen=True, eq=False)
class Pacing:
    """A pace along the path of a trajectory.

    Attributes:
        pace: over the path, a spline whose argument is s.
        stiffness: of each joint where it varies, by index, likewise.
        duration: with that pace, s.
        uniform: of the fastest motion that is passed uniformly slower or faster, s; NaN if there is none.
        found: whether the conditions for a local optimum hold.
        starts: from how many the search began.
        agreeing: from how many it came to this optimum.
        bounding: share of the path along each bound, by joint and name of the bound.
    """

    pace: BSpline[np.float64] = field(repr=False)
    stiffness: dict[int, BSpline[np.float64]] = field(repr=False)
    duration: float
    uniform: float
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, dict[str, float]]


class PacedSpaces(NamedTuple):
    """Splines of the pace, and of the stiffness of joints by index; their unknowns stand in this order."""

    pace: SplineSpace
    stiffness: dict[int, SplineSpace]

    @classmethod
    def of(cls, span: tuple[float, float], pieces: int, varied: Sequence[int]) -> PacedSpaces:
        """With so many pieces each."""
        at_rest = SplineSpace.at_rest(span, pieces)
        return cls(SplineSpace.free(span, pieces), dict.fromkeys(varied, at_rest))

    def parts(self) -> dict[int | None, tuple[SplineSpace, IndexArray]]:
        """Space and places of unknowns, of the pace, None, and of joints."""
        spaces: dict[int | None, SplineSpace] = {None: self.pace}
        spaces.update(self.stiffness.items())
        ends = np.cumsum([space.size for space in spaces.values()])
        places = np.split(np.arange(ends[-1]), ends[:-1])
        return {key: (space, own) for (key, space), own in zip(spaces.items(), places, strict=True)}

    def fitted(self, s: FloatArray, pace: FloatArray, stiffness: Mapping[int, FloatArray]) -> FloatArray:
        """Unknowns of what comes nearest to a pace and to stiffness, each (instants,)."""
        wanted: dict[int | None, FloatArray] = {None: pace}
        wanted.update(stiffness.items())
        return np.concatenate([space.fitted(s, wanted[key]) for key, (space, _) in self.parts().items()])


def joined_rows(first: FloatArray, second: FloatArray) -> FloatArray:
    """Two bases of rows with unknowns of their own as one, (rows, instants, unknowns)."""
    rows, instants = len(first) + len(second), first.shape[1]
    joined = np.zeros((rows, instants, first.shape[2] + second.shape[2]))
    joined[: len(first), :, : first.shape[2]] = first
    joined[len(first) :, :, first.shape[2] :] = second
    return joined
