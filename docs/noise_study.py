"""What noise does to the fourth derivative of a recorded motion: table and figure of docs/recorded.md."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import POSITION
from vsacli.trajectory.fits import INTERPOLATE, LEAST_SQUARES, SMOOTH, Fit, fit_samples

FREQUENCIES = np.array([0.3, 0.7, 1.1, 1.9])[:, None]
AMPLITUDES = np.array([0.8, 0.4, 0.2, 0.1])
DURATION = 10.0
RATES = (100, 1000)
NOISES = (1e-6, 1e-5, 1e-4, 1e-3)
SHOWN_SPAN = (0.0, 3.0)
ORANGE, BLUE = "#d55e00", "#0072b2"


def motion(time: FloatArray, order: int) -> FloatArray:
    """A derivative of a motion below 2 Hz, (samples,), rad/s^order."""
    rates = 2 * np.pi * FREQUENCIES
    swings = rates**order * np.sin(rates * time + FREQUENCIES + order * np.pi / 2)
    return np.asarray(AMPLITUDES @ swings)


def record(rate: int, noise: float) -> tuple[FloatArray, FloatArray]:
    """Times and values (1, samples) of the motion with white noise, always the same."""
    time = np.arange(round(DURATION * rate) + 1) / rate
    return time, (motion(time, 0) + noise * np.random.default_rng(0).standard_normal(len(time)))[None]


def fit(rate: int, noise: float, method: str) -> Fit:
    """The fit of that record."""
    return fit_samples(*record(rate, noise), POSITION.spline_degree, 4, method)


def error(of: Fit, within: tuple[float, float]) -> float:
    """Root mean square error of the fourth derivative, relative to its own."""
    time = np.linspace(*within, 2001)
    true = motion(time, 4)
    return float(np.sqrt(np.mean((of.at(time, 5)[4, 0] - true) ** 2) / np.mean(true**2)))


def table_rows() -> Iterator[tuple[str, ...]]:
    """Rate, noise, knots, unreliable stretch, error of least squares, error of interpolation."""
    for rate in RATES:
        for noise in NOISES:
            smooth, exact = fit(rate, noise, LEAST_SQUARES), fit(rate, noise, INTERPOLATE)
            start, end = smooth.unreliable
            inside = start, DURATION - end
            yield (
                f"{rate} Hz",
                f"{noise:.0e} rad".replace("e-0", "e-"),
                str(len(smooth.breakpoints)),
                f"{start:.2f} s",
                percent(error(smooth, inside)),
                percent(error(exact, inside)),
            )


def percent(share: float) -> str:
    """One digit, which is what a single record can tell."""
    return f"{100 * share:.1g} %".replace("e+0", "e")


def draw(path: Path) -> None:
    """The fourth derivative of a record with filtered noise: truth, interpolation, fit and band."""
    from matplotlib.figure import Figure

    time, values = filtered_record()
    smooth, exact = (
        fit_samples(time, values, POSITION.spline_degree, 4, each) for each in (SMOOTH, INTERPOLATE)
    )
    shown = np.linspace(*SHOWN_SPAN, 3001)
    true, found = motion(shown, 4), smooth.at(shown, 5)[4, 0]
    deviation = np.sqrt(smooth.covariance(shown)[0, 4, 4])
    size = np.sqrt(np.mean(true**2))
    figure = Figure(figsize=(7.5, 5.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(shown, true, color="0.75", linewidth=5, label="truth")
    above.plot(
        shown,
        exact.at(shown, 5)[4, 0],
        color=ORANGE,
        linewidth=0.4,
        alpha=0.35,
        zorder=1,
        label="interpolation",
    )
    above.plot(shown, found, color=BLUE, linewidth=1.4, label="smoothing spline")
    above.set(ylabel="d4q in rad/s$^4$", ylim=(1.6 * true.min(), 2.1 * true.max()))
    above.legend(framealpha=1, ncols=3, loc="upper right")
    below.fill_between(
        shown,
        -200 * deviation / size,
        200 * deviation / size,
        color=BLUE,
        alpha=0.2,
        linewidth=0,
        label="two deviations",
    )
    below.plot(
        shown, 100 * (found - true) / size, color=BLUE, linewidth=1.2, label="error of the smoothing spline"
    )
    below.set(xlabel="time in s", ylabel="error of d4q in % of its rms", ylim=(-25, 25), xlim=SHOWN_SPAN)
    below.legend(frameon=False, ncols=2, loc="upper right")
    for axes in (above, below):
        axes.axvspan(0, smooth.unreliable[0], color="0.93", zorder=0)
        axes.spines[["top", "right"]].set_visible(False)
    corner = {"xycoords": ("data", "axes fraction"), "xytext": (4, -12), "textcoords": "offset points"}
    above.annotate("unreliable", (0, 1), **corner)
    figure.savefig(path, dpi=150)


def filtered_record() -> tuple[FloatArray, FloatArray]:
    """Times and values (1, samples) of the motion from a 12-bit encoder, low-pass filtered at 50 Hz."""
    from scipy.signal import butter, filtfilt

    time = np.arange(round(DURATION * 1000) + 1) / 1000
    step = 2 * np.pi / 2**12
    return time, filtfilt(*butter(2, 2 * 50 / 1000), step * np.round(motion(time, 0) / step))[None]
