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
    found = smoothing_spline(record.time, row, degree, record.order, known or record.known[member])
    if found is None:
        return Part(members, fit_spline(record.time, row[None], 1, degree), exact=False)
    spline, smoothing = found
    part = Part(members, spline, exact=False, smoothing=smoothing, smooth=True)
    return _following(*_without_ends(part, record), record)


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
            instead = _instead(record, part, column, chosen=chosen)
            bar.update(len(record.time))
            if instead is not None:
                yield instead


def _instead(record: FittedRecording, part: Part, column: int, *, chosen: bool) -> Part | None:
    """Return the replacement of a component of a part; None if it needs no assessment, or has none."""
    member, degree = int(part.members[column]), part.spline.k
    wanted = not chosen and record.known[member].bandwidth is not None
    single, noise = _without_ends(part.of_columns(np.array([column])), record)
    unjudged = single if any(single.ringing) else None
    filtered = bool(record.filtered[member]) or noise.share > SUSPECT
    if part.exact and record.spoilt[member] <= SUSPECT and not filtered and not wanted:
        return replace(single, noise=noise) if noise.share > record.spoilt[member] else unjudged
    judge = _judge(record, member, degree)
    if judge.smoothing is None:
        return unjudged
    inside = _inside(judge, record)
    differ = disagreement(single.spline, judge.spline, inside, record.order + 1)
    size = float(np.sqrt(np.mean(judge.spline(inside, nu=record.order) ** 2)))
    difference = float(np.sqrt(differ[-1, -1])) / size if size else 0.0
    if wanted or (not chosen and _better(judge, difference, record, filtered)):
        return judge
    # Only noise is a reason to doubt a spline through the samples.
    if judge.smoothing.resolved or record.spoilt[member] > DISAGREEMENT or filtered or not part.exact:
        known = replace(
            judge.smoothing,
            relative=float(np.hypot(judge.smoothing.relative, difference)),
            disagreement=judge.smoothing.disagreement + differ,
            follows_lines=True,
        )
        return _following(replace(single, smoothing=known), noise, record)
    return unjudged


def _without_ends(part: Part, record: FittedRecording) -> tuple[Part, FollowedNoise]:
    """Return a part of one component with the ends at which a filter rings, or its transient lasts.

    Also returns the filtered noise that it follows between them.
    """
    part = replace(part, ringing=ringing_ends(part.spline, part.inside, record.order))
    noise = _noise_of(record, part)
    if part.exact or part.smooth:  # a least-squares spline has a cut-off of its own
        part = replace(part, transient=noise.transient)
    between = _noise_of(record, part) if noise.share else noise
    return part, between if between.share else noise


def _noise_of(record: FittedRecording, part: Part) -> FollowedNoise:
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


def _following(part: Part, noise: FollowedNoise, record: FittedRecording) -> Part:
    """Return a part of one component whose assessment includes the noise that it follows."""
    known = part.smoothing
    if known is None or not noise.share or (part.smooth and noise.relative <= known.relative):
        return part
    return replace(part, smoothing=known.following(noise, part.size(record.order).item()), noise=noise)


def _judge(record: FittedRecording, member: int, degree: int) -> Part:
    """Return the smoothing spline of a component; it follows a strong vibration, which may be motion."""
    judge = smooth_part(record, member, degree)
    known, lines = record.known[member], judge.smoothing and judge.smoothing.lines
    if not lines or lines.share < VIBRATION or known.bandwidth is not None:
        return judge
    follower = smooth_part(record, member, degree, known._replace(bandwidth=PASSING * max(lines.others)))
    if follower.smoothing is None:
        return judge
    return replace(follower, smoothing=replace(follower.smoothing, lines=lines, follows_lines=True))


def _better(judge: Part, difference: float, record: FittedRecording, filtered: bool) -> bool:
    """Return whether a smoothing spline should replace a spline through the samples of a component.

    If no resolution is accepted, noise must dominate more in the latter. If noise was filtered, both must
    differ by more than the smoothing spline's own deviation explains.
    """
    known, member = judge.smoothing, judge.members[0]
    if known is None:
        return False
    if record.spoilt[member] > (SUSPECT if known.resolved else DISAGREEMENT):
        return True
    return filtered and difference > DISAGREEMENT + DISAGREEING_DEVIATIONS * known.relative


