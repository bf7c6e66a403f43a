"""Dampers between the links whose damping is commanded: what they add to the torques, in every dynamics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy
from samples.driven_arm import ARM, DURATION, assert_follows, motion_of, robot_of
from samples.full_model import Drive, springs_of

from vsacli import (
    Antagonistic,
    Damper,
    Elastic,
    Flag,
    Gains,
    InputError,
    Motor,
    Rigid,
    Robot,
    State,
    inverse_dynamics,
    laws,
    link_torques,
    simulate,
    state_derivative,
)
from vsacli.dynamics.dampers import damper_torque

MOTOR = Motor(inertia=0.2, damping=0.1)
ACTUATORS = [
    Antagonistic(motor=(MOTOR, MOTOR), spring=(laws.Cubic(k=400, k_c=2000),) * 2),
    Elastic(motor=MOTOR, stiffness=800),
    Rigid(motor=MOTOR),
]
STIFFNESS = [(900, 1200), (np.nan, np.nan), (np.nan, np.nan)]
BETWEEN_LINKS = Damper(location="link", range=(1, 8))
DAMPERS = [BETWEEN_LINKS, BETWEEN_LINKS, None]
DAMPING = [(2, 8), (5, 3), (np.nan, np.nan)]


def commanded(start: float, end: float, time: float) -> float:
    """The polynomial of degree 7 from rest to rest, written out."""
    x = time / DURATION
    return start + (end - start) * x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)


def arm() -> Robot:
    return robot_of(ARM, list(ACTUATORS), DAMPERS)


@pytest.mark.slow
def test_the_full_model_follows() -> None:
    def pair(q: Any, *theta: Any) -> Any:
        return sum(200 * (x - q) ** 2 + 500 * (x - q) ** 4 for x in theta)

    drives = [
        Drive(np.diag([0.2, 0.2]), [0.1, 0.1], springs_of(pair, 2), damper=lambda t: commanded(2, 8, t)),
        Drive(
            0.2,
            [0.1],
            springs_of(lambda q, theta: 400 * (theta - q) ** 2, 1),
            damper=lambda t: commanded(5, 3, t),
        ),
        Drive(0.2, [0.1]),
    ]
    result = assert_follows(ARM, list(ACTUATORS), drives, STIFFNESS, DAMPERS, DAMPING)
    np.testing.assert_array_equal(result.tau_damper[:, :2], (result.damping * result.dq)[:, :2])
    assert np.isnan(result.tau_damper[:, 2]).all()


def test_derivatives_of_the_torque() -> None:
    time = sympy.symbols("t")
    d, v = (sympy.Function(name)(time) for name in "dv")
    rows = [[each.diff(time, order) for order in range(3)] for each in (d, v)]
    for order, found in enumerate(damper_torque(*map(tuple, rows))):
        assert sympy.simplify(found - (d * v).diff(time, order)) == 0


def test_a_constant_damping_is_as_if_the_joint_had_it() -> None:
    with_it = inverse_dynamics(arm(), motion_of(STIFFNESS, [(3, 3), (2, 2), (np.nan, np.nan)]))
    without = robot_of(ARM, list(ACTUATORS))
    joints = zip(without.joints, (3, 2, 0), strict=True)
    viscous = replace(without, joints=tuple(replace(each, damping=each.damping + d) for each, d in joints))
    expected = inverse_dynamics(viscous, motion_of(STIFFNESS))
    for name in ("tau_e", "dtau_e", "ddtau_e", "tau_motor", "phi", "motor_energy"):
        wanted = getattr(expected, name)
        scale = np.nanmax(np.abs(wanted))  # sums in another order: rounding
        np.testing.assert_allclose(getattr(with_it, name), wanted, rtol=0, atol=1e-13 * scale)


def test_forward_dynamics_inverts_the_torques() -> None:
    robot, result = arm(), inverse_dynamics(arm(), motion_of(STIFFNESS, DAMPING))
    state = State(result.q, result.dq, result.theta, result.dtheta)
    rates = state_derivative(robot, state, result.tau_motor, damping=np.nan_to_num(result.damping))
    np.testing.assert_allclose(rates.ddq, result.ddq, rtol=0, atol=1e-11 * np.abs(result.ddq).max())
    least = state_derivative(robot, state, result.tau_motor)
    ones = state_derivative(robot, state, result.tau_motor, damping=np.ones_like(result.q))
    np.testing.assert_array_equal(least.ddq, ones.ddq)  # the lower end of the range


def test_link_torques_take_the_least_unless_told() -> None:
    q = np.array([[0.1, 0.2, 0.3]])
    dq = np.array([[1.0, 2.0, 3.0]])
    bare = link_torques(robot_of(ARM, list(ACTUATORS)), q, dq, 0 * q).tau_e
    np.testing.assert_allclose(link_torques(arm(), q, dq, 0 * q).tau_e - bare, [[1, 2, 0]], atol=1e-14)
    told = link_torques(arm(), q, dq, 0 * q, damping=[[3, 4, 0]]).tau_e
    np.testing.assert_allclose(told - bare, [[3, 8, 0]], atol=1e-14)
    with pytest.raises(InputError, match=r"damping must have the shape \(1, 3\) of q, not \(3,\)"):
        link_torques(arm(), q, dq, 0 * q, damping=[3, 4, 0])


@pytest.mark.parametrize("gains", [None, Gains.from_poles([-20] * 4, [-20] * 2)])
def test_simulations_follow(gains: Gains | None) -> None:
    actuators = [ACTUATORS[0], ACTUATORS[1], Elastic(motor=MOTOR, stiffness=300)]
    robot = robot_of(ARM, actuators, DAMPERS)
    simulation = simulate(robot, motion_of(STIFFNESS, DAMPING), gains=gains)
    assert simulation.report.verdict == "ok"
    past = simulation.history
    assert np.abs(past.q_error).max() < 1e-8  # the integrator's tolerance
    damped = (past.damping * past.dq)[:, :2]
    np.testing.assert_allclose(past.tau_damper[:, :2], damped, rtol=1e-12)


def test_damping_beyond_its_range_is_flagged() -> None:
    result = inverse_dynamics(arm(), motion_of(STIFFNESS, [(0.5, 9), (5, 5), (np.nan, np.nan)]))
    outside = (result.damping[:, 0] < 1 - 1e-9) | (result.damping[:, 0] > 8 + 1e-8)
    np.testing.assert_array_equal(result.flags[:, 0] == Flag.DAMPING_LIMIT, outside)
    assert not result.flags[:, 1:].any()
    assert result.report.verdict == "over_limit"
    assert result.report.joints[0].worst["damping_limit"].bound == 8


def test_what_is_not_commanded_stands_at_its_least() -> None:
    result = inverse_dynamics(arm(), motion_of(STIFFNESS))
    np.testing.assert_array_equal(result.damping[0], [1, 1, np.nan])
    (note,) = result.report.notes
    assert note == (
        "no damping is commanded, so dampers stand at the least of their ranges: "
        "joint_1 at 1 N m s/rad, joint_2 at 1 N m s/rad"
    )
