"""Means of samples over equal bins of time, from moments that serve bins of all widths by powers of two.

`BinMoments` of fine bins are summed once, and halved for each coarser resolution. `Bins` has the means and
the mean B-splines of a resolution, and `Bins.whitened` the rows of a linear estimation with independent
errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.trajectory.fits.least_squares import BandedFactor, block_count, factorize, sort_rows

BLOCK_SAMPLES = 65536
"""Samples that are summed at a time; the last digits of the sums depend on it."""


class BinMoments(NamedTuple):
    """Moments of samples in fine bins, from which those of coarser bins follow.

    Attributes:
        start: start of the recording, s.
        width: width of a bin, s.
        powers: sums of powers 0, 1, ... of the places of samples in their bin, from 0 to 1, (powers, bins).
        time: sums of their times, (bins,), s.
        row: sums of their values, (bins,).
    """

    start: float
    width: float
    powers: FloatArray
    time: FloatArray
    row: FloatArray

    @classmethod
    def of(cls, time: FloatArray, row: FloatArray, bins: int, degree: int) -> BinMoments:
        """Return the moments of samples.

        Args:
            time: times, (samples,), s.
            row: values, (samples,).
            bins: number of bins of equal width.
            degree: highest power.
        """
        start, width = float(time[0]), float(time[-1] - time[0]) / bins
        sums = np.zeros((degree + 3, bins))
        for first in range(0, len(time), BLOCK_SAMPLES):
            block = slice(first, first + BLOCK_SAMPLES)
            bin_positions = np.clip((time[block] - start) / width, 0, bins * (1 - 1e-15))
            bin_indices = np.minimum(bin_positions.astype(int), bins - 1)
            bin_positions -= bin_indices
            power = np.ones_like(bin_positions)
            for power_sum in sums[:-2]:
                power_sum += np.bincount(bin_indices, power, minlength=bins)
                power *= bin_positions
            sums[-2] += np.bincount(bin_indices, time[block], minlength=bins)
            sums[-1] += np.bincount(bin_indices, row[block], minlength=bins)
        return cls(start, width, sums[:-2], sums[-2], sums[-1])

    @property
    def halved(self) -> BinMoments:
        """Moments of half as many bins, twice as wide; the number of bins must be even."""
        powers = merged(self.powers[:, ::2], self.powers[:, 1::2])
        time, row = self.time[::2] + self.time[1::2], self.row[::2] + self.row[1::2]
        return BinMoments(self.start, 2 * self.width, powers, time, row)


def merged(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return sums of powers of places in bins twice as wide, (powers, bins), from those of halves."""
    count = len(left)
    binomial_shift = np.array(
        [[math.comb(k, i) for i in range(count)] for k in range(count)], dtype=np.float64
    )
    return np.asarray((left + binomial_shift @ right) / 2.0 ** np.arange(count)[:, None])


BINS_PER_SPAN = 2

LONGEST_LINK = 4.001
"""Largest distance, in bins, of two means whose errors count as correlated: the row of their difference must
not be wider than a block of unknowns."""


class Whitened(NamedTuple):
    """Means with independent errors of the same size.

    Attributes:
        correlation: correlation of the errors of two means one bin apart.
        factor: factor of their rows, which takes their place.
        log_scale: minus the logarithm of the determinant of the correlation matrix of the errors.
        variance: variance of the errors; None if that of samples is unknown.
    """

    correlation: float
    factor: BandedFactor
    log_scale: float
    variance: float | None


