"""The paths of tools with ellipses of their compliance, and the links at both ends of the motion."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vsacli.base.arrays import FloatArray
from vsacli.results.charts.chart import PANEL_WIDTH
from vsacli.results.charts.tool_path import ToolPath
from vsacli.results.plots.arm_figure import NARROWEST_VIEW, VIEW_HEIGHT, frame_view, panels_of_views
from vsacli.results.plots.arrangement import columns_of_panels
from vsacli.results.plots.sheets import complete
from vsacli.results.plots.styles import line_style, new_figure, scaled

_LINK: dict[str, Any] = {"color": "0.75", "linewidth": 3, "solid_capstyle": "round"}
_PATH: dict[str, Any] = {"linewidth": 1.2}
_ELLIPSE: dict[str, Any] = {"linewidth": 0.9, "linestyle": "-"}
CIRCLE = np.stack((np.cos(np.linspace(0, 2 * np.pi, 73)), np.sin(np.linspace(0, 2 * np.pi, 73))))


def tool_path_figure(path: ToolPath) -> Figure:
    """Draw the views of the paths at one scale."""
    views = len(path.views)

    def natural(columns: int) -> tuple[float, float]:
        return PANEL_WIDTH * columns, (PANEL_WIDTH if columns == views else 2 * VIEW_HEIGHT) + 1.4

    stacked = columns_of_panels(views, natural, NARROWEST_VIEW) < views
    with new_figure(natural(2 if stacked else views)) as figure:
        panels = panels_of_views(figure, [1.0] * views, stacked=stacked)
        for axes, view in zip(panels, path.views, strict=True):
            frame_view(axes, path, view)
            for line in path.links:
                axes.plot(*view.project(line).T, **scaled(_LINK), zorder=1)
            for look, points in enumerate(path.paths.values()):
                axes.plot(*view.project(points).T, **scaled(_PATH), color=line_style(look).color, zorder=2)
                _draw_ellipses(axes, path, look, np.stack((view.right, view.up)))
        return complete(figure, path.title, _handles(path))


def _draw_ellipses(axes: Axes, path: ToolPath, tool: int, projection: FloatArray) -> None:
    """Draw the outlines of the displacements of a tool in a view, a projection (2, 3)."""
    for place, displacement in zip(path.places[tool], path.displacements[tool], strict=True):
        if np.isfinite(displacement).all():
            seen = projection @ displacement
            squares, directions = np.linalg.eigh(seen @ seen.T)
            outline = directions @ (np.sqrt(np.maximum(squares, 0.0))[:, None] * CIRCLE)
            corners = (projection @ place)[:, None] + outline
            axes.plot(*corners, **scaled(_ELLIPSE), color=line_style(tool).color, zorder=3)


def _handles(path: ToolPath) -> list[Artist]:
    """Return the legend: tools, links, and the force that the ellipses are for."""
    tools = [
        Line2D([], [], **scaled(_PATH), color=line_style(look).color, label=f"path of {name}")
        for look, name in enumerate(path.paths)
    ]
    ellipse = f"ellipses: displacement by {path.force:g} N"
    return [
        *tools,
        Line2D([], [], **scaled(_ELLIPSE), color="black", label=ellipse),
        Line2D([], [], **scaled(_LINK), label="links at start and end"),
    ]
