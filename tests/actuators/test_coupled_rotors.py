"""Motors that ride on one another: B is a full matrix, in inverse and forward dynamics, and in energy."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.driven_arm import ARM, LINK, assert_follows, motion_of, robot_of
from samples.full_model import Drive
from samples.mechanisms import DAMPING, DEVICES, INERTIA
from scipy.integrate import simpson

from vsacli import (
    Gains,
    InitialError,
    InputError,
    Motor,
    Result,
    Rigid,
    Serial,
    State,
    inverse_dynamics,
    simulate,
    state_derivative,
)

DEVICE = DEVICES["awas"]
COUPLING = -0.05
"""kg m^2; two thirds of what the rotors' inertias admit."""

COUPLED = dataclasses.replace(DEVICE.actuator, coupled_inertia=COUPLING)
MATRIX = [[INERTIA[0], COUPLING], [COUPLING, INERTIA[1]]]
DRIVE = Drive(MATRIX, DAMPING, DEVICE.springs)


def run(actuator: Serial = COUPLED) -> Result:
    return inverse_dynamics(robot_of(LINK, [actuator]), motion_of([DEVICE.stiffness]))


@pytest.mark.slow
def test_the_full_model_follows() -> None:
    rigid = Rigid(motor=Motor(inertia=0.2, damping=0.1)), Drive(0.2, [0.1]), (np.nan, np.nan)
    cases = [(COUPLED, DRIVE, (300, 700)), rigid, (DEVICE.actuator, DEVICE.drive, (500, 400))]
    actuators, drives, stiffness = map(list, zip(*cases, strict=True))
    assert_follows(ARM, actuators, drives, stiffness)


def test_gear_ratios_reflect_it_with_their_signs() -> None:
    """Shaft inertias b_k and coupling b_12 behind the ratios n_k: B_k = n_k^2 b_k, B_12 = n_1 n_2 b_12."""
    ratios = (50.0, -20.0)
    motors = tuple(
        Motor(inertia=b / n**2, damping=d / n**2, gear_ratio=n, side="shaft")
        for b, d, n in zip(INERTIA, DAMPING, ratios, strict=True)
    )
    geared = dataclasses.replace(COUPLED, motor=motors, coupled_inertia=COUPLING / (ratios[0] * ratios[1]))
    np.testing.assert_allclose(run(geared).tau_motor, run().tau_motor, rtol=1e-12)  # products round


@pytest.mark.parametrize("coupling", [0.08, -0.08, np.sqrt(0.3 * 0.02)])
def test_an_inertia_that_no_rotors_have_is_refused(coupling: float) -> None:
    with pytest.raises(InputError, match=r"coupled_inertia: is .* positive definite"):
        dataclasses.replace(DEVICE.actuator, coupled_inertia=coupling)


def test_forward_dynamics_return_the_accelerations() -> None:
    result = run()
    rates = state_derivative(
        result.robot, State(result.q, result.dq, result.theta, result.dtheta), result.tau_motor
    )
    # the springs' torques at theta - q round to 1e-16 of theta times the stiffness, over the smallest inertia
    np.testing.assert_allclose(rates.ddtheta, result.ddtheta, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rates.ddq, result.ddq, rtol=0, atol=1e-9)


def test_feedback_linearization_lets_errors_decay() -> None:
    simulation = simulate(
        robot_of(LINK, [COUPLED]),
        motion_of([DEVICE.stiffness]),
        gains=Gains.from_poles([-40] * 4, [-40] * 2),
        initial_error=InitialError(q=0.01),
    )
    error = simulation.history.q_error[:, 0]
    assert error[0] == pytest.approx(0.01)
    # four poles at -40: exp(-x) (1 + x + x^2/2 + x^3/6) after x = 20
    assert abs(error[-1]) == pytest.approx(0.01 * np.exp(-20) * (1 + 20 + 200 + 8000 / 6), rel=0.01)


def test_the_work_of_each_motor_is_the_integral_of_its_power() -> None:
    result = run()
    power = result.tau_motor[:, 0] * result.dtheta[:, 0]
    work = [simpson(power[: n + 1], x=result.time[: n + 1], axis=0) for n in (200, 500, 1000)]
    # both rules err by the fourth power of the step, 5e-4 s, over the time in which the power changes, 0.05 s
    np.testing.assert_allclose(result.motor_energy[[200, 500, 1000], 0], work, rtol=0, atol=1e-7)
    kinetic = np.einsum("ti,ij,tj->t", result.dtheta[:, 0], MATRIX, result.dtheta[:, 0]) / 2
    lost = simpson(np.sum(result.dtheta[:, 0] ** 2 * DAMPING, axis=1), x=result.time)
    to_link = simpson(result.tau_e[:, 0] * result.dq[:, 0], x=result.time)
    stored = np.ptp(kinetic[[0, -1]]) + result.elastic_energy[-1, 0] - result.elastic_energy[0, 0]
    assert result.motor_energy[-1, 0].sum() == pytest.approx(stored + lost + to_link, abs=1e-7)