@dataclass(frozen=True, eq=False)
class Bins:
    """Means of a recording over two bins per knot span, without empty bins.

    Attributes:
        start: start of the recording, s.
        span: length of a knot span, s.
        spans: number of knot spans.
        degree: degree of the spline.
        means: means of the samples, (bins,).
        design: means of the B-splines at these samples, (bins, degree + 1), so that averaging adds no bias.
        first: index of the first of these B-splines, (bins,).
        gaps: distance from one mean time to the next, in bins, (bins - 1,); infinite without correlation.
        samples: mean number of samples in a bin.
        noise: standard deviation of a sample's noise; None if unknown.
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
    def of(cls, moments: BinMoments, noise: float | None = None) -> Bins:
        """Return the means of samples from their moments.

        Args:
            moments: moments of the bins, up to the power of the degree.
            noise: standard deviation of a sample's noise; None if unknown.
        """
        count, degree = moments.powers[0], len(moments.powers) - 1
        used_bins = np.flatnonzero(count)
        means, times = moments.row[used_bins] / count[used_bins], moments.time[used_bins] / count[used_bins]
        # A bin is the first or second half of its span: merge it with an empty other half.
        powers_in_half, zeros = moments.powers[:, used_bins], np.zeros_like(moments.powers[:, used_bins])
        is_second_half = used_bins % BINS_PER_SPAN == 1
        powers = (
            np.where(is_second_half, merged(zeros, powers_in_half), merged(powers_in_half, zeros))
            / count[used_bins]
        )
        gaps = np.diff(times) / moments.width
        return cls(
            start=moments.start,
            span=BINS_PER_SPAN * moments.width,
            spans=len(count) // BINS_PER_SPAN,
            degree=degree,
            means=means,
            design=powers.T @ _basis_polynomials(degree),
            first=used_bins // BINS_PER_SPAN,
            gaps=np.where(gaps > LONGEST_LINK, np.inf, gaps),
            samples=float(np.sum(count)) / len(used_bins),
            noise=noise,
        )

    @property
    def coefficients(self) -> int:
        """Number of coefficients of the spline."""
        return self.spans + self.degree

    @property
    def knots(self) -> FloatArray:
        """Knots of the spline, s, equally spaced, also beyond both ends."""
        knot_indices = np.arange(-self.degree, self.spans + self.degree + 1, dtype=np.float64)
        return self.start + self.span * knot_indices

    def stretch(self, first: int, spans: int) -> Bins:
        """Return the bins of some spans, as of a recording of its own.

        Args:
            first: index of the first span.
            spans: number of spans.
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
        """Return differences of neighboring means, scaled so that their errors are independent and equal.

        Args:
            correlation: correlation of the errors of two means one bin apart; it decreases with the distance
                as for a first-order process.
        """
        rows_here, previous_rows, block, row_index = self._linked_rows
        lag = np.append(0.0, np.sign(correlation) * np.abs(correlation) ** self.gaps)
        scale = 1 / np.sqrt(1 - lag**2)
        lags, scales = np.zeros((2, *rows_here.shape[:2]))
        lags[block, row_index], scales[block, row_index] = lag, scale
        rows = scales[..., None] * (rows_here - lags[..., None] * previous_rows)
        target = np.zeros(rows_here.shape[:2])
        target[block, row_index] = scale * (self.means - lag * np.append(0.0, self.means[:-1]))
        variance = self._noise_variance(correlation)
        log_scale = 2 * float(np.sum(np.log(scale)))
        return Whitened(correlation, factorize(rows, target), log_scale, variance)

    @cached_property
    def _linked_rows(self) -> tuple[FloatArray, FloatArray, IndexArray, IndexArray]:
        """Design rows in blocks, those of the previous bins, and block and place of each bin's row."""
        is_linked, width = np.isfinite(self.gaps), self.degree + 1
        first = self.first.copy()
        first[1:] = np.where(is_linked, self.first[:-1], self.first[1:])
        padded_rows = np.zeros((2, len(first), width + math.ceil(LONGEST_LINK / BINS_PER_SPAN)))
        columns = (self.first - first)[:, None] + np.arange(width)
        np.put_along_axis(padded_rows[0], columns, self.design, axis=1)
        padded_rows[1, 1:, :width] = np.where(is_linked[:, None], self.design[:-1], 0)
        rows_here, previous_rows = (sort_rows(first, rows, self.coefficients) for rows in padded_rows)
        return rows_here.blocks, previous_rows.blocks, rows_here.block, rows_here.place

    def _noise_variance(self, correlation: float) -> float | None:
        """Return the variance of a mean for first-order noise; None if that of samples is unknown.

        Args:
            correlation: correlation of two neighboring means, which determines that of samples; samples count
                as uncorrelated if it is negative.
        """
        if self.noise is None:
            return None
        count = max(1.0, self.samples)
        sample_correlations = 1 - np.geomspace(1, 1e-6, 200)[1:]
        powers = sample_correlations**count
        sums = (1 - powers) / (1 - sample_correlations)
        # Sums of correlations over all pairs of samples in a bin, and over pairs from two neighboring bins.
        within_sums = (count * (1 + sample_correlations) - 2 * sample_correlations * sums) / (
            1 - sample_correlations
        )
        between_sums = sample_correlations * sums**2
        variance_share = np.interp(
            correlation, between_sums / within_sums, within_sums / count**2, left=1 / count
        )
        return float(self.noise**2 * variance_share)

    @cached_property
    def differences(self) -> FloatArray:
        """Rows of differences of the coefficients, of the order of the degree, (blocks, rows, columns).

        Unit rows after the last one make the unknowns zero that fill up the last block.
        """
        order = self.degree
        count, row_count = block_count(self.coefficients), self.coefficients - order
        weights = [(-1.0) ** (order - k) * math.comb(order, k) for k in range(order + 1)]
        rows = sort_rows(np.arange(row_count), np.tile(weights, (row_count, 1)), self.coefficients).blocks
        height = rows.shape[2] // 2
        padded_rows = np.zeros((count, height, 2 * height))
        padded_rows[:, : rows.shape[1]] = rows
        spare_indices = np.arange(self.coefficients, count * height)
        padded_rows[spare_indices // height, spare_indices % height, spare_indices % height] = 1
        return padded_rows


def uniform_basis(place: FloatArray, degree: int) -> list[FloatArray]:
    """Return the B-splines that are nonzero on a span, first to last, for knots at distance 1.

    Args:
        place: place within the span, 0 to 1, (samples,).
        degree: degree of the B-splines.
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
    """Return the coefficients of a span's B-splines by powers of the place in it, (powers, degree + 1)."""
    nodes = np.linspace(0, 1, degree + 1)
    values = np.stack(uniform_basis(nodes, degree), axis=1)
    return np.asarray(np.linalg.solve(np.vander(nodes, increasing=True), values), dtype=np.float64)