def _inside(part: Part, record: FittedRecording) -> FloatArray:
    """Return some sample times away from the ends, s."""
    time, (start, end) = record.time, part.inside
    inside = time[(time >= start) & (time <= end)]
    return inside[:: 1 + len(inside) // PROBES]


def replaced(parts: Sequence[Part], instead: Sequence[Part]) -> list[Part]:
    """Return all parts, with some components replaced by parts of their own."""
    taken = np.concatenate([part.members for part in instead])
    kept: list[Part] = []
    for part in parts:
        left = np.flatnonzero(~np.isin(part.members, taken))
        if len(left) == len(part.members):
            kept.append(part)
        elif left.size:
            kept.append(part.of_columns(left))
    return [*kept, *instead]


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
    single = [part.of_columns(np.array([column])) for part in parts for column in range(len(part.members))]
    return [part if part.exact else replace(part, left_out=_left_out(part, record)) for part in single]


def _left_out(part: Part, record: FittedRecording) -> LeftOutMotion | None:
    """Return the motion that a part of one component leaves out; lines count as vibrations instead.

    A residual as large as the filtered noise that the default fit follows is such noise.
    """
    lines = None if part.smoothing is None else part.smoothing.lines
    if lines and (lines.hum or lines.others):
        return None
    member = int(part.members[0])
    missed = left_out_motion(record.time, record.values[member] - part.spline(record.time)[:, 0])
    if missed is None:
        return None
    free = smooth_part(record, member, part.spline.k, record.known[member]._replace(bandwidth=None))
    noise = followed_noise(free.spline, free.inside, _interval(record), record.order)
    explained = noise.share and free.size(record.order) * np.sqrt(noise.covariance(record.order + 1)[0, 0])
    return missed if missed.size > explained else None


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
    present = np.flatnonzero(~np.all(np.isnan(values), axis=1))
    given = np.full(len(values), np.nan) if noise is None else noise
    estimate = np.zeros(len(values))
    estimate[present] = estimated_noise(time, values[present], degree + 1)
    estimate = np.where(np.isnan(given), estimate, given)
    record = FittedRecording(
        time,
        values,
        spoilt=np.zeros(len(values)),
        filtered=np.zeros(len(values), dtype=bool),
        order=order,
        known=[KnownNoise(None if np.isnan(each) else each, bandwidth) for each in given.tolist()],
    )
    parts: list[Part] = []
    if method == SMOOTH:
        with progress(len(time) * len(present)) as bar:
            for member in present.tolist():
                parts.append(smooth_part(record, member, degree))
                bar.update(len(time))
        return join(degree, _with_left_out_motion(parts, record), time, values, estimate, given)
    if present.size and method == LEAST_SQUARES:
        parts += _least_squares(time, values, present, degree)
    elif present.size:
        through = scipy.interpolate.make_interp_spline(time, values[present].T, k=degree)
        parts.append(Part(present, through, exact=True))
    if present.size and method != LEAST_SQUARES and len(time) >= FEWEST_JUDGED:
        typical = typical_noise(time, values[present], degree + 1)
        expected = np.where(np.isnan(given[present]), typical, given[present])
        record.spoilt[present], least = _spoilt(parts[0].spline, time, values[present], expected, order)
        record = record._replace(least=least)
        record.filtered[present] = filtered_noise(time, values[present], degree + 1)
    fit = join(degree, parts, time, values, estimate, given)
    with progress(len(time) * len(present)) as bar:
        instead = list(judged(record, fit, bar, chosen=method is not None))
    parts = replaced(parts, instead) if instead else parts
    if method is not None or bandwidth is not None or noise is not None:
        parts = _with_left_out_motion(parts, record)
    return join(degree, parts, time, values, estimate, given)


def _spoilt(
    spline: BSpline[np.float64], time: FloatArray, rows: FloatArray, noise: FloatArray, order: int
) -> tuple[FloatArray, float]:
    """Return the share of noise in the highest derivative of a spline through samples.

    Returns:
        Shares, (components,), and the smallest root mean square derivative that counts as motion.
    """
    degree, duration = spline.k, time[-1] - time[0]
    step = duration / (len(time) - 1)
    inside = time[degree:-degree] if len(time) > 4 * degree else time
    derivative = np.sqrt(np.mean(spline(inside, nu=order) ** 2, axis=0))
    least = np.abs(rows).max(axis=1) / duration**order
    smallest = SMALLEST_SHARE * float(derivative.max())
    scale = np.maximum(np.maximum(derivative, least), smallest)
    error = INTERPOLATION_GAIN[degree][order] * noise / step**order
    return np.asarray(error / np.maximum(scale, np.finfo(float).tiny)), smallest


def _least_squares(time: FloatArray, values: FloatArray, members: IndexArray, degree: int) -> Iterator[Part]:
    spans = best_spans(time, values[members], degree)
    for count in np.unique(spans).tolist():
        alike = members[spans == count]
        yield Part(alike, fit_spline(time, values[alike], count, degree), exact=False)
