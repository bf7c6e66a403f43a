"""Test of further columns: does what a fit leaves depend on something that its unknowns do not describe?

Of each column only the part counts that no combination of the unknowns' slopes explains (R. Frisch, F. V.
Waugh, Econometrica 1 (1933)). Its coefficients are held against zero by Wald's test with the covariance of
`score_covariance`, which holds for noise of any color. Since that is taken from few cosines, the statistic
has Hotelling's distribution (E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, Journal of Business &
Economic Statistics 36 (2018), section 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.identification.estimation.equations import Equations, System
from vsacli.studies.identification.estimation.independence import independence
from vsacli.studies.identification.estimation.least_squares import SEPARABLE, least_squares
from vsacli.studies.identification.estimation.score_covariance import freedom_of, wider

FEWEST_ROWS = 3
"""Equations to an unknown below which residuals say too little of what columns are missing."""


class Addition(NamedTuple):
    """Effect of some further columns on a fit.

    Attributes:
        chance: probability of an effect as large if the columns had none.
        left: share that they leave of the sum of squares of the residuals, in units of the noise.
        sizes: coefficients of the columns, (columns,).
    """

    chance: float
    left: float
    sizes: FloatArray


def addition(
    equations: Sequence[Equations], columns: Sequence[FloatArray], noise: dict[str, float]
) -> Addition | None:
    """Add columns to equations and test them; None if the unknowns explain them all, or rows are too few.

    Args:
        equations: of each record, at the values that fit best.
        columns: of each record, (rows, columns).
        noise: of each group.
    """
    system = System.of([each._replace(noise=None) for each in equations])
    weight = np.array([1 / noise[name] for name in system.groups])[system.group]
    known = independence(system.slopes * weight[:, None], SEPARABLE).q
    further = np.concatenate(columns) * weight[:, None]
    new, to_columns = _beyond(known, further)
    count, freedom = new.shape[1], freedom_of(system)
    if not count or freedom <= count or len(weight) < FEWEST_ROWS * (known.shape[1] + count):
        return None
    together = np.hstack((known, new)) / weight[:, None]
    ends = np.cumsum([len(each.measured) for each in equations])[:-1]
    parts = np.split(together, ends)
    fit = least_squares(
        [each._replace(slopes=part, noise=None) for each, part in zip(equations, parts, strict=True)],
        np.zeros(together.shape[1]),
    )
    sizes, covariance = fit.solution[-count:], fit.covariance[-count:, -count:]
    if not np.all(np.diagonal(covariance) > 0):
        return None
    left = system.residual - together @ fit.solution
    return Addition(
        chance=_chance(sizes, covariance / wider(freedom), freedom),
        left=float(np.sum((left * weight) ** 2) / np.sum((system.residual * weight) ** 2)),
        sizes=to_columns @ sizes,
    )


def _beyond(known: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis of what known ones leave of columns, and the columns' coefficients by the basis's."""
    norms = np.linalg.norm(columns, axis=0)
    scale = 1 / np.where(norms > 0, norms, 1.0)
    left = columns * scale
    for _ in range(2):  # twice: rounding of the first leaves a trace of the known ones
        left = left - known @ (known.T @ left)
    basis, sizes, turned = np.linalg.svd(left, full_matrices=False)
    there = sizes > SEPARABLE
    return basis[:, there], scale[:, None] * turned[there].T / sizes[there]


def _chance(sizes: FloatArray, covariance: FloatArray, freedom: int) -> float:
    """Probability that Hotelling's statistic of numbers that are zero is as large."""
    from scipy.special import fdtrc

    count = len(sizes)
    statistic = float(sizes @ np.linalg.solve(covariance, sizes))
    second = freedom - count + 1
    return float(fdtrc(count, second, statistic * second / (freedom * count)))
