"""Splines of degree 5, four times continuously differentiable, as linear combinations of shapes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray

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
        offset: what each spline has besides its shapes.
    """

    knots: FloatArray
    shapes: FloatArray
    offset: float = 0.0

    @classmethod
    def at_rest(
        cls, span: tuple[float, float], pieces: int, allowed: FloatArray | None = None
    ) -> SplineSpace:
        """Splines of so many equal pieces whose first two derivatives vanish at both ends.

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
        """Splines of so many equal pieces, whatever they do at the ends."""
        knots = cls.at_rest(span, pieces).knots
        return cls(knots, np.eye(pieces + DEGREE))

    @classmethod
    def periodic(
        cls, span: tuple[float, float], pieces: int, allowed: FloatArray | None = None
    ) -> SplineSpace:
        """Splines of so many equal pieces that go on at the end as they begin; see `at_rest`."""
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
        """Those of `free` splines that are one at an end, or both, where three derivatives vanish.

        They do where the first four coefficients are equal.
        """
        if not (first or last):
            return self
        fixed = FLAT_ENDS + 2
        return replace(self, shapes=self.shapes[:, fixed * first : self.size - fixed * last], offset=1.0)

    def of_mean(self, mean: float) -> SplineSpace:
        """Those of them with a mean over the span, the constant among them."""
        from scipy.interpolate import BSpline
        from scipy.linalg import null_space

        ends = self.knots[DEGREE], self.knots[-DEGREE - 1]
        integrals = BSpline(self.knots, self.shapes, DEGREE).integrate(*ends)
        return replace(self, shapes=self.shapes @ null_space(integrals[None]), offset=mean)

    def repeated(self, amounts: FloatArray, count: int) -> BSpline[np.float64]:
        """A spline that goes on at the end as it begins, passed so many times."""
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
        """The shapes and their derivatives, (orders, instants, shapes)."""
        from scipy.interpolate import BSpline

        every = BSpline(self.knots, self.shapes, DEGREE)
        return np.stack([every(time, nu=order) for order in range(orders)])

    def offsets(self, orders: int) -> FloatArray:
        """What the splines and their derivatives are without any shape, (orders,)."""
        return np.append(self.offset, np.zeros(orders - 1))

    def spline(self, amounts: FloatArray) -> BSpline[np.float64]:
        """The spline of so much of each shape, (shapes, ...)."""
        from scipy.interpolate import BSpline

        return BSpline(self.knots, self.offset + self.shapes @ amounts, DEGREE)

    def fitted(self, time: FloatArray, values: FloatArray) -> FloatArray:
        """The amounts of the shapes with which they come nearest to values, (shapes,)."""
        amounts: FloatArray = np.linalg.lstsq(self.basis(time, 1)[0], values - self.offset, rcond=None)[0]
        return amounts


def _ends(span: tuple[float, float], pieces: int, allowed: FloatArray | None) -> FloatArray:
    """The ends of pieces of about equal length, each the nearest that is allowed."""
    ends = np.linspace(*span, pieces + 1)
    if allowed is None:
        return ends
    after = np.clip(np.searchsorted(allowed, ends), 1, len(allowed) - 1)
    nearest = after - (ends - allowed[after - 1] < allowed[after] - ends)
    return allowed[np.unique(nearest)]
