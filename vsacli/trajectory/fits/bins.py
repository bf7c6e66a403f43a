"""Samples as means over equal bins of time, with what a uniform B-spline has for them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.trajectory.fits.information import block_count, sort_rows

BINS_PER_SPAN = 2

BLOCK_SAMPLES = 65536
"""Whose B-splines are held at a time: what fits into a cache is twice as fast."""

LONGEST_LINK = 4.001
"""Bins between two means whose errors are still taken for correlated: a row of the difference of both must
not reach further than a block of unknowns."""


class Whitened(NamedTuple):
    """Rows with independent errors of the same size.

    Attributes:
        rows: (blocks, rows, columns), see `information.Rows`.
        target: (blocks, rows).
        log_scale: logarithm of the determinant of what the covariance was divided by, twice negative.
        variance: of the errors, if that of samples is known.
    """

    rows: FloatArray
    target: FloatArray
    log_scale: float
    variance: float | None


@dataclass(frozen=True, eq=False)
class Bins:
    """Means of a record over two bins to a knot span, empty ones left out.

    Attributes:
        start: of the record, s.
        span: length of a knot span, s.
        spans: their number.
        degree: of the spline.
        means: (bins,), of the samples.
        design: (bins, degree + 1), means of the B-splines at the same samples: averaging costs no bias.
        first: index of the first of these B-splines, (bins,).
        gaps: distance from one mean time to the next, in bins, (bins - 1,); infinite where they are unlinked.
        samples: in a bin, on average.
        noise: standard deviation of a sample's noise, if it is known.
    """

    start: float
    span: float
    spans: int
    degree: int
    means: FloatArray
    design: FloatArray
    first: IndexArray
    gaps: FloatArray
    samples: float
    noise: float | None = None

    @classmethod
    def of(
        cls, time: FloatArray, row: FloatArray, spans: int, degree: int, noise: float | None = None
    ) -> Bins:
        """Averages of samples.

        Args:
            time: (samples,), s.
            row: (samples,).
            spans: of the spline, of equal length.
            degree: of the spline.
            noise: standard deviation of a sample's noise, if it is known.
        """
        start, span = float(time[0]), float(time[-1] - time[0]) / spans
        count, sums = np.zeros(BINS_PER_SPAN * spans), np.zeros((degree + 3, BINS_PER_SPAN * spans))
        for first in range(0, len(time), BLOCK_SAMPLES):
            block = slice(first, first + BLOCK_SAMPLES)
            place = np.clip((time[block] - start) / span, 0, spans * (1 - 1e-15))
            which = np.minimum((BINS_PER_SPAN * place).astype(int), len(count) - 1)
            basis = uniform_basis(place - which // BINS_PER_SPAN, degree)
            count += np.bincount(which, minlength=len(count))
            for total, values in zip(sums, (time[block], row[block], *basis), strict=True):
                total += np.bincount(which, values, minlength=len(count))
        used = np.flatnonzero(count)
        times, means, *design = sums[:, used] / count[used]
        gaps = np.diff(times) * BINS_PER_SPAN / span
        return cls(
            start=start,
            span=span,
            spans=spans,
            degree=degree,
            means=means,
            design=np.stack(design, axis=1),
            first=used // BINS_PER_SPAN,
            gaps=np.where(gaps > LONGEST_LINK, np.inf, gaps),
            samples=len(time) / len(used),
            noise=noise,
        )

    @property
    def coefficients(self) -> int:
        """Of the spline."""
        return self.spans + self.degree

    @property
    def knots(self) -> FloatArray:
        """Of the spline: equally spaced, also beyond both ends."""
        places = np.arange(-self.degree, self.spans + self.degree + 1, dtype=np.float64)
        return self.start + self.span * places

    def stretch(self, first: int, spans: int) -> Bins:
        """The bins of some spans, as if nothing else had been recorded.

        Args:
            first: index of the first of the spans.
            spans: their number.
        """
        start, stop = np.searchsorted(self.first, [first, first + spans])
        return replace(
            self,
            start=self.start + first * self.span,
            spans=spans,
            means=self.means[start:stop],
            design=self.design[start:stop],
            first=self.first[start:stop] - first,
            gaps=self.gaps[start : stop - 1],
        )

    def whitened(self, correlation: float) -> Whitened:
        """Differences of neighbouring means whose errors are independent.

        Args:
            correlation: of the errors of two neighbouring means; those further apart are correlated the less,
                as those of a process of first order.
        """
        lag = np.append(0.0, np.sign(correlation) * np.abs(correlation) ** self.gaps)
        scale = 1 / np.sqrt(1 - lag**2)
        linked = lag != 0
        first = self.first.copy()
        first[1:] = np.where(linked[1:], self.first[:-1], self.first[1:])
        width = self.degree + 1
        rows = np.zeros((len(first), width + math.ceil(LONGEST_LINK / BINS_PER_SPAN)))
        columns = (self.first - first)[:, None] + np.arange(width)
        np.put_along_axis(rows, columns, self.design, axis=1)
        rows[1:, :width] -= lag[1:, None] * self.design[:-1]
        errors = self.means - lag * np.append(0.0, self.means[:-1])
        ordered = sort_rows(first, rows * scale[:, None], self.coefficients)
        target = np.zeros(ordered.blocks.shape[:2])
        target[ordered.block, ordered.place] = errors * scale
        variance = self._noise_variance(correlation)
        return Whitened(ordered.blocks, target, 2 * float(np.sum(np.log(scale))), variance)

    def _noise_variance(self, correlation: float) -> float | None:
        """Of a mean, if that of a sample is known; its noise is taken for a process of first order.

        Args:
            correlation: of two neighbouring means, from which that of samples follows; if negative, none.
        """
        if self.noise is None:
            return None
        count = max(1.0, self.samples)
        of_samples = 1 - np.geomspace(1, 1e-6, 200)[1:]
        passed = of_samples**count
        sums = (1 - passed) / (1 - of_samples)
        # the sum over all pairs of a bin, and that over the pairs of two neighbouring bins
        within = (count * (1 + of_samples) - 2 * of_samples * sums) / (1 - of_samples)
        between = of_samples * sums**2
        share = np.interp(correlation, between / within, within / count**2, left=1 / count)
        return float(self.noise**2 * share)

    @cached_property
    def differences(self) -> FloatArray:
        """Rows of the differences of the coefficients, (blocks, rows, columns), and units behind the last.

        Their order is the degree. The units make the unknowns that fill up the last block zero.
        """
        order = self.degree
        count, last = block_count(self.coefficients), self.coefficients - order
        weights = [(-1.0) ** (order - k) * math.comb(order, k) for k in range(order + 1)]
        rows = sort_rows(np.arange(last), np.tile(weights, (last, 1)), self.coefficients).blocks
        height = rows.shape[2] // 2
        full = np.zeros((count, height, 2 * height))
        full[:, : rows.shape[1]] = rows
        spare = np.arange(self.coefficients, count * height)
        full[spare // height, spare % height, spare % height] = 1
        return full


def uniform_basis(place: FloatArray, degree: int) -> list[FloatArray]:
    """The B-splines that are not zero on a span, first to last, on knots one apart.

    Args:
        place: within the span, 0 to 1, (samples,).
        degree: of the B-splines.
    """
    values = [np.ones_like(place)]
    for k in range(1, degree + 1):
        higher = [np.zeros_like(place) for _ in range(k + 1)]
        for i, value in enumerate(values):
            rising = (place + (k - 1 - i)) / k
            higher[i + 1] += rising * value
            higher[i] += (1 - rising) * value
        values = higher
    return values
