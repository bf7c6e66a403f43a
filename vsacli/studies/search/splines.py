"""Spaces of quintic splines, and the splines of pace and stiffness along a path.

A shape is a combination of B-splines that satisfies the end conditions of its space; unknowns of a search are
coefficients of shapes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.studies.search.loads import Ends
from vsacli.studies.search.separable import Functions, Group

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


DEGREE = 5

FLAT_ENDS = 2
"""Number of derivatives that are zero at both ends of a spline from rest to rest."""


@dataclass(frozen=True, eq=False)
class SplineSpace:
    """A space of splines over a span: all, or those that are at rest at both ends, periodic or constant.

    Attributes:
        knots: knots, (coefficients + 6,) in s.
        shapes: B-spline coefficients of each shape, (coefficients, shapes).
        offset: constant that is added to every spline.
    """

    knots: FloatArray
    shapes: FloatArray
    offset: float = 0.0

    @classmethod
    def at_rest(
        cls, span: tuple[float, float], pieces: int, allowed: FloatArray | None = None
    ) -> SplineSpace:
        """Return the splines of equal pieces whose first two derivatives are zero at both ends.

        Args:
            span: first and last time, s.
            pieces: number of pieces; fewer if `allowed` has fewer.
            allowed: times at which pieces may begin and end, both ends of the span included; any if None.
        """
        # derivatives are zero at an end where three coefficients are equal
        ends = _piece_ends(span, pieces, allowed)
        knots = np.concatenate([[ends[0]] * DEGREE, ends, [ends[-1]] * DEGREE])
        coefficients = len(ends) - 1 + DEGREE
        shape_indices = np.clip(np.arange(coefficients) - FLAT_ENDS, 0, coefficients - 1 - 2 * FLAT_ENDS)
        return cls(knots, np.eye(shape_indices[-1] + 1)[shape_indices])

    @classmethod
    def free(cls, span: tuple[float, float], pieces: int) -> SplineSpace:
        """Return the splines of this many equal pieces, without conditions at the ends."""
        knots = cls.at_rest(span, pieces).knots
        return cls(knots, np.eye(pieces + DEGREE))

    @classmethod
    def periodic(
        cls, span: tuple[float, float], pieces: int, allowed: FloatArray | None = None
    ) -> SplineSpace:
        """Return the periodic splines of this many equal pieces; see `at_rest`."""
        ends = _piece_ends(span, pieces, allowed)
        pieces, period = len(ends) - 1, span[1] - span[0]
        turns, end_indices = np.divmod(np.arange(-DEGREE, pieces + DEGREE + 1), pieces)
        return cls(ends[end_indices] + turns * period, np.eye(pieces)[np.arange(pieces + DEGREE) % pieces])

    @classmethod
    def constant(cls, span: tuple[float, float]) -> SplineSpace:
        """Return the constants over a span."""
        rest_space = cls.at_rest(span, 1)
        return cls(rest_space.knots, np.ones((len(rest_space.shapes), 1)))

    def one_at(self, first: bool, last: bool) -> SplineSpace:
        """Return the `free` splines that are 1, with three zero derivatives, at one or both ends."""
        if not (first or last):
            return self
        # the value is 1 and derivatives are zero where four coefficients are 1, the offset
        fixed = FLAT_ENDS + 2
        return replace(self, shapes=self.shapes[:, fixed * first : self.size - fixed * last], offset=1.0)

    def of_mean(self, mean: float) -> SplineSpace:
        """Return the splines with a given mean over the span, among them the constant."""
        ends = self.knots[DEGREE], self.knots[-DEGREE - 1]
        integrals = scipy.interpolate.BSpline(self.knots, self.shapes, DEGREE).integrate(*ends)
        return replace(self, shapes=self.shapes @ scipy.linalg.null_space(integrals[None]), offset=mean)

    def repeated(self, coefficients: FloatArray, count: int) -> BSpline[np.float64]:
        """Return a periodic spline over `count` periods."""
        first, last = self.knots[DEGREE], self.knots[-DEGREE - 1]
        pieces = len(self.shapes) - DEGREE
        repeated_space = self.periodic((first, first + count * (last - first)), count * pieces)
        return repeated_space.spline(np.tile(self.spline(coefficients).c[:pieces], count))

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
        """Return the shapes with their derivatives, (orders, instants, shapes)."""
        all_shapes = scipy.interpolate.BSpline(self.knots, self.shapes, DEGREE)
        return np.stack([all_shapes(time, nu=order) for order in range(orders)])

    def offsets(self, orders: int) -> FloatArray:
        """Return the offset with its derivatives, which are zero, (orders,)."""
        return np.append(self.offset, np.zeros(orders - 1))

    def spline(self, coefficients: FloatArray) -> scipy.interpolate.BSpline[np.float64]:
        """Return the spline with given coefficients of the shapes, (shapes, ...)."""
        return scipy.interpolate.BSpline(self.knots, self.offset + self.shapes @ coefficients, DEGREE)

    def fitted(self, time: FloatArray, values: FloatArray) -> FloatArray:
        """Return the coefficients of the spline nearest to values, (shapes,), by least squares."""
        return np.asarray(np.linalg.lstsq(self.basis(time, 1)[0], values - self.offset, rcond=None)[0])


def _piece_ends(span: tuple[float, float], pieces: int, allowed: FloatArray | None) -> FloatArray:
    """Return the ends of pieces of about equal length, each at the nearest allowed time."""
    ends = np.linspace(*span, pieces + 1)
    if allowed is None:
        return ends
    next_index = np.clip(np.searchsorted(allowed, ends), 1, len(allowed) - 1)
    nearest_index = next_index - (ends - allowed[next_index - 1] < allowed[next_index] - ends)
    return allowed[np.unique(nearest_index)]


@dataclass(frozen=True, eq=False)
class Pacing:
    """An optimized pace along the path of a trajectory, with the stiffness of joints where it varies.

    Attributes:
        splines: space and coefficients of the pace (key None) and of each stiffness (key: joint index).
        found: whether the conditions for a local optimum hold.
        starts: number of starts of the search.
        agreeing: number of starts that reached this optimum.
        bounding: share of the path on which each bound is active, by joint and name of the bound.
    """

    splines: dict[int | None, tuple[SplineSpace, FloatArray]] = field(repr=False)
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, dict[str, float]]

    def pace(self, count: int = 1) -> BSpline[np.float64]:
        """Return the pace as a spline over s; for a periodic motion, over `count` periods."""
        return self._spline(None, count)

    def stiffness(self, count: int = 1) -> dict[int, BSpline[np.float64]]:
        """Return each varied stiffness as a spline over s, by joint index; see `pace`."""
        return {key: self._spline(key, count) for key in self.splines if key is not None}

    def stiffness_at(self, s: FloatArray) -> dict[int, FloatArray]:
        """Return each varied stiffness at coordinates of the path or its first period, (instants,)."""
        return {joint: spline(s) for joint, spline in self.stiffness().items()}

    def _spline(self, key: int | None, count: int) -> BSpline[np.float64]:
        space, coefficients = self.splines[key]
        return space.spline(coefficients) if count == 1 else space.repeated(coefficients, count)


class Rows(NamedTuple):
    """Rows as linear functions of unknowns: the fields of a `Group` for these."""

    basis: FloatArray
    unknown_indices: IndexArray
    scales: FloatArray
    offsets: FloatArray

    def first(self) -> Rows:
        """Return the first row only."""
        return Rows(self.basis[:1], self.unknown_indices, self.scales[:1], self.offsets[:1])

    def beside(self, other: Rows) -> Rows:
        """Return these rows followed by others, which have their own unknowns."""
        rows, unknown_count = len(self.basis), self.basis.shape[2]
        basis = np.zeros((rows + len(other.basis), self.basis.shape[1], unknown_count + other.basis.shape[2]))
        basis[:rows, :, :unknown_count], basis[rows:, :, unknown_count:] = self.basis, other.basis
        pairs = zip(self[1:], other[1:], strict=True)
        return Rows(basis, *(np.append(mine, others) for mine, others in pairs))


def group_of_rows(
    functions: Functions, instants: IndexArray, rows: Rows, weights: FloatArray, bounds: int
) -> Group:
    """Return the group for functions of rows at instants, with `bounds` bounds at each instant."""
    bound_mask = np.ones((bounds, len(instants)), dtype=np.bool_)
    return Group(
        functions, instants, rows.basis, rows.unknown_indices, weights, bound_mask, rows.scales, rows.offsets
    )


class PacedSpaces(NamedTuple):
    """Spaces of the pace and of the stiffness of joints, by index; unknowns are ordered like this."""

    pace: SplineSpace
    stiffness: dict[int, SplineSpace]

    @classmethod
    def of(cls, span: tuple[float, float], pieces: int, varied: Sequence[int], ends: Ends) -> PacedSpaces:
        """Return the spaces with this many pieces each, for a motion with these ends.

        Splines of a periodic motion are periodic. At an end at which another motion moves, velocity and
        higher derivatives remain as commanded.
        """
        if ends.periods:
            periodic = SplineSpace.periodic(span, pieces)
            return cls(periodic, dict.fromkeys(varied, periodic))
        pace = SplineSpace.free(span, pieces).one_at(*ends.moving)
        return cls(pace, dict.fromkeys(varied, SplineSpace.at_rest(span, pieces)))

    def lasting_as_commanded(self) -> PacedSpaces:
        """Return the spaces in which the motion has the commanded duration."""
        return self._replace(pace=self.pace.of_mean(1.0))

    def parts(self) -> dict[int | None, tuple[SplineSpace, IndexArray]]:
        """Return space and indices of unknowns of the pace (key None) and of each varied stiffness."""
        spaces: dict[int | None, SplineSpace] = {None: self.pace}
        spaces.update(self.stiffness.items())
        offsets = np.cumsum([space.size for space in spaces.values()])
        index_groups = np.split(np.arange(offsets[-1]), offsets[:-1])
        return {
            key: (space, unknown_indices)
            for (key, space), unknown_indices in zip(spaces.items(), index_groups, strict=True)
        }

    def fitted(self, s: FloatArray, pace: FloatArray, stiffness: Mapping[int, FloatArray]) -> FloatArray:
        """Return the unknowns nearest to a pace and to the stiffness of joints, each (instants,)."""
        values_by_key: dict[int | None, FloatArray] = {None: pace}
        values_by_key.update(stiffness.items())
        return np.concatenate(
            [space.fitted(s, values_by_key[key]) for key, (space, _) in self.parts().items()]
        )

    def even(self, s: FloatArray, pace: float, stiffness: Mapping[int, FloatArray]) -> FloatArray:
        """Return the unknowns of a constant pace, except at ends where it is prescribed."""
        unknowns = self.fitted(s, np.full_like(s, pace), stiffness)
        _, pace_indices = self.parts()[None]
        # shapes of a free pace are B-splines, whose sum is one
        unknowns[pace_indices] = pace - self.pace.offset
        return unknowns

    def slowed(self, unknowns: FloatArray, share: float) -> FloatArray:
        """Return unknowns with the pace increased by a share, except at ends where it is prescribed."""
        slowed_unknowns, (_, pace_indices) = unknowns.copy(), self.parts()[None]
        slowed_unknowns[pace_indices] += share * (slowed_unknowns[pace_indices] + self.pace.offset)
        return slowed_unknowns

    def rows(self, key: int | None, s: FloatArray, orders: int, scale: float = 1.0) -> Rows:
        """Return the rows of the pace (key None) or of a joint's stiffness of size `scale`, at instants."""
        space, unknown_indices = self.parts()[key]
        scales = scale * space.piece ** -np.arange(orders, dtype=np.float64)
        return Rows(space.basis(s, orders), unknown_indices, scales, space.offsets(orders))

    def level(self, s: FloatArray) -> Rows:
        """Return the row of a level: one further unknown after all others, constant over the path."""
        index = sum(space.size for space, _ in self.parts().values())
        return Rows(np.ones((1, len(s), 1)), np.array([index]), np.ones(1), np.zeros(1))
