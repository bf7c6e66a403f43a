"""Rest-to-rest splines through via points: profile, and its declaration in files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt
import scipy

from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.signals import POSITION
from vsacli.documents.fields import NON_NEGATIVE, Items, NumberWithUnit, integer, value
from vsacli.trajectory.curves.closed_form import (
    VIA_DEGREES,
    ClosedForm,
    Formula,
    Use,
    Values,
    nan_for_none,
    rescale,
)

SEAM = 1e-9
"""Largest jump between the expansions about two neighboring points, relative to the peak of each derivative;
it is 1e-13 for well-spaced points."""


class ProfileExtremes(NamedTuple):
    """The smallest and largest value of each component, (components,), and their times, s."""

    lowest: FloatArray
    lowest_at: FloatArray
    highest: FloatArray
    highest_at: FloatArray


@dataclass(frozen=True, kw_only=True)
class ViaPoints(ClosedForm):
    """The spline through points that begins and ends at rest.

    With m = (degree+1)/2, its derivatives up to m-1 vanish at both ends, and those up to degree-1 are
    continuous. Of all functions through the points with these ends, it has the smallest integral of the
    squared m-th derivative (de Boor, A Practical Guide to Splines, 2001): degree 7 gives the minimum-snap
    motion of Mellinger & Kumar (ICRA 2011). Through two points it is the rest-to-rest polynomial.

    Attributes:
        degree: degree, odd, 3 to 9.
        shares: times of the points as shares of the span, increasing from 0 to 1.
        points: values of the components for each point, passed exactly; all NaN for absent components.
    """

    degree: int
    shares: tuple[float, ...]
    points: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.degree not in VIA_DEGREES:
            allowed = f"{VIA_DEGREES[0]} to {VIA_DEGREES[-1]}"
            raise InputError.one(f"the degree must be odd, {allowed}, not {self.degree}")
        if len(self.points) < 2 or len(self.points) != len(self.shares):
            counts = f"{len(self.points)} points and {len(self.shares)} times"
            raise InputError.one(f"two or more points and as many times are needed, not {counts}")
        if len({len(point) for point in self.points}) > 1:
            raise InputError.one("the points have different numbers of values")
        if (self.shares[0], self.shares[-1]) != (0, 1) or not np.all(np.diff(self.shares) > 0):
            raise InputError.one("the times of the points must increase strictly, from the start to the end")

    @property
    def components(self) -> int:
        """See `Profile.components`."""
        return len(self.points[0])

    @cached_property
    def breakpoints(self) -> FloatArray:
        """Times of the points, s."""
        first, last = self.span
        times = first + (last - first) * np.array(self.shares)
        times[-1] = last
        return times

    @cached_property
    def _has_values(self) -> BoolArray:
        """Mask of components with values, (components,)."""
        return ~np.isnan(self.points[0])

    @cached_property
    def _derivatives(self) -> FloatArray:
        """Value and derivatives with respect to the share of the span, (degree+1, given components, points).

        The highest derivative is constant between two points, and stored for the first of them.
        """
        points, shares = np.array(self.points)[:, self._has_values], np.array(self.shares)
        vanishing = (self.degree - 1) // 2
        zero_derivatives = [(order, np.zeros(points.shape[1])) for order in range(1, vanishing + 1)]
        with np.errstate(all="ignore"):  # poorly spaced points are refused below
            try:
                ends: Any = (zero_derivatives, zero_derivatives)
                displacements = points - points[0]  # zero, and so exact, for a component at rest
                spline = scipy.interpolate.make_interp_spline(
                    shares, displacements, k=self.degree, bc_type=ends
                )
            except (np.linalg.LinAlgError, ValueError):
                raise _degree_error(self.degree) from None
            derivatives = np.stack([spline(shares, nu=order).T for order in range(self.degree + 1)])
            derivatives[0] = points.T
            derivatives[1 : vanishing + 1, :, [0, -1]] = 0.0
            if not _is_smooth(derivatives, np.diff(shares), min(self.signal.orders, self.degree)):
                raise _degree_error(self.degree)
        return derivatives

    def at(self, time: FloatArray) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples).

        They are expanded about the nearest point, where they are exact.

        Raises:
            InputError: the points are too unevenly spaced in time.
        """
        first, last = self.span
        knots = self.breakpoints
        piece_index = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
        nearest_index = piece_index + (time - knots[piece_index] > knots[piece_index + 1] - time)
        coefficients = [*self._derivatives[:-1, :, nearest_index], self._derivatives[-1][:, piece_index]]
        series = _taylor_series(
            coefficients, (time - knots[nearest_index]) / (last - first), self.signal.orders
        )

        derivatives = np.full((self.signal.orders, self.components, len(time)), np.nan)
        for order, taylor_sum in enumerate(series):
            derivatives[order, self._has_values] = taylor_sum / np.float64(last - first) ** order
        return derivatives

    def rescaled(self, factors: Sequence[float], constants: Sequence[float]) -> Self:
        """See `ClosedForm.rescaled`."""
        return replace(self, points=tuple(rescale(point, factors, constants) for point in self.points))

    def extremes(self) -> ProfileExtremes:
        """Return the smallest and largest values, from the zeros of the first derivative.

        Raises:
            InputError: see `at`.
        """
        times = [np.union1d(self.breakpoints, zeros) for zeros in self._stationary_times()]
        extremes = np.full((4, self.components), np.nan)
        for component, time in zip(np.flatnonzero(self._has_values), times, strict=True):
            values = self.at(time)[0, component]
            low_index, high_index = values.argmin(), values.argmax()
            extremes[:, component] = values[low_index], time[low_index], values[high_index], time[high_index]
        return ProfileExtremes(*extremes)

    def _stationary_times(self) -> Sequence[FloatArray]:
        """Return the times, s, at which the first derivative of each given component vanishes."""
        first, last = self.span
        orders = np.arange(self.degree, 0, -1)
        factorials = np.cumprod(np.arange(1.0, self.degree + 1))[::-1]
        powers = self._derivatives[orders, :, :-1] * (orders / factorials)[:, None, None]
        slope = scipy.interpolate.PPoly(np.moveaxis(powers, 1, 2), np.array(self.shares))
        roots = slope.roots(discontinuity=False, extrapolate=False)
        return [first + (last - first) * root[np.isfinite(root)] for root in roots]


