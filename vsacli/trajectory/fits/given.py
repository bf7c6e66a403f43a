"""Comparison of given derivatives with those of a fit of the values."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.units import time_text
from vsacli.trajectory.fits.fit import Fit
from vsacli.trajectory.fits.selection import INTERPOLATION_GAIN, LEAST_SQUARES_GAIN, SMALLEST_SHARE

SHARE = 0.05
"""Share of the root mean square of a derivative by which a given one may differ, as measured ones do."""

DEVIATIONS = 10.0
"""Number of standard deviations by which the derivative of the fit itself may be wrong."""

FACTORS = {
    180 / math.pi: "degrees instead of radians?",
    math.pi / 180: "are the values in degrees?",
    -1.0: "opposite sign?",
    1000.0: "milli-units?",
    0.001: "are the values in milli-units?",
}
"""Factors by which a given derivative may be too large throughout, with the likely mistake."""


def mismatches(
    names: Sequence[str],
    labels: Sequence[str],
    time: FloatArray,
    derivatives: Sequence[FloatArray | None],
    fit: Fit,
    *,
    start: float = 0.0,
) -> Iterator[str]:
    """Yield a sentence for each column of given derivatives that does not follow from the fit of the values.

    The unreliable ends are ignored, or the first and last quarter if these are shorter. A column differs if
    the root mean square of the difference exceeds 5 % of that of the fit's derivative, plus ten times the
    error of the latter due to noise.

    Args:
        names: names of the signal and its derivatives.
        labels: labels of the components.
        time: times, (samples,), s.
        derivatives: derivatives of the signal, each (components, samples); None if not given.
        fit: fit of the signal.
        start: stamp of time zero, s, added to reported times.
    """
    first, last = np.minimum(fit.unreliable, (time[-1] - time[0]) / 4)
    inside = (time >= time[0] + first) & (time <= time[-1] - last)
    if not inside.any() or all(given is None for given in derivatives):
        return
    rows = fit.at(time[inside], len(names))
    for order, given in enumerate(derivatives, start=1):
        if given is not None:
            found = given[:, inside]
            differ, stamps = _differ(found, rows, order, fit), start + time[inside]
            for component, label in enumerate(labels):
                if differ[component]:
                    amounts = _extent(stamps, found[component], rows[order, component])
                    yield f"{names[order]} of {label} does not follow from {names[0]}: {amounts}"


def _differ(given: FloatArray, rows: FloatArray, order: int, fit: Fit) -> BoolArray:
    """Return the mask of components that differ significantly, (components,)."""
    size = _rms(rows[order])
    least = SMALLEST_SHARE * np.nanmax(size, initial=0.0)
    allowed = SHARE * np.maximum(size, least) + DEVIATIONS * _errors(fit, order)
    return _rms(given - rows[order]) > allowed


def _errors(fit: Fit, order: int) -> FloatArray:
    """Return the standard deviation of the fit's derivative, inside, due to noise, (components,)."""
    errors = np.zeros(fit.components)
    for part in fit.parts:
        if part.smooth and part.smoothing is not None:
            errors[part.members] = part.smoothing.deviations[order]
            continue
        span = float(np.mean(np.diff(part.knots)))
        gain = (
            INTERPOLATION_GAIN[fit.degree][order]
            if part.exact
            else LEAST_SQUARES_GAIN[fit.degree][order] * math.sqrt(fit.step / span)
        )
        errors[part.members] = gain * fit.noise[part.members] / span**order
    return errors


def _extent(time: FloatArray, given: FloatArray, expected: FloatArray) -> str:
    factor = _factor(given, expected)
    if factor is not None:
        hint = next((hint for ratio, hint in FACTORS.items() if abs(factor / ratio - 1) < SHARE), None)
        return f"it is {factor:.3g} times as large throughout" + (f" ({hint})" if hint else "")
    return _amounts(time, given, expected)


def _amounts(time: FloatArray, given: FloatArray, expected: FloatArray) -> str:
    difference = np.abs(given - expected)
    worst = int(difference.argmax())
    amounts = f"{given[worst]:.4g} instead of {expected[worst]:.4g}"
    return f"it differs by up to {difference[worst]:.3g} ({amounts} at t = {time_text(time[worst])})"


def _factor(given: FloatArray, expected: FloatArray) -> float | None:
    """Return the common factor from expected to given values; None without one."""
    power = float(expected @ expected)
    if power == 0:
        return None
    factor = float(given @ expected) / power
    scaled = _rms(given - factor * expected) < SHARE * _rms(given)
    return factor if scaled else None


def _rms(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(rows**2, axis=-1)))
