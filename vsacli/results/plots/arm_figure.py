"""The arm of a robot as a drawing: links, joints with their axes and motors, base, tool frame and gravity.

Joints are convex solids: cylinders that turn, boxes that slide. A view draws their faces that point toward
the viewer, the farthest joint first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.base.arrays import FloatArray
from vsacli.results.charts.arm_chart import VIEW_WIDTH, ArmChart, View
from vsacli.results.charts.chart import PANEL_WIDTH
from vsacli.results.charts.look import CM_PER_INCH, current_look
from vsacli.results.charts.tool_charts import ToolPath
from vsacli.results.plots.arrangement import columns_of_panels
from vsacli.results.plots.long_texts import POINTS_PER_INCH
from vsacli.results.plots.panels import add_title
from vsacli.results.plots.sheets import complete
from vsacli.results.plots.styles import line_style, new_figure, scaled, shortened

LABEL_WIDTH = 0.8
"""Width of the column of names, relative to the size of the arm."""

NARROWEST_VIEW, VIEW_HEIGHT = 2.0, 2.6
"""Smallest width of a view, and its height where one is above the others, at the usual font size, inches."""

LABELED, AROUND = 0.75, 1.1
"""Height of the title and the labels of a view, and of legend and title, at the usual font size, inches."""

MARGIN, BESIDE_GRAVITY = 0.04, 0.15
"""Space around the arm, and at its left for the arrow of gravity, relative to the size of the arm."""

NAME_LENGTH, MOST_NAMES = 18, 14
"""Characters in the name of a joint, and number of names that fit into the column."""

RADIUS, MOTOR_RADIUS, MOTOR_LENGTH = 0.36, 0.26, 0.3
"""Radii of a joint and of a motor, and length of a motor, relative to the length of a joint."""

PLATE, PLATE_HEIGHT = 1.6, 0.16
"""Half-width and height of the base, relative to the length of a joint."""

AXIS_LENGTH = 1.5
"""Half-length of the line of an axis, relative to that length."""

ARROW_SHARE = 0.19
"""Length of the arrows of gravity and the tool frame, relative to the size of the arm."""

SHORTEST_ARROW = 0.3
"""Share of its length below which an arrow of a frame, seen from its tip, is left out."""

SEVERAL = 0.5
"""Share of the length of the arrows of the tool frame where there are several tools."""

NAME_SIZE, ARROW_SIZE = 9, 8
"""Sizes of the names of joints and arrows at the usual font size, points."""

NAME_LINE = 1.5
"""Height of the line of a name relative to its size."""

EDGE_WIDTH = 0.7
"""Width of edges, points."""

CYLINDER_SIDES = 24
"""Number of sides of a cylinder."""

FILLS = {"antagonistic": "#8fb8de", "serial": "#f0b27a", "elastic": "#c8e6c0", "rigid": "0.85"}
"""Fill of joints by kind of actuator; gray values differ as well."""

_OTHER_FILL, _MOTOR_FILL, _BASE_FILL = "white", "0.35", "0.6"
_LINK: dict[str, Any] = {"color": "0.55", "linewidth": 4.5, "solid_capstyle": "round"}
_AXIS: dict[str, Any] = {"color": "#d8261c", "linewidth": 0.9, "linestyle": (0, (8, 2, 1.5, 2))}
_PATH_LINK: dict[str, Any] = {"color": "0.75", "linewidth": 3, "solid_capstyle": "round"}
_PATH: dict[str, Any] = {"linewidth": 1.2}
_ELLIPSE: dict[str, Any] = {"linewidth": 0.9, "linestyle": "-"}
CIRCLE = np.stack((np.cos(np.linspace(0, 2 * np.pi, 73)), np.sin(np.linspace(0, 2 * np.pi, 73))))
_LEADER: dict[str, Any] = {"color": "0.5", "linewidth": 0.6}
_ARROW: dict[str, Any] = {"arrowstyle": "-|>", "color": "black", "linewidth": 1.1, "shrinkA": 0, "shrinkB": 0}


def arm_figure(chart: ArmChart) -> Figure:
    """Draw the views of an arm at one scale, each as large as its content; the first one names the joints."""
    windows = [_window(chart, view) for view in chart.views]
    windows[0][1, 0] += LABEL_WIDTH * chart.size
    extents: list[list[float]] = np.array([high - low for low, high in windows]).T.tolist()
    widths, heights = extents
    look, growth = current_look(), _crowding(chart)

    def view_scale(columns: int) -> float:
        """Return the inches of a meter, at the usual font size."""
        if look.width is None or look.height is not None:
            return growth * PANEL_WIDTH / (VIEW_WIDTH * chart.size)
        rows = (widths,) if columns == len(widths) else (widths[:1], widths[1:])
        available_width = look.width / CM_PER_INCH / look.scale
        return min(max(available_width - LABELED * len(row), available_width / 2) / sum(row) for row in rows)

    def first_height(columns: int) -> float:
        """Return the height of the first view, m, in which all names fit."""
        return max(heights[0], (_most_names(chart) + 1) * _line_height(chart) / view_scale(columns))

    def natural(columns: int) -> tuple[float, float]:
        if columns == len(widths):
            width, height, rows = sum(widths), max(first_height(columns), *heights), 1
        else:
            width, height, rows = max(widths[0], sum(widths[1:])), first_height(columns) + max(heights[1:]), 2
        return (
            view_scale(columns) * width + LABELED * (len(widths) + 1 - rows),
            view_scale(columns) * height + LABELED * rows + AROUND,
        )

    columns = columns_of_panels(
        len(widths), natural, NARROWEST_VIEW * (1 + LABEL_WIDTH / VIEW_WIDTH / len(widths))
    )
    with new_figure(natural(columns)) as figure:
        windows[0][:, 1] += (first_height(columns) - heights[0]) / 2 * np.array([-1, 1])
        row_heights = [first_height(columns), max(heights[1:])]
        panels = panels_of_views(figure, widths, row_heights, stacked=columns < len(widths))
        for axes, view, window in zip(panels, chart.views, windows, strict=True):
            frame_view(axes, view, window)
            _draw_arm(axes, chart, view)
        _name_joints(panels[0], chart, chart.views[0], _line_height(chart) / view_scale(columns))
        return complete(figure, chart.title, _handles(chart))


def _window(chart: ArmChart, view: View) -> FloatArray:
    """Return the lower left and the upper right corner of what a view shows, (2, 2), m."""
    points, arrow_length = (
        chart.points,
        1.4 * ARROW_SHARE * chart.size * (SEVERAL if chart.tool_names else 1.0),
    )
    axes = AXIS_LENGTH * chart.joint_length * points.axes[0]
    tips = points.tools[0][..., None] + arrow_length * points.tool_axes[0]
    faces = [corners for solid in _solids(chart) for corners in solid.faces]
    point_sets = [*chart.lines, chart.centers + axes, chart.centers - axes, *faces]
    point_sets.append(np.swapaxes(tips, -1, -2).reshape(-1, 3))
    projected = view.project(np.concatenate(point_sets))
    low, high = projected.min(axis=0) - MARGIN * chart.size, projected.max(axis=0) + MARGIN * chart.size
    if np.linalg.norm(view.project(chart.down)) > SHORTEST_ARROW:
        low[0] -= BESIDE_GRAVITY * chart.size
        high[1] = max(high[1], low[1] + 1.7 * ARROW_SHARE * chart.size)
    return np.stack((low, high))


def panels_of_views(
    figure: Figure, widths: Sequence[float], heights: Sequence[float] = (1.0, 1.0), *, stacked: bool
) -> list[Axes]:
    """Return panels of these widths side by side, or the first above the others in rows of these heights."""
    if not stacked:
        return list(figure.subplots(1, len(widths), width_ratios=widths, squeeze=False)[0])
    gridspec = figure.add_gridspec(2, len(widths) - 1, width_ratios=widths[1:], height_ratios=heights)
    first = figure.add_subplot(gridspec[0, :])
    return [first, *(figure.add_subplot(gridspec[1, column]) for column in range(len(widths) - 1))]


def frame_view(axes: Axes, view: View, window: FloatArray) -> None:
    """Set limits of equal scale, and labels and ticks where lengths are not foreshortened."""
    (left, bottom), (right, top) = window.tolist()
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_aspect("equal")
    add_title(axes, view.name)
    if view.labels is None:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(False)
        return
    axes.set_xlabel(view.labels[0])
    axes.set_ylabel(view.labels[1])
    axes.locator_params(nbins=5)
    for axis, flipped in zip((axes.xaxis, axes.yaxis), view.flipped, strict=True):
        if flipped:
            axis.set_major_formatter(lambda tick, _: f"{-tick + 0:g}")


def _draw_arm(axes: Axes, chart: ArmChart, view: View) -> None:
    """Draw links, joints from the farthest to the nearest, axes, tool frame and gravity."""
    length, arrow_length, points = chart.joint_length, ARROW_SHARE * chart.size, chart.points
    for line in chart.lines:
        axes.plot(*view.project(line).T, **scaled(_LINK), zorder=2)
    for seat, center in zip(points.seats[0], chart.centers, strict=True):  # joints moved along their axes
        segment = view.project(np.stack((seat, center))).T
        axes.plot(*segment, **scaled({**_LINK, "linewidth": 2.5}), zorder=2)
    solids = sorted(_solids(chart), key=lambda solid: float(solid.middle @ view.toward))
    for rank, solid in enumerate(solids):
        _draw_solid(axes, solid, view, 3 + rank / len(solids))
    for center, axis in zip(chart.centers, points.axes[0], strict=True):
        axis_ends = np.stack((center - AXIS_LENGTH * length * axis, center + AXIS_LENGTH * length * axis))
        axes.plot(*view.project(axis_ends).T, **scaled(_AXIS), zorder=4.2)
    arrow_scale = SEVERAL if chart.tool_names else 1.0
    for origin, tool_axes in zip(points.tools[0], points.tool_axes[0], strict=True):
        for direction, name in zip(tool_axes.T, "xyz", strict=True):
            _draw_arrow(axes, view, origin, arrow_scale * arrow_length * direction, name, arrow_scale)
    corner = (axes.get_xlim()[0] + BESIDE_GRAVITY / 2 * chart.size, axes.get_ylim()[1] - MARGIN * chart.size)
    start = corner[0] * view.right + corner[1] * view.up
    _draw_arrow(axes, view, start, arrow_length * chart.down, "g")


class _Solid(NamedTuple):
    """A convex solid: faces (corners, 3) that turn counterclockwise when seen from outside, and its color."""

    faces: Sequence[FloatArray]
    middle: FloatArray
    color: str


def _solids(chart: ArmChart) -> Iterator[_Solid]:
    """Yield base, joints and motors."""
    length = chart.joint_length
    foot, up = _base_pose(chart)
    yield _prism(foot - PLATE_HEIGHT * length * up, foot, PLATE * length, 4, _BASE_FILL)
    for center, axis, joint in zip(chart.centers, chart.points.axes[0], chart.joints, strict=True):
        half, fill = length / 2 * axis, FILLS.get(joint.actuator_type, _OTHER_FILL)
        yield _prism(
            center - half, center + half, RADIUS * length, CYLINDER_SIDES if joint.is_revolute else 4, fill
        )
        motor = MOTOR_LENGTH * length * axis
        ends = ((center - half - motor, center - half), (center + half, center + half + motor))
        for low, high in ends[: joint.actuator.motor_count]:
            yield _prism(low, high, MOTOR_RADIUS * length, CYLINDER_SIDES, _MOTOR_FILL)


def _base_pose(chart: ArmChart) -> tuple[FloatArray, FloatArray]:
    """Return place and normal of the base: the base frame, or below the first joint if that is near."""
    origin, up = chart.points.origins[0, 0], chart.points.base[0, :, 2]
    if np.linalg.norm(origin) > chart.joint_length:
        return np.zeros(3), np.array([0.0, 0.0, 1.0])
    offset = (0.5 + MOTOR_LENGTH) * chart.joint_length
    return origin + min(0.0, float((chart.centers[0] - origin) @ up) - offset) * up, up


def _prism(low: FloatArray, high: FloatArray, radius: float, sides: int, color: str) -> _Solid:
    """Return a regular prism between the centers of its ends."""
    axis = (high - low) / np.linalg.norm(high - low)
    least_aligned = np.eye(3)[int(np.argmin(np.abs(axis)))]
    normal = np.cross(axis, least_aligned)
    normal /= np.linalg.norm(normal)
    angles = 2 * math.pi * (np.arange(sides) + 0.5) / sides
    directions = np.cos(angles)[:, None] * normal + np.sin(angles)[:, None] * np.cross(axis, normal)
    ring = radius / math.cos(math.pi / sides) * directions if sides == 4 else radius * directions
    bottom, top = low + ring, high + ring
    next_side = np.roll(np.arange(sides), -1)
    walls = np.stack((bottom, bottom[next_side], top[next_side], top), axis=1)
    return _Solid([*walls, top, bottom[::-1]], (low + high) / 2, color)


def _draw_solid(axes: Axes, solid: _Solid, view: View, order: float) -> None:
    """Draw the faces of a convex solid that point toward the viewer; smooth walls have no edges.

    Black edges of all faces lie below, so that only their outer half is seen, which is the outline.
    """
    projected = [view.project(face) for face in solid.faces]
    visible_faces = [face for face in projected if _area(face) > 0]
    smooth = len(solid.faces) > CYLINDER_SIDES
    walls, ends = (
        [face for face in visible_faces if (len(face) == 4) == is_wall] for is_wall in (True, False)
    )
    layers = (
        (visible_faces, "black", 2 * EDGE_WIDTH),
        (walls, solid.color if smooth else "black", EDGE_WIDTH),
        (ends, "black", EDGE_WIDTH),
    )
    for rank, (faces, edge_color, width) in enumerate(layers):
        style: dict[str, Any] = {"facecolor": solid.color, "edgecolor": edge_color, "linewidth": width}
        axes.add_collection(PolyCollection(faces, **scaled(style), zorder=order + 1e-4 * rank))


def _area(face: FloatArray) -> float:
    """Return the signed area of a polygon, (corners, 2): positive if it turns counterclockwise."""
    x, y = face.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _draw_arrow(
    axes: Axes, view: View, start: FloatArray, arrow: FloatArray, name: str, share: float = 1.0
) -> None:
    """Draw an arrow with its name, of a share of the usual size, unless it is seen from an end."""
    tail, tip = view.project(start), view.project(start + arrow)
    if np.linalg.norm(tip - tail) <= SHORTEST_ARROW * np.linalg.norm(arrow):
        return
    annotation = axes.annotate("", tuple(tip), tuple(tail), arrowprops=_ARROW, zorder=5)
    annotation.set_fontsize(share * float(annotation.get_fontsize()))  # the size of its head
    x, y = tail + 1.25 * (tip - tail)
    size = current_look().points(ARROW_SIZE * share**0.5)
    axes.text(x, y, name, fontsize=size, ha="center", va="center", zorder=5)


def _name_joints(axes: Axes, chart: ArmChart, view: View, gap: float) -> None:
    """Write names in a column at the right, each with a line to its joint or tool; of many only some.

    Args:
        axes: panel of the view.
        chart: arm.
        view: first view.
        gap: distance of lines of names, m.
    """
    (_, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    size = current_look().points(NAME_SIZE / _crowding(chart))
    stride = math.ceil(len(_names(chart)) / _most_names(chart))
    tools = chart.points.tools[0, : len(chart.tool_names)]
    points = view.project(np.concatenate((chart.centers, tools)))[::stride]
    names = [shortened(name, NAME_LENGTH) for name in _names(chart)[::stride]]
    column_x = right - LABEL_WIDTH * chart.size
    heights = _spaced_heights(points[:, 1], gap, bottom + gap / 2, top - gap / 2)
    for (x, y), height, name in zip(points, heights, names, strict=True):
        axes.plot([x, column_x, column_x + gap / 2], [y, height, height], **scaled(_LEADER), zorder=1)
        axes.text(column_x + 0.7 * gap, height, name, fontsize=size, va="center", parse_math=False)


def _names(chart: ArmChart) -> list[str]:
    """Return the names of the joints, and of the tools if there are several."""
    return [*(joint.name for joint in chart.joints), *chart.tool_names]


def _most_names(chart: ArmChart) -> int:
    """Return the number of names that the column has room for."""
    return min(len(_names(chart)), math.ceil(MOST_NAMES * _crowding(chart) ** 2 - 1e-9))


def _line_height(chart: ArmChart) -> float:
    """Return the height of a line of the column of names at the usual font size, inches."""
    look = current_look()
    return NAME_LINE * look.points(NAME_SIZE / _crowding(chart)) / look.scale / POINTS_PER_INCH


def _crowding(chart: ArmChart) -> float:
    """Return by which factor the figure of a tree grows, and its names shrink, so that all names fit."""
    return 1.0 if len(chart.lines) == 1 else max(1.0, len(_names(chart)) / MOST_NAMES) ** 0.5


def _spaced_heights(heights: FloatArray, gap: float, low: float, high: float) -> FloatArray:
    """Return heights at least a gap apart, in the same order and between two ends, near the given ones."""
    order = np.argsort(heights, kind="stable")
    offsets = gap * np.arange(len(heights))
    # Without the offsets any ascending order will do; the mean of both bounds keeps clusters centered.
    without_offsets = heights[order] - offsets
    rising, falling = (
        np.maximum.accumulate(without_offsets),
        np.minimum.accumulate(without_offsets[::-1])[::-1],
    )
    spaced = np.empty_like(heights)
    spaced[order] = np.clip((rising + falling) / 2, low, max(low, high - offsets[-1])) + offsets
    return spaced


def _handles(chart: ArmChart) -> list[Artist]:
    """Return the legend: kinds of joints in the robot, motors, axes and base."""
    kinds = dict.fromkeys(joint.actuator_type for joint in chart.joints)
    handles: list[Artist] = [
        Patch(
            facecolor=FILLS.get(kind, _OTHER_FILL),
            edgecolor="black",
            linewidth=EDGE_WIDTH,
            label=f"{kind} joint",
        )
        for kind in kinds
    ]
    return [
        *handles,
        Patch(facecolor=_MOTOR_FILL, edgecolor="black", linewidth=EDGE_WIDTH, label="motor"),
        Line2D([], [], **scaled(_AXIS), label="joint axis"),
        Line2D([], [], **scaled(_LINK), label="link"),
        Patch(facecolor=_BASE_FILL, edgecolor="black", linewidth=EDGE_WIDTH, label="base"),
    ]


def tool_path_figure(path: ToolPath) -> Figure:
    """Draw the views of the paths at one scale."""
    views = len(path.views)

    def natural(columns: int) -> tuple[float, float]:
        return PANEL_WIDTH * columns, (PANEL_WIDTH if columns == views else 2 * VIEW_HEIGHT) + 1.4

    stacked = columns_of_panels(views, natural, NARROWEST_VIEW) < views
    with new_figure(natural(2 if stacked else views)) as figure:
        panels = panels_of_views(figure, [1.0] * views, stacked=stacked)
        for axes, view in zip(panels, path.views, strict=True):
            frame_view(
                axes, view, view.project(path.middle) + VIEW_WIDTH / 2 * path.size * np.array([[-1], [1]])
            )
            for line in path.links:
                axes.plot(*view.project(line).T, **scaled(_PATH_LINK), zorder=1)
            for tool, points in enumerate(path.paths.values()):
                axes.plot(*view.project(points).T, **scaled(_PATH), color=line_style(tool).color, zorder=2)
                _draw_ellipses(axes, path, tool, np.stack((view.right, view.up)))
        return complete(figure, path.title, _path_handles(path))


def _draw_ellipses(axes: Axes, path: ToolPath, tool: int, projection: FloatArray) -> None:
    """Draw the outlines of the displacements of a tool in a view, a projection (2, 3)."""
    for origin, displacement in zip(path.origins[tool], path.displacements[tool], strict=True):
        if np.isfinite(displacement).all():
            projected = projection @ displacement
            squares, directions = np.linalg.eigh(projected @ projected.T)
            outline = directions @ (np.sqrt(np.maximum(squares, 0.0))[:, None] * CIRCLE)
            corners = (projection @ origin)[:, None] + outline
            axes.plot(*corners, **scaled(_ELLIPSE), color=line_style(tool).color, zorder=3)


def _path_handles(path: ToolPath) -> list[Artist]:
    """Return the legend: tools, links, and the force that the ellipses are for."""
    tools = [
        Line2D([], [], **scaled(_PATH), color=line_style(tool).color, label=f"path of {name}")
        for tool, name in enumerate(path.paths)
    ]
    ellipse = f"ellipses: displacement by {path.force:g} N"
    return [
        *tools,
        Line2D([], [], **scaled(_ELLIPSE), color="black", label=ellipse),
        Line2D([], [], **scaled(_PATH_LINK), label="links at start and end"),
    ]
