"""What noise does to the fourth derivative of a recorded motion: table and figure of docs/recorded.md."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import POSITION
from vsacli.trajectory.fits import INTERPOLATE, LEAST_SQUARES, Fit, fit_samples

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
    """Rate, noise, knots, doubtful stretch, error of least squares, error of interpolation."""
    for rate in RATES:
        for noise in NOISES:
            smooth, exact = fit(rate, noise, LEAST_SQUARES), fit(rate, noise, INTERPOLATE)
            start, end = smooth.doubtful
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
    """The fourth derivative of the noisy record at 1 kHz, fitted and interpolated, and their errors."""
    from matplotlib.figure import Figure

    smooth, exact = fit(1000, 1e-5, LEAST_SQUARES), fit(1000, 1e-5, INTERPOLATE)
    time = np.linspace(*SHOWN_SPAN, 3001)
    true = motion(time, 4)
    size = np.sqrt(np.mean(true**2))
    figure = Figure(figsize=(7.5, 5.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(time, true, color="0.75", linewidth=5, label="truth")
    above.plot(time, smooth.at(time, 5)[4, 0], color=BLUE, linewidth=1.4, label="least squares")
    above.set(ylabel="d4q in rad/s$^4$", ylim=(1.6 * true.min(), 2.1 * true.max()))
    above.legend(frameon=False, ncols=2, loc="upper right")
    for spline, colour, label in ((exact, ORANGE, "interpolation"), (smooth, BLUE, "least squares")):
        off = np.abs(spline.at(time, 5)[4, 0] - true) / size
        below.semilogy(time, off, color=colour, linewidth=0.8, label=label)
    below.axhline(0.02, color="0.3", linewidth=0.8, linestyle="--")
    below.annotate("2 %", (SHOWN_SPAN[1], 0.02), xytext=(-4, 3), textcoords="offset points", ha="right")
    below.set(xlabel="time in s", ylabel="error of d4q over its rms", ylim=(1e-6, 1e9), xlim=SHOWN_SPAN)
    below.legend(frameon=False, ncols=2, loc="upper right")
    for axes in (above, below):
        axes.axvspan(0, smooth.doubtful[0], color="0.93", zorder=0)
        axes.spines[["top", "right"]].set_visible(False)
    corner = {"xycoords": ("data", "axes fraction"), "xytext": (4, -12), "textcoords": "offset points"}
    above.annotate("doubtful", (0, 1), **corner)
    figure.savefig(path, dpi=150)
