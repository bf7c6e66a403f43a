"""Splines through samples, or near them by least squares, judged by a smoothing spline."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.progress import Bar
from vsacli.trajectory.fits.fit import Fit, Part
from vsacli.trajectory.fits.least_squares import fit_spline
from vsacli.trajectory.fits.resolution import KnownNoise
from vsacli.trajectory.fits.smoothing import smoothing_spline
from vsacli.trajectory.fits.spectrum import FollowedNoise, followed_noise

SUSPECT = 0.01
"""Share of the highest derivative of the interpolating spline that noise may make up without being judged."""

DISAGREEMENT, DISAGREEING_DEVIATIONS = 0.1, 3.0
"""Share of the highest derivative that an interpolating spline may be off by, and deviations of a smoothing
one that it may differ from it by."""

PROBES = 4000
"""Samples, about, at which they are compared; between samples far apart neither is known."""

VIBRATION = 0.5
"""Share of the power of a residual in lines from which on it is a vibration rather than noise. The
faint line at 358 Hz that an encoder's steps left beside filtered noise must not count."""

PASSING = 2.0
"""Factor between the frequency of a vibration and the bandwidth with which a spline follows it."""


class Record(NamedTuple):
    """What was fitted.

    Attributes:
        time: (samples,), s.
        values: (components, samples).
        spoilt: share of the highest derivative of an interpolating spline that white noise makes up,
            (components,).
        filtered: whether there is noise that was filtered, (components,).
        order: of the highest derivative that is needed.
        known: what the user says of the noise of each component.
        least: derivative below which a component rests beside others that move, root mean square.
    """

    time: FloatArray
    values: FloatArray
    spoilt: FloatArray
    filtered: BoolArray
    order: int
    known: Sequence[KnownNoise]
    least: float = 0.0


def smooth_part(record: Record, member: int, degree: int, known: KnownNoise | None = None) -> Part:
    """A smoothing spline of one component; a polynomial by least squares if there can be none."""
    row, members = record.values[member], np.array([member])
    found = smoothing_spline(record.time, row, degree, record.order, known or record.known[member])
    if found is None:
        return Part(members, fit_spline(record.time, row[None], 1, degree), exact=False)
    spline, smoothing = found
    part = Part(members, spline, exact=False, smoothing=smoothing, smooth=True)
    return _following(part, _noise_of(record, part), record)


def judged(record: Record, fit: Fit, bar: Bar, *, chosen: bool) -> Iterator[Part]:
    """For components whose fit may follow noise: the same with what is known of it, or what stands instead.

    Suspect are least squares, whose number of knots has a bias, and splines through noisy samples. A
    smoothing spline is the judge: the difference from it counts as a deviation.

    Args:
        record: what was fitted.
        fit: by least squares, or through the samples.
        bar: on which the samples of each component are counted when it is judged.
        chosen: whether the user chose it, so that it stays.
    """
    for part in fit.parts:
        for column in range(len(part.members)):
            instead = _instead(record, part, column, chosen=chosen)
            bar.update(len(record.time))
            if instead is not None:
                yield instead


def _instead(record: Record, part: Part, column: int, *, chosen: bool) -> Part | None:
    """What stands for a component of a part; None if it needs no judge, or there is none."""
    member, degree = int(part.members[column]), part.spline.k
    wanted = not chosen and record.known[member].bandwidth is not None
    single = type(part.spline)(part.spline.t, part.spline.c[:, [column]], degree)
    noise = _noise_of(record, Part(np.array([member]), single, part.exact))
    filtered = bool(record.filtered[member]) or noise.share > SUSPECT
    if part.exact and record.spoilt[member] <= SUSPECT and not filtered and not wanted:
        more = noise.share > record.spoilt[member]
        return Part(np.array([member]), single, exact=True, noise=noise) if more else None
    judge = _judge(record, member, degree)
    if judge.smoothing is None:
        return None
    difference = _difference(part, column, judge, record)
    if wanted or (not chosen and _better(judge, difference, record, filtered)):
        return judge
    # noise alone speaks against a spline through the samples
    if judge.smoothing.resolved or record.spoilt[member] > DISAGREEMENT or filtered or not part.exact:
        relative = float(np.hypot(judge.smoothing.relative, difference))
        known = replace(judge.smoothing, relative=relative, follows_lines=True)
        return _following(Part(judge.members, single, part.exact, known), noise, record)
    return None


