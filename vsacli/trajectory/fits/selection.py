"""Selection of the spline that replaces samples: through them, by least squares, or a smoothing spline.

`fit_samples` fits all components through the samples, or by least squares; where noise may matter, a
smoothing spline assesses the result, or replaces it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.progress import Progress, ProgressBar, unseen
from vsacli.trajectory.fits.fit import Fit, Part, join
from vsacli.trajectory.fits.least_squares import best_spans, fit_spline
from vsacli.trajectory.fits.noise import (
    LeftOutMotion,
    estimated_noise,
    filtered_noise,
    left_out_motion,
    typical_noise,
)
from vsacli.trajectory.fits.resolution import KnownNoise
from vsacli.trajectory.fits.smoothing import disagreement, smoothing_spline
from vsacli.trajectory.fits.spectrum import FollowedNoise, followed_noise, ringing_ends

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


SUSPECT = 0.01
"""Share of noise in the highest derivative of an interpolating spline above which it is assessed."""

DISAGREEMENT, DISAGREEING_DEVIATIONS = 0.1, 3.0
"""Share of the highest derivative by which an interpolating spline may be off, and number of deviations of a
smoothing spline by which it may differ from that."""

PROBES = 4000
"""Approximate number of samples at which splines are compared; between distant samples neither is known."""

VIBRATION = 0.5
"""Share of the power of a residual in lines above which it is a vibration rather than noise. A faint line,
such as one of an encoder's steps at 358 Hz in addition to filtered noise, must not count."""

PASSING = 2.0
"""Bandwidth with which a spline follows a vibration, over the frequency of the vibration."""


class FittedRecording(NamedTuple):
    """The fitted recording.

    Attributes:
        time: times, (samples,), s.
        values: values, (components, samples).
        spoilt: share of white noise in the highest derivative of an interpolating spline, (components,).
        filtered: whether there is filtered noise, (components,).
        order: order of the highest derivative that is needed.
        known: noise and bandwidth of each component as given by the user.
        least: root mean square derivative below which a component counts as at rest while others move.
    """

    time: FloatArray
    values: FloatArray
    spoilt: FloatArray
    filtered: BoolArray
    order: int
    known: Sequence[KnownNoise]
    least: float = 0.0


def smooth_part(record: FittedRecording, member: int, degree: int, known: KnownNoise | None = None) -> Part:
    """Return a smoothing spline of one component; a polynomial by least squares if that is impossible."""
    row, members = record.values[member], np.array([member])
    spline_and_smoothing = smoothing_spline(
        record.time, row, degree, record.order, known or record.known[member]
    )
    if spline_and_smoothing is None:
        return Part(members, fit_spline(record.time, row[None], 1, degree), exact=False)
    spline, smoothing = spline_and_smoothing
    part = Part(members, spline, exact=False, smoothing=smoothing, smooth=True)
    return _with_followed_noise(*_without_ends(part, record), record)


def judged(record: FittedRecording, fit: Fit, bar: ProgressBar, *, chosen: bool) -> Iterator[Part]:
    """Yield parts whose fit may follow noise, with their assessment, or replacements for them.

    Such fits are least-squares splines, whose number of knots has a bias, and splines through noisy samples.
    They are assessed by a smoothing spline, the difference from which counts as a deviation.

    Args:
        record: recording.
        fit: fit by least squares, or through the samples.
        bar: progress bar, advanced by the samples of each component.
        chosen: whether the user chose the fit, so that it is not replaced.
    """
    for part in fit.parts:
        for column in range(len(part.members)):
            replacement = _replacement(record, part, column, chosen=chosen)
            bar.update(len(record.time))
            if replacement is not None:
                yield replacement


