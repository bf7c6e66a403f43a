"""Low-pass filters that laboratories run over their recordings, drawn at random, with their exact response.

A filter is a list of stages. Each is evaluated at the frequencies of a discrete Fourier transform, so that
its effect on a periodic signal is exact and without transients.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import bessel, butter, cheby1, cheby2, firwin, sosfreqz

CUTOFFS = (5.0, 40.0)
"""Range of cut-off frequencies, Hz."""

HIGHEST = 0.42
"""Largest cut-off as a share of the sampling rate."""

RECURSIVE = ("Butterworth", "Chebyshev I", "Chebyshev II", "Bessel")
SINGLE = ("Butterworth zero-phase", "Butterworth causal", *RECURSIVE[1:], "FIR", "moving average")
FAMILIES = ("none", *SINGLE, "cascade of two")
"""Families by which results are tabulated; only Butterworth filters of two passes have a row of their own."""

WINDOWS = ("hamming", "blackman", "hann")


class Stage(NamedTuple):
    """A filter that is run once, or forwards and backwards.

    Attributes:
        kind: of `RECURSIVE`, "FIR" or "moving average".
        order: of a recursive filter, or number of taps.
        cutoff: nominal frequency, Hz: at -3 dB; at the end of the ripple (Chebyshev I), at the beginning of
            the stop band (Chebyshev II), in the middle of the slope (FIR).
        zero_phase: whether it delays nothing: forwards and backwards (recursive) or centered.
        ripple: of Chebyshev filters: in the pass band (I), attenuation in the stop band (II), dB.
        window: of an FIR filter.
    """

    kind: str
    order: int
    cutoff: float
    zero_phase: bool
    ripple: float
    window: str

    def response(self, samples: int, rate: float) -> np.ndarray:
        """Return the complex gain at the frequencies of `numpy.fft.rfft` of a period of that many samples."""
        if self.kind in RECURSIVE:
            angles = np.linspace(0, 2 * np.pi, samples, endpoint=False)[: samples // 2 + 1]
            gain = sosfreqz(self._sections(rate), worN=angles)[1]
            return np.abs(gain) ** 2 + 0j if self.zero_phase else gain
        if self.kind == "FIR":
            taps = firwin(self.order, self.cutoff, window=self.window, fs=rate)
        else:
            taps = np.full(self.order, 1 / self.order)
        padded = np.zeros(samples)
        padded[: self.order] = taps
        return np.fft.rfft(np.roll(padded, -(self.order // 2)) if self.zero_phase else padded)

    def _sections(self, rate: float) -> np.ndarray:
        """Return second-order sections, which do not lose digits at low cut-offs as coefficients do."""
        if self.kind == "Butterworth":
            return butter(self.order, self.cutoff, fs=rate, output="sos")
        if self.kind == "Chebyshev I":
            return cheby1(self.order, self.ripple, self.cutoff, fs=rate, output="sos")
        if self.kind == "Chebyshev II":
            return cheby2(self.order, self.ripple, self.cutoff, fs=rate, output="sos")
        return bessel(self.order, self.cutoff, fs=rate, output="sos", norm="mag")


class Filter(NamedTuple):
    """One of `FAMILIES`.

    Attributes:
        family: its name.
        stages: none, one or two.
    """

    family: str
    stages: tuple[Stage, ...]

    def response(self, samples: int, rate: float) -> np.ndarray:
        """See `Stage.response`."""
        gain = np.ones(samples // 2 + 1, dtype=complex)
        for stage in self.stages:
            gain *= stage.response(samples, rate)
        return gain

    def __str__(self) -> str:
        return (
            "no filter"
            if not self.stages
            else " + ".join(
                f"{stage.kind} {stage.order}, {stage.cutoff:.3g} Hz{', zero-phase' * stage.zero_phase}"
                for stage in self.stages
            )
        )


def draw_filter(rng: np.random.Generator, rate: float) -> Filter:
    """Draw a filter for recordings of a sampling rate, in Hz."""
    family = str(rng.choice(FAMILIES))
    if family == "none":
        return Filter(family, ())
    families = rng.choice(SINGLE, 2).tolist() if family == FAMILIES[-1] else [family]
    return Filter(family, tuple(_draw_stage(rng, each, rate) for each in families))


def _draw_stage(rng: np.random.Generator, family: str, rate: float) -> Stage:
    low, high = CUTOFFS
    cutoff = float(np.exp(rng.uniform(np.log(low), np.log(min(high, HIGHEST * rate)))))
    kind = family.removesuffix(" zero-phase").removesuffix(" causal")
    zero_phase = bool(rng.integers(2)) if kind != "Butterworth" else family.endswith("zero-phase")
    order = int(rng.integers(1, 9))
    if kind == "FIR":
        order = 2 * round(rng.uniform(1, 4) * rate / cutoff / 2) + 1
    elif kind == "moving average":
        order = max(3, 2 * round(0.443 * rate / cutoff / 2) + 1)  # -3 dB at the cut-off
    ripple = float(rng.uniform(0.1, 1) if kind == "Chebyshev I" else rng.uniform(30, 60))
    return Stage(kind, order, cutoff, zero_phase, ripple, str(rng.choice(WINDOWS)))
