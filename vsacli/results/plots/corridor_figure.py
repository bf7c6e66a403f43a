"""Stiffness of each joint inside what its load allows: the figure of `check-feasibility`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Patch

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.units import STIFFNESS
from vsacli.results.corridors import BOUNDS, compliant_joints, visible_range
from vsacli.results.curves import Curves, Failures, read_curves
from vsacli.results.plots.drawing import draw_bands, draw_curve, draw_limits
from vsacli.results.plots.panels import PANEL_WIDTH, add_title, complete, folding, joint_panels, result_title
from vsacli.results.plots.styles import house_style, line_style
from vsacli.results.store.reader import StoredResult

FEASIBILITY = "feasibility"
"""Name of the figure; its file is called `<stem>-feasibility`."""

FEASIBILITY_VARIABLES = ("stiffness", "stiffness_lower", "stiffness_upper", "flags")
"""What it is drawn from."""

PANEL_HEIGHT = 1.7
"""Inches."""

MOST_ROWS = 5

_AREA: dict[str, Any] = {"facecolor": "#8fc1ec", "alpha": 0.4, "linewidth": 0, "zorder": 0.8}
_EDGE: dict[str, Any] = {"color": "#6f9fc8", "linewidth": 0.9, "zorder": 1}


def draw_corridors(
    place: SubplotSpec, result: StoredResult, failures: Failures, most_rows: int = MOST_ROWS
) -> list[Artist]:
    """Draw one panel per joint with a stiffness, of which there is one; returns what a legend shows."""
    bounds = [name for name in BOUNDS if set(BOUNDS) <= set(result.variables)]
    joints = compliant_joints(result.actuators)
    curves = read_curves(result, ["stiffness", *bounds])
    panels = joint_panels(place, failures.time, np.ones((len(joints), 1), dtype=bool), most_rows)[:, 0]
    limits = result.limits("stiffness")
    handles: list[Artist] = []
    for joint, axes in zip(joints, panels, strict=True):
        handles += _draw_stiffness(axes, curves[joint], joint)
        handles += draw_limits(axes, {joint: limits[joint, 0]})
        handles += draw_bands(axes, failures.time, *failures.among([joint]))
        add_title(axes, result.joint_names[joint])
        axes.set_ylabel(rf"$\sigma$ [{STIFFNESS.unit(result.joint_types[joint])}]")
    return handles


def _draw_stiffness(axes: Axes, curves: Curves, joint: int) -> list[Artist]:
    command, *bounds = curves.values
    handles = draw_corridor(axes, curves.time, command, bounds)
    return [*draw_curve(axes, curves[0], joint, line_style(joint)), *handles]


def draw_corridor(
    axes: Axes, time: FloatArray, shown: FloatArray, bounds: Sequence[FloatArray]
) -> list[Artist]:
    """Draw what a stiffness may be as far as that is near; returns what a legend shows.

    Args:
        axes: with nothing else so far.
        time: (points,), s.
        shown: stiffnesses that are to be seen, any number.
        bounds: nothing, or lower and upper end of the corridor, each (points,).
    """
    bottom, top = visible_range(shown, *bounds)
    axes.set_ylim(bottom, top)
    if not bounds:
        return []
    lower, upper = bounds
    carried = ~np.isnan(lower)
    if not carried.any():
        return []
    axes.fill_between(time, np.maximum(lower, bottom), np.minimum(upper, top), carried, **_AREA)
    for bound in bounds:
        axes.plot(time, np.where(np.isinf(bound), np.nan, bound), **_EDGE)
    return [Patch(**_AREA, label="reachable")]


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
