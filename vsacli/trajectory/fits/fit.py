"""Splines that replace recorded samples, with covariances of value and derivatives, or bounds of them.

A `Fit` consists of parts, each a spline for components that share its knots. `Unresolved` and `vibrations`
give uncertainties that no covariance states.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.trajectory.fits.banded_qr import Posterior
from vsacli.trajectory.fits.least_squares import local_basis, of_derivatives, of_least_squares
from vsacli.trajectory.fits.smoothing import Smoothing
from vsacli.trajectory.fits.spectrum import FollowedNoise
from vsacli.trajectory.times import stretch

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


ORDERS = {7: 5, 5: 3}
"""Number of functions that are needed, value and derivatives, by the degree of the splines."""

PROBES = 500
"""Number of times for root mean squares."""


@dataclass(frozen=True, eq=False)
class Part:
    """A spline for components that share its knots.

    Attributes:
        members: indices of the components.
        spline: spline with one column per member.
        exact: whether it goes through the samples, rather than near them.
        smoothing: assessment by a smoothing spline, which it is or was compared with; None without one.
        smooth: whether it is a smoothing spline.
        noise: filtered, and so smooth, noise that the spline follows; the deviation in `smoothing` includes
            it.
    """

    members: IndexArray
    spline: BSpline[np.float64]
    exact: bool
    smoothing: Smoothing | None = None
    smooth: bool = False
    noise: FollowedNoise | None = None

    @property
    def knots(self) -> FloatArray:
        """Ascending times between which the spline is one polynomial; the first and last are its span."""
        return np.asarray(self.spline.t[self.spline.k : -self.spline.k])

    @property
    def unreliable(self) -> tuple[float, float]:
        """Times after the start and before the end with unreliable derivatives, s.

        They are (degree + 1)/2 knot spans. Beyond, noise in the highest derivative that is needed is less
        than 1.4 times that anywhere inside; at the ends it is up to 850 times that.
        """
        spans = (self.spline.k + 1) // 2
        return float(np.ptp(self.knots[: spans + 1])), float(np.ptp(self.knots[-spans - 1 :]))

    @property
    def inside(self) -> tuple[float, float]:
        """First and last time, s, with reliable derivatives; of the middle half if that is longer."""
        first, last = self.knots[[0, -1]].tolist()
        start, end = np.minimum(self.unreliable, (last - first) / 4).tolist()
        return first + start, last - end

    def of_columns(self, columns: IndexArray) -> Part:
        """Return the part with only some members, given by columns of the spline."""
        from scipy.interpolate import BSpline

        spline = BSpline(self.spline.t, self.spline.c[:, columns], self.spline.k)
        return replace(self, members=self.members[columns], spline=spline)

    def at(self, time: FloatArray, orders: int) -> FloatArray:
        """Return value and derivatives, shape (orders, members, samples).

        Within a knot span one polynomial is evaluated, so that neighboring values share their rounding error.
        Evaluating derivatives of B-splines point by point leaves noise of about eps / step^order.
        """
        degree, knots = self.spline.k, self.knots
        span = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
        used, which = np.unique(span, return_inverse=True)
        offset = time - knots[span]
        taylor = [self.spline(knots[used], nu=order).T[:, which] for order in range(degree + 1)]
        rows = np.empty((orders, len(self.members), len(time)))
        for order, row in enumerate(rows):
            row[:] = taylor[degree]
            for power in range(degree - order, 0, -1):
                row *= offset / power
                row += taylor[order + power - 1]
        return rows

    def posterior(self, time: FloatArray) -> Posterior | None:
        """Return the posterior of the coefficients; None if it is unknown.

        Args:
            time: times of the recording, (samples,), s.
        """
        if self.smoothing is not None and not self.smoothing.resolved:
            return None
        if self.smooth and self.smoothing is not None:
            return self.smoothing.posterior
        try:
            return of_least_squares(time, self.spline.t, self.spline.k)
        except np.linalg.LinAlgError:  # very uneven times
            return None

    def stretched(self, factor: float) -> Part:
        """Return the spline slowed down by a factor, with the same first time."""
        from scipy.interpolate import BSpline

        knots = stretch(self.spline.t, self.knots[0], factor)
        known = None if self.smoothing is None else self.smoothing.stretched(factor)
        noise = None if self.noise is None else self.noise.stretched(factor)
        return replace(
            self, spline=BSpline(knots, self.spline.c, self.spline.k), smoothing=known, noise=noise
        )


@dataclass(frozen=True, eq=False)
class Fit:
    """The splines that replace the samples of a signal.

    Attributes:
        components: number of components; those in no part have no values.
        degree: degree of the splines.
        parts: splines of components that share knots.
        residual: root mean square of sample minus fit, (components,).
        largest: largest |sample - fit|, (components,).
        noise: estimated standard deviation of a sample, (components,).
        time: times of the recording, (samples,), s.
    """

    components: int
    degree: int
    parts: tuple[Part, ...]
    residual: FloatArray
    largest: FloatArray
    noise: FloatArray
    time: FloatArray

    @property
    def step(self) -> float:
        """Mean sampling interval, s."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    @cached_property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which all components are polynomials; the first and last are the span."""
        return np.unique(np.concatenate([part.knots for part in self.parts]))

    @property
    def unreliable(self) -> tuple[float, float]:
        """Times after the start and before the end with unreliable derivatives of any component, s."""
        stretches = [part.unreliable for part in self.parts] or [(0.0, 0.0)]
        starts, ends = zip(*stretches, strict=True)
        return max(starts), max(ends)

    @cached_property
    def exact(self) -> BoolArray:
        """Mask of components whose splines pass through the samples, or without values, (components,)."""
        exact = np.ones(self.components, dtype=bool)
        for part in self.parts:
            exact[part.members] = part.exact
        return exact

    def at(self, time: FloatArray, orders: int) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples)."""
        rows = np.full((orders, self.components, len(time)), np.nan)
        for part in self.parts:
            rows[:, part.members] = part.at(time, orders)
        return rows

    def stretched(self, factor: float) -> Fit:
        """Return the splines slowed down by a factor, with the same first time."""
        parts = tuple(part.stretched(factor) for part in self.parts)
        return replace(self, parts=parts, time=stretch(self.time, self.time[0], factor))

    def covariance(self, time: FloatArray) -> FloatArray:
        """Return covariances of value and derivatives, (components, orders, orders, samples).

        Orders go from the value to the highest derivative that the signal needs. Square roots of the diagonal
        are standard deviations. Those of a smoothing spline include the uncertainty due to its resolution, in
        addition to noise. Splines through samples with all digits have deviations of the size of rounding.

        Args:
            time: times of the span, (samples,), s.

        Returns:
            Covariances; NaN for components without values, and for those for which no two resolutions of a
            smoothing spline agree.
        """
        orders = ORDERS[self.degree]
        found = np.full((self.components, orders, orders, len(time)), np.nan)
        for part, posterior in zip(self.parts, self._posteriors, strict=True):
            if posterior is not None:
                basis = local_basis(part.spline.t, self.degree, time, orders)
                units = self._units(part, posterior, time)
                found[part.members] = units[:, :, None] * units[:, None] * of_derivatives(posterior, basis)
        return found

    @cached_property
    def _posteriors(self) -> list[Posterior | None]:
        """Posteriors of the coefficients of each part; None if unknown."""
        return [part.posterior(self.time) for part in self.parts]

    def _units(self, part: Part, posterior: Posterior, time: FloatArray) -> FloatArray:
        """Return the factors of the posterior's deviations, (members, orders or 1, samples or 1)."""
        known = part.smoothing
        if part.smooth and known is not None:
            start, end = part.knots[[0, -1]]
            return known.units_at((time - start) / (end - start))[None]
        units = self.noise[part.members]
        # The derivative's size includes this error; relative is its ratio to the derivative without it.
        share = 0.0 if known is None else known.relative / np.hypot(1.0, known.relative)
        share = max(share, 0.0 if part.noise is None else part.noise.share)
        if share > 0:
            order, probes = ORDERS[self.degree] - 1, np.linspace(*part.inside, PROBES)
            basis = local_basis(part.spline.t, self.degree, probes, order + 1)
            found = units * np.sqrt(np.mean(of_derivatives(posterior, basis)[order, order]))
            size = np.sqrt(np.mean(part.spline(probes, nu=order) ** 2, axis=0))
            units = units * np.maximum(1.0, share * size / found)
        return np.asarray(units[:, None, None])


