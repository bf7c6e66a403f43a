"""The figures of one result, after Figs. 1-3 of Buondonno & De Luca (2016), and its energy."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.figure import Figure

from vsacli.base.units import ENERGY, POSITION, TORQUE
from vsacli.base.variables import MOTORS, existing
from vsacli.results.plots.corridor_figure import MOST_ROWS, compliant_joints, draw_corridors
from vsacli.results.plots.curves import Failures
from vsacli.results.plots.drawings import Drawing
from vsacli.results.plots.grouped import MOTOR_LABELS, PANEL_HEIGHT, draw_groups, force, grouped_figure
from vsacli.results.plots.panels import PANEL_WIDTH, complete, folding, panel_groups, result_title
from vsacli.results.store.reader import StoredResult

NARROW_WIDTH = 2.5
"""Inches: a stiffness panel where there are several columns of them."""


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
    motors = int(
        np.count_nonzero(np.any(existing(result.declared["motor_energy"], result.actuators), axis=0))
    )
    if not compliant_joints(result.actuators):
        return grouped_figure(result, failures, "motor_energy", _WORK_LABELS)
    height = PANEL_HEIGHT * len(panel_groups(result.joint_types)) + 1
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


RESULT_DRAWINGS: dict[str, Drawing] = {
    "motion": Drawing(("q", "stiffness"), _motion),
    "motor-torque": Drawing(("tau_motor",), _motor_torque),
    "elastic-torque": Drawing(("tau_e",), _elastic_torque),
    "energy": Drawing(("elastic_energy", "motor_energy"), _energy),
}
"""The figures of a result of `invdyn`, by name."""
