"""Deflections that follow the first root by integration, against the root at each step."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.deflections import (
    ARM,
    COARSE,
    DRIFT,
    MOTOR_VARIABLES,
    dipping,
    drifts,
    integrated,
    motion,
    softened,
    softening,
)
from samples.drives import joint_with, springs, with_joint
from samples.marks import slow_but
from samples.shipped import shipped_run

from vsacli import Elastic, InputError, Motor, Robot, Trajectory, inverse_dynamics, laws
from vsacli.analysis.run import Run
from vsacli.dynamics.integrated_deflections import DeflectionEquation, integrate_deflections

TORQUE_AGREEMENT = 1e-9
"""Of the peak motor torque: a drift of 1e-11, which A^-1 magnifies up to a hundredfold at a margin of 3 %."""


def unlike(branch: str) -> tuple[Robot, Trajectory]:
    """The arm with a shoulder whose springs differ."""
    actuator = springs(laws.Cubic(k=400, k_c=2000), laws.Cubic(k=360, k_c=6000), branch)
    return with_joint(ARM, 1, joint_with(actuator)), motion(end=(1275.0, 1275.0))


def tendons() -> tuple[Robot, Trajectory]:
    """The arm with a shoulder that two exponential tendons drive."""
    tendon = laws.Exponential(c=2.0, a=12.0)
    return with_joint(ARM, 1, joint_with(springs(tendon, tendon))), motion(end=(1275.0, 1275.0))


def recorded(samples: int, noise: float = 0.0) -> Trajectory:
    """A motion of 2 s as samples of positions and stiffness, rough if noise is added."""
    time = np.linspace(0, 2, samples)
    smooth = motion(end=(1275.0, 1275.0)).at(time)
    rough = noise * np.random.default_rng(5).standard_normal(smooth.q.shape)
    return Trajectory.from_samples(time, smooth.q + rough, smooth.commanded["stiffness"], fit="interpolate")


CASES = {
    "3R": lambda: shipped_run("vsa_3r", "rest_to_rest"),
    "3R soft": lambda: shipped_run("vsa_3r", "rest_to_rest_soft"),
    "R-P": lambda: shipped_run("rp_2", "rp_2"),
    "sides differ": lambda: unlike("positive"),
    "branch negative": lambda: unlike("negative"),
    "tendons": tendons,
}


@pytest.mark.cases(2)
@pytest.mark.parametrize("case", slow_but({"sides differ"}, CASES))
def test_integration_stays_at_the_root(case: str):
    robot, trajectory = CASES[case]()
    root, result = inverse_dynamics(robot, trajectory), integrated(robot, trajectory)
    assert max(drifts(result)) == np.abs(result.phi - root.phi).max() < DRIFT
    for name in MOTOR_VARIABLES:
        expected = getattr(root, name)
        assert np.abs(getattr(result, name) - expected).max() < TORQUE_AGREEMENT * np.abs(expected).max()
    np.testing.assert_array_equal(result.flags, root.flags)
    assert result.report.verdict == "ok"


@pytest.mark.slow
def test_corridor_is_that_of_the_root():
    crossing = inverse_dynamics(ARM, softening(), deflection_solver=softened())
    root = inverse_dynamics(ARM, softening())
    for name in ("stiffness_min", "stiffness_max", "tau_e"):
        np.testing.assert_array_equal(getattr(crossing, name), getattr(root, name))


@pytest.mark.slow
def test_first_step_is_the_root_itself():
    trajectory = motion()
    start = integrate_deflections(ARM, trajectory).at(np.zeros(1))
    np.testing.assert_array_equal(start[..., 0], inverse_dynamics(ARM, trajectory).phi[0])


@pytest.mark.slow
def test_result_does_not_depend_on_the_blocks():
    trajectory = softening()
    deflections = softened()
    at_once, by_seven = (
        Run(ARM, trajectory, deflection_solver=deflections, block_samples=samples) for samples in (201, 7)
    )
    (whole,), pieces = list(at_once), list(by_seven)
    assert at_once.report().as_json() == by_seven.report().as_json()
    for name in MOTOR_VARIABLES:
        joined = np.concatenate([getattr(piece, name) for piece in pieces])
        np.testing.assert_array_equal(joined, getattr(whole, name))


def test_cost_does_not_grow_with_the_samples(monkeypatch):
    calls = []
    rates = DeflectionEquation.rates
    monkeypatch.setattr(DeflectionEquation, "rates", lambda *arguments: calls.append(0) or rates(*arguments))
    counts = []
    for rate in (100, 10_000):
        calls.clear()
        integrate_deflections(ARM, motion(rate=rate), COARSE)
        counts.append(len(calls))
    assert 0 < counts[0] == counts[1]


@pytest.mark.slow
def test_recording_is_followed_from_breakpoint_to_breakpoint():
    trajectory = recorded(21, noise=1e-3)
    result = integrated(ARM, trajectory)
    assert np.isfinite(result.phi).all()
    assert max(drifts(result)) < DRIFT


@pytest.mark.slow
def test_long_recording_drifts_a_little(monkeypatch):
    monkeypatch.setattr("vsacli.dynamics.integrated_deflections.MOST_PIECES", 20)
    smooth, rough = (integrated(ARM, recorded(101, noise)) for noise in (0.0, 1e-5))
    # A tolerance of 1e-6 of 0.1 rad a step; and steps of 0.1 s, in which a smooth motion changes little.
    assert DRIFT < max(drifts(smooth)) < 1e-9
    assert smooth.report.verdict == "ok"
    # What the spline does with the noise inside a step is seen by some of the 12 stages only.
    assert max(drifts(rough)) > 1e-9


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("floor", [800.0 * (1 + 2e-9), 800.0 + 1e-4])
def test_passing_closely_by_goes_on(floor: float):
    trajectory = dipping(floor)
    result = integrated(ARM, trajectory)
    assert result.report.drifts[0].stop is None
    # Near the fold an error of the integration grows like 1/sqrt(margin), to 3e4 times at a margin of 1e-9.
    assert drifts(result)[0] < 3e4 * DRIFT
    assert (result.phi[:, 0, 0] > result.phi[:, 0, 1]).all()


def test_only_antagonistic_joints_are_followed():
    elastic = Elastic(motor=Motor(inertia=3), stiffness=900)
    robot = with_joint(ARM, 0, dataclasses.replace(ARM.joints[0], actuator=elastic))
    root, result = inverse_dynamics(robot, motion()), integrated(robot, motion(), COARSE)
    assert [drift.joint for drift in result.report.drifts] == ["shoulder"]
    np.testing.assert_array_equal(result.phi[:, 0], root.phi[:, 0])
    assert np.isfinite(result.phi[:, 1]).all()


def test_unknown_deflections_are_refused():
    with pytest.raises(InputError, match=r"^unknown deflection solver 'integral'; valid: root, ode$"):
        inverse_dynamics(ARM, motion(), deflection_solver="integral")
