"""The figures of a file: of a result, after Figs. 1-3 of Buondonno & De Luca (2016), and of a simulation."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from vsacli.base.variables import VARIABLES, Variable
from vsacli.results.corridors import compliant_joints
from vsacli.results.curves import Failures
from vsacli.results.plots.corridor_figure import MOST_ROWS, draw_corridors
from vsacli.results.plots.drawings import Drawing, Figures, drawable_figures
from vsacli.results.plots.groups import GROUP_HEIGHT, draw_groups, grouped_figure, legend_width
from vsacli.results.plots.labels import (
    CURRENTS,
    DAMPER_TORQUES,
    DAMPINGS,
    ELASTIC_ENERGIES,
    ELASTIC_TORQUES,
    LOSSES,
    MOTOR_TORQUES,
    POSITIONS,
    VOLTAGES,
    WORK,
)
from vsacli.results.plots.panels import PANEL_WIDTH, complete, folding, panel_groups, result_title
from vsacli.results.plots.simulation_figures import simulation_drawings
from vsacli.results.plots.styles import house_style
from vsacli.results.plots.variable_figures import draw_variable, drawable_variables
from vsacli.results.store.reader import StoredResult

NARROW_WIDTH, LOW_HEIGHT = 2.5, 1.4
"""Inches: a stiffness panel where there are several columns of them, beside the positions."""

LARGE = 150.0
"""Square inches from which on a figure is cleared away before the next is drawn; 20 joints have fewer. It is
full of circles, and the collector, which counts objects, does not see that its picture has 100 MB."""


def _motion(result: StoredResult, failures: Failures) -> Figure:
    """Fig. 1: positions at the left, stiffness at the right if any joint has one."""
    compliant = compliant_joints(result.actuators)
    if not compliant:
        return grouped_figure(result, failures, "q", [POSITIONS])
    left = GROUP_HEIGHT * len(panel_groups(result.joint_types))
    most_rows = max(MOST_ROWS, int(left / LOW_HEIGHT))
    rows, folds = folding(len(compliant), most_rows)
    widths = (PANEL_WIDTH, PANEL_WIDTH if folds == 1 else NARROW_WIDTH * folds)
    size = (sum(widths) + legend_width(result), max(left, LOW_HEIGHT * rows) + 1)
    figure = Figure(size, layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=widths)
    handles = draw_groups(grid[0], result, failures, "q", [POSITIONS])
    handles += draw_corridors(grid[1], result, failures, most_rows)
    return complete(figure, result_title(result), handles)


def _motor_torque(result: StoredResult, failures: Failures) -> Figure:
    """Fig. 2: motor 1 at the left, motor 2 at the right."""
    return grouped_figure(result, failures, "tau_motor", MOTOR_TORQUES)


def _elastic_torque(result: StoredResult, failures: Failures) -> Figure:
    """Fig. 3."""
    return grouped_figure(result, failures, "tau_e", [ELASTIC_TORQUES])


def _energy(result: StoredResult, failures: Failures) -> Figure:
    """Energy in the springs at the left, if there are any; beside it what each motor has worked."""
    motors = int(np.count_nonzero(np.any(result.existing(result.declared["motor_energy"]), axis=0)))
    if not compliant_joints(result.actuators):
        return grouped_figure(result, failures, "motor_energy", WORK)
    height = GROUP_HEIGHT * len(panel_groups(result.joint_types)) + 1
    figure = Figure(((1 + motors) * PANEL_WIDTH, height), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1, motors))
    handles = draw_groups(grid[0], result, failures, "elastic_energy", [ELASTIC_ENERGIES], named=False)
    handles += draw_groups(grid[1], result, failures, "motor_energy", WORK)
    return complete(figure, result_title(result), handles)


def _losses(result: StoredResult, failures: Failures) -> Figure:
    return grouped_figure(result, failures, "dissipated_power", [LOSSES])


def _current(result: StoredResult, failures: Failures) -> Figure:
    return grouped_figure(result, failures, "current", CURRENTS)


def _voltage(result: StoredResult, failures: Failures) -> Figure:
    return grouped_figure(result, failures, "voltage", VOLTAGES)


def _damper(result: StoredResult, failures: Failures) -> Figure:
    """Damping at the left, beside it the torque that it makes."""
    height = GROUP_HEIGHT * len(panel_groups(result.joint_types)) + 1
    figure = Figure((2 * PANEL_WIDTH, height), layout="constrained")
    grid = figure.add_gridspec(1, 2)
    handles = draw_groups(grid[0], result, failures, "damping", [DAMPINGS], named=False)
    handles += draw_groups(grid[1], result, failures, "tau_damper", [DAMPER_TORQUES])
    return complete(figure, result_title(result), handles)


RESULT_DRAWINGS: dict[str, Drawing] = {
    "motion": Drawing(("q", "stiffness"), _motion),
    "motor-torque": Drawing(("tau_motor",), _motor_torque),
    "elastic-torque": Drawing(("tau_e",), _elastic_torque),
    "energy": Drawing(("elastic_energy", "motor_energy"), _energy),
    "losses": Drawing(("dissipated_power",), _losses),
    "damper": Drawing(("damping", "tau_damper"), _damper),
    "motor-current": Drawing(("current",), _current),
    "motor-voltage": Drawing(("voltage",), _voltage),
}
"""The figures of a result of `invdyn`, by name."""


def result_drawings(has: Callable[[Variable], bool]) -> dict[str, Drawing]:
    """The figures of a result of `invdyn`, by name, of a robot that has the variables that they need."""
    return {
        name: drawing
        for name, drawing in RESULT_DRAWINGS.items()
        if all(has(VARIABLES[needed]) for needed in drawing.needs)
    }


def drawings_of(stored: StoredResult) -> Mapping[str, Drawing]:
    """The figures that a file of its kind has, by name."""
    if stored.kind == "simulation":
        return simulation_drawings(lambda variable: bool(stored.existing(variable).any()))
    return result_drawings(stored.has)


def chosen_figures(stored: StoredResult, variables: Sequence[str] | None) -> list[str]:
    """Names of the figures that can be drawn: those of these variables, or else those that files have.

    Raises:
        InputError: there is no curve of one of the variables, or of none if they are not asked for.
    """
    if variables is None:
        return drawable_figures(drawings_of(stored), stored.variables, stored.path)
    return [variable.name for variable in drawable_variables(stored, variables)]


def draw_stored(stored: StoredResult, variables: Sequence[str] | None = None) -> Iterator[tuple[str, Figure]]:
    """Draw what `plot_stored` does, each figure when it is asked for: those of many joints are large."""
    names = chosen_figures(stored, variables)
    failures = Failures.of(stored)
    drawings = drawings_of(stored)
    for name in names:
        with house_style():
            figure = (
                drawings[name].draw(stored, failures)
                if variables is None
                else draw_variable(stored.declared[name], stored, failures)
            )
        large = np.prod(figure.get_size_inches()) > LARGE
        yield name, figure
        del figure  # before the next one is drawn
        if large:
            gc.collect()


def plot_stored(stored: StoredResult, variables: Sequence[str] | None = None) -> Figures:
    """Draw the figures of a result or a simulation by name, all but the `omitted_figures`.

    Args:
        stored: the open file, or an excerpt.
        variables: names of those to draw instead, each in a figure that is called after it.

    Raises:
        InputError: nothing can be drawn from what is stored, or there is no curve of one of the variables.
    """
    return dict(draw_stored(stored, variables))
