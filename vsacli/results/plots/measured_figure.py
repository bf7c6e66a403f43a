"""Measured signals over computed ones, and beside them by how much they differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli.base.arrays import FloatArray
from vsacli.results.envelopes import FULL_DETAIL, column_starts, kept_samples
from vsacli.results.plots.drawing import draw_curve, house_style, line_handle, line_style
from vsacli.results.plots.panels import PANEL_WIDTH, add_title, complete, joint_panels

MOST_ROWS = 8
ROW_HEIGHT = 1.6
"""Inches."""


class MeasuredCurve(NamedTuple):
    """A signal as it was measured and computed.

    Attributes:
        name: of the signal.
        unit: of its values.
        rms: root mean square of measured minus computed.
        time: (samples,), s.
        computed, measured: (samples,).
    """

    name: str
    unit: str
    rms: float
    time: FloatArray
    computed: FloatArray
    measured: FloatArray


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
        for curve, (over, apart) in zip(curves, panels, strict=True):
            _draw(over, apart, curve)
        handles = [
            line_handle(line_style(index), name) for index, name in enumerate(("computed", "measured"))
        ]
        return complete(figure, title, handles)


def _draw(over: Axes, apart: Axes, curve: MeasuredCurve) -> None:
    for index, values in ((1, curve.measured), (0, curve.computed)):
        draw_curve(over, *_reduced(curve.time, values), index, line_style(index))
    draw_curve(apart, *_reduced(curve.time, curve.measured - curve.computed), 1, line_style(1))
    add_title(over, curve.name)
    add_title(apart, f"difference, rms {curve.rms:.3g} {curve.unit}")
    over.set_ylabel(f"[{curve.unit}]")


def _reduced(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What of a long curve can be seen."""
    if time.size <= FULL_DETAIL:
        return time, values
    kept = kept_samples(values, column_starts(time))
    return time[kept], values[kept]