def _noise_of(record: Record, part: Part) -> FollowedNoise:
    """Return the noise that the part of one component follows."""
    step = float(record.time[-1] - record.time[0]) / (len(record.time) - 1)
    bandwidth = record.known[int(part.members[0])].bandwidth
    noise = followed_noise(part.spline, part.inside, step, record.order, bandwidth)
    if not (noise.share and part.exact and record.least):
        return noise
    return noise._replace(share=noise.share * min(1.0, _size(part, record.order) / record.least))


def _following(part: Part, noise: FollowedNoise, record: Record) -> Part:
    """Return the part of one component with the noise that it follows, an error like any other."""
    known = part.smoothing
    if known is None or noise.relative <= known.relative:
        return part
    return replace(part, smoothing=known.following(noise, _size(part, record.order)), noise=noise)


def _size(part: Part, order: int) -> float:
    """Return the root mean square of a derivative of one component, away from the ends."""
    return float(np.sqrt(np.mean(part.spline(np.linspace(*part.inside, PROBES), nu=order) ** 2)))


def _judge(record: Record, member: int, degree: int) -> Part:
    """The smoothing spline of a component; one that follows a vibration, which may be motion."""
    judge = smooth_part(record, member, degree)
    known, lines = record.known[member], judge.smoothing and judge.smoothing.lines
    if not lines or lines.share < VIBRATION or known.bandwidth is not None:
        return judge
    follower = smooth_part(record, member, degree, known._replace(bandwidth=PASSING * max(lines.others)))
    if follower.smoothing is None:
        return judge
    return replace(follower, smoothing=replace(follower.smoothing, lines=lines, follows_lines=True))


def _better(judge: Part, difference: float, record: Record, filtered: bool) -> bool:
    """Whether a smoothing spline is to stand for a component instead of one through its samples.

    If no resolution is accepted, noise must spoil the latter. If noise was filtered, it must differ by more
    than the smoothing spline's own deviation explains.
    """
    known, member = judge.smoothing, judge.members[0]
    if known is None:
        return False
    if record.spoilt[member] > (SUSPECT if known.resolved else DISAGREEMENT):
        return True
    return filtered and difference > DISAGREEMENT + DISAGREEING_DEVIATIONS * known.relative


def _difference(part: Part, column: int, smooth: Part, record: Record) -> float:
    """Between the highest derivatives of a fit and a smoothing spline, relative, away from the ends."""
    time, order = record.time, record.order
    start, end = smooth.doubtful
    inside = time[(time >= time[0] + start) & (time <= time[-1] - end)]
    probes = inside[:: 1 + len(inside) // PROBES]
    expected = smooth.spline(probes, nu=order)[:, 0]
    error = part.spline(probes, nu=order)[:, column] - expected
    power = float(np.sum(expected**2))
    return float(np.sqrt(np.sum(error**2) / power)) if power > 0 else 0.0


def replaced(parts: Sequence[Part], instead: Sequence[Part]) -> list[Part]:
    """All parts, some components taken out of them and put in again by themselves."""
    taken = np.concatenate([part.members for part in instead])
    kept: list[Part] = []
    for part in parts:
        left = ~np.isin(part.members, taken)
        if left.all():
            kept.append(part)
        elif left.any():
            spline = type(part.spline)(part.spline.t, part.spline.c[:, left], part.spline.k)
            kept.append(Part(part.members[left], spline, part.exact))
    return [*kept, *instead]
