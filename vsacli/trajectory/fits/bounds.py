"""How far components of a fit may be off of which the record does not determine a standard deviation."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.covariance import local_basis, of_derivatives, of_least_squares
from vsacli.trajectory.fits.fit import Fit, Part
from vsacli.trajectory.fits.information import Posterior
from vsacli.trajectory.fits.smoothing import Smoothing

CAUTION = 3.2
"""Factor between what resolutions differ by and what is taken for a standard deviation. With motions of
minimum jerk or steps of velocity within 50 and 200 ms, and twelve colours of noise, torques that were wrong
by more than 5 % were so by up to 6.2 times as much: twice this deviation is a little more."""

SMOOTH_CAUTION = 1.6
"""The same if the spectrum of the highest derivative falls, so that it has no impulses. With steps of
velocity within 200 ms d4q was off by 0.75 to 1.3 times what resolutions differ by."""

SHORTEST_IMPULSE = 5e-4
"""Duration, s, of an impulse of the highest derivative, as where jerk jumps: the current of a motor hardly
follows faster."""

IMPULSES = 0.6
"""Standard deviation of the highest derivative, in what such an impulse has that a spline spreads: longer by
a factor, its root mean square is less by the root of it. Of 110 motions of minimum jerk d4q was off by 0.58
to 1.01 times that."""

PROBES = 500
"""Times that root mean squares are taken of."""


class Unresolved:
    """The components of a part of a fit of which no two resolutions agree.

    Attributes:
        members: their indices.
    """

    def __init__(self, fit: Fit, part: Part, posterior: Posterior, known: Smoothing, orders: int) -> None:
        """Scale a posterior.

        Args:
            fit: of the signal.
            part: of it.
            posterior: of the coefficients of the part's spline.
            known: what resolutions differ by, and over what impulses are spread.
            orders: value and derivatives that are needed.
        """
        self.members, self._orders = part.members, orders
        self._knots, self._degree, self._posterior = part.spline.t, fit.degree, posterior
        probes = np.linspace(*part.inside, PROBES)
        found = np.sqrt(np.mean(self._of_posterior(probes)[-1, -1]))
        size = np.sqrt(np.mean(part.spline(probes, nu=orders - 1) ** 2, axis=0))
        caution = CAUTION if known.spread else SMOOTH_CAUTION
        self._units: FloatArray = caution * known.relative * size / found
        self._impulses: FloatArray = IMPULSES * np.sqrt(known.spread / SHORTEST_IMPULSE) * size

    def covariance(self, time: FloatArray) -> FloatArray:
        """Of value and derivatives at any times of the span, s: (members, orders, orders, samples)."""
        found = self._units[:, None, None, None] ** 2 * self._of_posterior(time)
        found[:, -1, -1] += self._impulses[:, None] ** 2
        return np.asarray(found)

    def _of_posterior(self, time: FloatArray) -> FloatArray:
        basis = local_basis(self._knots, self._degree, time, self._orders)
        return of_derivatives(self._posterior, basis)


def unresolved(fit: Fit, orders: int) -> Iterator[Unresolved]:
    """Those of a fit."""
    for part in fit.parts:
        known = part.smoothing
        if known is not None and not known.resolved:
            posterior = known.posterior if part.smooth else _of_least_squares(fit, part)
            if posterior is not None:
                yield Unresolved(fit, part, posterior, known, orders)


def _of_least_squares(fit: Fit, part: Part) -> Posterior | None:
    try:
        return of_least_squares(fit.time, part.spline.t, fit.degree)
    except np.linalg.LinAlgError:  # of very uneven times
        return None


def vibrations(fit: Fit, orders: int) -> Iterator[tuple[int, FloatArray]]:
    """Components with lines in their spectrum that nobody knows to be motion or noise.

    Yields:
        The index of each, and the covariance of value and derivatives, (orders, orders), of lines that were
        taken for noise, all their power at the highest frequency; NaN if the spline follows the lines.
    """
    for part in fit.parts:
        known = part.smoothing
        if known is not None and known.lines.others:
            rate = 2 * np.pi * max(known.lines.others) * np.exp(0.5j * np.pi)
            line = rate ** np.arange(orders)  # derivatives of a turning phasor
            covariance = np.real(line[:, None] * line.conj())
            for member in part.members.tolist():
                power = np.nan if known.follows_lines else known.lines.share * fit.residual[member] ** 2
                yield member, power * covariance
