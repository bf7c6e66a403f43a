"""Splines through, or close to, recorded samples: which kind, how many knots, and how far to trust them."""

from vsacli.trajectory.fits.fit import Fit
from vsacli.trajectory.fits.given import mismatches
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
