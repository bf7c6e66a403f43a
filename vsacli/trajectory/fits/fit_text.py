"""Sentences of reports on fits: accuracy, unreliable ends, noise and vibrations; and JSON values.

Given derivatives are compared with those of a fit of the values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.units import time_text
from vsacli.trajectory.fits.fit import ORDERS, Fit, Part
from vsacli.trajectory.fits.selection import (
    FEWEST_JUDGED,
    INTERPOLATE,
    INTERPOLATION_GAIN,
    LEAST_SQUARES,
    LEAST_SQUARES_GAIN,
    SMALLEST_SHARE,
    SMOOTH,
)
from vsacli.trajectory.fits.smoothing import MAX_DETERMINED_ERROR, Smoothing
from vsacli.trajectory.fits.spectrum import motion_band

MIN_REPORTED_SHARE = 0.01
"""Share of the highest derivative above which filtered noise is reported."""

LISTED_LINES = 5
"""Most frequencies that a sentence names."""


def fit_sentences(
    value: str, fitted: Sequence[str], labels: Sequence[str], time: FloatArray, fit: Fit
) -> Iterator[str]:
    """Yield sentences on the values from splines, their distance from the samples, and unreliable ends.

    Args:
        value: name of the signal.
        fitted: names of the derivatives that come from splines.
        labels: labels of the components.
        time: times, (samples,), s.
        fit: fit of the signal.
    """
    if not fitted or not fit.parts:
        return
    exact = [part for part in fit.parts if part.exact]
    approximating = {
        "least-squares": [part for part in fit.parts if not part.exact and not part.smooth],
        "smoothing": [part for part in fit.parts if part.smooth],
    }
    names = ", ".join(fitted)
    verb = "comes" if len(fitted) == 1 else "come"
    is_partial = sum(map(bool, (exact, *approximating.values()))) > 1
    if exact:
        members_clause = f" of {_member_names(exact, labels)}" if is_partial else ""
        yield (
            f"{names}{members_clause} {verb} from a C{fit.degree - 1} spline through {value}; "
            f"{_unreliable_ends_text(time, exact)}"
        )
    for kind, parts in approximating.items():
        if parts:
            members_clause = f" of {_member_names(parts, labels)}" if is_partial else ""
            source = f"come from a C{fit.degree - 1} {kind} spline near the samples of {value}"
            misfit, trust = _misfit(parts, labels, fit), _unreliable_ends_text(time, parts)
            yield f"{value}, {names}{members_clause} {source}: {misfit}; {trust}"
    yield from _left_out_sentences(value, labels, fit)


def _left_out_sentences(value: str, labels: Sequence[str], fit: Fit) -> Iterator[str]:
    """Yield sentences on motion that a fit leaves out, and on vibrations."""
    for part in fit.parts:
        smoothing, label = part.smoothing, _member_names([part], labels)
        if part.left_out is not None and part.left_out.size > fit.noise[part.members].max() / 2:
            yield (
                f"{value} of {label} moves below {part.left_out.above:.2g} Hz beyond what the fit follows, by"
                f" {part.left_out.size:.2g} rms, as its residual shows: leave out fit, noise and bandwidth,"
                f" or set bandwidth: {part.left_out.above:.2g}"
            )
        if smoothing is not None and smoothing.lines.others:
            yield f"{value} of {label} has a vibration at {_vibration(smoothing)}"


def undetermined_derivatives(
    value: str, highest: str, labels: Sequence[str], fit: Fit
) -> Iterator[tuple[str, str]]:
    """Yield components whose highest derivative is not determined, and what to do.

    Args:
        value: name of the signal.
        highest: name of the derivative.
        labels: labels of the components.
        fit: fit of the signal.

    Yields:
        A sentence, and the same without the derivative, for a robot that does not use it.
    """
    for part in fit.parts:
        smoothing, label = part.smoothing, _member_names([part], labels)
        if smoothing is None or smoothing.determined:
            continue
        extent, advice = "", f"record it with less noise{_advised_bandwidth(part, fit)}"
        reason = "no two resolutions of a smoothing spline agree on it"
        if smoothing.resolved:
            extent, advice = " to 10 %", _advice(part)
            reason = f"its standard deviation is {100 * smoothing.relative:.2g} % of its root mean square"
        yield (
            f"{highest} of {label} is not determined by the record{extent}: {reason}; {advice}",
            f"{value} of {label}: {advice}",
        )


def _advice(part: Part) -> str:
    if part.noise is not None:
        return (
            f"above {part.noise.above:.2g} Hz it is noise that a filter made smooth: record it without the"
            f" filter, or set bandwidth: {part.noise.above:.2g}; if it is motion, set bandwidth:"
            f" {2 * part.noise.peak:.2g}"
        )
    if part.smooth or part.smoothing is None or part.smoothing.own > MAX_DETERMINED_ERROR:
        return "record it with less noise, or slower"
    return "try it with fit: smooth"


def _advised_bandwidth(part: Part, fit: Fit) -> str:
    """Return the advice to say that there is no motion beyond that of the spline; none at rest."""
    band = _band(part, int(part.members[0]), fit)
    return "" if band is None else f", or set bandwidth: {band:.2g} if there is no motion above that many Hz"


def _vibration(smoothing: Smoothing) -> str:
    lines = smoothing.lines.others
    line_texts = ", ".join(f"{frequency:.4g}" for frequency in lines[:LISTED_LINES])
    if smoothing.follows_lines:
        return f"{line_texts} Hz beyond a smooth motion; if it is noise, set bandwidth: {min(lines) / 2:.2g}"
    return f"{line_texts} Hz, which is taken for noise; if it is motion, set bandwidth: {2 * max(lines):.2g}"


def fit_notes(value: str, labels: Sequence[str], fit: Fit) -> Iterator[str]:
    """Yield notes on the interpretation of noise: ends that ring, hum, images, filtered noise.

    Args:
        value: name of the signal.
        labels: labels of the components.
        fit: fit of the signal.
    """
    exact = [part for part in fit.parts if part.exact]
    if exact and len(fit.time) < FEWEST_JUDGED:
        yield (
            f"{value} of {_member_names(exact, labels)} is taken for exact: {len(fit.time)} "
            "samples are too few to"
            f" tell noise from motion, which takes {FEWEST_JUDGED}"
        )
    for part in fit.parts:
        smoothing = part.smoothing
        ends = zip(("first", "last"), part.ringing, strict=True)
        if rings := " and the ".join(f"{which} {time:.2g} s" for which, time in ends if time):
            yield (
                f"{value} of {_member_names([part], labels)} rings in the {rings}, as if a filter "
                "had started or"
                " stopped there: left out of the verdict"
            )
        if smoothing is not None and smoothing.lines.hum:
            hum = ", ".join(f"{frequency:.4g}" for frequency in smoothing.lines.hum[:LISTED_LINES])
            yield f"mains hum of {hum} Hz in {value} of {_member_names([part], labels)} is taken for noise"
        if smoothing is not None and smoothing.lines.resampled:
            yield (
                f"{value} of {_member_names([part], labels)} was resampled from "
                f"{smoothing.lines.resampled:.4g} Hz,"
                " which left images of the motion: they are taken for noise"
            )
        if (
            part.noise is not None
            and part.noise.share > MIN_REPORTED_SHARE
            and (smoothing is None or smoothing.determined)
        ):
            yield (
                f"{value} of {_member_names([part], labels)} has noise above {part.noise.above:.2g} Hz that a"
                " filter made smooth, which counts as uncertainty"
            )


def describe(value: str, labels: Sequence[str], fit: Fit) -> dict[str, Any]:
    """Return the properties of a fit, as JSON values.

    Args:
        value: name of the signal.
        labels: labels of the components.
        fit: fit of the signal.
    """
    parts = {int(member): part for part in fit.parts for member in part.members}
    return {
        "signal": value,
        "degree": fit.degree,
        "columns": [
            {
                "name": labels[member],
                "method": _method(part),
                "knots": len(part.knots),
                "residual": {"rms": float(fit.residual[member]), "max": float(fit.largest[member])},
                "noise": float(fit.noise[member]),
                "unreliable": dict(zip(("start", "end"), part.unreliable, strict=True)),
                "band": _band(part, member, fit),
                **_judgment(part),
            }
            for member, part in sorted(parts.items(), key=itemgetter(0))
        ],
    }


def _band(part: Part, member: int, fit: Fit) -> float | None:
    """Return the frequency up to which a component moves, Hz; None at rest."""
    spline = part.of_columns(np.flatnonzero(part.members == member)).spline
    above = np.inf if part.noise is None else part.noise.above
    band = motion_band(spline, part.inside, fit.step, ORDERS[fit.degree] - 1, above)
    return None if np.isnan(band) else band


def _judgment(part: Part) -> dict[str, Any]:
    """Return the assessment of a component by a smoothing spline and by the spectrum."""
    properties: dict[str, Any] = {}
    if part.smoothing is not None:
        properties["deviation"] = part.smoothing.relative
    if part.noise is not None:
        properties["filtered_noise"] = {"share": part.noise.share, "above": part.noise.above}
    return properties


def _method(part: Part) -> str:
    if part.smooth:
        return SMOOTH
    return INTERPOLATE if part.exact else LEAST_SQUARES


def _member_names(parts: Sequence[Part], labels: Sequence[str]) -> str:
    return ", ".join(labels[i] for i in sorted(member for part in parts for member in part.members.tolist()))


def _misfit(parts: Sequence[Part], labels: Sequence[str], fit: Fit) -> str:
    knots = [len(part.knots) for part in parts]
    count = f"{min(knots)} to {max(knots)}" if min(knots) < max(knots) else f"{knots[0]}"
    worst_index = int(np.argmax(fit.largest))
    largest_text = f"at most {fit.largest[worst_index]:.2g} ({labels[worst_index]})"
    return f"{count} knots, off by {np.max(fit.residual):.2g} rms, {largest_text}"


def _unreliable_ends_text(time: FloatArray, parts: Sequence[Part]) -> str:
    start, end = (max(stretch) for stretch in zip(*(part.unreliable for part in parts), strict=True))
    if start + end >= time[-1] - time[0]:
        return "on so few knots, derivatives are unreliable far into the record from both ends"
    return f"derivatives are unreliable in the first {start:.3g} s and the last {end:.3g} s"


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
