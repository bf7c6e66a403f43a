"""Which numbers of a robot matter most, and how far motor torques may be off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli.base.arrays import FloatArray
from vsacli.base.units import TORQUE
from vsacli.base.variables import MOTORS
from vsacli.results.curves import Curve
from vsacli.results.plots.drawing import draw_curve, draw_uncertainty
from vsacli.results.plots.panels import PANEL_WIDTH, add_title, complete, joint_panels
from vsacli.results.plots.styles import house_style, line_handle, line_style, shortened

MOST_ROWS = 7
ROW_HEIGHT, BAR_HEIGHT = 1.6, 0.28
"""Inches."""

LABEL_LENGTH, ROOM_FOR_LABELS = 16, 0.35
"""Characters of a joint's name beside its bar, and the space for it, relative to the longest bar."""


class Bar(NamedTuple):
    """What a change of a number does.

    Attributes:
        label: the number, and its change.
        share: largest change of a motor torque over the largest torque of its joint.
        joint: that one.
    """

    label: str
    share: float
    joint: str


class Torque(NamedTuple):
    """Torque of a motor over time, with its standard deviation; all (samples,)."""

    joint: str
    joint_type: str
    motor: int
    values: FloatArray
    deviation: FloatArray


def ranking_figure(bars: Sequence[Bar], title: str) -> Figure:
    """A bar for each number, the most important on top, with the joint that it moves most."""
    with house_style():
        figure = Figure((2 * PANEL_WIDTH, BAR_HEIGHT * len(bars) + 1.2), layout="constrained")
        axes = figure.add_subplot()
        joints = list(dict.fromkeys(bar.joint for bar in bars))
        colors = [line_style(joints.index(bar.joint)).color for bar in bars]
        axes.barh(range(len(bars)), [100 * bar.share for bar in bars], color=colors, height=0.7)
        axes.set_yticks(range(len(bars)), [bar.label for bar in bars], parse_math=False)
        axes.invert_yaxis()
        for place, bar in enumerate(bars):
            text = f" {shortened(bar.joint, LABEL_LENGTH)}"
            axes.text(100 * bar.share, place, text, va="center", fontsize=8, parse_math=False)
        axes.margins(x=ROOM_FOR_LABELS)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("change of motor torque [% of its peak]")
        return complete(figure, title, [])


def band_figure(time: FloatArray, torques: Sequence[Torque], title: str) -> Figure:
    """Motor torques with a band of two standard deviations, a row of panels for each joint."""
    with house_style():
        joints = list(dict.fromkeys(torque.joint for torque in torques))
        there = np.array([[_of(torques, joint, motor) is not None for motor in MOTORS] for joint in joints])
        figure = Figure((2 * PANEL_WIDTH, ROW_HEIGHT * len(joints) + 1), layout="constrained")
        panels = joint_panels(figure.add_gridspec()[0], time, there, MOST_ROWS)
        handles = [line_handle(line_style(0), "computed")]
        for torque in torques:
            axes = panels[joints.index(torque.joint)][torque.motor - 1]
            handles += draw_curve(axes, Curve(time, torque.values), 0, line_style(0))
            handles += draw_uncertainty(axes, time, torque.values, torque.deviation, line_style(1))
            _show_all(axes, torque)
            add_title(axes, f"{torque.joint}, motor {torque.motor}")
            axes.set_ylabel(rf"$\tau_{torque.motor}$ [{TORQUE.unit(torque.joint_type)}]")
        return complete(figure, title, handles)


def _show_all(axes: Axes, torque: Torque) -> None:
    """Let the axis hold the whole band."""
    low = np.nanmin(torque.values - 2 * torque.deviation)
    high = np.nanmax(torque.values + 2 * torque.deviation)
    room = 0.05 * (high - low) or 1.0
    axes.set_ylim(low - room, high + room)


def _of(torques: Sequence[Torque], joint: str, motor: int) -> Torque | None:
    return next((each for each in torques if (each.joint, each.motor) == (joint, motor)), None)
