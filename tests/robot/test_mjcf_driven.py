"""Computed torques drive exported models: what is left is the error of the integrator."""

from __future__ import annotations

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.marks import slow
from samples.mujoco_models import driven

from vsacli import inverse_dynamics, load_robot, load_trajectory

COARSE, FINE = 0.016, 0.008
"""Steps, s, of RK4; each goes over two samples."""


def error(robot_name, trajectory_name, step):
    """Largest error of a position along the motion."""
    robot = load_robot(REPOSITORY / "robots" / f"{robot_name}.yaml")
    file = REPOSITORY / "trajectories" / f"{trajectory_name}.yaml"
    trajectory = load_trajectory(file, robot, {"rate": 2 / step})
    return np.abs(driven(robot, inverse_dynamics(robot, trajectory))).max()


@pytest.mark.parametrize(
    ("robot", "trajectory", "largest"),
    [
        ("vsa_3r", "rest_to_rest", 1e-7),
        ("maccepa_1r", "maccepa_1r", 1e-5),
        slow("awas_1r", "awas_1r", 1e-5),
        slow("lwr_7r_vsa", "lwr_7r", 1e-5),
        slow("mixed_3r", "mixed_3r", 1e-5),
        slow("rp_2", "rp_2", 1e-5),
        slow("compact_1r", "compact_1r", 1e-5),
        slow("tendon_1r", "tendon_1r", 1e-5),
    ],
)
def test_the_error_falls_with_the_fourth_power_of_the_step(robot, trajectory, largest):
    """Half the step, a sixteenth of the error; between 12 and 22 while terms of fifth order still count."""
    coarse, fine = (error(robot, trajectory, step) for step in (COARSE, FINE))
    assert coarse < largest
    assert 12 < coarse / fine < 22


@pytest.mark.slow
def test_of_a_small_step_hardly_anything_is_left():
    """1 ms; 4e-13 rad were seen."""
    assert error("vsa_3r", "rest_to_rest", 1e-3) < 1e-12
