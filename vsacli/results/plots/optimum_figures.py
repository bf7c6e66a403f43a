"""What an optimisation changes: stiffness and motor torques before and after, and the pace along the path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli.base.arrays import FloatArray
from vsacli.base.units import STIFFNESS, TIME, TORQUE
from vsacli.results.curves import Curve
from vsacli.results.plots.corridor_figure import draw_corridor
from vsacli.results.plots.drawing import draw_curve, draw_limits
from vsacli.results.plots.panels import PANEL_WIDTH, add_title, complete, folding, joint_panels
from vsacli.results.plots.styles import house_style, line_handle, line_style

MOST_ROWS = 6
ROW_HEIGHT = 1.7
PACE_HEIGHT = 3.0
"""Inches."""

BEFORE, AFTER = 1, 0
"""Line styles: what was found is the solid one."""

PATH = f"place on the path, as the time at which it was commanded [{TIME}]"


class Moved(NamedTuple):
    """What a joint does along a motion; all (samples,), torques (motors, samples).

    Attributes:
        place: where on the path, or when.
        stiffness: NaN throughout if the joint has none to choose.
        lower, upper: ends of its corridor.
        torques: of the motors.
    """

    place: FloatArray
    stiffness: FloatArray
    lower: FloatArray
    upper: FloatArray
    torques: FloatArray


class JointChange(NamedTuple):
    """A joint before and after.

    Attributes:
        name: of the joint.
        joint_type: revolute or prismatic.
        before: as commanded.
        after: at the optimum.
        limits: of its motor torques, (2,), infinite if there are none.
    """

    name: str
    joint_type: str
    before: Moved
    after: Moved
    limits: FloatArray


def change_figure(joints: Sequence[JointChange], title: str, *, along_path: bool) -> Figure:
    """A row of panels for each joint: its stiffness in the corridor, and its motor torques.

    Args:
        joints: with what they do.
        title: of the figure.
        along_path: whether places are on the path, rather than times.
    """
    rows, folds = folding(len(joints), MOST_ROWS)
    variable = [bool(np.isfinite(joint.after.stiffness).any()) for joint in joints]
    present = np.array([[has_stiffness, True] for has_stiffness in variable])[:, 0 if any(variable) else 1 :]
    with house_style():
        figure = Figure((2 * PANEL_WIDTH * folds, ROW_HEIGHT * rows + 1), layout="constrained")
        panels = joint_panels(figure.add_gridspec()[0], joints[0].before.place, present, MOST_ROWS)
        handles = [line_handle(line_style(BEFORE), "as commanded"), line_handle(line_style(AFTER), "optimum")]
        for joint, (*stiffness, torque), has_stiffness in zip(joints, panels, variable, strict=True):
            if has_stiffness:
                handles += _draw_stiffness(stiffness[0], joint)
            handles += _draw_torques(torque, joint)
        for axes in panels[present] if along_path else ():
            if axes.get_xlabel():
                axes.set_xlabel(f"place on the path [{TIME}]")
        return complete(figure, title, handles)


def _draw_stiffness(axes: Axes, joint: JointChange) -> list[Artist]:
    both = np.concatenate([joint.before.stiffness, joint.after.stiffness])
    handles = draw_corridor(axes, joint.after.place, both, [joint.after.lower, joint.after.upper])
    for style, moved in ((BEFORE, joint.before), (AFTER, joint.after)):
        handles += draw_curve(axes, Curve.reduced(moved.place, moved.stiffness), style, line_style(style))
    add_title(axes, joint.name)
    axes.set_ylabel(rf"$\sigma$ [{STIFFNESS.unit(joint.joint_type)}]")
    return handles


def _draw_torques(axes: Axes, joint: JointChange) -> list[Artist]:
    handles: list[Artist] = []
    for style, moved in ((BEFORE, joint.before), (AFTER, joint.after)):
        for torques in moved.torques:
            handles += draw_curve(axes, Curve.reduced(moved.place, torques), style, line_style(style))
    add_title(axes, f"{joint.name}: motors")
    axes.set_ylabel(rf"$\tau$ [{TORQUE.unit(joint.joint_type)}]")
    return [*handles, *draw_limits(axes, {AFTER: joint.limits})]


def pace_figure(place: FloatArray, speed: FloatArray, uniform: float, title: str) -> Figure:
    """How fast the path is passed at the optimum.

    Args:
        place: on the path, (samples,), s as commanded.
        speed: there, relative to the motion as commanded, (samples,).
        uniform: that of the fastest motion that is sped up as a whole; NaN if it does not matter.
        title: of the figure.
    """
    with house_style():
        figure = Figure((2 * PANEL_WIDTH, PACE_HEIGHT), layout="constrained")
        axes = figure.add_subplot()
        ends = place[[0, -1]]
        lines = {"as commanded": np.ones(2), "fastest as a whole": np.full(2, uniform)}
        handles = [line_handle(line_style(AFTER), "optimum")]
        handles += draw_curve(axes, Curve.reduced(place, speed), AFTER, line_style(AFTER))
        for style, (label, values) in zip((BEFORE, 3), lines.items(), strict=True):
            if np.isfinite(values).all():
                axes.plot(ends, values, **line_style(style).words)
                handles.append(line_handle(line_style(style), label))
        axes.set_xlim(*ends)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel(PATH)
        axes.set_ylabel("times as fast")
        return complete(figure, title, handles)