def _replacement(record: FittedRecording, part: Part, column: int, *, chosen: bool) -> Part | None:
    """Return the replacement of a component of a part; None if it needs no assessment, or has none."""
    member, degree = int(part.members[column]), part.spline.k
    has_bandwidth = not chosen and record.known[member].bandwidth is not None
    single_part, noise = _without_ends(part.of_columns(np.array([column])), record)
    unassessed_part = single_part if any(single_part.ringing) else None
    is_filtered = bool(record.filtered[member]) or noise.share > SUSPECT
    if part.exact and record.spoilt[member] <= SUSPECT and not is_filtered and not has_bandwidth:
        return replace(single_part, noise=noise) if noise.share > record.spoilt[member] else unassessed_part
    smoothing_part = _smoothing_part(record, member, degree)
    if smoothing_part.smoothing is None:
        return unassessed_part
    inside = _inner_times(smoothing_part, record)
    difference_covariance = disagreement(single_part.spline, smoothing_part.spline, inside, record.order + 1)
    derivative_rms = float(np.sqrt(np.mean(smoothing_part.spline(inside, nu=record.order) ** 2)))
    difference = float(np.sqrt(difference_covariance[-1, -1])) / derivative_rms if derivative_rms else 0.0
    if has_bandwidth or (not chosen and _is_better(smoothing_part, difference, record, is_filtered)):
        return smoothing_part
    # Only noise is a reason to doubt a spline through the samples.
    if (
        smoothing_part.smoothing.resolved
        or record.spoilt[member] > DISAGREEMENT
        or is_filtered
        or not part.exact
    ):
        smoothing = replace(
            smoothing_part.smoothing,
            relative=float(np.hypot(smoothing_part.smoothing.relative, difference)),
            disagreement=smoothing_part.smoothing.disagreement + difference_covariance,
            follows_lines=True,
        )
        return _with_followed_noise(replace(single_part, smoothing=smoothing), noise, record)
    return unassessed_part


def _without_ends(part: Part, record: FittedRecording) -> tuple[Part, FollowedNoise]:
    """Return a part of one component with the ends at which a filter rings, or its transient lasts.

    Also returns the filtered noise that it follows between them.
    """
    part = replace(part, ringing=ringing_ends(part.spline, part.inside, record.order))
    noise = _followed_noise_of(record, part)
    if part.exact or part.smooth:  # a least-squares spline has a cut-off of its own
        part = replace(part, transient=noise.transient)
    noise_between_ends = _followed_noise_of(record, part) if noise.share else noise
    return part, noise_between_ends if noise_between_ends.share else noise


def _followed_noise_of(record: FittedRecording, part: Part) -> FollowedNoise:
    """Return the filtered noise that a part of one component follows."""
    bandwidth = record.known[int(part.members[0])].bandwidth
    rings = any(part.ringing)
    noise = followed_noise(part.spline, part.inside, _interval(record), record.order, bandwidth, rings=rings)
    if not (noise.share and part.exact and record.least):
        return noise
    return noise._replace(share=noise.share * min(1.0, part.size(record.order).item() / record.least))


def _interval(record: FittedRecording) -> float:
    """Return the mean sampling interval of a recording, s."""
    return float(record.time[-1] - record.time[0]) / (len(record.time) - 1)


def _with_followed_noise(part: Part, noise: FollowedNoise, record: FittedRecording) -> Part:
    """Return a part of one component whose assessment includes the noise that it follows."""
    smoothing = part.smoothing
    if smoothing is None or not noise.share or (part.smooth and noise.relative <= smoothing.relative):
        return part
    return replace(part, smoothing=smoothing.following(noise, part.size(record.order).item()), noise=noise)


def _smoothing_part(record: FittedRecording, member: int, degree: int) -> Part:
    """Return the smoothing spline of a component; it follows a strong vibration, which may be motion."""
    smoothing_part = smooth_part(record, member, degree)
    known_noise, lines = record.known[member], smoothing_part.smoothing and smoothing_part.smoothing.lines
    if not lines or lines.share < VIBRATION or known_noise.bandwidth is not None:
        return smoothing_part
    following_part = smooth_part(
        record, member, degree, known_noise._replace(bandwidth=PASSING * max(lines.others))
    )
    if following_part.smoothing is None:
        return smoothing_part
    return replace(
        following_part, smoothing=replace(following_part.smoothing, lines=lines, follows_lines=True)
    )


def _is_better(smoothing_part: Part, difference: float, record: FittedRecording, filtered: bool) -> bool:
    """Return whether a smoothing spline should replace a spline through the samples of a component.

    If no resolution is accepted, noise must dominate more in the latter. If noise was filtered, both must
    differ by more than the smoothing spline's own deviation explains.
    """
    smoothing, member = smoothing_part.smoothing, smoothing_part.members[0]
    if smoothing is None:
        return False
    if record.spoilt[member] > (SUSPECT if smoothing.resolved else DISAGREEMENT):
        return True
    return filtered and difference > DISAGREEMENT + DISAGREEING_DEVIATIONS * smoothing.relative


