"""A pace along a path, and the splines among which it is looked for, with those of stiffness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.studies.optimisation.periods import Ends
from vsacli.studies.optimisation.separable import Functions, Group
from vsacli.studies.optimisation.spline_space import SplineSpace

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


@dataclass(frozen=True, eq=False)
class Pacing:
    """A pace along the path of a trajectory, and the stiffness of joints where it varies.

    Attributes:
        splines: of the pace, None, and of joints by index: a space, and the amounts of its shapes.
        found: whether the conditions for a local optimum hold.
        starts: from how many the search began.
        agreeing: from how many it came to this optimum.
        bounding: share of the path along each bound, by joint and name of the bound.
    """

    splines: dict[int | None, tuple[SplineSpace, FloatArray]] = field(repr=False)
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, dict[str, float]]

    def pace(self, count: int = 1) -> BSpline[np.float64]:
        """Over the path, a spline whose argument is s; passed so many times if it repeats itself."""
        return self._spline(None, count)

    def stiffness(self, count: int = 1) -> dict[int, BSpline[np.float64]]:
        """Likewise of the joints where it varies, by index."""
        return {key: self._spline(key, count) for key in self.splines if key is not None}

    def stiffness_at(self, s: FloatArray) -> dict[int, FloatArray]:
        """The stiffness of these joints at instants of the path, or of its first period, (instants,) each."""
        return {joint: spline(s) for joint, spline in self.stiffness().items()}

    def _spline(self, key: int | None, count: int) -> BSpline[np.float64]:
        space, amounts = self.splines[key]
        return space.spline(amounts) if count == 1 else space.repeated(amounts, count)


class Rows(NamedTuple):
    """How rows of functions follow from unknowns: the fields of a `Group` that say so."""

    basis: FloatArray
    places: IndexArray
    scales: FloatArray
    offsets: FloatArray

    def first(self) -> Rows:
        """The first of them alone."""
        return Rows(self.basis[:1], self.places, self.scales[:1], self.offsets[:1])

    def beside(self, other: Rows) -> Rows:
        """These and others, with unknowns of their own."""
        rows, own = len(self.basis), self.basis.shape[2]
        joined = np.zeros((rows + len(other.basis), self.basis.shape[1], own + other.basis.shape[2]))
        joined[:rows, :, :own], joined[rows:, :, own:] = self.basis, other.basis
        pairs = zip(self[1:], other[1:], strict=True)
        return Rows(joined, *(np.append(mine, others) for mine, others in pairs))


def of_rows(
    functions: Functions, instants: IndexArray, rows: Rows, weights: FloatArray, bounds: int
) -> Group:
    """Functions of rows at instants, with so many bounds at each of them."""
    there = np.ones((bounds, len(instants)), dtype=np.bool_)
    return Group(functions, instants, rows.basis, rows.places, weights, there, rows.scales, rows.offsets)


class PacedSpaces(NamedTuple):
    """Splines of the pace, and of the stiffness of joints by index; their unknowns stand in this order."""

    pace: SplineSpace
    stiffness: dict[int, SplineSpace]

    @classmethod
    def of(cls, span: tuple[float, float], pieces: int, varied: Sequence[int], ends: Ends) -> PacedSpaces:
        """With so many pieces each, for a motion with such ends.

        What repeats itself goes on at the end as it begins, at whatever pace. What begins or ends on its way
        without repeating itself does so at the pace as commanded, with the accelerations as commanded, too.
        """
        if ends.periods:
            periodic = SplineSpace.periodic(span, pieces)
            return cls(periodic, dict.fromkeys(varied, periodic))
        pace = SplineSpace.free(span, pieces).one_at(*ends.moving)
        return cls(pace, dict.fromkeys(varied, SplineSpace.at_rest(span, pieces)))

    def lasting_as_commanded(self) -> PacedSpaces:
        """Those with which the path takes as long as it is."""
        return self._replace(pace=self.pace.of_mean(1.0))

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

    def even(self, s: FloatArray, pace: float, stiffness: Mapping[int, FloatArray]) -> FloatArray:
        """Unknowns of the same pace everywhere, but for ends where it is given."""
        unknowns = self.fitted(s, np.full_like(s, pace), stiffness)
        _, own = self.parts()[None]
        unknowns[own] = pace - self.pace.offset  # shapes of a free pace are B-splines, whose sum is one
        return unknowns

    def slowed(self, unknowns: FloatArray, share: float) -> FloatArray:
        """Unknowns of a pace that is larger by a share, but for ends where it is given."""
        slower, (_, own) = unknowns.copy(), self.parts()[None]
        slower[own] += share * (slower[own] + self.pace.offset)
        return slower

    def rows(self, key: int | None, s: FloatArray, orders: int, size: float = 1.0) -> Rows:
        """The pace, None, or the stiffness of a joint, of about a size, with its derivatives at instants."""
        space, own = self.parts()[key]
        scales = size * space.piece ** -np.arange(orders, dtype=np.float64)
        return Rows(space.basis(s, orders), own, scales, space.offsets(orders))

    def level(self, s: FloatArray) -> Rows:
        """A further unknown, behind all others, that is the same everywhere."""
        last = sum(space.size for space, _ in self.parts().values())
        return Rows(np.ones((1, len(s), 1)), np.array([last]), np.ones(1), np.zeros(1))
