"""Curves of many joints on few panels: those of one unit share them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from vsacli.base.units import TORQUE
from vsacli.base.variables import MOTORS, existing
from vsacli.results.plots.curves import Failures, read_curves
from vsacli.results.plots.drawing import draw_bands, draw_curve, line_handle
from vsacli.results.plots.panels import PANEL_WIDTH, complete, panel_groups, result_title, share_time
from vsacli.results.plots.style import line_style
from vsacli.results.store.reader import StoredResult

PANEL_HEIGHT = 2.3
"""Inches."""

Label = Callable[[str], str]
"""Label of an axis for a type of joint."""


def grouped_figure(result: StoredResult, failures: Failures, name: str, labels: Sequence[Label]) -> Figure:
    """A figure of one variable that some joint has, with a column of panels for each of its curves."""
    height = PANEL_HEIGHT * len(panel_groups(result.joint_types)) + 1
    figure = Figure((2 * PANEL_WIDTH, height), layout="constrained")
    handles = draw_groups(figure.add_gridspec()[0], result, failures, name, labels)
    return complete(figure, result_title(result), handles)


def draw_groups(
    place: SubplotSpec, result: StoredResult, failures: Failures, name: str, labels: Sequence[Label]
) -> list[Artist]:
    """Draw a variable, a row of panels for each group of joints that have it; returns what a legend shows."""
    there = np.array(existing(result.declared[name], result.actuators))
    drawn = np.flatnonzero(there.any(axis=0)).tolist()
    groups = [group for group in panel_groups(result.joint_types) if there[group].any()]
    joints = read_curves(result, [name])
    panels = place.subgridspec(len(groups), len(drawn)).subplots(squeeze=False)
    handles = [line_handle(line_style(joint), name) for joint, name in enumerate(result.joint_names)]
    for group, row in zip(groups, panels, strict=True):
        for curve, axes in zip(drawn, row, strict=True):
            for joint in [joint for joint in group if there[joint, curve]]:
                draw_curve(axes, joints[joint].time, joints[joint].values[curve], joint, line_style(joint))
            handles += draw_bands(axes, failures.time, *failures.among(group))
            axes.set_ylabel(labels[curve](result.joint_types[group[0]]))
    share_time(panels, np.array([there[group][:, drawn].any(axis=0) for group in groups]), failures.time)
    return handles


def force(joint_type: str) -> str:
    """What a joint of this type is moved by."""
    return "torque" if joint_type == "revolute" else "force"


def _motor_label(motor: int, joint_type: str) -> str:
    return rf"motor {force(joint_type)} $\tau_{motor}$ [{TORQUE.unit(joint_type)}]"


MOTOR_LABELS: tuple[Label, ...] = tuple(partial(_motor_label, motor) for motor in MOTORS)
"""Of the axes for the torques, or forces, of the motors."""