def passing_shares(points: npt.ArrayLike, degree: int) -> FloatArray:
    """Return default times of passing points, as shares of the span, (points,).

    The length between two points is the square root of their distance (Lee, Computer-Aided Design 21, 1989),
    so that near points do not follow each other too fast. Time along the total length follows the
    rest-to-rest polynomial of this degree, a regularized incomplete beta function.

    Args:
        points: points, (points, components); components that are NaN are ignored.
        degree: degree of the spline.
    """
    corners = np.nan_to_num(np.asarray(points, dtype=np.float64))
    steps = np.diff(corners / (np.abs(corners).max() or 1.0), axis=0)
    lengths = np.concatenate(([0.0], np.cumsum(np.sqrt(np.linalg.norm(steps, axis=1)))))
    half_order = (degree + 1) // 2
    return scipy.special.betaincinv(half_order, half_order, lengths / (lengths[-1] or 1.0))


def _is_smooth(derivatives: FloatArray, lengths: FloatArray, orders: int) -> bool:
    """Return whether expansions about neighboring points agree half-way, below order `orders`.

    Differences of values are relative to the largest point, those of derivatives to their peaks.
    """
    left_derivatives, right_derivatives = (
        list(derivatives[:, :, :-1]),
        [*derivatives[:-1, :, 1:], derivatives[-1, :, :-1]],
    )
    left_middle, right_middle = (
        np.array(_taylor_series(*side, orders))
        for side in ((left_derivatives, lengths / 2), (right_derivatives, -lengths / 2))
    )
    quarters = [
        _taylor_series(left_derivatives, lengths / 4, orders),
        _taylor_series(right_derivatives, -lengths / 4, orders),
    ]
    peaks = np.abs(np.concatenate([derivatives[:orders], left_middle, *quarters], axis=2)).max(axis=2)
    peaks[0] = np.abs(derivatives[0]).max(axis=1)
    return bool(np.all(np.abs(left_middle - right_middle).max(axis=2) <= SEAM * peaks))


def _degree_error(degree: int) -> InputError:
    return InputError.one(
        f"the points are too unevenly spaced in time for a spline of degree {degree};"
        " space them more evenly, or take a lower degree"
    )


def _taylor_series(derivatives: Sequence[FloatArray], offset: FloatArray, orders: int) -> list[FloatArray]:
    """Return a Taylor polynomial and its derivatives of order below `orders`, by Horner's rule.

    Args:
        derivatives: derivatives at the centers, from order 0 to the degree, each (components, samples).
        offset: offset from the center, (samples,).
        orders: number of derivatives to return, the value included.
    """
    zeros = np.zeros_like(derivatives[0])
    return [_horner(derivatives[order:] or [zeros], offset) for order in range(orders)]


def _horner(derivatives: Sequence[FloatArray], offset: FloatArray) -> FloatArray:
    polynomial = derivatives[-1].copy()
    for power in range(len(derivatives) - 1, 0, -1):
        polynomial *= offset / power
        polynomial += derivatives[power - 1]
    return polynomial


OVERSHOOT = 0.1
"""Distance of the spline beyond a joint's points, as a share of their range, that causes a warning."""

MAX_POINTS = 1000
"""Most points; more are probably recorded samples, not chosen points."""

SHOWN_TIMES = 12
"""Most times that are printed; of more, the first and last ones are."""

_TIMES = (
    "time of each point, from the start, the first 0; the last one is the duration."
    " If absent, they follow from the distances of the points"
)


