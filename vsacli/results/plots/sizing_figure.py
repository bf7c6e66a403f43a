"""Figure of torque over speed of each motor, with its peak and continuous limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.base.arrays import FloatArray
from vsacli.results.plots.arrangement import panel_grid
from vsacli.results.plots.sheets import complete
from vsacli.results.plots.styles import line_style, scaled, shortened

PANEL_HEIGHT = 2.3
"""Height of a panel, inches."""

TITLE_LENGTH = 32
"""Characters in a line of the title of a panel, which has two lines."""

SIGHT = 6.0
"""Limits larger than the motion by more than this factor are not shown, so that the motion stays visible."""

ROOM = 1.08
"""Factor by which axes extend beyond their content."""

POINTS = 400
"""Number of points on the edge of the operating range of a motor."""

PEAK_LOOK: dict[str, Any] = {"facecolor": "#e8eef9", "linewidth": 0.0}
CONTINUOUS_LOOK: dict[str, Any] = {"facecolor": "#c3d4f1", "linewidth": 0.0}
RMS_LOOK: dict[str, Any] = {
    "linestyle": "none",
    "marker": "D",
    "markersize": 6,
    "color": "white",
    "markeredgecolor": "black",
}
EDGE: dict[str, Any] = {"color": "0.35", "linewidth": 1.0}
BRAKING = 0.3
"""Opacity of curves while the motor brakes."""


class MotorLimits(NamedTuple):
    """Limits of a motor, infinite where there is none.

    Attributes:
        max_torque, continuous_torque: maximum of torque, and of its root mean square.
        max_velocity: maximum speed.
        max_voltage: maximum voltage.
        torque_constant, resistance: constants that relate the voltage to torque and speed.
    """

    max_torque: float
    continuous_torque: float
    max_velocity: float
    max_voltage: float
    torque_constant: float
    resistance: float

    def torque_at(self, speed: FloatArray) -> FloatArray:
        """Return the largest driving torque at a speed; NaN above the largest attainable speed."""
        torque = np.full_like(speed, self.max_torque)
        if math.isfinite(self.max_voltage):
            remaining_voltage = self.max_voltage - self.torque_constant * speed
            voltage_limited = (
                remaining_voltage * self.torque_constant / self.resistance
                if self.resistance
                else np.where(remaining_voltage >= 0, math.inf, -math.inf)
            )
            torque = np.minimum(torque, voltage_limited)
        return np.where((speed <= self.max_velocity) & (torque >= 0), torque, np.nan)


class TorqueSpeed(NamedTuple):
    """Operating points of a motor over some motions.

    Attributes:
        name: joint and motor.
        drive: motor model and gear.
        torque_unit, velocity_unit: units of the values.
        bounds: limits of the motor.
        runs: velocities and torques, each (samples,), by trajectory.
        rms: root mean squares of velocity and torque over all trajectories.
    """

    name: str
    drive: str
    torque_unit: str
    velocity_unit: str
    bounds: MotorLimits
    runs: Mapping[str, tuple[FloatArray, FloatArray]]
    rms: tuple[float, float]


def torque_speed_figure(motors: Sequence[TorqueSpeed], title: str) -> Figure:
    """Draw a panel for each motor: |torque| over |speed|, paler where it brakes."""
    with panel_grid(len(motors), PANEL_HEIGHT) as (figure, panels):
        names = list(dict.fromkeys(name for motor in motors for name in motor.runs))
        handles: list[Artist] = [
            Line2D([], [], **_run_look(index), label=name) for index, name in enumerate(names)
        ]
        for axes, motor in zip(panels, motors, strict=True):
            handles += _draw_motor(axes, motor, names)
        return complete(figure, title, handles)


def _draw_motor(axes: Axes, motor: TorqueSpeed, names: Sequence[str]) -> list[Artist]:
    """Draw a panel; return its legend entries."""
    speeds, torques = (np.concatenate([np.abs(run[part]) for run in motor.runs.values()]) for part in (0, 1))
    x_max = _axis_end(float(speeds.max()), [min(motor.bounds.max_velocity, _no_load_speed(motor.bounds))])
    y_max = _axis_end(float(torques.max()), [motor.bounds.max_torque, motor.bounds.continuous_torque])
    handles = _draw_bounds(axes, motor.bounds, x_max, y_max)
    for name, (velocity, torque) in motor.runs.items():
        _draw_run(axes, velocity, torque, _run_look(names.index(name)))
    axes.plot(*motor.rms, **scaled(RMS_LOOK), zorder=5)
    handles.append(Line2D([], [], **scaled(RMS_LOOK), label="root mean square"))
    if any((velocity * torque < 0).any() for velocity, torque in motor.runs.values()):
        handles.append(Line2D([], [], color="black", alpha=BRAKING, label="pale: while it brakes"))
    axes.set_xlim(0, x_max)
    axes.set_ylim(0, y_max)
    title = "\n".join(shortened(line, TITLE_LENGTH) for line in (motor.name, motor.drive))
    axes.set_title(title, loc="left", parse_math=False)
    axes.set_xlabel(f"|speed| [{motor.velocity_unit}]")
    axes.set_ylabel(f"|torque| [{motor.torque_unit}]" if motor.torque_unit != "N" else "|force| [N]")
    return handles


def _run_look(index: int) -> dict[str, Any]:
    """Return the style of a trajectory: its color and dashes."""
    style = line_style(index)
    return {"color": style.color, "linestyle": style.linestyle}


def _axis_end(largest: float, bounds: Sequence[float]) -> float:
    """Return the end of an axis, beyond the motion and beyond visible bounds."""
    visible_bounds = [bound for bound in bounds if bound <= SIGHT * largest]
    return ROOM * max([largest, *visible_bounds]) or 1.0


def _no_load_speed(bounds: MotorLimits) -> float:
    """Return the no-load speed at the maximum voltage."""
    return bounds.max_voltage / bounds.torque_constant if math.isfinite(bounds.max_voltage) else math.inf


def _draw_bounds(axes: Axes, bounds: MotorLimits, x_max: float, y_max: float) -> list[Artist]:
    speed = np.linspace(0, x_max, POINTS)
    torque_limit = bounds.torque_at(speed)
    handles: list[Artist] = []
    if np.isinf(torque_limit).all():
        return handles
    axes.fill_between(speed, np.minimum(torque_limit, 2 * y_max), **PEAK_LOOK, zorder=0.4)
    handles.append(
        Patch(facecolor=PEAK_LOOK["facecolor"], edgecolor=EDGE["color"], label="within the peak limits")
    )
    if math.isfinite(bounds.continuous_torque):
        continuous_torque = np.minimum(torque_limit, bounds.continuous_torque)
        axes.fill_between(speed, np.minimum(continuous_torque, 2 * y_max), **CONTINUOUS_LOOK, zorder=0.5)
        handles.append(Patch(**CONTINUOUS_LOOK, label="within the continuous limits"))
    axes.plot(speed, np.minimum(torque_limit, 2 * y_max), **scaled(EDGE))
    attainable_speeds = speed[np.isfinite(torque_limit)]
    if attainable_speeds.size and attainable_speeds[-1] < x_max * (1 - 1 / POINTS):
        axes.plot(
            [attainable_speeds[-1]] * 2,
            [0, min(torque_limit[np.isfinite(torque_limit)][-1], 2 * y_max)],
            **scaled(EDGE),
        )
    return handles


def _draw_run(axes: Axes, velocity: FloatArray, torque: FloatArray, style: Mapping[str, Any]) -> None:
    """Draw |torque| over |speed|, dark where the motor drives."""
    drives = velocity * torque >= 0
    for mask, alpha, zorder in ((~drives, BRAKING, 2), (drives, 1.0, 3)):
        axes.plot(
            np.where(mask, np.abs(velocity), np.nan),
            np.where(mask, np.abs(torque), np.nan),
            **style,
            alpha=alpha,
            zorder=zorder,
            linewidth=1.2,
        )
