"""Figures of a robot before any run: the torque of its springs, and its attainable stiffness."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.results.charts.look import current_look
from vsacli.results.charts.robot_charts import LIMITS, ActuatorChart, StiffnessMap, TorqueCurve
from vsacli.results.plots.arrangement import panel_grid
from vsacli.results.plots.panels import ZERO
from vsacli.results.plots.sheets import complete
from vsacli.results.plots.styles import line_style, scaled, shortened

PANEL_HEIGHT = 2.7
"""Height of a panel, inches."""

LEGEND_SIZE = 8
"""Font size of legends inside a panel, points at the usual font size."""

LEGEND_ROOM = 0.15
"""Space above and below the curves of a figure of a fixed width, relative to them."""

TITLE_LENGTH = 34
"""Characters in a line of the title of a panel, which has two lines."""

WIDE_RATIO, SMALLEST_SHARE = 50.0, 1e-4
"""Ratio of the largest to the median minimum stiffness from which the axis is logarithmic, and the lowest
stiffness on such an axis, relative to the largest."""

_AREA: dict[str, Any] = {"facecolor": "#c9dff4", "linewidth": 0, "zorder": 0.6}
_BEYOND: dict[str, Any] = {"facecolor": "0.88", "edgecolor": "0.6", "hatch": "////", "linewidth": 0}
_SINGULAR: dict[str, Any] = {"color": line_style(1).color, "linewidth": 2.8, "linestyle": "-"}
_END: dict[str, Any] = {"color": line_style(2).color, "linewidth": 1.0, "linestyle": "-"}
_LOAD: dict[str, Any] = {"color": "black", "linewidth": 0.9, "linestyle": (0, (6, 2, 1, 2))}
_ALLOWED: dict[str, Any] = {"color": "black", "linewidth": 0.9, "linestyle": (0, (1, 2))}
_ONLY: dict[str, Any] = {"color": "black", "linewidth": 1.8}
_LIMIT: dict[str, dict[str, Any]] = {
    LIMITS["tau_motor"]: {"color": "0.25", "linewidth": 1.2, "linestyle": (0, (5, 2))},
    LIMITS["phi"]: {"color": "0.25", "linewidth": 1.4, "linestyle": (0, (1.2, 1.2))},
}


def actuators_figure(charts: Sequence[ActuatorChart], title: str) -> Figure:
    """Draw the torque over deflection of the springs, a panel for joints with equal actuators."""
    return _panels_figure(charts, f"{title}: torque of springs", _draw_torques)


def stiffness_figure(charts: Sequence[ActuatorChart], title: str) -> Figure:
    """Draw the attainable stiffness over torque, a panel for joints with equal actuators."""
    return _panels_figure(charts, f"{title}: attainable stiffness at rest", _draw_map)


def _panels_figure(
    charts: Sequence[ActuatorChart], title: str, draw: Callable[[Axes, ActuatorChart], list[Artist]]
) -> Figure:
    """Draw a panel for each chart, with one legend."""
    with panel_grid(len(charts), PANEL_HEIGHT) as (figure, panels):
        handles: list[Artist] = []
        for axes, chart in zip(panels, charts, strict=True):
            _set_panel_title(axes, chart)
            handles += draw(axes, chart)
        return complete(figure, title, handles)


def _set_panel_title(axes: Axes, chart: ActuatorChart) -> None:
    """Set the title of a panel: names of the joints, and kind of their actuators."""
    title = "\n".join(shortened(line, TITLE_LENGTH) for line in (chart.title, chart.kind))
    axes.set_title(title, loc="left", parse_math=False)


def _torque_words(chart: ActuatorChart) -> str:
    return "torque" if chart.joints[0].is_revolute else "force"


def _draw_torques(axes: Axes, chart: ActuatorChart) -> list[Artist]:
    """Draw the torques of springs into a panel; return the legend entries."""
    handles: list[Artist] = []
    axes.axhline(0.0, **scaled(ZERO))
    axes.axvline(0.0, **scaled(ZERO))
    curves = chart.torques
    for index, curve in enumerate(curves):
        style = line_style(index)
        style_with_markers = {**style.line_kwargs, "markevery": max(1, np.isfinite(curve.torque).sum() // 8)}
        finite = np.isfinite(curve.torque)
        axes.plot(curve.deflection[finite], curve.torque[finite], **style_with_markers, label=curve.label)
        if math.isfinite(curve.limit):
            axes.axvline(curve.limit, **scaled(_LIMIT[LIMITS["phi"]]))
            axes.axvline(-curve.limit, **scaled(_LIMIT[LIMITS["phi"]]))
            handles.append(Line2D([], [], **scaled(_LIMIT[LIMITS["phi"]]), label=LIMITS["phi"]))
    axes.margins(x=0.04)
    if current_look().width is not None:
        axes.margins(y=LEGEND_ROOM)  # in narrow panels the legend is above the curves instead
    _legend(axes, chart, curves)
    axes.set_xlabel(f"deflection [{chart.unit('phi')}]")
    axes.set_ylabel(f"{_torque_words(chart)} [{chart.unit('tau_e')}]")
    return handles


def _legend(axes: Axes, chart: ActuatorChart, curves: Sequence[TorqueCurve]) -> None:
    """Name the curves of a panel inside of it; the corner at the upper left is always free."""
    mechanism = chart.actuator.spring_elements is None
    title = rf"$\theta_2$ [{chart.unit('theta')}]" if mechanism else None
    if mechanism or len(curves) > 1 or chart.commanded:
        size = current_look().points(LEGEND_SIZE)
        axes.legend(loc="upper left", fontsize=size, title=title, title_fontsize=size, handlelength=2.2)


def _draw_map(axes: Axes, chart: ActuatorChart) -> list[Artist]:
    """Draw the attainable stiffness into a panel; return the legend entries."""
    stiffness_map = chart.stiffness
    handles: list[Artist] = []
    if chart.commanded:
        handles += _draw_area(axes, stiffness_map)
        handles += _draw_limits(axes, stiffness_map)
        handles += _draw_ends(axes, stiffness_map)
    else:
        handles += _draw_fixed_stiffness(axes, stiffness_map)
    for load in (-chart.load, chart.load) if chart.load else ():
        axes.axvline(load, **scaled(_LOAD))
        handles.append(Line2D([], [], **scaled(_LOAD), label="largest torque of gravity"))
    for limit in chart.limits:
        axes.axhline(limit, **scaled(_ALLOWED))
        handles.append(Line2D([], [], **scaled(_ALLOWED), label="stiffness limit of the file"))
    axes.set_xlim(stiffness_map.tau_e[0], stiffness_map.tau_e[-1])
    axes.set_ylim(0, stiffness_map.top)
    if _is_wide(stiffness_map):
        smallest = SMALLEST_SHARE * stiffness_map.top
        visible_minimum = stiffness_map.lower[stiffness_map.lower > smallest]
        axes.set_yscale("log")
        axes.set_ylim(visible_minimum.min() / 2 if visible_minimum.size else smallest, stiffness_map.top)
    words = "elastic " + _torque_words(chart)
    axes.set_xlabel(rf"{words} $\tau_e$ [{chart.unit('tau_e')}]")
    axes.set_ylabel(f"stiffness [{chart.unit('stiffness')}]")
    return handles


def _is_wide(stiffness_map: StiffnessMap) -> bool:
    """Return whether the stiffness needs a logarithmic axis."""
    lower = stiffness_map.lower[np.isfinite(stiffness_map.lower)]
    return bool(stiffness_map.top > WIDE_RATIO * np.median(lower))


def _draw_area(axes: Axes, stiffness_map: StiffnessMap) -> list[Artist]:
    """Draw the attainable range, and the part of it beyond a limit."""
    upper = np.minimum(stiffness_map.upper, stiffness_map.top)
    axes.fill_between(
        stiffness_map.tau_e, stiffness_map.lower, upper, where=upper >= stiffness_map.lower, **_AREA
    )
    return [Patch(**_AREA, label="attainable")]


def _draw_limits(axes: Axes, stiffness_map: StiffnessMap) -> list[Artist]:
    """Draw where motors or springs reach their limits, and hatch the range beyond."""
    tau_e = np.broadcast_to(stiffness_map.tau_e, stiffness_map.levels.shape)
    handles: list[Artist] = []
    for caption, clearance in stiffness_map.clearance.items():
        if not (clearance < 0).any():
            continue
        style = scaled(_LIMIT[caption])
        lines = {
            "colors": style["color"],
            "linewidths": style["linewidth"],
            "linestyles": [style["linestyle"]],
        }
        axes.contour(tau_e, stiffness_map.levels, clearance, levels=[0.0], **lines)
        handles.append(Line2D([], [], **style, label=caption))
    if not handles:
        return handles
    smallest_clearance = np.min(np.stack(list(stiffness_map.clearance.values())), axis=0)
    shading = axes.contourf(
        tau_e,
        stiffness_map.levels,
        smallest_clearance,
        levels=[-np.inf, 0.0],
        colors=[_BEYOND["facecolor"]],
        hatches=["////"],
    )
    shading.set_edgecolor(_BEYOND["edgecolor"])
    shading.set_linewidth(0.0)
    shading.set_zorder(0.7)
    return [*handles, Patch(**_BEYOND, label="beyond a limit")]


def _draw_ends(axes: Axes, stiffness_map: StiffnessMap) -> list[Artist]:
    """Draw the ends of the attainable range: where A is singular, and where springs or settings end."""
    handles: list[Artist] = []
    kinds = ((True, _SINGULAR, "singular decoupling matrix"), (False, _END, "end of springs or settings"))
    for singular, style, label in kinds:
        for end, end_singular in (
            (stiffness_map.lower, stiffness_map.lower_singular),
            (stiffness_map.upper, stiffness_map.upper_singular),
        ):
            at_end = np.isfinite(end) & (end <= stiffness_map.top) & (end_singular == singular)
            if at_end.any():
                extended = at_end | np.roll(at_end, 1) & np.isfinite(end)
                axes.plot(stiffness_map.tau_e, np.where(extended, end, np.nan), **scaled(style))
                handles.append(Line2D([], [], **scaled(style), label=label))
    return handles


def _draw_fixed_stiffness(axes: Axes, stiffness_map: StiffnessMap) -> list[Artist]:
    """Draw the stiffness of springs that no motor adjusts, dotted beyond a limit."""
    within_limits, beyond_style = stiffness_map.within_limits[0], {**_ONLY, "linestyle": (0, (1, 1.5))}
    axes.plot(stiffness_map.tau_e, np.where(within_limits, stiffness_map.lower, np.nan), **scaled(_ONLY))
    axes.plot(
        stiffness_map.tau_e, np.where(within_limits, np.nan, stiffness_map.lower), **scaled(beyond_style)
    )
    handles: list[Artist] = [Line2D([], [], **scaled(_ONLY), label="stiffness that no motor adjusts")]
    if not within_limits.all():
        handles.append(Line2D([], [], **scaled(beyond_style), label="stiffness beyond a limit"))
    return handles
