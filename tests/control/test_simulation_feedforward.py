"""Simulated feedforward: the computed torques reproduce what they were computed for."""

from __future__ import annotations

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.marks import needs_compiler
from samples.plants import elastic, rigid, with_actuators
from samples.robots import random_robot, vsa_3r
from samples.simulated import mixed_3r, short_motion
from scipy.integrate import solve_ivp

from vsacli import InitialError, Trajectory, load_robot, load_trajectory, perturbed, simulate
from vsacli.control.simulation.tabulated import Table
from vsacli.dynamics.forward import Plant
from vsacli.trajectory.times import UniformTimes

REPRODUCED = 2e-9
"""rad, and relative stiffness: 1.4e-10 was seen with every backend and the kernels of five processors, of
local errors of 1e-10 over some three hundred steps."""


@pytest.mark.parametrize("engine", ["auto", "numpy", pytest.param("c", marks=needs_compiler)])
@pytest.mark.parametrize("name", ["rest_to_rest", "rest_to_rest_soft", "rest_to_rest_stiff"])
def test_feedforward_reproduces_the_tests_of_the_paper(name, engine):
    robot = load_robot(REPOSITORY / "robots" / "vsa_3r.yaml")
    shipped = load_trajectory(REPOSITORY / "trajectories" / f"{name}.yaml", robot)
    times = UniformTimes(shipped.duration, 50)  # fewer samples; the integration is the same
    trajectory = Trajectory(times, shipped.position, shipped.commanded, name=name)
    simulation = simulate(robot, trajectory, engine=engine)
    past = simulation.history
    assert simulation.report.complete
    assert simulation.report.verdict == "ok"
    assert past.time[-1] == 4
    assert np.abs(past.q_error).max() < REPRODUCED
    assert np.abs(past.stiffness_error / past.stiffness_ref).max() < REPRODUCED


def test_feedforward_reproduces_the_motion_of_mixed_actuators():
    """An antagonistic base, an elastic shoulder and a rigid elbow."""
    robot = with_actuators(mixed_3r()[0], {2: rigid(0.5, 0.1)})
    past = simulate(robot, short_motion(3)).history
    assert np.abs(past.q_error).max() < REPRODUCED
    assert np.abs(past.stiffness_error[:, 0] / past.stiffness_ref[:, 0]).max() < REPRODUCED
    assert not past.stiffness_error[:, 1].any()
    assert (past.stiffness_ref[:, 1] == 1200).all()
    assert np.isnan(past.stiffness[:, 2]).all()
    assert np.array_equal(past.theta[:, 2, 0], past.q[:, 2])


@pytest.mark.parametrize("frame", [None, "end_effector"])
def test_feedforward_reproduces_the_motion_of_other_robots(frame):
    robot = random_robot("RPR", seed=11)
    trajectory = short_motion(3, size=0.2, stiffness=(1900, 2100), wrench=frame)
    past = simulate(robot, trajectory).history
    assert np.abs(past.q_error).max() < REPRODUCED
    assert np.abs(past.stiffness_error / past.stiffness_ref).max() < REPRODUCED
    assert past.tau_motor == pytest.approx(past.tau_motor_cmd, rel=1e-15)


def test_an_error_at_the_start_is_kept_open_loop():
    """Nothing feeds back: the error neither vanishes nor is hidden, and the run goes on."""
    simulation = simulate(vsa_3r(), short_motion(3), initial_error=InitialError(0.02, [0, 0, 0]))
    assert simulation.history.q_error[0] == pytest.approx([0.02] * 3, rel=1e-12)
    assert simulation.report.joints[0].q.peak >= 0.02
    assert simulation.report.complete


@pytest.mark.slow
def test_the_course_does_not_depend_on_the_model_of_a_perfect_controller():
    robot, trajectory = vsa_3r(), short_motion(3)
    assert perturbed(robot, 0.0, seed=3) == robot
    off = simulate(robot, trajectory, model=perturbed(robot, 0.05, seed=3)).report
    assert max(joint.q.peak for joint in off.joints) > 1e-3
    assert simulate(robot, trajectory, model=perturbed(robot, 0.05, seed=3)).report == off
    assert simulate(robot, trajectory, model=perturbed(robot, 0.05, seed=4)).report != off


def test_an_elastic_drive_comes_down_to_a_rigid_one():
    """From the same state under the same torque, q differs by what 1/K leaves."""
    robot = random_robot("R", seed=5)
    stiffness = np.array([1e4, 1e5, 1e6])
    torque, duration = 9.0, 0.1
    drive = rigid(2.0, 0.3)
    exact = fall(with_actuators(robot, {0: drive}), torque, duration, None)
    errors = [
        abs(fall(with_actuators(robot, {0: elastic(constant, 2.0, 0.3)}), torque, duration, constant) - exact)
        for constant in stiffness
    ]
    assert errors[0] < 0.1 * abs(exact - 0.4)
    # the residual oscillation, of amplitude 1/K too, has another phase for each K
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx([10, 10], rel=0.5)


def fall(robot, torque, duration, stiffness):
    """q after a time from rest at q = 0.4, an elastic drive stretched as its link will demand."""
    plant = Plant(robot)
    q, still = np.array([0.4]), np.zeros(1)
    matrix, bias = plant.links.mass_matrix(q)[0], plant.links.bias(q, still, None)
    demand = matrix * (torque - bias) / (matrix + 2.0) + bias  # M q'' + n, with (M + B) q'' = tau - n
    theta = np.empty(0) if stiffness is None else q + demand / stiffness
    parts = len(theta)

    def rates(_time, y):
        state = y[:1], y[1:2], y[2 : 2 + parts], y[2 + parts :]
        ddq, ddtheta, _ = plant.accelerations(*state, np.array([torque]), None, {})
        return np.concatenate((state[1], ddq, state[3], ddtheta))

    start = np.concatenate((q, still, theta, np.zeros(parts)))
    solution = solve_ivp(rates, (0, duration), start, method="DOP853", rtol=1e-10, atol=1e-12)
    return solution.y[0, -1]


def test_a_table_of_a_function_is_as_good_as_the_function():
    ends = np.array([0.0, 0.3, 2.0])

    def function(time):
        kink = np.where(time < 0.3, np.sin(40 * time), np.sin(12.0) + np.exp(-60 * (time - 0.3)) - 1)
        return np.stack((kink, 1 / (0.001 + (time - 1) ** 2)), axis=1)

    table = Table.of(function, ends)
    times = np.linspace(0, 2, 4001)
    error = np.abs(table(times) - function(times))
    # the tolerance of the table, relative to the peaks 2 and 1000, in the places its probes do not look at
    assert (error.max(axis=0) < np.array([2, 1000]) * 1e-11).all()
    assert table(0.7) == pytest.approx(function(np.array([0.7]))[0], rel=1e-10)
    assert table.first_undefined is None


def test_a_table_says_where_its_function_ends():
    def function(time):
        return np.stack((time, np.where(time <= 0.97, np.sin(time), np.nan)), axis=1)

    time, column = Table.of(function, np.array([0.0, 2.0])).first_undefined
    assert column == 1
    assert 0.97 - 2 / 32 / 1024 < time <= 0.97  # the smallest cell


def test_noise_of_a_function_is_not_resolved():
    noise = np.random.default_rng(0)
    table = Table.of(
        lambda time: np.sin(time)[:, None] + noise.normal(0, 1e-9, (len(time), 1)), np.array([0.0, 1.0])
    )
    assert len(table.coefficients) <= 128