class Via(Formula):
    """A spline through points, at rest at both ends."""

    degree: int
    points: tuple[Values, ...]
    times: tuple[float, ...] | None

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        degree = "degree of the spline"
        if use.signal is POSITION and not use.rigid:
            degree += "; from 3 on if all joints are rigid"
        return {
            "degree": integer(degree, check=use.degree(VIA_DEGREES)),
            "points": use.several(" to pass, from the first to the last"),
            "times": value(Items(NumberWithUnit(units.TIME)), _TIMES, check=NON_NEGATIVE, default=None),
        }

    @classmethod
    def meaning(cls, use: Use) -> str:
        """Return the meaning for users."""
        if use.rigid:
            return "The same for a robot whose joints are all rigid."
        meaning = "A spline through points, from rest to rest"
        if use.signal is POSITION:
            meaning += "; that of degree 7 has the least mean square snap"
        elif use.signal.positive:
            meaning = "A spline through points, which must stay positive between them"
        vanishing_text = "All derivatives up to (degree-1)/2 vanish at both ends"
        return f"{meaning}.\n\n{vanishing_text}, those up to degree-1 are continuous."

    def _problems(self) -> Iterator[FieldProblem]:
        if not 2 <= len(self.points) <= MAX_POINTS:
            message = f"expected 2 to {MAX_POINTS} points, found {len(self.points)}"
            yield FieldProblem(("points",), message)
        elif self.times is None:
            for index, (point, next_point) in enumerate(pairwise(self.points), start=1):
                if point == next_point:
                    message = f"point {index + 1} is the one before again; give times to pass it twice"
                    yield FieldProblem(("points", index), message)
        else:
            yield from self._point_time_problems(self.times)

    def _point_time_problems(self, times: tuple[float, ...]) -> Iterator[FieldProblem]:
        if len(times) != len(self.points):
            message = f"expected {len(self.points)}, one for each point, found {len(times)}"
            yield FieldProblem(("times",), message)
        if times and times[0] != 0:
            yield FieldProblem(
                ("times", 0), f"the first must be 0, not {times[0]:g}: it counts from the start"
            )
        for index, (point_time, next_point_time) in enumerate(pairwise(times), start=1):
            if not point_time < next_point_time:
                message = f"must increase strictly, but {next_point_time:g} follows {point_time:g}"
                yield FieldProblem(("times", index), message)

    @property
    def lasts(self) -> float | None:
        """Last of the times, s; None without times."""
        return None if self.times is None else self.times[-1]

    def profile_over(self, span: tuple[float, float]) -> ViaPoints:
        """See `Formula.profile_over`."""
        points = tuple(map(nan_for_none, self.points))
        if self.times is None:
            shares = passing_shares(points, self.degree)
        else:
            shares = np.array(self.times) / self.times[-1]
        return ViaPoints(
            signal=self.signal, span=span, degree=self.degree, shares=tuple(shares.tolist()), points=points
        )

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """See `Formula.problems_over`."""
        problems = list(super().problems_over(duration))
        yield from problems
        if problems or not self.signal.positive:
            return
        lowest, lowest_times, *_ = self.profile_over((0.0, duration)).extremes()
        for joint in np.flatnonzero(lowest <= 0).tolist():
            message_start = (
                f"the spline through them falls to {lowest[joint]:.4g} after {lowest_times[joint]:.3f} s"
            )
            message = f"{message_start}, but must stay positive; add a point there, or give other times"
            yield FieldProblem(("points",), message, joint)

    def notes_over(self, span: tuple[float, float], /) -> Iterator[str]:
        """Yield a note on times that were derived from the points."""
        if self.times is None:
            yield (
                f"passes its via points at t = {_list_times(self.profile_over(span).breakpoints.tolist())} s"
            )

    def warnings_over(self, span: tuple[float, float], joints: Mapping[str, str], /) -> Iterator[str]:
        """Yield warnings about joints whose spline goes far beyond its points."""
        profile = self.profile_over(span)
        for name, joint_type, points, *extremes in zip(
            joints, joints.values(), np.transpose(profile.points), *profile.extremes(), strict=True
        ):
            lowest, lowest_at, highest, highest_at = extremes
            overshoot, overshoot_time = max(
                (points.min() - lowest, lowest_at), (highest - points.max(), highest_at)
            )
            if overshoot > OVERSHOOT * np.ptp(points):
                unit = self.signal.quantities[0].unit(joint_type)
                yield (
                    f"{name} goes {overshoot:.3g} {unit} beyond its via points, at t = {overshoot_time:.3f} s"
                )


def _list_times(times: list[float]) -> str:
    time_texts = [f"{time:.4g}" for time in times]
    if len(time_texts) > SHOWN_TIMES:
        half = SHOWN_TIMES // 2
        time_texts[half:-half] = ["..."]
    return ", ".join(time_texts)
