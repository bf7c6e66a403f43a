"""Measured signals over computed ones, and beside them by how much they differ."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli.results.curves import Curve
from vsacli.results.measured_curves import MeasuredCurve
from vsacli.results.plots.drawing import ZERO, draw_curve
from vsacli.results.plots.panels import PANEL_WIDTH, add_title, complete, joint_panels
from vsacli.results.plots.styles import DIFFERENCE, house_style, line_handle, line_style

MOST_ROWS = 8
ROW_HEIGHT = 1.6
"""Inches."""


def measured_figure(curves: Sequence[MeasuredCurve], title: str) -> Figure:
    """Two panels for each curve: measured over computed, and measured minus computed."""
    with house_style():
        columns = 2 * math.ceil(len(curves) / MOST_ROWS)
        rows = math.ceil(2 * len(curves) / columns)
        figure = Figure((PANEL_WIDTH * columns, ROW_HEIGHT * rows + 1), layout="constrained")
        span = np.array([min(c.time[0] for c in curves), max(c.time[-1] for c in curves)])
        panels = joint_panels(
            figure.add_gridspec()[0], span, np.ones((len(curves), 2), dtype=bool), MOST_ROWS
        )
        handles = [
            line_handle(line_style(index), name) for index, name in enumerate(("computed", "measured"))
        ]
        for curve, (over, apart) in zip(curves, panels, strict=True):
            handles += _draw(over, apart, curve)
        return complete(figure, title, handles)


def _draw(over: Axes, apart: Axes, curve: MeasuredCurve) -> list[Artist]:
    """Draw both panels of a signal; returns what a legend shows besides the lines."""
    handles = []
    for index, values in ((0, curve.computed), (1, curve.measured)):
        handles += draw_curve(over, Curve.reduced(curve.time, values), index, line_style(index))
    apart.axhline(0.0, **ZERO)
    difference = Curve.reduced(curve.time, curve.measured - curve.computed)
    handles += draw_curve(apart, difference, 0, DIFFERENCE)
    add_title(over, curve.name)
    add_title(apart, f"difference, rms {curve.rms:.3g} {curve.unit}")
    over.set_ylabel(f"[{curve.unit}]")
    return handles
