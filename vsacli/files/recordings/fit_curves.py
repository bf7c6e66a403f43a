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
from vsacli.results.charts.measured import AmplitudeSpectrum, Highest, RecordedCurve
from vsacli.results.charts.reduction import Curve
from vsacli.results.store.excerpt import WHOLE, Span, joint_numbers, steps_between
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

FOLLOWED = 0.5
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
    wanted = [signal for signal in (POSITION, *COMMANDED.values()) if layout.quantities.get(signal.names[0])]
    choices = dict.fromkeys(wanted, AS_IT_ASKS_FOR)
    return list(read_recorded_signals(path, joints, choices, progress=progress).profiles)


def recorded_curves(
    profiles: Iterable[SampledProfile],
    joint_types: Sequence[str],
    file: str | Path,
    shown: Sequence[str] = (),
    span: Span = WHOLE,
) -> list[RecordedCurve]:
    """Return recorded signals and their splines, component by component.

    Args:
        profiles: recorded signals; those without a spline are omitted.
        joint_types: joint types of the robot.
        file: path for errors.
        shown: names of the joints to show; all if empty. A wrench is always shown.
        span: first and last time of the curves, s; spectra are of the whole recording.

    Raises:
        InputError: a joint is unknown, or no sample lies in the span.
    """
    curves = []
    for profile in (each for each in profiles if each.estimate is not None):
        record, wanted = profile.record, () if profile.signal.is_wrench else shown
        members = {record.labels[number] for number in joint_numbers(record.labels, wanted, file)}
        steps = steps_between(record.start + record.time, span, file)
        curves += [
            _curve(profile, record.labels.index(stated["name"]), joint_types, stated, steps)
            for stated in profile.summary()["columns"]
            if stated["name"] in members
        ]
    return curves


def _curve_name(signal: Signal, component: str) -> str:
    if signal.is_wrench:
        return f"{signal.tool}.{component}" if signal.tool else component
    return f"{component}.{signal.names[0]}"


def _curve(
    profile: SampledProfile,
    member: int,
    joint_types: Sequence[str],
    stated: Mapping[str, Any],
    steps: slice,
) -> RecordedCurve:
    """Return one component.

    Args:
        profile: recorded signal.
        member: index of the component.
        joint_types: joint types of the robot.
        stated: summary of its fit, an entry of the report.
        steps: samples to show.
    """
    record, fit = profile.record, profile.fit
    values, time = record.values[member], record.time
    exact = stated["method"] == INTERPOLATE
    residual = np.zeros_like(values) if exact else values - fit.at(time, 1)[0, member]
    even = np.linspace(time[0], time[-1], len(time))
    smooth = fit.at(even, 1)[0, member]
    stamps, shown = record.start + time[steps], time[steps]
    fine = shown if len(shown) >= FEWEST_POINTS else np.linspace(shown[0], shown[-1], FEWEST_POINTS)
    ends = stated["unreliable"]
    return RecordedCurve(
        name=_curve_name(profile.signal, stated["name"]),
        unit=profile.signal.quantities[0].of_component(member, joint_types),
        fit=FITS.get(stated["method"], stated["method"]),
        knots=stated["knots"],
        recorded=Curve.reduced(stamps, values[steps]),
        fitted=Curve.reduced(record.start + fine, fit.at(fine, 1)[0, member]),
        residual=Curve.reduced(stamps, residual[steps]),
        rms=float(stated["residual"]["rms"]),
        noise=float(stated["noise"]),
        inside=(record.start + time[0] + ends["start"], record.start + time[-1] - ends["end"]),
        # interpolating the small residual at even times makes a small error
        spectrum=_spectrum(even, smooth + np.interp(even, time, residual), smooth, stated),
        highest=Highest(
            name=profile.signal.names[-1],
            unit=profile.signal.quantities[-1].of_component(member, joint_types),
            order=profile.signal.orders - 1,
            deviation=float(stated.get("deviation", math.nan)),
        ),
    )


def _spectrum(
    time: FloatArray, recorded: FloatArray, fitted: FloatArray, stated: Mapping[str, Any]
) -> AmplitudeSpectrum:
    """Return densities in bands of equal logarithmic width, from equally spaced samples."""
    count, step = len(time), float(time[1] - time[0])
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** WINDOW_POWER
    unit = math.sqrt(2 * step / float(np.sum(window**2)))
    moving = float(np.ptp(recorded)) > ROUNDING * float(np.max(np.abs(recorded)))
    lines = [unit * moving * np.fft.rfft(window * (row - row.mean())) for row in (recorded, fitted)]
    first, end = min(FIRST_LINE, count // 4), len(lines[0]) - 1
    starts = np.unique(np.geomspace(first, end, BANDS).astype(int))
    sizes = np.diff(np.append(starts, len(lines[0])))
    means = [
        np.add.reduceat(np.real(one * np.conj(other)), starts) / sizes
        for one, other in (lines[:1] * 2, lines[::-1], lines[1:] * 2)
    ]
    frequencies = (starts + (sizes - 1) / 2) / (count * step)
    own, shared, smooth = means
    passed = np.flatnonzero(shared > FOLLOWED * own)
    last = int(passed[-1]) if passed.size else len(starts) - 1
    cutoff = math.nan if last == len(starts) - 1 else float(frequencies[last : last + 2].mean())
    noise = float(stated["noise"]) * math.sqrt(2 * step)
    above = float(stated.get("filtered_noise", {}).get("above", math.nan))
    return AmplitudeSpectrum(frequencies, np.sqrt(own), np.sqrt(smooth), noise, cutoff, above)
