"""Recorded signals of a trajectory with their splines, for figures that show how noise was estimated.

All statements on a fit are taken from its summary, as in reports. Spectra are computed here, from the samples
and the spline alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.progress import Progress, unseen
from vsacli.base.signals import COMMANDED, POSITION, Signal
from vsacli.documents.csv_file import read_header
from vsacli.results.charts.measured import AmplitudeSpectrum, HighestDerivative, RecordedCurve
from vsacli.results.charts.reduction import Curve
from vsacli.results.store.excerpt import WHOLE, Span, requested_joint_indices, samples_between
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.model import Robot
from vsacli.trajectory.fits import AS_IT_ASKS_FOR
from vsacli.trajectory.fits.selection import INTERPOLATE, LEAST_SQUARES, SMOOTH
from vsacli.trajectory.recorded.columns import column_layout
from vsacli.trajectory.recorded.recording import read_recorded_signals
from vsacli.trajectory.recorded.samples import SampledProfile

FEWEST_POINTS = 1000
"""Minimum number of points of a drawn spline: lines between fewer samples would look like corners."""

WINDOW_POWER = 8
"""Exponent of the sine window. Leakage falls with the ninth power of the frequency, so that motion of 1 rad
does not hide noise of 1e-9 rad ten lines away; with a Hann window it would hide 1e-5 rad."""

FIRST_LINE = 4
"""Lowest frequency shown, in cycles per recording: the window mixes lower ones with the mean."""

BANDS = 120

ROUNDING = 16 * np.finfo(float).eps
"""Relative range of a recording below which it is at rest."""

FOLLOWED_GAIN = 0.5
"""Gain of the spline relative to the samples in a band from which it follows them."""

FITS = {
    INTERPOLATE: "interpolated",
    LEAST_SQUARES: "least squares",
    SMOOTH: "smoothed",
}
"""Words for the fitting methods of the report."""


def table_profiles(path: str, robot: Robot, progress: Progress = unseen) -> list[SampledProfile]:
    """Return position and commanded signals in the columns of a CSV file, fitted as in a run.

    Args:
        path: path of the file.
        robot: robot that was recorded; unlike in a run, signals that it requires may be missing.
        progress: opens a progress bar over the samples to which splines are fitted.

    Raises:
        InputError: as `read_recorded_signals`.
    """
    joints, header = CommandedJoints.of(robot), read_header(path)
    layout = column_layout(header.columns, joints, (POSITION,), path, header.line)
    signals = [signal for signal in (POSITION, *COMMANDED.values()) if layout.quantities.get(signal.names[0])]
    choices = dict.fromkeys(signals, AS_IT_ASKS_FOR)
    return list(read_recorded_signals(path, joints, choices, progress=progress).profiles)


def recorded_curves(
    profiles: Iterable[SampledProfile],
    joint_types: Sequence[str],
    file: str | Path,
    joint_names: Sequence[str] = (),
    span: Span = WHOLE,
) -> list[RecordedCurve]:
    """Return recorded signals and their splines, component by component.

    Args:
        profiles: recorded signals; those without a spline are omitted.
        joint_types: joint types of the robot.
        file: path for errors.
        joint_names: names of the joints to show; all if empty. A wrench is always shown.
        span: first and last time of the curves, s; spectra are of the whole recording.

    Raises:
        InputError: a joint is unknown, or no sample lies in the span.
    """
    curves = []
    for profile in (
        profile_with_fit for profile_with_fit in profiles if profile_with_fit.estimate is not None
    ):
        record, requested = profile.record, () if profile.signal.is_wrench else joint_names
        component_names = {
            record.labels[index] for index in requested_joint_indices(record.labels, requested, file)
        }
        sample_slice = samples_between(record.start + record.time, span, file)
        curves += [
            _recorded_curve(profile, record.labels.index(summary["name"]), joint_types, summary, sample_slice)
            for summary in profile.summary()["columns"]
            if summary["name"] in component_names
        ]
    return curves


def _curve_name(signal: Signal, component: str) -> str:
    if signal.is_wrench:
        return f"{signal.tool}.{component}" if signal.tool else component
    return f"{component}.{signal.names[0]}"


def _recorded_curve(
    profile: SampledProfile,
    component: int,
    joint_types: Sequence[str],
    summary: Mapping[str, Any],
    sample_slice: slice,
) -> RecordedCurve:
    """Return one component.

    Args:
        profile: recorded signal.
        component: index of the component.
        joint_types: joint types of the robot.
        summary: summary of its fit, an entry of the report.
        sample_slice: samples to show.
    """
    record, fit = profile.record, profile.fit
    values, time = record.values[component], record.time
    is_interpolated = summary["method"] == INTERPOLATE
    residual = np.zeros_like(values) if is_interpolated else values - fit.at(time, 1)[0, component]
    even_times = np.linspace(time[0], time[-1], len(time))
    even_values = fit.at(even_times, 1)[0, component]
    shown_stamps, shown_times = record.start + time[sample_slice], time[sample_slice]
    curve_times = (
        shown_times
        if len(shown_times) >= FEWEST_POINTS
        else np.linspace(shown_times[0], shown_times[-1], FEWEST_POINTS)
    )
    unreliable = summary["unreliable"]
    return RecordedCurve(
        name=_curve_name(profile.signal, summary["name"]),
        unit=profile.signal.quantities[0].of_component(component, joint_types),
        fit=FITS.get(summary["method"], summary["method"]),
        knots=summary["knots"],
        recorded=Curve.reduced(shown_stamps, values[sample_slice]),
        fitted=Curve.reduced(record.start + curve_times, fit.at(curve_times, 1)[0, component]),
        residual=Curve.reduced(shown_stamps, residual[sample_slice]),
        rms=float(summary["residual"]["rms"]),
        noise=float(summary["noise"]),
        inside=(record.start + time[0] + unreliable["start"], record.start + time[-1] - unreliable["end"]),
        # interpolating the small residual at even times makes a small error
        spectrum=_spectrum(
            even_times, even_values + np.interp(even_times, time, residual), even_values, summary
        ),
        highest=HighestDerivative(
            name=profile.signal.names[-1],
            unit=profile.signal.quantities[-1].of_component(component, joint_types),
            order=profile.signal.orders - 1,
            deviation=float(summary.get("deviation", math.nan)),
        ),
    )


def _spectrum(
    time: FloatArray, recorded: FloatArray, fitted: FloatArray, summary: Mapping[str, Any]
) -> AmplitudeSpectrum:
    """Return densities in bands of equal logarithmic width, from equally spaced samples."""
    count, step = len(time), float(time[1] - time[0])
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** WINDOW_POWER
    scale = math.sqrt(2 * step / float(np.sum(window**2)))
    is_moving = float(np.ptp(recorded)) > ROUNDING * float(np.max(np.abs(recorded)))
    spectra = [scale * is_moving * np.fft.rfft(window * (row - row.mean())) for row in (recorded, fitted)]
    first_line, last_line = min(FIRST_LINE, count // 4), len(spectra[0]) - 1
    starts = np.unique(np.geomspace(first_line, last_line, BANDS).astype(int))
    band_sizes = np.diff(np.append(starts, len(spectra[0])))
    band_means = [
        np.add.reduceat(np.real(first_spectrum * np.conj(second_spectrum)), starts) / band_sizes
        for first_spectrum, second_spectrum in (spectra[:1] * 2, spectra[::-1], spectra[1:] * 2)
    ]
    frequencies = (starts + (band_sizes - 1) / 2) / (count * step)
    recorded_power, cross_power, fitted_power = band_means
    followed_bands = np.flatnonzero(cross_power > FOLLOWED_GAIN * recorded_power)
    last_band = int(followed_bands[-1]) if followed_bands.size else len(starts) - 1
    cutoff = (
        math.nan if last_band == len(starts) - 1 else float(frequencies[last_band : last_band + 2].mean())
    )
    noise = float(summary["noise"]) * math.sqrt(2 * step)
    above = float(summary.get("filtered_noise", {}).get("above", math.nan))
    return AmplitudeSpectrum(
        frequencies, np.sqrt(recorded_power), np.sqrt(fitted_power), noise, cutoff, above
    )
