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
import scipy

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.trajectory.fits.least_squares import Posterior, local_basis, of_derivatives, of_least_squares
from vsacli.trajectory.fits.noise import LeftOutMotion
from vsacli.trajectory.fits.smoothing import Smoothing
from vsacli.trajectory.fits.spectrum import FollowedNoise
from vsacli.trajectory.times import stretch

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


ORDERS = {7: 5, 5: 3}
"""Number of functions that are needed, value and derivatives, by the degree of the splines."""

PROBES = 4000
"""Number of times for root mean squares: of 500, impulses of a long recording fall between two."""


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
        ringing: times after the start and before the end in which a filter rings, s.
        transient: time after the start and before the end in which the transient of a filter lasts, s.
        left_out: motion that a fit chosen by the user leaves out; None if its residual looks like noise.
    """

    members: IndexArray
    spline: BSpline[np.float64]
    exact: bool
    smoothing: Smoothing | None = None
    smooth: bool = False
    noise: FollowedNoise | None = None
    ringing: tuple[float, float] = (0.0, 0.0)
    transient: float = 0.0
    left_out: LeftOutMotion | None = None

    @property
    def knots(self) -> FloatArray:
        """Ascending times between which the spline is one polynomial; the first and last are its span."""
        return np.asarray(self.spline.t[self.spline.k : -self.spline.k])

    @property
    def unreliable(self) -> tuple[float, float]:
        """Times after the start and before the end with unreliable derivatives, s.

        They are (degree + 1)/2 knot spans, or longer while a filter rings or its transient lasts. Beyond,
        noise in the highest derivative that is needed is less than 1.4 times that anywhere inside; at the
        ends it is up to 850 times that.
        """
        spans, (start, end) = (self.spline.k + 1) // 2, self.ringing
        first, last = float(np.ptp(self.knots[: spans + 1])), float(np.ptp(self.knots[-spans - 1 :]))
        return max(first, start, self.transient), max(last, end, self.transient)

    @property
    def inside(self) -> tuple[float, float]:
        """First and last time, s, with reliable derivatives; of the middle half if that is longer."""
        first, last = self.knots[[0, -1]].tolist()
        start, end = np.minimum(self.unreliable, (last - first) / 4).tolist()
        return first + start, last - end

    def of_columns(self, columns: IndexArray) -> Part:
        """Return the part with only some members, given by columns of the spline."""
        spline = scipy.interpolate.BSpline(self.spline.t, self.spline.c[:, columns], self.spline.k)
        return replace(self, members=self.members[columns], spline=spline)

    def at(self, time: FloatArray, orders: int) -> FloatArray:
        """Return value and derivatives, shape (orders, members, samples).

        Within a knot span one polynomial is evaluated, so that neighboring values share their rounding error.
        Evaluating derivatives of B-splines point by point leaves noise of about eps / step^order.
        """
        degree, knots = self.spline.k, self.knots
        span = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
        used_spans, span_of_sample = np.unique(span, return_inverse=True)
        offset = time - knots[span]
        taylor = [
            self.spline(knots[used_spans], nu=order).T[:, span_of_sample] for order in range(degree + 1)
        ]
        derivatives = np.empty((orders, len(self.members), len(time)))
        for order, derivative in enumerate(derivatives):
            derivative[:] = taylor[degree]
            for power in range(degree - order, 0, -1):
                derivative *= offset / power
                derivative += taylor[order + power - 1]
        return derivatives

    def size(self, order: int) -> FloatArray:
        """Return the root mean square of a derivative away from the ends, (members,)."""
        derivative = self.spline(np.linspace(*self.inside, PROBES), nu=order)
        return np.asarray(np.sqrt(np.mean(derivative**2, axis=0)))

    def unmodeled_covariance(self, orders: int) -> FloatArray:
        """Return covariances of noise that is followed and of motion left out, (members, orders, orders)."""
        covariances = np.zeros((len(self.members), orders, orders))
        if self.noise is not None and self.noise.share:
            covariances += self.size(orders - 1)[:, None, None] ** 2 * self.noise.covariance(orders)
        if self.left_out is not None:
            covariances += self.left_out.covariance(orders)
        return covariances

    def posterior(self, time: FloatArray) -> Posterior | None:
        """Return the posterior of the coefficients for white noise of deviation 1; None if it is unknown.

        Args:
            time: times of the recording, (samples,), s.
        """
        try:
            return of_least_squares(time, self.spline.t, self.spline.k)
        except np.linalg.LinAlgError:  # very uneven times
            return None

    def stretched(self, factor: float) -> Part:
        """Return the spline slowed down by a factor, with the same first time."""
        knots = stretch(self.spline.t, self.knots[0], factor)
        smoothing = None if self.smoothing is None else self.smoothing.stretched(factor)
        noise = None if self.noise is None else self.noise.stretched(factor)
        spline, (start, end) = scipy.interpolate.BSpline(knots, self.spline.c, self.spline.k), self.ringing
        left_out = None if self.left_out is None else self.left_out.stretched(factor)
        return replace(
            self,
            spline=spline,
            smoothing=smoothing,
            noise=noise,
            ringing=(factor * start, factor * end),
            transient=factor * self.transient,
            left_out=left_out,
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
        derivatives = np.full((orders, self.components, len(time)), np.nan)
        for part in self.parts:
            derivatives[:, part.members] = part.at(time, orders)
        return derivatives

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
        covariances = np.full((self.components, orders, orders, len(time)), np.nan)
        for part in self.parts:
            smoothing = part.smoothing
            if smoothing is None:
                covariances[part.members] = self._white_noise_covariance(part, time)
            elif smoothing.resolved:
                covariances[part.members] = smoothing.covariance(time)
                if not part.smooth:
                    covariances[part.members] += smoothing.disagreement[..., None]
            covariances[part.members] += part.unmodeled_covariance(orders)[..., None]
        return covariances

    def _white_noise_covariance(self, part: Part, time: FloatArray) -> FloatArray:
        """Return the covariances of a part that no smoothing spline assesses; NaN if they are unknown."""
        orders, posterior = ORDERS[self.degree], self._posterior_of(part)
        if posterior is None:
            return np.full((len(part.members), orders, orders, len(time)), np.nan)
        covariance = of_derivatives(posterior, local_basis(part.spline.t, self.degree, time, orders))
        scaled_covariance = self.noise[part.members, None, None, None] ** 2 * covariance
        return np.asarray(scaled_covariance)

    def _posterior_of(self, part: Part) -> Posterior | None:
        if part not in self._posteriors:
            self._posteriors[part] = part.posterior(self.time)
        return self._posteriors[part]

    @cached_property
    def _posteriors(self) -> dict[Part, Posterior | None]:
        """Posteriors of parts that were asked for."""
        return {}


def join(
    degree: int,
    parts: Sequence[Part],
    time: FloatArray,
    rows: FloatArray,
    noise: FloatArray,
    given_noise: FloatArray,
) -> Fit:
    """Return the fit that consists of parts.

    Args:
        degree: degree of the splines.
        parts: parts, with each component in at most one.
        time: times of the recording, (samples,), s.
        rows: fitted samples, (components, samples).
        noise: estimated standard deviation of the samples, (components,); replaced by an estimate from the
            residual for parts that are not exact.
        given_noise: standard deviation given by the user, (components,); NaN without one.
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
    noise = np.where(np.isnan(given_noise), noise, given_noise)
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


