"""Computed torques drive exported models: what is left is the error of the integrator."""

from __future__ import annotations

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.mujoco_models import driven, frame_of_wrenches

from vsacli import inverse_dynamics, load_robot, load_trajectory

pytestmark = pytest.mark.slow


def error(robot_name, trajectory_name, step):
    """Largest error of a position along the motion with steps of RK4, each of which goes over two samples."""
    robot = load_robot(REPOSITORY / "robots" / f"{robot_name}.yaml")
    file = REPOSITORY / "trajectories" / f"{trajectory_name}.yaml"
    trajectory = load_trajectory(file, robot, {"rate": 2 / step})
    result = inverse_dynamics(robot, trajectory)
    return np.abs(driven(robot, result, frame_of_wrenches(trajectory))).max()


@pytest.mark.parametrize(
    ("robot", "trajectory", "step", "largest"),
    [
        ("vsa_3r", "rest_to_rest", 0.016, 1e-6),
        ("maccepa_1r", "maccepa_1r", 0.016, 1e-5),
        ("awas_1r", "awas_1r", 0.008, 1e-6),
        ("lwr_7r_vsa", "lwr_7r", 0.002, 1e-9),
        ("mixed_3r", "mixed_3r", 0.008, 1e-6),
        ("rp_2", "rp_2", 0.004, 1e-7),
        ("compact_1r", "compact_1r", 0.008, 1e-6),
        ("tendon_1r", "tendon_1r", 0.008, 1e-6),
        ("torso_2x3r", "torso_2x3r", 0.01, 1e-6),
        ("hand_3x2r", "hand_3x2r", 0.004, 1e-6),
    ],
)
def test_the_error_falls_with_the_fourth_power_of_the_step(robot, trajectory, step, largest):
    """Half the step, a sixteenth of the error; between 12 and 22 while terms of fifth order still count.

    Steps are as long as the frequencies of springs and rotors allow RK4 to be.
    """
    coarse, fine = (error(robot, trajectory, each) for each in (step, step / 2))
    assert coarse < largest
    assert 12 < coarse / fine < 22


def test_of_a_small_step_hardly_anything_is_left():
    """1 ms; 4e-13 rad were seen."""
    assert error("vsa_3r", "rest_to_rest", 1e-3) < 1e-12
