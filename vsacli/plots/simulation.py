"""The figures of a simulation: errors of position and stiffness, and the torques the motors gave."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from vsacli.plots.curves import Failures
from vsacli.plots.figures import grouped_figure, motor_label
from vsacli.plots.style import house_style
from vsacli.store.simulation import StoredSimulation
from vsacli.units import POSITION, STIFFNESS
from vsacli.variables import MOTORS, existing


def plot_simulation(simulation: StoredSimulation) -> dict[str, Figure]:
    """Draw the figures of a simulation by name, those of `SIMULATION_FIGURES`."""
    with house_style():
        failures = Failures.of(simulation)
        return {
            name: grouped_figure(simulation, failures, variable, labels)
            for name, (variable, labels) in _FIGURES.items()
            if np.any(existing(simulation.declared[variable], simulation.actuators))
        }


def _position_error(joint_type: str) -> str:
    return f"position error $q - q_d$ [{POSITION.unit(joint_type)}]"


def _stiffness_error(joint_type: str) -> str:
    return rf"stiffness error $\sigma - \sigma_d$ [{STIFFNESS.unit(joint_type)}]"


_FIGURES: dict[str, tuple[str, list[Callable[[str], str]]]] = {
    "position-error": ("q_error", [_position_error]),
    "stiffness-error": ("stiffness_error", [_stiffness_error]),
    "motor-torque": ("tau_motor_actual", [partial(motor_label, motor) for motor in MOTORS]),
}

SIMULATION_FIGURES = tuple(_FIGURES)
"""Names of the figures of a simulation."""
