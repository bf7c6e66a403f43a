"""The figure of `check-feasibility`: the stiffness of each joint inside its corridor."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from vsacli.base.errors import InputError
from vsacli.results.plots.corridor_figure import MOST_ROWS, compliant_joints, draw_corridors
from vsacli.results.plots.curves import Failures
from vsacli.results.plots.panels import PANEL_WIDTH, complete, folding, result_title
from vsacli.results.plots.style import house_style
from vsacli.results.store.reader import StoredResult

FEASIBILITY = "feasibility"
"""Name of the figure; its file is called `<stem>-feasibility`."""

FEASIBILITY_VARIABLES = ("stiffness", "stiffness_lower", "stiffness_upper", "flags")
"""What it is drawn from."""

PANEL_HEIGHT = 1.7
"""Inches."""


def check_drawable(actuators: Sequence[str]) -> None:
    """Refuse a robot whose joints, by the types of their actuators, have no stiffness to draw.

    Raises:
        InputError: they have not.
    """
    if not compliant_joints(actuators):
        raise InputError.one("there is no stiffness to plot: all joints are rigid")


def plot_feasibility(result: StoredResult) -> Figure:
    """Draw the commanded stiffness of each joint inside what its load allows, bad stretches shaded."""
    rows, folds = folding(len(compliant_joints(result.actuators)), MOST_ROWS)
    width = 2 * PANEL_WIDTH if folds == 1 else PANEL_WIDTH * folds
    with house_style():
        figure = Figure((width, PANEL_HEIGHT * rows + 1), layout="constrained")
        handles = draw_corridors(figure.add_gridspec()[0], result, Failures.of(result))
        return complete(figure, result_title(result), handles)
