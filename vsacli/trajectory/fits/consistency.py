"""Whether derivatives that are given follow from the values they are derivatives of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.trajectory.fits.fit import Fit
from vsacli.trajectory.fits.noise import INTERPOLATION_GAIN, LEAST_SQUARES_GAIN
from vsacli.trajectory.fits.selection import SMALL

SHARE = 0.05
"""Of the root mean square of a derivative by which a given one may differ: measured ones do."""

DEVIATIONS = 10.0
"""Standard deviations by which the derivative of the fit itself may be wrong."""

FACTORS = {
    180 / math.pi: "degrees instead of radians?",
    math.pi / 180: "are the values in degrees?",
    -1.0: "opposite sign?",
    1000.0: "milli-units?",
    0.001: "are the values in milli-units?",
}
"""By how much a given derivative may be too large throughout, and what that hints at."""


def mismatches(
    names: Sequence[str],
    labels: Sequence[str],
    time: FloatArray,
    derivatives: Sequence[FloatArray | None],
    fit: Fit,
) -> Iterator[str]:
    """A sentence for each column of given derivatives that does not follow from the fit of the values.

    The doubtful stretches at both ends play no part, or the first and last quarter if these are shorter. A
    column differs if the root mean square of the difference exceeds 5 % of that of the fit's derivative, plus
    ten times the error that noise gives the latter.

    Args:
        names: of the signal and its derivatives.
        labels: of the components.
        time: (samples,), s.
        derivatives: of the signal, each (components, samples) if it is given.
        fit: of the signal.
    """
    start, end = np.minimum(fit.doubtful, (time[-1] - time[0]) / 4)
    inside = (time >= time[0] + start) & (time <= time[-1] - end)
    if not inside.any() or all(given is None for given in derivatives):
        return
    rows = fit.at(time[inside], len(names))
    for order, given in enumerate(derivatives, start=1):
        if given is not None:
            found = given[:, inside]
            for component in np.flatnonzero(_differ(found, rows, order, fit)).tolist():
                what = f"{names[order]} of {labels[component]} does not follow from {names[0]}"
                yield f"{what}: {_extent(time[inside], found[component], rows[order, component])}"


def _differ(given: FloatArray, rows: FloatArray, order: int, fit: Fit) -> BoolArray:
    """Which components differ by more than what can be told, (components,)."""
    size = _rms(rows[order])
    least = SMALL * np.nanmax(size, initial=0.0)
    allowed = SHARE * np.maximum(size, least) + DEVIATIONS * _errors(fit, order)
    differ: BoolArray = _rms(given - rows[order]) > allowed
    return differ


def _errors(fit: Fit, order: int) -> FloatArray:
    """Standard deviation of a derivative of the fit, inside, due to noise of the samples, (components,)."""
    errors = np.zeros(fit.components)
    for part in fit.parts:
        span = float(np.mean(np.diff(part.knots)))
        gain = (
            INTERPOLATION_GAIN[fit.degree][order]
            if part.exact
            else LEAST_SQUARES_GAIN[fit.degree][order] * math.sqrt(fit.step / span)
        )
        errors[part.members] = gain * fit.noise[part.members] / span**order
    return errors


def _extent(time: FloatArray, given: FloatArray, expected: FloatArray) -> str:
    difference = np.abs(given - expected)
    worst = int(difference.argmax())
    factor = _factor(given, expected)
    if factor is not None:
        hint = next((hint for ratio, hint in FACTORS.items() if abs(factor / ratio - 1) < SHARE), None)
        return f"it is {factor:.3g} times as large throughout" + (f" ({hint})" if hint else "")
    amounts = f"{given[worst]:.4g} instead of {expected[worst]:.4g}"
    return f"it differs by up to {difference[worst]:.3g} ({amounts} at t = {time[worst]:.6g} s)"


def _factor(given: FloatArray, expected: FloatArray) -> float | None:
    """What the expected values are multiplied by throughout, if they are."""
    power = float(expected @ expected)
    if power == 0:
        return None
    factor = float(given @ expected) / power
    scaled = _rms(given - factor * expected) < SHARE * _rms(given)
    return factor if scaled else None


def _rms(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(rows**2, axis=-1)))