def _inner_times(part: Part, record: FittedRecording) -> FloatArray:
    """Return some sample times away from the ends, s."""
    time, (start, end) = record.time, part.inside
    inside = time[(time >= start) & (time <= end)]
    return inside[:: 1 + len(inside) // PROBES]


def replace_components(parts: Sequence[Part], replacements: Sequence[Part]) -> list[Part]:
    """Return all parts, with some components replaced by parts of their own."""
    replaced_members = np.concatenate([part.members for part in replacements])
    remaining_parts: list[Part] = []
    for part in parts:
        remaining_columns = np.flatnonzero(~np.isin(part.members, replaced_members))
        if len(remaining_columns) == len(part.members):
            remaining_parts.append(part)
        elif remaining_columns.size:
            remaining_parts.append(part.of_columns(remaining_columns))
    return [*remaining_parts, *replacements]


LEAST_SQUARES, INTERPOLATE, SMOOTH = "lsq", "interpolate", "smooth"
METHODS = (LEAST_SQUARES, INTERPOLATE, SMOOTH)


@dataclass(frozen=True)
class FitChoice:
    """The choice of the spline of a signal by the user.

    Attributes:
        method: see `fit_samples`.
        noise: standard deviation of the samples of each component; None to estimate it.
        bandwidth: frequency above which there is no motion, Hz; None to determine it from the recording.
    """

    method: str | None = None
    noise: tuple[float | None, ...] | None = None
    bandwidth: float | None = None

    @property
    def deviations(self) -> FloatArray | None:
        """Noise of each component, (components,); NaN where it is estimated."""
        return None if self.noise is None else np.array(self.noise, dtype=np.float64)

    def stretched(self, factor: float) -> FitChoice:
        """Return the choice for the motion slowed down by a factor."""
        return replace(self, bandwidth=None if self.bandwidth is None else self.bandwidth / factor)


AS_IT_ASKS_FOR = FitChoice()
"""Default: the noise of the samples decides."""

INTERPOLATION_GAIN = {7: (1.0, 1.481, 4.628, 6.957, 37.415), 5: (1.0, 1.376, 4.798)}
"""Noise gain by degree, for each derivative k: standard deviation at the samples, times step^k, of a spline
through equally spaced samples with independent noise of standard deviation 1."""

LEAST_SQUARES_GAIN = {7: (1.0, 1.823, 4.484, 12.11, 34.37), 5: (1.0, 1.829, 4.538)}
"""Noise gain by degree, for each derivative k: root mean square over a knot span, times span^k sqrt(samples
in a span), of a least-squares spline near many such samples, far from its ends."""


FEWEST_JUDGED = 32
"""Fewest samples with which differences distinguish noise from motion; fewer, e.g. a table of set points, are
always interpolated."""

SMALLEST_SHARE = 1e-3
"""Share of the largest component's derivative that replaces smaller ones as the reference for noise: they may
be only rounding of a component at rest."""


def _with_left_out_motion(parts: Sequence[Part], record: FittedRecording) -> list[Part]:
    """Return parts of one component each, with the motion that those near the samples leave out."""
    single_parts = [
        part.of_columns(np.array([column])) for part in parts for column in range(len(part.members))
    ]
    return [
        part if part.exact else replace(part, left_out=_left_out_motion(part, record))
        for part in single_parts
    ]


def _left_out_motion(part: Part, record: FittedRecording) -> LeftOutMotion | None:
    """Return the motion that a part of one component leaves out; lines count as vibrations instead.

    A residual as large as the filtered noise that the default fit follows is such noise.
    """
    lines = None if part.smoothing is None else part.smoothing.lines
    if lines and (lines.hum or lines.others):
        return None
    member = int(part.members[0])
    motion = left_out_motion(record.time, record.values[member] - part.spline(record.time)[:, 0])
    if motion is None:
        return None
    free_part = smooth_part(record, member, part.spline.k, record.known[member]._replace(bandwidth=None))
    noise = followed_noise(free_part.spline, free_part.inside, _interval(record), record.order)
    noise_size = noise.share and free_part.size(record.order) * np.sqrt(
        noise.covariance(record.order + 1)[0, 0]
    )
    return motion if motion.size > noise_size else None


def fit_samples(
    time: FloatArray,
    values: FloatArray,
    degree: int,
    order: int,
    method: str | None,
    *,
    noise: FloatArray | None = None,
    bandwidth: float | None = None,
    progress: Progress = unseen,
) -> Fit:
    """Fit splines to samples.

    Args:
        time: times, (samples,), s, strictly increasing, more than `degree`.
        values: values, (components, samples); a component that is all NaN has no spline.
        degree: degree of the splines, 5 or 7.
        order: order of the highest derivative that is needed.
        method: `LEAST_SQUARES`, `INTERPOLATE`, `SMOOTH`, or None to choose for each component by its noise: a
            spline through the samples if noise, estimated from their differences, is less than 1 % of the
            highest derivative; else, and if noise was filtered, a smoothing spline.
        noise: standard deviation of the samples of each component, (components,); NaN if unknown.
        bandwidth: frequency above which there is no motion, Hz; None to let smoothing splines determine it.
        progress: function that opens a progress bar over the samples of all components.
    """
    present_members = np.flatnonzero(~np.all(np.isnan(values), axis=1))
    given_noise = np.full(len(values), np.nan) if noise is None else noise
    estimate = np.zeros(len(values))
    estimate[present_members] = estimated_noise(time, values[present_members], degree + 1)
    estimate = np.where(np.isnan(given_noise), estimate, given_noise)
    record = FittedRecording(
        time,
        values,
        spoilt=np.zeros(len(values)),
        filtered=np.zeros(len(values), dtype=bool),
        order=order,
        known=[KnownNoise(None if np.isnan(each) else each, bandwidth) for each in given_noise.tolist()],
    )
    parts: list[Part] = []
    if method == SMOOTH:
        with progress(len(time) * len(present_members)) as bar:
            for member in present_members.tolist():
                parts.append(smooth_part(record, member, degree))
                bar.update(len(time))
        return join(degree, _with_left_out_motion(parts, record), time, values, estimate, given_noise)
    if present_members.size and method == LEAST_SQUARES:
        parts += _least_squares_parts(time, values, present_members, degree)
    elif present_members.size:
        interpolating_spline = scipy.interpolate.make_interp_spline(time, values[present_members].T, k=degree)
        parts.append(Part(present_members, interpolating_spline, exact=True))
    if present_members.size and method != LEAST_SQUARES and len(time) >= FEWEST_JUDGED:
        noise_estimate = typical_noise(time, values[present_members], degree + 1)
        expected = np.where(
            np.isnan(given_noise[present_members]), noise_estimate, given_noise[present_members]
        )
        record.spoilt[present_members], rest_derivative = _noise_shares(
            parts[0].spline, time, values[present_members], expected, order
        )
        record = record._replace(least=rest_derivative)
        record.filtered[present_members] = filtered_noise(time, values[present_members], degree + 1)
    fit = join(degree, parts, time, values, estimate, given_noise)
    with progress(len(time) * len(present_members)) as bar:
        replacements = list(judged(record, fit, bar, chosen=method is not None))
    parts = replace_components(parts, replacements) if replacements else parts
    if method is not None or bandwidth is not None or noise is not None:
        parts = _with_left_out_motion(parts, record)
    return join(degree, parts, time, values, estimate, given_noise)


def _noise_shares(
    spline: BSpline[np.float64], time: FloatArray, rows: FloatArray, noise: FloatArray, order: int
) -> tuple[FloatArray, float]:
    """Return the share of noise in the highest derivative of a spline through samples.

    Returns:
        Shares, (components,), and the smallest root mean square derivative that counts as motion.
    """
    degree, duration = spline.k, time[-1] - time[0]
    step = duration / (len(time) - 1)
    inner_times = time[degree:-degree] if len(time) > 4 * degree else time
    derivative = np.sqrt(np.mean(spline(inner_times, nu=order) ** 2, axis=0))
    min_derivative = np.abs(rows).max(axis=1) / duration**order
    rest_derivative = SMALLEST_SHARE * float(derivative.max())
    scale = np.maximum(np.maximum(derivative, min_derivative), rest_derivative)
    error = INTERPOLATION_GAIN[degree][order] * noise / step**order
    return np.asarray(error / np.maximum(scale, np.finfo(float).tiny)), rest_derivative


def _least_squares_parts(
    time: FloatArray, values: FloatArray, members: IndexArray, degree: int
) -> Iterator[Part]:
    spans = best_spans(time, values[members], degree)
    for count in np.unique(spans).tolist():
        equal_members = members[spans == count]
        yield Part(equal_members, fit_spline(time, values[equal_members], count, degree), exact=False)
