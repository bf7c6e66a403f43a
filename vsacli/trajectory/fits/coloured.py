"""Components whose noise is not white, which least squares and interpolation follow: what stands instead."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.fit import Fit, Part
from vsacli.trajectory.fits.least_squares import fit_spline
from vsacli.trajectory.fits.residual import FLAT, STAGNATION, slowest_fall
from vsacli.trajectory.fits.smoothing import smoothing_spline

DISAGREEMENT, DISAGREEING_DEVIATIONS = 0.1, 3.0
"""Share of the highest derivative, and deviations of a smoothing spline, that a fit may differ from it by."""

COMPARED_SAMPLES = 100_000
"""Up to which least squares are compared with a smoothing spline without suspicion: it takes as long."""

PROBES = 4000
"""Samples, about, at which they are compared; between samples far apart neither is known."""

VIBRATION = 0.5
"""Share of the power of a residual in lines from which on it is a vibration rather than noise. The
faint line at 358 Hz that an encoder's steps left beside filtered noise must not count."""


def smooth_part(time: FloatArray, values: FloatArray, member: int, degree: int, order: int) -> Part:
    """A smoothing spline of one component; a polynomial by least squares if there can be none."""
    found = smoothing_spline(time, values[member], degree, order)
    members = np.array([member])
    if found is None:
        return Part(members, fit_spline(time, values[members], 1, degree), exact=False)
    spline, known = found
    return Part(members, spline, exact=False, smoothing=known, smooth=True)


def instead_of_followed_noise(time: FloatArray, values: FloatArray, fit: Fit, order: int) -> Iterator[Part]:
    """For components whose noise is not white, and whose fit follows it: what stands for them instead.

    That the residual of coarse splines stagnates is the suspicion; what convicts the fit is a smoothing
    spline whose highest derivative is another by more than its own deviation explains. If the residual of
    the latter is a vibration, this may be motion, and the fit stays, with what was found; as it does if
    no resolution is accepted and the suspicion is not beyond doubt. Least squares that follow no noise stay,
    with what was found if the record does not determine the derivative; their difference from the smoothing
    spline counts as a deviation then.
    """
    for part in fit.parts:
        for column, member in enumerate(part.members.tolist()):
            fall = slowest_fall(time, values[member], fit.degree, fit.noise[member])
            suspect = fall < STAGNATION
            if not suspect and (part.exact or len(time) > COMPARED_SAMPLES):
                continue
            smooth = smooth_part(time, values, member, fit.degree, order)
            known = smooth.smoothing
            if known is None:
                continue
            difference = _difference(time, part, column, smooth, order)
            allowed = DISAGREEMENT + DISAGREEING_DEVIATIONS * known.relative
            differs = suspect and difference > allowed
            if not differs and not part.exact:
                known = replace(known, relative=float(np.hypot(known.relative, difference)))
            if not differs and (part.exact or known.determined):
                continue
            if not differs or known.lines.share > VIBRATION or not (known.resolved or fall < FLAT):
                single = type(part.spline)(part.spline.t, part.spline.c[:, [column]], fit.degree)
                yield Part(smooth.members, single, part.exact, known)
            else:
                yield smooth


def _difference(time: FloatArray, part: Part, column: int, smooth: Part, order: int) -> float:
    """Between the highest derivatives of a fit and a smoothing spline, relative, away from the ends."""
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
