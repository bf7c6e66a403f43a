"""Smoothing splines for noise of any color, and their errors: variance due to noise, and bias."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.least_squares import Posterior, local_basis, of_derivatives
from vsacli.trajectory.fits.noise import Lines, is_rounding, spectral_lines, white_noise_level
from vsacli.trajectory.fits.penalized import Model, falls, motion_power
from vsacli.trajectory.fits.resolution import LEFT_OVER, KnownNoise, Resolution, find_resolution
from vsacli.trajectory.fits.spectrum import FollowedNoise
from vsacli.trajectory.times import stretch

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


STEP = 0.35
"""Step of log t to both sides, for finite differences with respect to it."""

KINK_VARIANCE_FACTOR = 2.5
"""Factor of the variance where motion starts or stops: there a single difference of coefficients carries what
the penalty spreads over a segment. On 32 rest-to-rest recordings errors were 0.7 to 2.1 deviations there.
With this factor deviations are 0.7 to 1.5 times the errors over a recording; with twice as much up to 2.0."""

MIN_BIAS_SHARE = 0.3
"""Smallest share of the expected bias; its estimate varies by about 0.4 from recording to recording."""


SEGMENT_ERROR_FACTOR = 2.0
"""Factor from the posterior deviation of a spline with several penalties to its error, both root mean square.
A few samples at the ends of pauses have most of the error: nearly all samples are within twice their
deviation, and yet the sum of squares is larger. On 150 recordings the factor was up to 2.4."""


class Calibration(NamedTuple):
    """Standard deviations of a spline and its derivatives.

    Attributes:
        deviations: standard deviations at `Model.probes`, (orders, probes).
        units: standard deviations over those of the posterior `Model.cautious`, (orders, probes).
    """

    deviations: FloatArray
    units: FloatArray


def calibrated(model: Model, orders: int, unexplained: float) -> Calibration:
    """Return the standard deviations of value and derivatives.

    Args:
        model: model of the spline.
        orders: number of functions, value and derivatives.
        unexplained: change of the highest derivative from one resolution to the next that noise does not
            explain, root mean square away from the ends.
    """
    neighbor_models = [model.stiffened(-STEP), model.stiffened(STEP)]
    share = _bias_share(model, orders - 1)
    cautious = np.array([model.variances(order, model.cautious) for order in range(orders)])
    softer_variances, stiffer_variances = (
        np.array([each.variances(order) for order in range(orders)]) for each in neighbor_models
    )
    bias = (softer_variances - stiffer_variances) / (2 * STEP)
    # The finite difference may exceed the variance, although bias is a part of that: bound it.
    variances = np.maximum(cautious - (1 - share) * bias, min(share, 1.0) * cautious)
    variances = np.where(model.kinks, np.maximum(variances, KINK_VARIANCE_FACTOR * cautious), variances)
    variances *= 1 + unexplained**2 / float(np.mean(variances[-1, model.inside]) * model.noise_variance)
    return Calibration(
        np.sqrt(model.noise_variance * variances), np.sqrt(model.noise_variance * variances / cautious)
    )


def posterior_error(model: Model, order: int) -> float:
    """Return the root mean square error of a derivative away from the ends, by the posterior only."""
    variance = np.mean(model.variances(order, model.cautious)[model.inside]) * model.noise_variance
    return float((SEGMENT_ERROR_FACTOR if model.segments > 1 else 1.0) * np.sqrt(variance))


def _bias_share(model: Model, order: int) -> float:
    """Return the squared bias of a derivative as a share of the prior's, from the motion at the cut-off.

    Motion above the cut-off is extrapolated: the share is larger again if the spectrum falls more slowly than
    the prior's.
    """
    weight = model.inside / model.variances(order)  # equal weight of all parts of the recording
    power = motion_power(model, order, 2, weight)
    has_power = power.expected > 0  # a straight line has no cut-off
    share = float(np.max(power.found[has_power] / power.expected[has_power], initial=0.0))
    return max(share, MIN_BIAS_SHARE, share * abs(share))


MAX_DETERMINED_ERROR = 0.074
"""Largest expected relative error of the highest derivative with which it counts as accurate to 10 %. Of 1260
recordings with seven motions and twelve noises, three with 0.077 were off by 10.0 to 10.4 %, none with
less."""


@dataclass(frozen=True, eq=False)
class Smoothing:
    """The assessment of a fit by a smoothing spline.

    Attributes:
        deviations: standard deviation of the value and each derivative, root mean square away from the ends,
            (orders,).
        relative: expected error of the highest derivative that is needed, over this derivative's own root
            mean square; somewhat more than the deviation.
        resolved: whether two successive resolutions agree on this derivative.
        spread: duration over which the spline spreads possible impulses of it, s; zero if it is resolved, or
            if its spectrum falls.
        lines: frequencies that stand out of the residual.
        knots: knots of the smoothing spline, s.
        posterior: posterior of its coefficients.
        units: factors of the posterior's deviations of the value and each derivative, at equal steps of the
            spline's span, (orders, steps).
        disagreement: covariance over time of value and derivatives of the difference between two resolutions,
            or between this spline and another fit compared with it, (orders, orders).
        own: expected error of the smoothing spline itself, like `relative`, which may be that of another fit
            compared with it.
        follows_lines: whether the spline follows lines other than mains hum.
    """

    deviations: FloatArray
    relative: float
    resolved: bool
    spread: float
    lines: Lines
    knots: FloatArray
    posterior: Posterior
    units: FloatArray
    disagreement: FloatArray
    own: float
    follows_lines: bool = False

    @property
    def determined(self) -> bool:
        """Whether the recording determines the highest derivative to 10 %."""
        return self.resolved and self.relative <= MAX_DETERMINED_ERROR

    def following(self, noise: FollowedNoise, size: float) -> Smoothing:
        """Return the assessment of a spline that also follows filtered noise.

        Args:
            noise: noise in its highest derivative.
            size: root mean square of this derivative away from the ends.
        """
        # If unresolved, the error is relative to the spline's derivative including the noise.
        relative = float(np.hypot(self.relative, noise.relative if self.resolved else noise.share))
        noise_variance = size**2 * np.diag(noise.covariance(len(self.deviations)))
        return replace(self, deviations=np.sqrt(self.deviations**2 + noise_variance), relative=relative)

    def units_at(self, place: FloatArray) -> FloatArray:
        """Return the factors of the posterior's deviations, (orders, places).

        Args:
            place: places in the spline's span, 0 to 1, (places,).
        """
        steps = self.units.shape[1]
        return np.array([np.interp(place * steps - 0.5, np.arange(steps), row) for row in self.units])

    def covariance(self, time: FloatArray) -> FloatArray:
        """Return the covariance of value and derivatives, (orders, orders, samples), at times, s."""
        orders, degree = len(self.units), 2 * len(self.units) - 3
        start, end = self.knots[[degree, -degree - 1]]
        units = self.units_at((time - start) / (end - start))
        basis = local_basis(self.knots, degree, time, orders)
        return np.asarray(units[:, None] * units * of_derivatives(self.posterior, basis))

    def stretched(self, factor: float) -> Smoothing:
        """Return the assessment for the motion slowed down by a factor."""
        return replace(
            self,
            deviations=self.deviations / factor ** np.arange(len(self.deviations)),
            spread=factor * self.spread,
            lines=self.lines.stretched(factor),
            knots=stretch(self.knots, self.knots[len(self.units) * 2 - 3], factor),
            disagreement=self.disagreement / factor ** np.add.outer(*2 * [np.arange(len(self.units))]),
        )


def smoothing_spline(
    time: FloatArray, row: FloatArray, degree: int, order: int, known: KnownNoise
) -> tuple[BSpline[np.float64], Smoothing] | None:
    """Return the smoothing spline of samples, at the resolution that the recording determines.

    Args:
        time: times, (samples,), s.
        row: values, (samples,).
        degree: degree of the spline.
        order: order of the highest derivative that is needed.
        known: given noise and bandwidth.

    Returns:
        The spline, with one column, and its assessment; None if the recording is constant, too short or too
        uneven.
    """
    offset, scale = float(np.mean(row)), float(np.std(row))
    if scale <= 4 * np.finfo(float).eps * abs(offset):
        return None
    deviation = None if known.deviation is None else known.deviation / scale
    normalized_noise = known._replace(deviation=deviation)
    resolution = _resolution_below_hum(time, (row - offset) / scale, degree, order, normalized_noise)
    if resolution is None:
        return None
    model, spline = resolution.model, resolution.model.spline
    calibration = calibrated(model, order + 1, resolution.unexplained)
    deviations = scale * np.sqrt(np.mean(calibration.deviations[:, model.inside] ** 2, axis=1))
    derivative_rms = scale * float(np.sqrt(np.mean(spline(model.probes, nu=order)[model.inside] ** 2)))
    relative = resolution.total
    if resolution.accepted:
        errors = np.array([deviations[order], scale * posterior_error(model, order)])
        relative = float(
            np.max(np.hypot(errors / max(derivative_rms, np.finfo(float).tiny), [0.0, resolution.change]))
        )
    residual = row - (scale * spline(time)[:, 0] + offset)
    lines = (
        Lines()
        if is_rounding(row, residual)
        else spectral_lines(time, residual, order, derivative_rms, known.bandwidth)
    )
    units = scale * calibration.units
    spread = 0.0 if resolution.accepted or falls(model, order) else model.piece
    probes = model.probes[model.inside]
    smoothing = Smoothing(
        deviations,
        relative,
        resolution.accepted,
        spread,
        lines,
        spline.t,
        model.cautious,
        units,
        scale**2 * disagreement(spline, resolution.other.spline, probes, order + 1),
        relative,
    )
    return scipy.interpolate.BSpline(spline.t, scale * spline.c + offset, degree), smoothing


def disagreement(
    spline: BSpline[np.float64], other: BSpline[np.float64], time: FloatArray, orders: int
) -> FloatArray:
    """Return the covariance over times, s, of the difference of two splines and derivatives.

    Both splines have one column; the result is (orders, orders).
    """
    rows = np.array([(spline(time, nu=order) - other(time, nu=order))[:, 0] for order in range(orders)])
    return np.asarray(rows @ rows.T / len(time))


def _resolution_below_hum(
    time: FloatArray, row: FloatArray, degree: int, order: int, known: KnownNoise
) -> Resolution | None:
    """Return the resolution below mains hum, which a finer one would follow like a motion.

    Where white noise hides the motion in the differences of samples, its size is known: a resolution that
    leaves over more leaves motion out.
    """
    resolution = find_resolution(time, row, degree, order, known)
    if resolution is None or resolution.given:
        return resolution
    spline = resolution.model.spline
    derivative_rms = float(np.sqrt(np.mean(spline(resolution.model.probes, nu=order) ** 2)))
    hum = spectral_lines(time, spline(time)[:, 0], order, derivative_rms).hum
    if hum:
        return find_resolution(time, row, degree, order, known, min(hum))
    white_noise = white_noise_level(time, row, degree + 1) if known.deviation is None else None
    if white_noise is None or (resolution.accepted and resolution.residual <= LEFT_OVER * white_noise):
        return resolution
    vibrations = spectral_lines(time, row - spline(time)[:, 0], order, derivative_rms)
    if resolution.accepted and (vibrations.hum or vibrations.others):
        return resolution  # they may be noise, which is for the user to say
    finer_resolution = find_resolution(time, row, degree, order, KnownNoise(white_noise, white=True))
    if finer_resolution is not None and finer_resolution.accepted:
        return finer_resolution
    return resolution._replace(refused=resolution.residual > LEFT_OVER * white_noise)