def join(
    degree: int,
    parts: Sequence[Part],
    time: FloatArray,
    rows: FloatArray,
    noise: FloatArray,
    given: FloatArray,
) -> Fit:
    """Return the fit that consists of parts.

    Args:
        degree: degree of the splines.
        parts: parts, with each component in at most one.
        time: times of the recording, (samples,), s.
        rows: fitted samples, (components, samples).
        noise: estimated standard deviation of the samples, (components,); replaced by an estimate from the
            residual for parts that are not exact.
        given: standard deviation given by the user, (components,); NaN without one.
    """
    components = len(rows)
    residual, largest, noise = np.zeros(components), np.zeros(components), noise.copy()
    for part in parts:
        if not part.exact:
            error = rows[part.members] - part.spline(time).T
            freedom = max(1, len(time) - len(part.spline.c))
            residual[part.members] = np.sqrt(np.mean(error**2, axis=1))
            largest[part.members] = np.abs(error).max(axis=1)
            noise[part.members] = np.sqrt(np.sum(error**2, axis=1) / freedom)
    noise = np.where(np.isnan(given), noise, given)
    return Fit(components, degree, tuple(parts), residual, largest, noise, time)


CAUTION = 3.2
"""Factor from the difference between resolutions to the standard deviation. With motions of minimum jerk or
steps of velocity within 50 and 200 ms, and twelve colors of noise, torques that were wrong by more than 5 %
were so by up to 6.2 times the difference; twice this deviation is a little more."""

