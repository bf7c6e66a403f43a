"""Smoothing splines for records whose noise has any colour: which resolution, and how far to trust it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.bins import BINS_PER_SPAN, Bins
from vsacli.trajectory.fits.information import Posterior
from vsacli.trajectory.fits.penalised import Model, most_likely
from vsacli.trajectory.fits.residual import Lines, spectral_lines

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

FIRST_SPANS, FIRST_SPANS_SHORT = 32, 4
"""Of the coarsest resolution; that of records of fewer than `SHORT` samples is coarser."""

SHORT = 256

FEWEST_SAMPLES, ALWAYS_SPANS, MOST_SPANS = 4, 128, 32768
"""Samples of a span; spans that there may be also with fewer, and never more of. Noise of fewer samples in a
row has spoilt what a finer resolution would show, and time grows with the spans."""

SEGMENTED_FACTOR = 2.5
"""By which the deviation of a spline with several penalties is multiplied. On rest-to-rest motions with
pauses the error was up to 2.3 times the posterior deviation, which takes the penalties for known."""

NEGLIGIBLE = 0.01
"""Relative change of the highest derivative from one resolution to the next that asks for no finer one."""

CONFIRMED = 1.6
"""Deviations by which that derivative may change then. With 2 encoders from rest to rest got half the knots
and twice the error."""

ACCEPTED = 0.25
"""Largest relative deviation of the highest derivative with which a resolution is accepted. Motions whose
fast parts pass for noise had 0.3 and more."""


@dataclass(frozen=True, eq=False)
class Smoothing:
    """What is known of a smoothing spline.

    Attributes:
        deviations: standard deviation of the value and each derivative, root mean square away from the ends,
            (orders,).
        relative: that of the highest derivative that is needed, over this derivative's own root mean square.
        resolved: whether two successive resolutions agree on that derivative.
        lines: frequencies that stand out of the residual.
        posterior: of the coefficients.
        unit: of the posterior's deviations.
    """

    deviations: FloatArray
    relative: float
    resolved: bool
    lines: Lines
    posterior: Posterior
    unit: float

    @property
    def determined(self) -> bool:
        """Whether the record determines the highest derivative to 10 %."""
        return self.resolved and self.relative <= 0.1

    def stretched(self, factor: float) -> Smoothing:
        """That of the same course, slower by a factor."""
        return replace(
            self,
            deviations=self.deviations / factor ** np.arange(len(self.deviations)),
            lines=self.lines.stretched(factor),
        )


class _Step(NamedTuple):
    """A resolution, compared with the next.

    Attributes:
        model: the coarser of both.
        deviation: of the highest derivative by noise, relative.
        change: of that derivative from one to the other, relative.
    """

    model: Model
    deviation: float
    change: float

    @property
    def stated(self) -> float:
        """Both together, as what is unresolved is an error like any other."""
        return float(np.hypot(self.deviation, self.change))

    @property
    def accepted(self) -> bool:
        """Whether the next resolution changes no more than noise does, and both are small."""
        return self.change < max(CONFIRMED * self.deviation, NEGLIGIBLE) and self.stated < ACCEPTED


def smoothing_spline(
    time: FloatArray, row: FloatArray, degree: int, order: int
) -> tuple[BSpline[np.float64], Smoothing] | None:
    """The smoothing spline near samples at the first resolution that the next one confirms.

    Coarse to fine, since it is the band that counts: above the frequency at which the motion falls below the
    noise, whatever colour this has does not matter, and only a resolution beyond it would have to know it.

    Args:
        time: (samples,), s.
        row: (samples,).
        degree: of the spline.
        order: of the highest derivative that is needed.

    Returns:
        The spline, with one column, and what is known of it. If no resolution is accepted, the spline of
        that with the least deviation; None of a constant record, or one too short or uneven for any.
    """
    from scipy.interpolate import BSpline

    offset, scale = float(np.mean(row)), float(np.std(row))
    if scale <= 4 * np.finfo(float).eps * abs(offset):
        return None
    best: _Step | None = None
    for step in _steps(time, (row - offset) / scale, degree, order):
        if best is None or step.accepted or step.stated < best.stated:
            best = step
        if step.accepted:
            break
    if best is None:
        return None
    model, spline = best.model, best.model.spline
    deviations = np.array([scale * _rms_deviation(model, each) for each in range(order + 1)])
    residual = row - (scale * spline(time)[:, 0] + offset)
    size = scale * float(np.sqrt(np.mean(spline(model.probes, nu=order)[model.inside] ** 2)))
    lines = spectral_lines(time, residual, order, size)
    # the unit of the posterior that makes its deviations those that are stated
    unit = scale * _factor(model) * math.sqrt(model.noise_variance) * best.stated / best.deviation
    known = Smoothing(deviations, best.stated, best.accepted, lines, model.posterior, unit)
    return BSpline(spline.t, scale * spline.c + offset, degree), known


def _steps(time: FloatArray, row: FloatArray, degree: int, order: int) -> Iterator[_Step]:
    """Successive resolutions, each compared with the next."""
    for coarse, fine in pairwise(_models(time, row, degree)):
        expected = fine.spline(fine.probes, nu=order)[fine.inside, 0]
        size = float(np.sqrt(np.mean(expected**2)))
        found = coarse.spline(fine.probes, nu=order)[fine.inside, 0]
        change = float(np.sqrt(np.mean((found - expected) ** 2)))
        deviation = _rms_deviation(coarse, order)
        least = np.finfo(float).tiny
        yield _Step(coarse, deviation / max(size, least), change / max(size, least))


def _models(time: FloatArray, row: FloatArray, degree: int) -> Iterator[Model]:
    spans = FIRST_SPANS if len(time) >= SHORT else FIRST_SPANS_SHORT
    model: Model | None = None
    most = max(len(time) // FEWEST_SAMPLES, min(len(time) // BINS_PER_SPAN, ALWAYS_SPANS), FIRST_SPANS)
    while spans <= min(most, MOST_SPANS):
        bins = Bins.of(time, row, spans, degree)
        if len(bins.means) > degree + 1:
            model = most_likely(bins, model)
            yield model
        spans *= 2


def _rms_deviation(model: Model, order: int) -> float:
    """Of a derivative, away from the ends."""
    return _factor(model) * float(np.sqrt(np.mean(model.deviations(order)[model.inside] ** 2)))


def _factor(model: Model) -> float:
    return SEGMENTED_FACTOR if model.segments > 1 else 1.0