def unresolved(fit: Fit, orders: int) -> Iterator[tuple[IndexArray, FloatArray]]:
    """Yield the components for which no two resolutions agree, with a covariance that bounds their error.

    Yields:
        Indices of the components, and covariances of value and derivatives, (members, orders, orders): that
        of the difference between resolutions, and impulses of the highest derivative.
    """
    for part in fit.parts:
        smoothing = part.smoothing
        if smoothing is not None and not smoothing.resolved:
            caution = CAUTION if smoothing.spread else SMOOTH_CAUTION
            error_covariance = caution**2 * smoothing.disagreement + part.unmodeled_covariance(orders)
            shortest = max(SHORTEST_IMPULSE, fit.step)
            error_covariance[:, -1, -1] += (
                IMPULSES**2 * smoothing.spread / shortest * part.size(orders - 1) ** 2
            )
            yield part.members, error_covariance


def vibrations(fit: Fit, orders: int) -> Iterator[tuple[int, FloatArray]]:
    """Yield components with lines in their spectrum that may be motion or noise.

    Yields:
        Index of the component, and covariance of value and derivatives, (orders, orders), of lines that count
        as noise, with all their power at the highest frequency; NaN if the spline follows the lines.
    """
    for part in fit.parts:
        smoothing = part.smoothing
        if smoothing is not None and smoothing.lines.others:
            rate = 2 * np.pi * max(smoothing.lines.others) * np.exp(0.5j * np.pi)
            line_phasor = rate ** np.arange(orders)  # derivatives of a rotating phasor
            covariance = np.real(line_phasor[:, None] * line_phasor.conj())
            for member in part.members.tolist():
                power = (
                    np.nan if smoothing.follows_lines else smoothing.lines.share * fit.residual[member] ** 2
                )
                yield member, power * covariance
