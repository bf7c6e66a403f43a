"""The penalties and the correlation of noise that make a record most likely, at one resolution.

They maximise the restricted likelihood (Patterson & Thompson, 1971), the penalties by the fixed point of
Fellner (1986) and Schall (1991) with step control.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.bins import Bins
from vsacli.trajectory.fits.penalised import Model, deviances, evidence, segment_of

CORRELATIONS = np.array([-0.5, -0.25, 0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.87, 0.92, 0.95, 0.98])
"""Of the noise of neighbouring means, tried at first."""

SMALL_CORRELATIONS = np.array([0.01, 0.03, 0.1])
"""Tried, too, if the noise of samples is known: that of means then depends on them."""

FINER_CORRELATIONS = np.array([-0.3, -0.1, 0.0, 0.1, 0.3])
"""Added to the inverse hyperbolic tangent of the best, twice."""

FIRST_DECADES = np.arange(-6.0, 19.0)
"""Penalties tried at the coarsest resolution, as powers of ten: from none to a polynomial."""

NEAR_DECADES = np.arange(-5.0, 5.0)
"""Penalties tried around what the coarser resolution found."""

NEAR_CORRELATION = 1.2
"""Distance of inverse hyperbolic tangents within which correlations are tried around it."""

MOST_SPANS_OF_GRID = 2048
"""Of longer records stretches are tried, since only a start is sought: that saves half of the time."""

STRETCHES = 8

MOST_SEGMENTS = 64
FEWEST_DIFFERENCES = 4
"""In a segment."""

UPDATES = 30
LEAST_GAIN = 0.05
"""Of twice the logarithm of the likelihood by which an update must improve to be followed by another."""


def most_likely(bins: Bins, coarser: Model | None) -> Model:
    """The model of the largest restricted likelihood that the search finds.

    Args:
        bins: of the record.
        coarser: what was found with half as many spans, around which to search; None: everywhere.
    """
    model = _segmented(_improved(_best_of_grids(bins, _grids(bins, coarser))))
    for _ in range(1 if _long(bins) else 2):
        model = _improved(_recorrelated(model))
    return model


class _Grid(NamedTuple):
    """Models that are tried together.

    Attributes:
        correlations: of the noise of neighbouring means.
        shape: logarithms of the penalties of segments to the base 10, (segments,).
        decades: added to these.
    """

    correlations: FloatArray
    shape: FloatArray
    decades: FloatArray

    def penalties(self, differences: int) -> FloatArray:
        """Of each difference of coefficients, (decades, differences)."""
        each = self.shape[segment_of(differences, len(self.shape))]
        return np.asarray(10.0 ** (each + self.decades[:, None]))


def _grids(bins: Bins, coarser: Model | None) -> list[_Grid]:
    """With one penalty throughout; of long records also with those of the coarser model."""
    tried = CORRELATIONS if bins.noise is None else np.append(CORRELATIONS, SMALL_CORRELATIONS)
    level = np.zeros(1)
    if coarser is None:
        return [_Grid(tried, level, FIRST_DECADES)]
    near = np.abs(np.arctanh(tried) - np.arctanh(coarser.correlation)) <= NEAR_CORRELATION
    found = np.log10(coarser.each_penalty if _long(bins) else coarser.penalties)
    shape = found if _long(bins) else np.mean(found, keepdims=True)
    # differences of order n of a given function shrink by 2^n, noise of a mean by 2^(-1/2)
    growth = (2 * bins.degree - 1) * np.log10(2)
    # what passed for noise on coarser bins, as a sweep does, may be resolved now: look everywhere too
    everywhere = _Grid(CORRELATIONS[::3], level, FIRST_DECADES[::3])
    return [_Grid(tried[near], shape + growth, NEAR_DECADES), everywhere]


def _best_of_grids(bins: Bins, grids: Sequence[_Grid]) -> Model:
    """That of the largest likelihood; of long records by stretches far apart, as only a start is sought."""
    differences = bins.coefficients - bins.degree
    spans = MOST_SPANS_OF_GRID // STRETCHES if _long(bins) else bins.spans
    firsts = np.linspace(0, bins.spans - spans, STRETCHES if _long(bins) else 1).astype(int).tolist()
    stretches = [(bins.stretch(first, spans), slice(first, first + spans)) for first in firsts]
    best, least = Model(bins, 0.0, np.ones(differences), 1), np.inf
    for grid in grids:
        penalties = grid.penalties(differences)
        for correlation in grid.correlations.tolist():
            found = deviances(
                [evidence(part, part.whitened(correlation), penalties[:, of]) for part, of in stretches]
            )
            i = int(np.argmin(found))
            if found[i] < least:
                best, least = Model(bins, correlation, penalties[i], len(grid.shape)), found[i]
    return best


def _long(bins: Bins) -> bool:
    return bins.spans > MOST_SPANS_OF_GRID


def _improved(model: Model) -> Model:
    """After updates of its penalties, each accepted if it makes the data more likely."""
    step = 1.0
    for _ in range(UPDATES):
        candidate = model.updated(step)
        gain = model.deviance - candidate.deviance
        if gain > 0:
            model, step = candidate, min(1.0, 1.5 * step)
            if gain < LEAST_GAIN:
                break
        else:
            step *= 0.4
            if step < 0.05:
                break
    return model


def _segmented(model: Model) -> Model:
    """With twice as many segments as long as the likelihood gains, if need be after doubling twice.

    Each additional segment must gain more than its own parameter can by chance.
    """
    most = min(MOST_SEGMENTS, len(model.penalties) // FEWEST_DIFFERENCES)
    trial = model
    while 2 * trial.segments <= most and trial.segments <= 2 * model.segments:
        trial = _improved(Model(model.bins, model.correlation, trial.penalties, 2 * trial.segments))
        if trial.deviance < model.deviance - (trial.segments - model.segments) - 1:
            model = trial
    return model


def _recorrelated(model: Model) -> Model:
    """With the most likely correlation of the noise near its own."""
    centre = np.arctanh(model.correlation)
    candidates = np.clip(np.tanh(centre + FINER_CORRELATIONS), -0.6, 0.985)
    models = [Model(model.bins, each, model.penalties, model.segments) for each in candidates.tolist()]
    return min(models, key=lambda each: each.deviance)
