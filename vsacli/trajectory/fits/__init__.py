"""Splines through recorded samples or near them: choice of the kind and of knots, and uncertainty."""

from vsacli.trajectory.fits.fit import Fit
from vsacli.trajectory.fits.fit_text import mismatches
from vsacli.trajectory.fits.selection import (
    AS_IT_ASKS_FOR,
    INTERPOLATE,
    LEAST_SQUARES,
    METHODS,
    SMOOTH,
    FitChoice,
    fit_samples,
)

__all__ = [
    "AS_IT_ASKS_FOR",
    "INTERPOLATE",
    "LEAST_SQUARES",
    "METHODS",
    "SMOOTH",
    "Fit",
    "FitChoice",
    "fit_samples",
    "mismatches",
]
