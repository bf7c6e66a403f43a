"""Figures of measured and computed signals."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from vsacli.results.charts.measured import MeasuredCurve, measured_sheet
from vsacli.results.plots import draw_sheet

TIME = np.linspace(0.0, 1.0, 50)


def figure(*computed: str) -> Figure:
    curve = MeasuredCurve("elbow.q", "rad", 0.1, TIME, np.sin(TIME), np.sin(TIME) + 0.1)
    return draw_sheet(measured_sheet([curve], "fit", *computed))


def test_every_curve_is_in_the_legend() -> None:
    shown = figure()
    labels = [text.get_text() for text in shown.legends[0].get_texts()]
    assert labels == ["computed", "measured", "measured minus computed"]
    over, difference = shown.axes
    curves = [*over.lines, difference.lines[-1]]
    handles = shown.legends[0].get_lines()
    looks = [[(line.get_color(), line.get_linestyle()) for line in lines] for lines in (curves, handles)]
    assert looks[0] == looks[1]


def test_fitted_torques_are_called_predicted() -> None:
    labels = [text.get_text() for text in figure("predicted").legends[0].get_texts()]
    assert labels == ["predicted", "measured", "measured minus predicted"]
