"""Samples as means over equal bins of time, from sums that serve bins of any power of two."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.trajectory.fits.banded_qr import block_count, sort_rows

BLOCK_SAMPLES = 65536
"""Samples held at a time: a block that fits into a cache is twice as fast."""


class Moments(NamedTuple):
    """Moments of fine bins, from which those of all resolutions are averaged.

    Attributes:
        start: of the record, s.
        width: of a bin, s.
        powers: sums over the samples of a bin of the powers 0, 1, ... of their place in it, 0 to 1,
            (powers, bins).
        time: sums of their times, (bins,).
        row: sums of their values, (bins,).
    """

    start: float
    width: float
    powers: FloatArray
    time: FloatArray
    row: FloatArray

    @classmethod
    def of(cls, time: FloatArray, row: FloatArray, bins: int, degree: int) -> Moments:
        """Sums over samples.

        Args:
            time: (samples,), s.
            row: (samples,).
            bins: of equal width.
            degree: of the highest power.
        """
        start, width = float(time[0]), float(time[-1] - time[0]) / bins
        sums = np.zeros((degree + 3, bins))
        for first in range(0, len(time), BLOCK_SAMPLES):
            block = slice(first, first + BLOCK_SAMPLES)
            place = np.clip((time[block] - start) / width, 0, bins * (1 - 1e-15))
            which = np.minimum(place.astype(int), bins - 1)
            place -= which
            power = np.ones_like(place)
            for total in sums[:-2]:
                total += np.bincount(which, power, minlength=bins)
                power *= place
            sums[-2] += np.bincount(which, time[block], minlength=bins)
            sums[-1] += np.bincount(which, row[block], minlength=bins)
        return cls(start, width, sums[:-2], sums[-2], sums[-1])

    @property
    def halved(self) -> Moments:
        """Return the moments of half as many bins, twice as wide; their number must be even."""
        powers = merged(self.powers[:, ::2], self.powers[:, 1::2])
        time, row = self.time[::2] + self.time[1::2], self.row[::2] + self.row[1::2]
        return Moments(self.start, 2 * self.width, powers, time, row)


def merged(left: FloatArray, right: FloatArray) -> FloatArray:
    """Sums of the powers of places in a bin twice as wide, from those in its halves, (powers, bins)."""
    count = len(left)
    shift = np.array([[math.comb(k, i) for i in range(count)] for k in range(count)], dtype=np.float64)
    return np.asarray((left + shift @ right) / 2.0 ** np.arange(count)[:, None])


BINS_PER_SPAN = 2

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
    def of(cls, moments: Moments, noise: float | None = None) -> Bins:
        """Averages of samples.

        Args:
            moments: of the bins, up to the power of the degree.
            noise: standard deviation of a sample's noise, if it is known.
        """
        count, degree = moments.powers[0], len(moments.powers) - 1
        used = np.flatnonzero(count)
        means, times = moments.row[used] / count[used], moments.time[used] / count[used]
        # the first and the second half of a span: the other half is empty
        halves, nothing = moments.powers[:, used], np.zeros_like(moments.powers[:, used])
        second = used % BINS_PER_SPAN == 1
        powers = np.where(second, merged(nothing, halves), merged(halves, nothing)) / count[used]
        gaps = np.diff(times) / moments.width
        return cls(
            start=moments.start,
            span=BINS_PER_SPAN * moments.width,
            spans=len(count) // BINS_PER_SPAN,
            degree=degree,
            means=means,
            design=powers.T @ _basis_polynomials(degree),
            first=used // BINS_PER_SPAN,
            gaps=np.where(gaps > LONGEST_LINK, np.inf, gaps),
            samples=float(np.sum(count)) / len(used),
            noise=noise,
        )

    @property
    def coefficients(self) -> int:
        """Number of coefficients of the spline."""
        return self.spans + self.degree

    @property
    def knots(self) -> FloatArray:
        """Knots of the spline: equally spaced, also beyond both ends."""
        places = np.arange(-self.degree, self.spans + self.degree + 1, dtype=np.float64)
        return self.start + self.span * places

    def stretch(self, first: int, spans: int) -> Bins:
        """Return the bins of some spans, as if nothing else had been recorded.

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
        here, before, block, place = self._linked_rows
        lag = np.append(0.0, np.sign(correlation) * np.abs(correlation) ** self.gaps)
        scale = 1 / np.sqrt(1 - lag**2)
        lags, scales = np.zeros((2, *here.shape[:2]))
        lags[block, place], scales[block, place] = lag, scale
        rows = scales[..., None] * (here - lags[..., None] * before)
        target = np.zeros(here.shape[:2])
        target[block, place] = scale * (self.means - lag * np.append(0.0, self.means[:-1]))
        variance = self._noise_variance(correlation)
        return Whitened(rows, target, 2 * float(np.sum(np.log(scale))), variance)

    @cached_property
    def _linked_rows(self) -> tuple[FloatArray, FloatArray, IndexArray, IndexArray]:
        """The design sorted into blocks, for each bin that of the bin before it, and where each bin is."""
        linked, width = np.isfinite(self.gaps), self.degree + 1
        first = self.first.copy()
        first[1:] = np.where(linked, self.first[:-1], self.first[1:])
        both = np.zeros((2, len(first), width + math.ceil(LONGEST_LINK / BINS_PER_SPAN)))
        columns = (self.first - first)[:, None] + np.arange(width)
        np.put_along_axis(both[0], columns, self.design, axis=1)
        both[1, 1:, :width] = np.where(linked[:, None], self.design[:-1], 0)
        here, before = (sort_rows(first, rows, self.coefficients) for rows in both)
        return here.blocks, before.blocks, here.block, here.place

    def _noise_variance(self, correlation: float) -> float | None:
        """Return the variance of a mean, if that of a sample is known, for noise of first order.

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
    """Return the B-splines that are not zero on a span, first to last, on knots one apart.

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


@cache
def _basis_polynomials(degree: int) -> FloatArray:
    """Coefficients of the B-splines of a span by powers of the place in it, (powers, degree + 1)."""
    nodes = np.linspace(0, 1, degree + 1)
    values = np.stack(uniform_basis(nodes, degree), axis=1)
    return np.asarray(np.linalg.solve(np.vander(nodes, increasing=True), values), dtype=np.float64)
