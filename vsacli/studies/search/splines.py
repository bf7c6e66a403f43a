"""Splines of degree 5 as combinations of shapes, and the splines of pace and stiffness along a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.studies.search.loads import Ends
from vsacli.studies.search.separable import Functions, Group

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


DEGREE = 5

FLAT_ENDS = 2
"""Derivatives that vanish at both ends of a spline from rest to rest."""


@dataclass(frozen=True, eq=False)
class SplineSpace:
    """Splines over a span, all of them or those that begin and end at rest, or repeat, or are constant.

    Attributes:
        knots: (coefficients + 6,), s.
        shapes: B-spline coefficients of each shape, (coefficients, shapes).
        offset: of each spline, without its shapes.
    """

    knots: FloatArray
    shapes: FloatArray
    offset: float = 0.0

    @classmethod
    def at_rest(
        cls, span: tuple[float, float], pieces: int, allowed: FloatArray | None = None
    ) -> SplineSpace:
        """Splines of this many equal pieces whose first two derivatives vanish at both ends.

        They vanish where the first three coefficients are equal.

        Args:
            span: where they are defined, s.
            pieces: their number; fewer if fewer are allowed.
            allowed: times at which pieces may begin and end, both ends of the span among them; any if None.
        """
        ends = _ends(span, pieces, allowed)
        knots = np.concatenate([[ends[0]] * DEGREE, ends, [ends[-1]] * DEGREE])
        coefficients = len(ends) - 1 + DEGREE
        shape_of = np.clip(np.arange(coefficients) - FLAT_ENDS, 0, coefficients - 1 - 2 * FLAT_ENDS)
        return cls(knots, np.eye(shape_of[-1] + 1)[shape_of])

    @classmethod
    def free(cls, span: tuple[float, float], pieces: int) -> SplineSpace:
        """Splines of this many equal pieces, whatever they do at the ends."""
        knots = cls.at_rest(span, pieces).knots
        return cls(knots, np.eye(pieces + DEGREE))

    @classmethod
    def periodic(
        cls, span: tuple[float, float], pieces: int, allowed: FloatArray | None = None
    ) -> SplineSpace:
        """Splines of this many equal pieces that go on at the end as they begin; see `at_rest`."""
        ends = _ends(span, pieces, allowed)
        pieces, period = len(ends) - 1, span[1] - span[0]
        turns, places = np.divmod(np.arange(-DEGREE, pieces + DEGREE + 1), pieces)
        return cls(ends[places] + turns * period, np.eye(pieces)[np.arange(pieces + DEGREE) % pieces])

    @classmethod
    def constant(cls, span: tuple[float, float]) -> SplineSpace:
        """Constants."""
        whole = cls.at_rest(span, 1)
        return cls(whole.knots, np.ones((len(whole.shapes), 1)))

    def one_at(self, first: bool, last: bool) -> SplineSpace:
        """Return the `free` splines that are one at one or both ends, where three derivatives vanish.

        They do where the first four coefficients are equal.
        """
        if not (first or last):
            return self
        fixed = FLAT_ENDS + 2
        return replace(self, shapes=self.shapes[:, fixed * first : self.size - fixed * last], offset=1.0)

    def of_mean(self, mean: float) -> SplineSpace:
        """Return those splines with a mean over the span, the constant among them."""
        from scipy.interpolate import BSpline
        from scipy.linalg import null_space

        ends = self.knots[DEGREE], self.knots[-DEGREE - 1]
        integrals = BSpline(self.knots, self.shapes, DEGREE).integrate(*ends)
        return replace(self, shapes=self.shapes @ null_space(integrals[None]), offset=mean)

    def repeated(self, amounts: FloatArray, count: int) -> BSpline[np.float64]:
        """Return a spline that goes on at the end as it begins, passed this many times."""
        first, last = self.knots[DEGREE], self.knots[-DEGREE - 1]
        pieces = len(self.shapes) - DEGREE
        whole = self.periodic((first, first + count * (last - first)), count * pieces)
        return whole.spline(np.tile(self.spline(amounts).c[:pieces], count))

    @property
    def size(self) -> int:
        """Number of shapes."""
        return int(self.shapes.shape[1])

    @property
    def piece(self) -> float:
        """Mean length of the pieces, s."""
        ends = self.knots[DEGREE : len(self.knots) - DEGREE]
        return float(ends[-1] - ends[0]) / (len(ends) - 1)

    def basis(self, time: FloatArray, orders: int) -> FloatArray:
        """Return the shapes and their derivatives, (orders, instants, shapes)."""
        from scipy.interpolate import BSpline

        every = BSpline(self.knots, self.shapes, DEGREE)
        return np.stack([every(time, nu=order) for order in range(orders)])

    def offsets(self, orders: int) -> FloatArray:
        """Return values and derivatives of the splines without any shape, (orders,)."""
        return np.append(self.offset, np.zeros(orders - 1))

    def spline(self, amounts: FloatArray) -> BSpline[np.float64]:
        """Return the spline of so much of each shape, (shapes, ...)."""
        from scipy.interpolate import BSpline

        return BSpline(self.knots, self.offset + self.shapes @ amounts, DEGREE)

    def fitted(self, time: FloatArray, values: FloatArray) -> FloatArray:
        """Return the amounts of the shapes with which they come nearest to values, (shapes,)."""
        amounts: FloatArray = np.linalg.lstsq(self.basis(time, 1)[0], values - self.offset, rcond=None)[0]
        return amounts


def _ends(span: tuple[float, float], pieces: int, allowed: FloatArray | None) -> FloatArray:
    """Return the ends of pieces of about equal length, each the nearest that is allowed."""
    ends = np.linspace(*span, pieces + 1)
    if allowed is None:
        return ends
    after = np.clip(np.searchsorted(allowed, ends), 1, len(allowed) - 1)
    nearest = after - (ends - allowed[after - 1] < allowed[after] - ends)
    return allowed[np.unique(nearest)]


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
        """Over the path, a spline whose argument is s; passed this many times if it repeats itself."""
        return self._spline(None, count)

    def stiffness(self, count: int = 1) -> dict[int, BSpline[np.float64]]:
        """Return the same of the joints where it varies, by index."""
        return {key: self._spline(key, count) for key in self.splines if key is not None}

    def stiffness_at(self, s: FloatArray) -> dict[int, FloatArray]:
        """Return the stiffness of these joints at instants of the path or its first period, (instants,)."""
        return {joint: spline(s) for joint, spline in self.stiffness().items()}

    def _spline(self, key: int | None, count: int) -> BSpline[np.float64]:
        space, amounts = self.splines[key]
        return space.spline(amounts) if count == 1 else space.repeated(amounts, count)


class Rows(NamedTuple):
    """Rows of functions from unknowns: the fields of a `Group` that say so."""

    basis: FloatArray
    places: IndexArray
    scales: FloatArray
    offsets: FloatArray

    def first(self) -> Rows:
        """Return the first of them alone."""
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
    """Functions of rows at instants, with this many bounds at each of them."""
    there = np.ones((bounds, len(instants)), dtype=np.bool_)
    return Group(functions, instants, rows.basis, rows.places, weights, there, rows.scales, rows.offsets)


class PacedSpaces(NamedTuple):
    """Splines of the pace, and of the stiffness of joints by index; their unknowns stand in this order."""

    pace: SplineSpace
    stiffness: dict[int, SplineSpace]

    @classmethod
    def of(cls, span: tuple[float, float], pieces: int, varied: Sequence[int], ends: Ends) -> PacedSpaces:
        """Return the spaces with this many pieces each, for a motion with these ends.

        A repeated motion goes on at the end as it begins, at any pace. A motion that begins or ends on its
        way without repeating itself does so at the pace as commanded, with the accelerations as commanded,
        too.
        """
        if ends.periods:
            periodic = SplineSpace.periodic(span, pieces)
            return cls(periodic, dict.fromkeys(varied, periodic))
        pace = SplineSpace.free(span, pieces).one_at(*ends.moving)
        return cls(pace, dict.fromkeys(varied, SplineSpace.at_rest(span, pieces)))

    def lasting_as_commanded(self) -> PacedSpaces:
        """Return the spaces in which the path takes the commanded time."""
        return self._replace(pace=self.pace.of_mean(1.0))

    def parts(self) -> dict[int | None, tuple[SplineSpace, IndexArray]]:
        """Space and places of unknowns, of the pace, None, and of joints."""
        spaces: dict[int | None, SplineSpace] = {None: self.pace}
        spaces.update(self.stiffness.items())
        ends = np.cumsum([space.size for space in spaces.values()])
        places = np.split(np.arange(ends[-1]), ends[:-1])
        return {key: (space, own) for (key, space), own in zip(spaces.items(), places, strict=True)}

    def fitted(self, s: FloatArray, pace: FloatArray, stiffness: Mapping[int, FloatArray]) -> FloatArray:
        """Return unknowns nearest to a pace and to stiffness, each (instants,)."""
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
        """Return None (the timing) or the stiffness of a joint, scaled, with its derivatives at instants."""
        space, own = self.parts()[key]
        scales = size * space.piece ** -np.arange(orders, dtype=np.float64)
        return Rows(space.basis(s, orders), own, scales, space.offsets(orders))

    def level(self, s: FloatArray) -> Rows:
        """Return a further unknown, behind all others, that is the same everywhere."""
        last = sum(space.size for space, _ in self.parts().values())
        return Rows(np.ones((1, len(s), 1)), np.array([last]), np.ones(1), np.zeros(1))
