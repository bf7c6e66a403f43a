"""How far a smoothing spline is off: by noise, and by a bias as large as the record shows it to be.

The posterior variance of a penalised spline is the sum of what noise makes of it and of the squared bias that
the prior expects, averaged over all motions that it holds possible. One motion has a bias of its own: sines
far below the cut-off have next to none, a motion whose spectrum falls more slowly than the prior's has many
times as much. Both parts follow from how the posterior variance v changes with a common factor t of all
penalties: the expected bias is -dv/dlog t, noise is the rest. How large the bias is shows at the cut-off, by
how much motion there is beside what the prior expects.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.cutoff import motion_power
from vsacli.trajectory.fits.penalised import Model

STEP = 0.35
"""Of log t to both sides, between which derivatives by it are taken."""

KINK_VARIANCE = 2.5
"""Factor of the variance where motion starts or stops: there one difference of coefficients carries what the
penalty spreads over a segment. On 32 records from rest to rest errors were 0.7 to 2.1 deviations there. With
this, deviations are 0.7 to 1.5 times the errors, all over a record; with twice as much up to 2.0."""

LEAST_SHARE = 0.3
"""Of the expected bias. Its measure is off by some 0.4 from record to record."""


FEW_SAMPLES = 2.0
"""Factor from the posterior deviation of a spline with several penalties to its error, both root mean square.
A few samples at the ends of pauses have most of that, so that nearly all samples are right within twice their
deviation, and the sum of all squares is larger all the same. On 150 records it was up to 2.4 times."""


class Calibration(NamedTuple):
    """Standard deviations of a spline and its derivatives.

    Attributes:
        deviations: at `Model.probes`, (orders, probes).
        units: the same relative to those of the posterior `Model.cautious`, (orders, probes).
    """

    deviations: FloatArray
    units: FloatArray


def calibrated(model: Model, orders: int, unexplained: float) -> Calibration:
    """The deviations of value and derivatives.

    Args:
        model: the spline.
        orders: of the value and its derivatives.
        unexplained: how much the highest derivative changes from one resolution to the next beyond what noise
            explains, root mean square away from the ends.
    """
    near = [model.stiffened(-STEP), model.stiffened(STEP)]
    share = _bias_share(model, orders - 1)
    cautious = np.array([model.variances(order, model.cautious) for order in range(orders)])
    softer, stiffer = (np.array([each.variances(order) for order in range(orders)]) for each in near)
    bias = (softer - stiffer) / (2 * STEP)
    found = np.maximum(cautious - (1 - share) * bias, 0)
    found = np.where(model.kinks, np.maximum(found, KINK_VARIANCE * cautious), found)
    found *= 1 + unexplained**2 / float(np.mean(found[-1, model.inside]) * model.noise_variance)
    return Calibration(
        np.sqrt(model.noise_variance * found), np.sqrt(model.noise_variance * found / cautious)
    )


def posterior_error(model: Model, order: int) -> float:
    """Of a derivative, root mean square away from the ends, by the posterior alone."""
    variance = np.mean(model.variances(order, model.cautious)[model.inside]) * model.noise_variance
    return float((FEW_SAMPLES if model.segments > 1 else 1.0) * np.sqrt(variance))


def _bias_share(model: Model, order: int) -> float:
    """The squared bias of a derivative, as share of what the prior expects, by the motion at the cut-off.

    What lies above the cut-off is extrapolated: if the spectrum falls more slowly than the prior's, it is
    more again.
    """
    weight = model.inside / model.variances(order)  # each part of the record counts alike
    power = motion_power(model, order, 2, weight)
    exists = power.expected > 0  # a straight line has no cut-off
    share = float(np.max(power.found[exists] / power.expected[exists], initial=0.0))
    return max(share, LEAST_SHARE, share * abs(share))
