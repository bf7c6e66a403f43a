"""Covariance of sums of correlated scores: their lowest frequencies say how noise of any color adds up.

What noise of any color does to unknowns is what the scores, slope times residual, have at frequency 0.
Autocovariances weighted by lag (W. K. Newey, K. D. West, Econometrica 55 (1987)) smear that over a wide band,
and derivatives of noise have much more there: errors came out 2 to 30 times too large. A few cosines do not:
E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, "HAR inference: recommendations for practice", Journal of
Business & Economic Statistics 36 (2018), section 3. Of white residuals it is the usual covariance.
"""

from __future__ import annotations

from vsacli.base.arrays import FloatArray

COSINES = 24
"""Cosines of a record that count. With 8 the errors themselves were too uncertain (87 % within two of them);
with 80, of 3000 samples, those of pure derivatives of noise came out 5 times too large."""

SAMPLES_A_COSINE = 4
"""At least, so that of short records the cosines remain the lowest ones."""


def covariance_of_sum(scores: FloatArray) -> tuple[FloatArray, int]:
    """Return the covariance of the sum of scores, (samples, unknowns), and the number of cosines used."""
    from scipy.fft import dct

    count = count_of_cosines(len(scores))
    amplitudes = dct(scores, axis=0, norm="ortho")[1 : count + 1]
    return len(scores) / count * amplitudes.T @ amplitudes, count


def count_of_cosines(samples: int) -> int:
    """Return how many cosines count in a record of so many samples."""
    return min(COSINES, -(-samples // SAMPLES_A_COSINE), max(samples - 1, 1))
