"""The figures of a file: of a result, after Figs. 1-3 of Buondonno & De Luca (2016), and of a simulation."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from matplotlib.figure import Figure

from vsacli.base.errors import InputError
from vsacli.base.units import CURRENT, DAMPING, ENERGY, POSITION, POWER, STIFFNESS, TORQUE, VOLTAGE, Quantity
from vsacli.base.variables import MOTORS, VARIABLES, Variable
from vsacli.results.corridors import compliant_joints
from vsacli.results.curves import Failures
from vsacli.results.plots.corridor_figure import MOST_ROWS, draw_corridors
from vsacli.results.plots.drawing import house_style
from vsacli.results.plots.panels import (
    GROUP_HEIGHT,
    MOTOR_LABELS,
    PANEL_WIDTH,
    Label,
    complete,
    draw_groups,
    folding,
    force,
    grouped_figure,
    missing_variables,
    panel_groups,
    result_title,
)
from vsacli.results.store.reader import StoredResult
from vsacli.results.store.simulation import StoredSimulation

NARROW_WIDTH = 2.5
"""Inches: a stiffness panel where there are several columns of them."""


Figures: TypeAlias = dict[str, Figure]
"""By name, such as "motion"."""


class Drawing(NamedTuple):
    """How a figure is drawn, and the variables without which it cannot be."""

    needs: tuple[str, ...]
    draw: Callable[[StoredResult, Failures], Figure]


def drawable_figures(
    drawings: Mapping[str, Drawing], variables: Collection[str], path: str | Path = ""
) -> list[str]:
    """Names of the figures that can be drawn from these variables.

    Raises:
        InputError: there is none; `path` is the file it names.
    """
    omitted = omitted_figures(drawings, variables)
    if len(omitted) == len(drawings):
        raise InputError.one("nothing can be plotted: " + "; ".join(omitted.values()), path)
    return [name for name in drawings if name not in omitted]


def omitted_figures(drawings: Mapping[str, Drawing], variables: Collection[str]) -> dict[str, str]:
    """Figures that cannot be drawn from these variables, by name, each with the reason as a sentence."""
    reasons = {}
    for name, drawing in drawings.items():
        missing = [variable for variable in drawing.needs if variable not in variables]
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
    height = max(GROUP_HEIGHT * len(panel_groups(result.joint_types)), 1.4 * rows)
    figure = Figure((sum(widths), height + 1), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=widths)
    handles = draw_groups(grid[0], result, failures, "q", [_position_label])
    handles += draw_corridors(grid[1], result, failures)
    return complete(figure, result_title(result), handles)


def _motor_torque(result: StoredResult, failures: Failures) -> Figure:
    """Fig. 2: motor 1 at the left, motor 2 at the right."""
    return grouped_figure(result, failures, "tau_motor", MOTOR_LABELS)


def _elastic_torque(result: StoredResult, failures: Failures) -> Figure:
    """Fig. 3."""
    return grouped_figure(result, failures, "tau_e", [_elastic_label])


def _energy(result: StoredResult, failures: Failures) -> Figure:
    """Energy in the springs at the left, if there are any; beside it what each motor has worked."""
    motors = int(np.count_nonzero(np.any(result.existing(result.declared["motor_energy"]), axis=0)))
    if not compliant_joints(result.actuators):
        return grouped_figure(result, failures, "motor_energy", _WORK_LABELS)
    height = GROUP_HEIGHT * len(panel_groups(result.joint_types)) + 1
    figure = Figure(((1 + motors) * PANEL_WIDTH, height), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1, motors))
    handles = draw_groups(grid[0], result, failures, "elastic_energy", [_elastic_energy_label])
    handles += draw_groups(grid[1], result, failures, "motor_energy", _WORK_LABELS)
    return complete(figure, result_title(result), handles)


def _position_label(joint_type: str) -> str:
    return f"joint position $q$ [{POSITION.unit(joint_type)}]"


def _elastic_label(joint_type: str) -> str:
    return rf"elastic {force(joint_type)} $\tau_e$ [{TORQUE.unit(joint_type)}]"


def _elastic_energy_label(_joint_type: str) -> str:
    return f"elastic energy [{ENERGY}]"


def _work_label(motor: int, _joint_type: str) -> str:
    return f"work of motor {motor} [{ENERGY}]"


_WORK_LABELS = [partial(_work_label, motor) for motor in MOTORS]


def _losses(result: StoredResult, failures: Failures) -> Figure:
    return grouped_figure(result, failures, "dissipated_power", [_loss_label])


def _loss_label(_joint_type: str) -> str:
    return f"friction and damping [{POWER}]"


def _current(result: StoredResult, failures: Failures) -> Figure:
    return grouped_figure(result, failures, "current", _CURRENT_LABELS, "max_current")


def _voltage(result: StoredResult, failures: Failures) -> Figure:
    return grouped_figure(result, failures, "voltage", _VOLTAGE_LABELS, "max_voltage")


def _electrical_label(letter: str, quantity: Quantity, motor: int, joint_type: str) -> str:
    words = {"i": "current", "u": "voltage"}[letter]
    return f"{words} of motor {motor}, ${letter}_{motor}$ [{quantity.unit(joint_type)}]"


_CURRENT_LABELS = [partial(_electrical_label, "i", CURRENT, motor) for motor in MOTORS]
_VOLTAGE_LABELS = [partial(_electrical_label, "u", VOLTAGE, motor) for motor in MOTORS]


def _damper(result: StoredResult, failures: Failures) -> Figure:
    """Damping at the left, beside it the torque that it makes."""
    height = GROUP_HEIGHT * len(panel_groups(result.joint_types)) + 1
    figure = Figure((2 * PANEL_WIDTH, height), layout="constrained")
    grid = figure.add_gridspec(1, 2)
    handles = draw_groups(grid[0], result, failures, "damping", [_damping_label])
    handles += draw_groups(grid[1], result, failures, "tau_damper", [_damper_label])
    return complete(figure, result_title(result), handles)


def _damping_label(joint_type: str) -> str:
    return f"damping $d$ [{DAMPING.unit(joint_type)}]"


def _damper_label(joint_type: str) -> str:
    return rf"{force(joint_type)} of the damper [{TORQUE.unit(joint_type)}]"


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


def simulation_drawings(there: Callable[[Variable], bool]) -> dict[str, Drawing]:
    """The figures of a simulation, by name, of a robot one of whose joints has what they show."""
    return {
        name: _drawing(variable, *look)
        for name, (variable, *look) in _FIGURES.items()
        if there(StoredSimulation.declared[variable])
    }


def _drawing(variable: str, labels: Sequence[Label], limit: str = "") -> Drawing:
    def draw(simulation: StoredResult, failures: Failures) -> Figure:
        return grouped_figure(simulation, failures, variable, labels, limit)

    return Drawing((variable,), draw)


def _position_error(joint_type: str) -> str:
    return f"position error $q - q_d$ [{POSITION.unit(joint_type)}]"


def _stiffness_error(joint_type: str) -> str:
    return rf"stiffness error $\sigma - \sigma_d$ [{STIFFNESS.unit(joint_type)}]"


_FIGURES: dict[str, tuple[Any, ...]] = {
    "position-error": ("q_error", [_position_error]),
    "stiffness-error": ("stiffness_error", [_stiffness_error]),
    "motor-torque": ("tau_motor_actual", MOTOR_LABELS),
    "losses": ("dissipated_power_actual", [_loss_label]),
    "motor-current": ("current_actual", _CURRENT_LABELS, "max_current"),
    "motor-voltage": ("voltage_actual", _VOLTAGE_LABELS, "max_voltage"),
}
"""Variable, labels, and the limit if there is one."""


def drawings_of(stored: StoredResult) -> Mapping[str, Drawing]:
    """The figures that a file of its kind has, by name."""
    if isinstance(stored, StoredSimulation):
        return simulation_drawings(lambda variable: bool(stored.existing(variable).any()))
    return result_drawings(stored.has)


def plot_stored(stored: StoredResult) -> Figures:
    """Draw the figures of a result or a simulation by name, all but the `omitted_figures`.

    Raises:
        InputError: nothing can be drawn from what is stored.
    """
    drawings = drawings_of(stored)
    names = drawable_figures(drawings, stored.variables, stored.path)
    with house_style():
        failures = Failures.of(stored)
        return {name: drawings[name].draw(stored, failures) for name in names}
