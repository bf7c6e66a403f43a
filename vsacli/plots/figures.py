"""The figures of one result, after Figs. 1-3 of Buondonno & De Luca (2016), and its energy."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from vsacli.errors import InputError
from vsacli.plots.corridor import MOST_ROWS, compliant_joints, draw_corridors
from vsacli.plots.curves import Failures, read_curves
from vsacli.plots.drawing import draw_bands, draw_curve, line_handle
from vsacli.plots.layout import (
    PANEL_WIDTH,
    complete,
    folding,
    missing_variables,
    panel_groups,
    result_title,
    share_time,
)
from vsacli.plots.style import house_style, line_style
from vsacli.store.reader import StoredResult
from vsacli.units import ENERGY, POSITION, TORQUE
from vsacli.variables import MOTORS, existing

PANEL_HEIGHT = 2.3
"""Inches."""

NARROW_WIDTH = 2.5
"""Inches: a stiffness panel where there are several columns of them."""

Label = Callable[[str], str]
"""Label of an axis for a type of joint."""


def plot_result(result: StoredResult) -> dict[str, Figure]:
    """Draw the figures of a result by name, all but the `omitted_figures`.

    Raises:
        InputError: nothing can be drawn from what is stored.
    """
    names = drawable_figures(result.variables, result.path)
    with house_style():
        failures = Failures.of(result)
        return {name: _FIGURES[name][1](result, failures) for name in names}


def drawable_figures(variables: Collection[str], path: str | Path = "") -> list[str]:
    """Names of the figures that can be drawn from these variables.

    Raises:
        InputError: there is none; `path` is the file it names.
    """
    omitted = omitted_figures(variables)
    if len(omitted) == len(_FIGURES):
        raise InputError.one("nothing can be plotted: " + "; ".join(omitted.values()), path)
    return [name for name in _FIGURES if name not in omitted]


def omitted_figures(variables: Collection[str]) -> dict[str, str]:
    """Figures that cannot be drawn from these variables, by name, each with the reason as a sentence."""
    reasons = {}
    for name, (needed, _) in _FIGURES.items():
        missing = [variable for variable in needed if variable not in variables]
        if missing:
            reasons[name] = missing_variables(name, missing)
    return reasons


def _motion(result: StoredResult, failures: Failures) -> Figure:
    """Fig. 1: positions at the left, stiffness at the right if any joint has one."""
    compliant = compliant_joints(result.actuators)
    if not compliant:
        return grouped_figure(result, failures, "q", [_position_label])
    rows, folds = folding(len(compliant), MOST_ROWS)
    widths = (PANEL_WIDTH, PANEL_WIDTH if folds == 1 else NARROW_WIDTH * folds)
    height = max(PANEL_HEIGHT * len(panel_groups(result.joint_types)), 1.4 * rows)
    figure = Figure((sum(widths), height + 1), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=widths)
    handles = _draw_groups(grid[0], result, failures, "q", [_position_label])
    handles += draw_corridors(grid[1], result, failures)
    return complete(figure, result_title(result), handles)


def _motor_torque(result: StoredResult, failures: Failures) -> Figure:
    """Fig. 2: motor 1 at the left, motor 2 at the right."""
    return grouped_figure(result, failures, "tau_motor", [partial(motor_label, motor) for motor in MOTORS])


def _elastic_torque(result: StoredResult, failures: Failures) -> Figure:
    """Fig. 3."""
    return grouped_figure(result, failures, "tau_e", [_elastic_label])


def _energy(result: StoredResult, failures: Failures) -> Figure:
    """Energy in the springs at the left, if there are any; beside it what each motor has worked."""
    motors = int(
        np.count_nonzero(np.any(existing(result.declared["motor_energy"], result.actuators), axis=0))
    )
    if not compliant_joints(result.actuators):
        return grouped_figure(result, failures, "motor_energy", _WORK_LABELS)
    height = PANEL_HEIGHT * len(panel_groups(result.joint_types)) + 1
    figure = Figure(((1 + motors) * PANEL_WIDTH, height), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1, motors))
    handles = _draw_groups(grid[0], result, failures, "elastic_energy", [_elastic_energy_label])
    handles += _draw_groups(grid[1], result, failures, "motor_energy", _WORK_LABELS)
    return complete(figure, result_title(result), handles)


def grouped_figure(result: StoredResult, failures: Failures, name: str, labels: Sequence[Label]) -> Figure:
    """A figure of one variable that some joint has, with a column of panels for each of its curves."""
    height = PANEL_HEIGHT * len(panel_groups(result.joint_types)) + 1
    figure = Figure((2 * PANEL_WIDTH, height), layout="constrained")
    handles = _draw_groups(figure.add_gridspec()[0], result, failures, name, labels)
    return complete(figure, result_title(result), handles)


def _draw_groups(
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


def _position_label(joint_type: str) -> str:
    return f"joint position $q$ [{POSITION.unit(joint_type)}]"


def motor_label(motor: int, joint_type: str) -> str:
    """Of the axis for the torque, or force, of a motor."""
    return rf"motor {_force(joint_type)} $\tau_{motor}$ [{TORQUE.unit(joint_type)}]"


def _elastic_label(joint_type: str) -> str:
    return rf"elastic {_force(joint_type)} $\tau_e$ [{TORQUE.unit(joint_type)}]"


def _elastic_energy_label(_joint_type: str) -> str:
    return f"elastic energy [{ENERGY}]"


def _work_label(motor: int, _joint_type: str) -> str:
    return f"work of motor {motor} [{ENERGY}]"


_WORK_LABELS = [partial(_work_label, motor) for motor in MOTORS]


def _force(joint_type: str) -> str:
    return "torque" if joint_type == "revolute" else "force"


_FIGURES = {
    "motion": (("q", "stiffness"), _motion),
    "motor-torque": (("tau_motor",), _motor_torque),
    "elastic-torque": (("tau_e",), _elastic_torque),
    "energy": (("elastic_energy", "motor_energy"), _energy),
}
