"""Which spline stands for recorded samples: one through them, or a smoother one near them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.trajectory.fits.coloured import instead_of_followed_noise, replaced, smooth_part
from vsacli.trajectory.fits.fit import Fit, Part, join
from vsacli.trajectory.fits.least_squares import best_spans, fit_spline, most_spans

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

LEAST_SQUARES, INTERPOLATE, SMOOTH = "lsq", "interpolate", "smooth"
METHODS = (LEAST_SQUARES, INTERPOLATE, SMOOTH)

INTERPOLATION_GAIN = {7: (1.0, 1.481, 4.628, 6.957, 37.415), 5: (1.0, 1.376, 4.798)}
"""By degree, for each derivative k: standard deviation at the samples, times step^k, of a spline through
equally spaced samples with independent noise of standard deviation 1."""

LEAST_SQUARES_GAIN = {7: (1.0, 1.823, 4.484, 12.11, 34.37), 5: (1.0, 1.829, 4.538)}
"""By degree, for each derivative k: root mean square over a knot span, times span^k sqrt(samples in a span),
of a least-squares spline near many such samples, far from its ends."""


BLOCK_SAMPLES = 16384
"""Samples whose differences are held in memory at a time."""

NOISY = 0.01
"""Share of the highest derivative of the interpolating spline that noise may make up."""

SMALLEST_SHARE = 1e-3
"""Share of the largest component's derivative against which smaller ones are measured: what is below may be
nothing but rounding of a component that rests."""


def fit_samples(time: FloatArray, values: FloatArray, degree: int, order: int, method: str | None) -> Fit:
    """Fit splines to samples.

    Args:
        time: (samples,) in s, strictly increasing, more than `degree`.
        values: (components, samples); a component that is NaN throughout gets no spline.
        degree: of the splines, 5 or 7.
        order: of the highest derivative that is needed.
        method: `LEAST_SQUARES`, `INTERPOLATE`, `SMOOTH`, or None: for each component by its noise. Least
            squares are used if noise, as estimated from differences of the samples, makes up more than 1 % of
            the highest derivative of the interpolating spline, and if cross-validation finds fewer knots
            better. A component whose noise is not white, which either would follow, gets a smoothing spline.
    """
    present = np.flatnonzero(~np.all(np.isnan(values), axis=1))
    noise = np.zeros(len(values))
    noise[present] = estimated_noise(time, values[present], degree + 1)
    parts: list[Part] = []
    if method == SMOOTH:
        parts += (smooth_part(time, values, member, degree, order) for member in present.tolist())
    elif present.size and method == LEAST_SQUARES:
        spans = best_spans(time, values[present], degree)
        parts += _least_squares(time, values, present, spans, degree)
    elif present.size:
        exact = _interpolation(time, values, present, degree)
        if method is None:
            noisy = present[_noisy(exact.spline, time, values[present], noise[present], order)]
            parts += _where_fewer_knots_do(time, values, noisy, degree)
            left = np.setdiff1d(present, [member for part in parts for member in part.members])
            exact = exact if len(left) == len(present) else _interpolation(time, values, left, degree)
        parts += [exact] if exact.members.size else []
    fit = join(degree, parts, time, values, noise)
    instead = list(instead_of_followed_noise(time, values, fit, order)) if method is None else []
    return join(degree, replaced(parts, instead), time, values, noise) if instead else fit


def _interpolation(time: FloatArray, values: FloatArray, members: IndexArray, degree: int) -> Part:
    from scipy.interpolate import make_interp_spline

    return Part(members, make_interp_spline(time, values[members].T, k=degree), exact=True)


def _noisy(
    spline: BSpline[np.float64], time: FloatArray, rows: FloatArray, noise: FloatArray, order: int
) -> BoolArray:
    """Whether noise spoils the highest derivative of a spline through samples, (components,)."""
    degree, duration = spline.k, time[-1] - time[0]
    step = duration / (len(time) - 1)
    inside = time[degree:-degree] if len(time) > 4 * degree else time
    derivative = np.sqrt(np.mean(spline(inside, nu=order) ** 2, axis=0))
    least = np.abs(rows).max(axis=1) / duration**order
    scale = np.maximum(np.maximum(derivative, least), SMALLEST_SHARE * derivative.max())
    noisy: BoolArray = INTERPOLATION_GAIN[degree][order] * noise / step**order > NOISY * scale
    return noisy


def _where_fewer_knots_do(
    time: FloatArray, values: FloatArray, members: IndexArray, degree: int
) -> Iterator[Part]:
    """Least squares for those components that do not want as many knots as there can be."""
    if members.size:
        spans = best_spans(time, values[members], degree)
        fewer = spans < most_spans(len(time), degree)
        yield from _least_squares(time, values, members[fewer], spans[fewer], degree)


def _least_squares(
    time: FloatArray, values: FloatArray, members: IndexArray, spans: IndexArray, degree: int
) -> Iterator[Part]:
    for count in np.unique(spans).tolist():
        alike = members[spans == count]
        yield Part(alike, fit_spline(time, values[alike], count, degree), exact=False)


def estimated_noise(time: FloatArray, rows: FloatArray, order: int) -> FloatArray:
    """Standard deviation of independent noise, from divided differences of the samples.

    A difference of a high order leaves next to nothing of a function that is smooth over a few samples; its
    weights are scaled so that their squares add up to 1.

    Args:
        time: (samples,), s.
        rows: (components, samples).
        order: of the differences.

    Returns:
        (components,), zero if there are too few samples to tell.
    """
    count = len(time) - order
    power = np.zeros(len(rows))
    for start in range(0, count, BLOCK_SAMPLES):
        block = slice(start, start + BLOCK_SAMPLES + order)
        power += np.sum(_differences(time[block], rows[:, block], order) ** 2, axis=1)
    return np.asarray(np.sqrt(power / max(1, count)))


def _differences(time: FloatArray, rows: FloatArray, order: int) -> FloatArray:
    """(components, samples - order)."""
    count = len(time) - order
    nodes = [time[i : i + count] for i in range(order + 1)]
    span = nodes[-1] - nodes[0]
    weights = np.ones((order + 1, count))
    for i, node in enumerate(nodes):
        for other in (*nodes[:i], *nodes[i + 1 :]):
            weights[i] /= (node - other) / span
    weights /= np.sqrt(np.sum(weights**2, axis=0))
    total = np.zeros((len(rows), count))
    for i, weight in enumerate(weights):
        total += weight * rows[:, i : i + count]
    return total
