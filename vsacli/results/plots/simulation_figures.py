"""The figures of a simulation: what was commanded and what came out, errors, and what motors did."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure

from vsacli.base import units
from vsacli.base.simulation_variables import SIMULATION_VARIABLES, actual
from vsacli.base.variables import Variable
from vsacli.results.curves import Failures, read_curves
from vsacli.results.plots.drawing import draw_bands, draw_curve, draw_limits
from vsacli.results.plots.drawings import Drawing
from vsacli.results.plots.groups import grouped_figure
from vsacli.results.plots.labels import (
    CURRENTS,
    LOSSES,
    MOTOR_TORQUES,
    POSITION_ERRORS,
    STIFFNESS_ERRORS,
    VOLTAGES,
    Label,
    label,
)
from vsacli.results.plots.panels import PANEL_WIDTH, add_title, complete, folding, joint_panels, result_title
from vsacli.results.plots.styles import line_handle, line_style
from vsacli.results.store.reader import StoredResult

MOST_ROWS = 7
ROW_HEIGHT = 1.7
"""Inches."""

_FOLLOWED = {"q": label("$q$", units.POSITION), "stiffness": label(r"$\sigma$", units.STIFFNESS)}
"""What is commanded, a column of panels each, and the label of its axes."""


def simulation_drawings(there: Callable[[Variable], bool]) -> dict[str, Drawing]:
    """The figures of a simulation, by name, of a robot one of whose joints has what they show."""
    motion = Drawing((*_FOLLOWED, *map(actual, _FOLLOWED)), _motion)
    of_variables = {
        name: _drawing(variable, labels)
        for name, (variable, labels) in _FIGURES.items()
        if there(SIMULATION_VARIABLES[variable])
    }
    return {"motion": motion, **of_variables}


def _drawing(variable: str, labels: Sequence[Label]) -> Drawing:
    def draw(simulation: StoredResult, failures: Failures) -> Figure:
        return grouped_figure(simulation, failures, variable, labels)

    return Drawing((variable,), draw)


_FIGURES: dict[str, tuple[str, Sequence[Label]]] = {
    "position-error": ("q_error", [POSITION_ERRORS]),
    "stiffness-error": ("stiffness_error", [STIFFNESS_ERRORS]),
    "motor-torque": ("tau_motor_actual", MOTOR_TORQUES),
    "losses": ("dissipated_power_actual", [LOSSES]),
    "motor-current": ("current_actual", CURRENTS),
    "motor-voltage": ("voltage_actual", VOLTAGES),
}
"""Variable and labels."""


def _motion(simulation: StoredResult, failures: Failures) -> Figure:
    """A row of panels for each joint: its position and its stiffness, commanded and as they were."""
    there = np.array([simulation.existing(simulation.declared[name])[:, 0] for name in _FOLLOWED]).T
    there = there[:, there.any(axis=0)]
    joints, columns = there.shape
    rows, folds = folding(joints, MOST_ROWS)
    width = max(2, folds * columns) * PANEL_WIDTH
    figure = Figure((width, ROW_HEIGHT * rows + 1.2), layout="constrained")
    panels = joint_panels(figure.add_gridspec()[0], failures.time, there, MOST_ROWS)
    handles = [line_handle(line_style(index), label) for index, label in enumerate(("commanded", "actual"))]
    for column, (name, words) in zip(range(columns), _FOLLOWED.items(), strict=False):
        curves, limits = read_curves(simulation, [name, actual(name)]), simulation.limits(name)
        for joint in np.flatnonzero(there[:, column]).tolist():
            axes = panels[joint, column]
            for index in range(2):
                handles += draw_curve(axes, curves[joint][index], index, line_style(index))
            handles += draw_limits(axes, {2: limits[joint, 0]})
            handles += draw_bands(axes, failures.time, *failures.among([joint]))
            add_title(axes, simulation.joint_names[joint])
            axes.set_ylabel(words(simulation.joint_types[joint]))
    return complete(figure, result_title(simulation), handles)
