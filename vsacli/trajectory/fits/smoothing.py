"""Smoothing splines for noise of any colour, and how far they are off: by noise, and by a bias."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.banded_qr import Posterior
from vsacli.trajectory.fits.noise import Lines, is_rounding, spectral_lines
from vsacli.trajectory.fits.penalised import Model, falls, motion_power
from vsacli.trajectory.fits.resolution import KnownNoise, Resolution, find_resolution
from vsacli.trajectory.fits.spectrum import FollowedNoise

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


STEP = 0.35
"""Step of log t to both sides, between which derivatives by it are taken."""

KINK_VARIANCE = 2.5
"""Factor of the variance where motion starts or stops: there one difference of coefficients carries what the
penalty spreads over a segment. On 32 records from rest to rest errors were 0.7 to 2.1 deviations there. With
this, deviations are 0.7 to 1.5 times the errors, all over a record; with twice as much up to 2.0."""

LEAST_SHARE = 0.3
"""Smallest share of the expected bias. Its measure is off by some 0.4 from recording to recording."""


FEW_SAMPLES = 2.0
"""Factor from the posterior deviation of a spline with several penalties to its error, both root mean square.
A few samples at the ends of pauses have most of that, so that nearly all samples are right within twice their
deviation, and the sum of all squares is larger all the same. On 150 records it was up to 2.4 times."""


class Calibration(NamedTuple):
    """Standard deviations of a spline and its derivatives.

    Attributes:
        deviations: at `Model.probes`, (orders, probes).
        units: the same relative to those of the posterior `Model.cautious`, (orders, probes).
    """

    deviations: FloatArray
    units: FloatArray


def calibrated(model: Model, orders: int, unexplained: float) -> Calibration:
    """Return the deviations of value and derivatives.

    Args:
        model: the spline.
        orders: of the value and its derivatives.
        unexplained: how much the highest derivative changes from one resolution to the next beyond what noise
            explains, root mean square away from the ends.
    """
    near = [model.stiffened(-STEP), model.stiffened(STEP)]
    share = _bias_share(model, orders - 1)
    cautious = np.array([model.variances(order, model.cautious) for order in range(orders)])
    softer, stiffer = (np.array([each.variances(order) for order in range(orders)]) for each in near)
    bias = (softer - stiffer) / (2 * STEP)
    # the difference that stands for the derivative may exceed the variance, of which bias is a part
    found = np.maximum(cautious - (1 - share) * bias, min(share, 1.0) * cautious)
    found = np.where(model.kinks, np.maximum(found, KINK_VARIANCE * cautious), found)
    found *= 1 + unexplained**2 / float(np.mean(found[-1, model.inside]) * model.noise_variance)
    return Calibration(
        np.sqrt(model.noise_variance * found), np.sqrt(model.noise_variance * found / cautious)
    )


def posterior_error(model: Model, order: int) -> float:
    """Return the root mean square error of a derivative away from the ends, by the posterior alone."""
    variance = np.mean(model.variances(order, model.cautious)[model.inside]) * model.noise_variance
    return float((FEW_SAMPLES if model.segments > 1 else 1.0) * np.sqrt(variance))


def _bias_share(model: Model, order: int) -> float:
    """Return the squared bias of a derivative as a share of the prior, by the motion at the cut-off.

    What lies above the cut-off is extrapolated: if the spectrum falls more slowly than the prior's, it is
    more again.
    """
    weight = model.inside / model.variances(order)  # each part of the record counts alike
    power = motion_power(model, order, 2, weight)
    exists = power.expected > 0  # a straight line has no cut-off
    share = float(np.max(power.found[exists] / power.expected[exists], initial=0.0))
    return max(share, LEAST_SHARE, share * abs(share))


DETERMINED = 0.074
"""Expected relative error of the highest derivative up to which it counts as right to 10 %. Of 1260 records
with seven motions and twelve noises three with 0.077 were wrong by 10.0 to 10.4 %, none with less."""


@dataclass(frozen=True, eq=False)
class Smoothing:
    """The judgement of a smoothing spline.

    Attributes:
        deviations: standard deviation of the value and each derivative, root mean square away from the ends,
            (orders,).
        relative: error that must be expected of the highest derivative that is needed, over this derivative's
            own root mean square; rather more than the deviation.
        resolved: whether two successive resolutions agree on that derivative.
        spread: length over which it has what may be impulses, s; zero if it is resolved, or its spectrum
            falls.
        lines: frequencies that stand out of the residual.
        posterior: of the coefficients.
        units: of the posterior's deviations of the value and each derivative, at equal steps of the spline's
            span, (orders, steps).
        follows_lines: whether the spline follows those that are not of mains.
    """

    deviations: FloatArray
    relative: float
    resolved: bool
    spread: float
    lines: Lines
    posterior: Posterior
    units: FloatArray
    follows_lines: bool = False

    @property
    def determined(self) -> bool:
        """Whether the record determines the highest derivative to 10 %."""
        return self.resolved and self.relative <= DETERMINED

    def following(self, noise: FollowedNoise, size: float) -> Smoothing:
        """Return the judgement of a spline that follows noise, too.

        Args:
            noise: in its highest derivative.
            size: of this derivative, root mean square away from the ends.
        """
        # of what is unresolved the error is relative to the spline's derivative with all that it follows
        relative = float(np.hypot(self.relative, noise.relative if self.resolved else noise.share))
        factor = max(1.0, noise.share * size / max(self.deviations[-1], np.finfo(float).tiny))
        return replace(
            self,
            deviations=factor * self.deviations,
            units=factor * self.units,
            relative=relative,
        )

    def units_at(self, place: FloatArray) -> FloatArray:
        """Units of the posterior's deviations, (orders, places).

        Args:
            place: of the spline's span, 0 to 1, (places,).
        """
        steps = self.units.shape[1]
        return np.array([np.interp(place * steps - 0.5, np.arange(steps), row) for row in self.units])

    def stretched(self, factor: float) -> Smoothing:
        """Return the judgement for the same motion, slower by a factor."""
        return replace(
            self,
            deviations=self.deviations / factor ** np.arange(len(self.deviations)),
            spread=factor * self.spread,
            lines=self.lines.stretched(factor),
        )


def smoothing_spline(
    time: FloatArray, row: FloatArray, degree: int, order: int, known: KnownNoise
) -> tuple[BSpline[np.float64], Smoothing] | None:
    """Return the smoothing spline near samples at the resolution that the record asks for.

    Args:
        time: (samples,), s.
        row: (samples,).
        degree: of the spline.
        order: of the highest derivative that is needed.
        known: given noise and bandwidth.

    Returns:
        The spline, with one column, and its judgement; None for a constant recording, or one too short or
        uneven for any.
    """
    from scipy.interpolate import BSpline

    offset, scale = float(np.mean(row)), float(np.std(row))
    if scale <= 4 * np.finfo(float).eps * abs(offset):
        return None
    deviation = None if known.deviation is None else known.deviation / scale
    normal = known._replace(deviation=deviation)
    found = _found(time, (row - offset) / scale, degree, order, normal)
    if found is None:
        return None
    model, spline = found.model, found.model.spline
    known_errors = calibrated(model, order + 1, found.unexplained)
    deviations = scale * np.sqrt(np.mean(known_errors.deviations[:, model.inside] ** 2, axis=1))
    size = scale * float(np.sqrt(np.mean(spline(model.probes, nu=order)[model.inside] ** 2)))
    relative = found.total
    if found.accepted:
        errors = np.array([deviations[order], scale * posterior_error(model, order)])
        relative = float(np.max(np.hypot(errors / max(size, np.finfo(float).tiny), [0.0, found.change])))
    residual = row - (scale * spline(time)[:, 0] + offset)
    lines = (
        Lines()
        if is_rounding(row, residual)
        else spectral_lines(time, residual, order, size, known.bandwidth)
    )
    units = scale * known_errors.units
    spread = 0.0 if found.accepted or falls(model, order) else model.piece
    smoothing = Smoothing(deviations, relative, found.accepted, spread, lines, model.cautious, units)
    return BSpline(spline.t, scale * spline.c + offset, degree), smoothing


def _found(
    time: FloatArray, row: FloatArray, degree: int, order: int, known: KnownNoise
) -> Resolution | None:
    """Return the resolution of the recording, without mains hum, which a fine one follows like a motion."""
    found = find_resolution(time, row, degree, order, known)
    if found is None or found.given:
        return found
    spline = found.model.spline
    size = float(np.sqrt(np.mean(spline(found.model.probes, nu=order) ** 2)))
    hum = spectral_lines(time, spline(time)[:, 0], order, size).hum
    return find_resolution(time, row, degree, order, known, min(hum)) if hum else found