SMOOTH_CAUTION = 1.6
"""The same factor if the spectrum of the highest derivative decreases, so that it has no impulses. With steps
of velocity within 200 ms, d4q was off by 0.75 to 1.3 times the difference between resolutions."""

SHORTEST_IMPULSE = 5e-4
"""Shortest duration, s, of an impulse of the highest derivative, e.g. where jerk jumps: the current of a
motor hardly follows faster."""

IMPULSES = 0.6
"""Standard deviation of the highest derivative, as a share of the size that such an impulse would have. A
spline spreads an impulse: if it is longer by a factor, its root mean square is smaller by the root of the
factor. In 110 motions of minimum jerk, d4q was off by 0.58 to 1.01 times that size."""


class Unresolved:
    """Uncertainty of the components of a part for which no two resolutions agree.

    Attributes:
        members: indices of the components.
    """

    def __init__(self, fit: Fit, part: Part, posterior: Posterior, known: Smoothing, orders: int) -> None:
        """Scale a posterior.

        Args:
            fit: fit of the signal.
            part: part of the fit.
            posterior: posterior of the coefficients of the part's spline.
            known: difference between resolutions, and duration over which impulses are spread.
            orders: number of functions that are needed, value and derivatives.
        """
        self.members, self._orders = part.members, orders
        self._knots, self._degree, self._posterior = part.spline.t, fit.degree, posterior
        probes = np.linspace(*part.inside, PROBES)
        found = np.sqrt(np.mean(self._of_posterior(probes)[-1, -1]))
        size = np.sqrt(np.mean(part.spline(probes, nu=orders - 1) ** 2, axis=0))
        caution = CAUTION if known.spread else SMOOTH_CAUTION
        self._units: FloatArray = caution * known.relative * size / found
        self._impulses: FloatArray = IMPULSES * np.sqrt(known.spread / SHORTEST_IMPULSE) * size

    def covariance(self, time: FloatArray) -> FloatArray:
        """Return covariances of value and derivatives at times, s, (members, orders, orders, samples)."""
        found = self._units[:, None, None, None] ** 2 * self._of_posterior(time)
        found[:, -1, -1] += self._impulses[:, None] ** 2
        return np.asarray(found)

    def _of_posterior(self, time: FloatArray) -> FloatArray:
        basis = local_basis(self._knots, self._degree, time, self._orders)
        return of_derivatives(self._posterior, basis)


def unresolved(fit: Fit, orders: int) -> Iterator[Unresolved]:
    """Yield the unresolved components of a fit."""
    for part in fit.parts:
        known = part.smoothing
        if known is not None and not known.resolved:
            posterior = known.posterior if part.smooth else _of_least_squares(fit, part)
            if posterior is not None:
                yield Unresolved(fit, part, posterior, known, orders)


def _of_least_squares(fit: Fit, part: Part) -> Posterior | None:
    try:
        return of_least_squares(fit.time, part.spline.t, fit.degree)
    except np.linalg.LinAlgError:  # very uneven times
        return None


def vibrations(fit: Fit, orders: int) -> Iterator[tuple[int, FloatArray]]:
    """Yield components with lines in their spectrum that may be motion or noise.

    Yields:
        Index of the component, and covariance of value and derivatives, (orders, orders), of lines that count
        as noise, with all their power at the highest frequency; NaN if the spline follows the lines.
    """
    for part in fit.parts:
        known = part.smoothing
        if known is not None and known.lines.others:
            rate = 2 * np.pi * max(known.lines.others) * np.exp(0.5j * np.pi)
            line = rate ** np.arange(orders)  # derivatives of a rotating phasor
            covariance = np.real(line[:, None] * line.conj())
            for member in part.members.tolist():
                power = np.nan if known.follows_lines else known.lines.share * fit.residual[member] ** 2
                yield member, power * covariance
