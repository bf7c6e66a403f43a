"""Smoothing splines for records whose noise has any colour, and how far to trust them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.calibration import calibrated, posterior_error
from vsacli.trajectory.fits.cutoff import falls
from vsacli.trajectory.fits.information import Posterior
from vsacli.trajectory.fits.resolution import KnownNoise, Resolution, find_resolution
from vsacli.trajectory.fits.spectral_lines import Lines, is_rounding, spectral_lines
from vsacli.trajectory.fits.spectrum import FollowedNoise

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


DETERMINED = 0.074
"""Expected relative error of the highest derivative up to which it counts as right to 10 %. Of 1260 records
with seven motions and twelve noises three with 0.077 were wrong by 10.0 to 10.4 %, none with less."""


@dataclass(frozen=True, eq=False)
class Smoothing:
    """What is known of a smoothing spline.

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
        """Return what is known of a spline that follows noise, too.

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
        """That of the same course, slower by a factor."""
        return replace(
            self,
            deviations=self.deviations / factor ** np.arange(len(self.deviations)),
            spread=factor * self.spread,
            lines=self.lines.stretched(factor),
        )


def smoothing_spline(
    time: FloatArray, row: FloatArray, degree: int, order: int, known: KnownNoise
) -> tuple[BSpline[np.float64], Smoothing] | None:
    """The smoothing spline near samples at the resolution that the record asks for.

    Args:
        time: (samples,), s.
        row: (samples,).
        degree: of the spline.
        order: of the highest derivative that is needed.
        known: what need not be estimated.

    Returns:
        The spline, with one column, and what is known of it; None of a constant record, or one too short or
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
    """The resolution that the record asks for, and no mains hum, which a fine one follows like a motion."""
    found = find_resolution(time, row, degree, order, known)
    if found is None or found.given:
        return found
    spline = found.model.spline
    size = float(np.sqrt(np.mean(spline(found.model.probes, nu=order) ** 2)))
    hum = spectral_lines(time, spline(time)[:, 0], order, size).hum
    return find_resolution(time, row, degree, order, known, min(hum)) if hum else found
