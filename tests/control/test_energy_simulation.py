"""Energy of a simulated motion: what the motors did, against independent energies of what moved."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
from oracles.lagrange import chain_of
from samples.marks import slow
from samples.plants import all_rigid
from samples.robots import random_robot, vsa_3r
from samples.simulated import mixed_3r, short_motion
from scipy.interpolate import make_interp_spline

from vsacli import Gains, InitialError, Robot, inverse_dynamics, simulate
from vsacli.actuators.drivetrain import Drivetrain
from vsacli.control.simulation.history import History

GAINS = Gains.from_poles([-20.0] * 4, [-20.0] * 2)


def balance(robot: Robot, past: History) -> np.ndarray:
    """Energy of links, rotors and springs less its start, and all that was lost until then, (samples,)."""
    still = np.zeros_like(past.q)
    chain = chain_of(robot, (past.q, past.dq, still, still, still))
    drivetrain = Drivetrain(robot.actuators)
    dtheta = drivetrain.of_motors(past.dtheta)
    rotors = (drivetrain.inertia * dtheta**2).sum(axis=1) / 2
    energy = chain.kinetic_energy(0) + chain.potential_energy(0) + rotors
    energy = energy + past.elastic_energy.sum(axis=1)
    friction = np.array([joint.damping for joint in robot.joints])
    lost = (friction * past.dq**2).sum(axis=1) + (drivetrain.damping * dtheta**2).sum(axis=1)
    spline = make_interp_spline(past.time, lost, k=3).antiderivative()
    return energy - energy[0] + spline(past.time) - spline(past.time[0])


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("robot", "gains"),
    [
        (vsa_3r(), GAINS),
        (random_robot("RP", seed=11), GAINS),
        (mixed_3r()[0], GAINS),
        (all_rigid("RP", seed=4), Gains.from_poles([-20.0] * 2)),
    ],
    ids=["3R", "RP", "elastic shoulder", "rigid"],
)
@pytest.mark.parametrize("feedback", ["state", slow("positions")])
def test_the_motors_work_is_what_moves_lifts_deflects_and_is_lost(robot, gains, feedback):
    trajectory = short_motion(len(robot.joints), rate=1000, duration=0.3, stiffness=(1900, 2100))
    error = InitialError(0.02)
    past = simulate(robot, trajectory, gains=gains, initial_error=error, feedback=feedback).history
    work = np.nansum(past.motor_energy, axis=(1, 2))
    scale = np.nanmax(np.abs(past.motor_energy))
    # torques linear over 1 ms: (20 1/s * 1e-3 s)^2/12 = 3e-5 of what passes, twice; held ones are exact, and
    # what remains is the spline through losses whose slope jumps with the torques
    tolerance = 1e-4 if feedback == "state" else 2e-6
    np.testing.assert_allclose(work, balance(robot, past), rtol=0, atol=tolerance * scale)


def test_feedforward_spends_what_the_inverse_dynamics_says():
    robot, _ = mixed_3r()
    trajectory = short_motion(3, rate=1000)
    commanded = inverse_dynamics(robot, trajectory)
    simulation = simulate(robot, trajectory)
    past = simulation.history
    scale = np.nanmax(np.abs(commanded.motor_energy))
    # torques taken for linear over 1 ms, (1e-3/0.8)^2 of the work
    np.testing.assert_allclose(past.motor_energy, commanded.motor_energy, rtol=0, atol=2e-6 * scale)
    for was, planned in zip(simulation.report.joints, commanded.report.joints, strict=True):
        found, expected = (astuple(each.energy)[:5] for each in (was, planned))  # without losses
        assert found == pytest.approx(expected, rel=1e-5, nan_ok=True)
    [energy] = [line for line in str(simulation.report).splitlines() if line.startswith("energy: ")]
    assert f"springs store up to {max(past.elastic_energy.max(axis=0)):.1f} J" in energy
