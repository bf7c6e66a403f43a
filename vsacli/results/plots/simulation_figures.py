"""The figures of a simulation: errors of position and stiffness, and the torques the motors gave."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure

from vsacli.base.units import POSITION, STIFFNESS
from vsacli.base.variables import existing
from vsacli.results.plots.curves import Failures
from vsacli.results.plots.drawings import Drawing
from vsacli.results.plots.grouped import MOTOR_LABELS, Label, grouped_figure
from vsacli.results.store.reader import StoredResult
from vsacli.results.store.simulation import StoredSimulation


def simulation_drawings(actuators: Iterable[str]) -> dict[str, Drawing]:
    """The figures of a simulation of joints with these types of actuators, by name."""
    types = tuple(actuators)
    return {
        name: _drawing(variable, labels)
        for name, (variable, labels) in _FIGURES.items()
        if np.any(existing(StoredSimulation.declared[variable], types))
    }


def _drawing(variable: str, labels: Sequence[Label]) -> Drawing:
    def draw(simulation: StoredResult, failures: Failures) -> Figure:
        return grouped_figure(simulation, failures, variable, labels)

    return Drawing((variable,), draw)


def _position_error(joint_type: str) -> str:
    return f"position error $q - q_d$ [{POSITION.unit(joint_type)}]"


def _stiffness_error(joint_type: str) -> str:
    return rf"stiffness error $\sigma - \sigma_d$ [{STIFFNESS.unit(joint_type)}]"


_FIGURES: dict[str, tuple[str, Sequence[Label]]] = {
    "position-error": ("q_error", [_position_error]),
    "stiffness-error": ("stiffness_error", [_stiffness_error]),
    "motor-torque": ("tau_motor_actual", MOTOR_LABELS),
}
