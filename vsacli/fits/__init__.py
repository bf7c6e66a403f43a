"""Splines through, or close to, recorded samples: which kind, how many knots, and how far to trust them."""

from vsacli.fits.choice import INTERPOLATE, LEAST_SQUARES, METHODS, fit_samples
from vsacli.fits.consistency import mismatches
from vsacli.fits.fit import Fit

__all__ = ["INTERPOLATE", "LEAST_SQUARES", "METHODS", "Fit", "fit_samples", "mismatches"]
