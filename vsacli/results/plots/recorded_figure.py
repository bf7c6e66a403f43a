"""Figures of recorded signals and their splines: samples, residual and spectra of each component."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.results.charts.chart import DIFFERENCE, PANEL_WIDTH, folding
from vsacli.results.charts.measured import AmplitudeSpectrum, HighestDerivative, RecordedCurve
from vsacli.results.plots.arrangement import columns_of_panels
from vsacli.results.plots.panels import ZERO, add_title, draw_curve
from vsacli.results.plots.sheets import AxesGrid, complete, share_time
from vsacli.results.plots.styles import LineStyle, line_handle, line_style, new_figure, scaled

COLUMNS, MOST_ROWS = 4, 14
ROW_HEIGHT, LABEL_HEIGHT = 1.8, 0.4
"""Height of a row of panels, and of the labels below a row, inches."""

LEAST_DENSITY = 1e-12
"""Density, relative to the largest, below which only rounding errors remain and nothing is shown."""

_SAMPLES: dict[str, Any] = {"color": "0.65", "linewidth": 3.0}
_NOISE: dict[str, Any] = {"color": "0.3", "linewidth": 1.0, "linestyle": (0, (1, 2))}
_CUTOFF: dict[str, Any] = {"color": "0.3", "linewidth": 1.0, "linestyle": (0, (5, 2))}
_BAND: dict[str, Any] = {"facecolor": "0.93", "edgecolor": "none", "linewidth": 0, "zorder": 0.4}
_FILTERED: dict[str, Any] = {**_BAND, "facecolor": "#f3d9d9", "edgecolor": "#cfa3a3", "hatch": "////"}
_ENDS: dict[str, Any] = {**_BAND, "facecolor": "#fde9c8", "edgecolor": "#d9b77a", "hatch": "....."}
_FIT = LineStyle(line_style(1).color, "-", "")


def recorded_figure(curves: Sequence[RecordedCurve], title: str) -> Figure:
    """Draw four panels for each component: samples and spline, their difference, and two spectra."""
    rows, folds = folding(len(curves), MOST_ROWS)
    panel_columns = _panel_columns(rows, folds)
    folds = folds if panel_columns == COLUMNS else 1
    with new_figure(_natural_size(len(curves), folds, panel_columns)) as figure:
        panels = _panels(figure, curves, folds, panel_columns)
        handles: list[Artist] = [
            Line2D([], [], **scaled(_SAMPLES), label="recorded"),
            line_handle(_FIT, "spline"),
        ]
        for curve, (signal, residual, spectrum, highest) in zip(curves, panels, strict=False):
            handles += _draw_signal(signal, curve)
            handles += _draw_residual(residual, curve)
            handles += _draw_spectrum(spectrum, curve, 0, curve.unit)
            handles += _draw_spectrum(highest, curve, curve.highest.order, curve.highest.unit)
            add_title(spectrum, _spectrum_title(curve))
            add_title(highest, _highest_title(curve.highest))
        return complete(figure, title, handles)


def _natural_size(count: int, folds: int, panel_columns: int) -> tuple[float, float]:
    """Return the size of the figure, inches, with `panel_columns` panels of a component side by side."""
    rows = math.ceil(count / folds)
    label_height = 0.0 if panel_columns == COLUMNS else LABEL_HEIGHT
    return panel_columns * folds * PANEL_WIDTH, (
        ROW_HEIGHT + label_height
    ) * rows * COLUMNS / panel_columns + 1.2


def _panel_columns(rows: int, folds: int) -> int:
    """Return the number of panels of a component side by side: 4, or 2 or 1 where the figure is narrow."""
    count = rows * folds
    layout_by_columns = {4 * folds: (folds, 4), 2: (1, 2), 1: (1, 1)}

    def figure_size(columns: int) -> tuple[float, float]:
        return _natural_size(count, *layout_by_columns.get(columns, (folds, 4)))

    columns = columns_of_panels(COLUMNS * folds, figure_size)
    return COLUMNS if columns >= COLUMNS else min(columns, 2)


def _panels(figure: Figure, curves: Sequence[RecordedCurve], folds: int, panel_columns: int) -> AxesGrid:
    """Return panels with labels of time and frequency, (components, 4)."""
    rows, row_parts = math.ceil(len(curves) / folds), COLUMNS // panel_columns
    grid = figure.add_gridspec(rows * row_parts, folds * panel_columns).subplots(squeeze=False)
    grid = grid.reshape(rows, row_parts, folds, panel_columns).transpose(2, 0, 1, 3)
    panels: AxesGrid = grid.reshape(-1, COLUMNS)
    for unused in panels[len(curves) :].flat:
        unused.remove()
    # Panels of other axes lie between those of one kind unless all are side by side: each is labeled.
    _label_axes(panels[: len(curves)], curves, rows if row_parts == 1 else 1)
    return panels


def _label_axes(panels: AxesGrid, curves: Sequence[RecordedCurve], rows: int) -> None:
    """Share the time axis of the panels of a column of so many rows, and label it below the last."""
    times = [time for curve in curves for time in curve.recorded.time[[0, -1]].tolist()]
    span = np.array([min(times), max(times)])
    for start in range(0, len(panels), rows):
        group = panels[start : start + rows]
        for column in group[:, :2].T:
            share_time(column, span)
        for axes in group[-1, 2:]:
            axes.set_xlabel("frequency [Hz]")


def _draw_signal(axes: Axes, curve: RecordedCurve) -> list[Artist]:
    axes.plot(curve.recorded.time, curve.recorded.values, **scaled(_SAMPLES))
    handles = draw_curve(axes, curve.fitted, _FIT)
    if not np.any(curve.spectrum.recorded):  # at rest: rounding errors must not set the scale
        mean = float(np.mean(curve.recorded.values))
        axes.set_ylim(mean - 0.1 * (abs(mean) or 1.0), mean + 0.1 * (abs(mean) or 1.0))
    add_title(axes, curve.name)
    axes.set_ylabel(f"[{curve.unit}]")
    return handles


def _draw_residual(axes: Axes, curve: RecordedCurve) -> list[Artist]:
    """Draw the residual of the spline, the reported noise, and the ends with unreliable derivatives."""
    axes.axhline(0.0, **scaled(ZERO))
    handles = draw_curve(axes, curve.residual, line_style(DIFFERENCE))
    if curve.rms > 0:
        for level in (-2 * curve.noise, 2 * curve.noise):
            axes.axhline(level, **scaled(_NOISE))
        handles.append(_noise_handle())
    else:
        axes.set_yticks([0.0])
    first, last = axes.get_xlim()
    for start, end in ((first, curve.inside[0]), (curve.inside[1], last)):
        if start < end:
            axes.axvspan(start, end, **_ENDS)
            handles.append(Patch(**_ENDS, label="ends: derivatives unreliable"))
    axes.set_xlim(first, last)
    handles.append(line_handle(line_style(DIFFERENCE), "recorded minus spline"))
    add_title(axes, f"{curve.fit}, noise {curve.noise:.2g} {curve.unit}")
    return handles


def _noise_handle() -> Artist:
    return Line2D([], [], **scaled(_NOISE), label="reported noise (difference: twice)")


def _draw_spectrum(axes: Axes, curve: RecordedCurve, order: int, unit: str) -> list[Artist]:
    """Draw densities of a derivative on logarithmic axes.

    Differentiation multiplies by the angular frequency: noise that is small in the signal may exceed the
    motion in its highest derivative.
    """
    spectrum = curve.spectrum
    axes.set_ylabel(rf"[{unit}/$\sqrt{{\mathrm{{Hz}}}}$]")
    factor = (2 * np.pi * spectrum.frequencies) ** order
    recorded, fitted, noise = (
        factor * density for density in (spectrum.recorded, spectrum.fitted, spectrum.noise)
    )
    largest = float(np.max(recorded))
    if largest == 0:
        return []
    handles: list[Artist] = []
    axes.loglog(spectrum.frequencies, recorded, **scaled(_SAMPLES))
    axes.loglog(spectrum.frequencies, fitted, **_FIT.line_kwargs)
    if spectrum.noise > LEAST_DENSITY * float(np.max(spectrum.recorded)):
        axes.loglog(spectrum.frequencies, noise, **scaled(_NOISE))
        handles.append(_noise_handle())
    axes.set_ylim(max(LEAST_DENSITY * float(np.max(fitted)), float(np.min(recorded)) / 3), 3 * largest)
    axes.set_xlim(spectrum.frequencies[0], spectrum.frequencies[-1])
    return [*handles, *_draw_bands(axes, spectrum)]


def _draw_bands(axes: Axes, spectrum: AmplitudeSpectrum) -> list[Artist]:
    """Shade the frequency band of the motion, and that of noise below the cut-off of the spline."""
    first, last = float(spectrum.frequencies[0]), float(spectrum.frequencies[-1])
    handles: list[Artist] = []
    end = last if math.isnan(spectrum.cutoff) else spectrum.cutoff
    motion_end = float(np.fmin(spectrum.cutoff, spectrum.above))
    if not math.isnan(motion_end):
        axes.axvspan(first, motion_end, **_BAND)
        handles.append(Patch(**_BAND, label="frequencies of the motion"))
    if spectrum.above < end:
        axes.axvspan(spectrum.above, end, **_FILTERED)
        handles.append(Patch(**_FILTERED, label="low-pass filtered noise"))
    if end < last:
        axes.axvline(end, **scaled(_CUTOFF))
        handles.append(Line2D([], [], **scaled(_CUTOFF), label="cut-off of the spline"))
    return handles


def _spectrum_title(curve: RecordedCurve) -> str:
    cutoff, above = curve.spectrum.cutoff, curve.spectrum.above
    if not np.any(curve.spectrum.recorded):
        return "at rest"
    motion_end = np.fmin(cutoff, above)
    return (
        "motion at all frequencies"
        if math.isnan(motion_end)
        else f"motion to {motion_end:.3g} Hz, {curve.knots} knots"
    )


def _highest_title(highest: HighestDerivative) -> str:
    deviation_text = "" if math.isnan(highest.deviation) else f" +- {100 * highest.deviation:.2g} %"
    return f"{highest.name}{deviation_text}"
