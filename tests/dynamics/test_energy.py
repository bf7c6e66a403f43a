"""Energy: work of the motors against independent energies, accuracy of the sums, what is reported."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from oracles.kinematics import jacobian, tool_pose
from oracles.lagrange import chain_of
from samples.drives import motion
from samples.plants import all_rigid, elastic, rigid, with_actuators
from samples.robots import random_robot, vsa_3r, with_gravity
from samples.shipped import shipped_run
from samples.simulated import short_motion
from scipy.integrate import trapezoid
from scipy.interpolate import make_interp_spline

from vsacli import Flag, Result, Robot, Trajectory, inverse_dynamics
from vsacli.actuators.drivetrain import Drivetrain
from vsacli.analysis.run import Run
from vsacli.dynamics.energy import EnergyMeter, Flow
from vsacli.dynamics.losses import integrals, positive_part

REPOSITORY = Path(__file__).parents[2]

ROUNDING = 1e-8
"""Of the largest energy: Hermite's rule at 1 kHz leaves about 1e-10, rounding of 1000 terms less."""


def stiff(robot: Robot, wrench: str | None = None) -> tuple[Robot, Trajectory]:
    """Stiff enough for random links."""
    return robot, short_motion(len(robot.joints), rate=1000, stiffness=(1900, 2100), wrench=wrench)


def mixed(types: str, seed: int) -> Robot:
    """A rigid, an elastic, then antagonistic joints."""
    return with_actuators(random_robot(types, seed), {0: rigid(), 1: elastic()})


CASES = {
    "3R": lambda: shipped_run("vsa_3r", "rest_to_rest"),
    "arm with a slide": lambda: shipped_run("rp_2", "rp_2"),
    "7R": lambda: shipped_run("lwr_7r_vsa", "lwr_7r"),
    "tendons": lambda: shipped_run("tendon_1r", "tendon_1r"),
    "damped RPR": lambda: stiff(random_robot("RPR", seed=3)),
    "mixed": lambda: stiff(mixed("RPR", seed=5)),
    "rigid": lambda: stiff(all_rigid("RP", seed=4)),
    "pushed, base axes": lambda: stiff(random_robot("RP", seed=6), wrench="base"),
    "pushed, tool axes": lambda: stiff(mixed("RRP", seed=7), wrench="end_effector"),
}


def integral(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """From the first time on, by an interpolating spline of degree 7: error O(h^8)."""
    spline = make_interp_spline(time, values, k=7).antiderivative()
    return spline(time) - spline(time[0])


def constants(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Inertia and damping of the motors, (joints, 2), NaN where there is none."""
    drivetrain = Drivetrain(robot.actuators)
    return drivetrain.of_joints(drivetrain.inertia), drivetrain.of_joints(drivetrain.damping)


def energy_of_motion(robot: Robot, result: Result) -> np.ndarray:
    """Kinetic and potential energy of links and rotors, (samples,), and what the springs hold."""
    chain = chain_of(robot, (result.q, result.dq, result.ddq, result.d3q, result.d4q))
    inertia, _ = constants(robot)
    rotors = np.nansum(inertia * result.dtheta**2, axis=(1, 2)) / 2
    return chain.kinetic_energy(0) + chain.potential_energy(0) + rotors + result.elastic_energy.sum(axis=1)


def lost_power(robot: Robot, result: Result) -> np.ndarray:
    _, damping = constants(robot)
    joints = np.array([joint.damping for joint in robot.joints])
    return (joints * result.dq**2).sum(axis=1) + np.nansum(damping * result.dtheta**2, axis=(1, 2))


def wrench_power(robot: Robot, trajectory: Trajectory, result: Result) -> np.ndarray:
    if trajectory.wrench is None:
        return np.zeros(len(result.time))
    power = []
    for q, dq, wrench in zip(result.q, result.dq, result.wrench, strict=True):
        turn = np.eye(3) if trajectory.wrench.frame == "base" else tool_pose(robot, q).real[:3, :3]
        power.append((turn @ wrench.reshape(2, 3).T).T.ravel() @ jacobian(robot, q) @ dq)
    return np.array(power)


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_motors_work_is_what_moves_lifts_deflects_and_is_lost(case):
    robot, trajectory = case()
    result = inverse_dynamics(robot, trajectory)
    assert result.report.verdict == "ok"
    energy = energy_of_motion(robot, result)
    flow = lost_power(robot, result) - wrench_power(robot, trajectory, result)
    expected = energy - energy[0] + integral(result.time, flow)
    work = np.nansum(result.motor_energy, axis=(1, 2))
    scale = np.nanmax(np.abs(result.motor_energy)) + np.abs(energy).max()
    np.testing.assert_allclose(work, expected, rtol=0, atol=ROUNDING * scale)


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_energy_is_the_integral_of_power_motor_by_motor(case):
    robot, trajectory = case()
    result = inverse_dynamics(robot, trajectory)
    np.testing.assert_array_equal(result.motor_power, result.tau_motor * result.dtheta)
    for joint, side in zip(*np.nonzero(Drivetrain(robot.actuators).present), strict=True):
        work, power = result.motor_energy[:, joint, side], result.motor_power[:, joint, side]
        scale = max(np.abs(power).max() * trajectory.duration, 1e-12)
        np.testing.assert_allclose(work, integral(result.time, power), rtol=0, atol=ROUNDING * scale)
    assert np.isnan(result.motor_energy[:, ~Drivetrain(robot.actuators).present]).all()


def test_elastic_energy_is_that_of_every_spring_of_the_joint():
    robot, trajectory = stiff(mixed("RPR", seed=5))
    result = inverse_dynamics(robot, trajectory)
    stiffness = robot.joints[1].actuator.stiffness
    assert (result.elastic_energy[:, 0] == 0).all()
    expected = result.tau_e[:, 1] ** 2 / (2 * stiffness)
    np.testing.assert_allclose(result.elastic_energy[:, 1], expected, rtol=1e-12)  # rounding
    power = (result.tau_transmission * result.dphi)[:, 2].sum(axis=1)
    change = result.elastic_energy[:, 2] - result.elastic_energy[0, 2]
    peak = result.elastic_energy[:, 2].max()
    np.testing.assert_allclose(change, integral(result.time, power), rtol=0, atol=ROUNDING * peak)


def test_work_is_of_fourth_order_in_the_steps():
    robot = vsa_3r()
    exact, *coarse = (
        inverse_dynamics(robot, short_motion(3, rate=rate)).motor_energy[-1] for rate in (4000, 40, 80)
    )
    once, twice = (np.abs(work - exact).max() for work in coarse)
    assert 13 < once / twice < 19  # 2^4, and what of the next order remains


def test_integrals_are_exact_for_cubics_over_unequal_intervals():
    time = np.array([0.0, 0.3, 0.35, 1.1, 2.0])
    values, rates = time**3 - 2 * time**2 + 1, 3 * time**2 - 4 * time
    expected = np.diff(time**4 / 4 - 2 * time**3 / 3 + time)
    np.testing.assert_allclose(integrals(np.diff(time), values, rates), expected, rtol=1e-13)  # rounding


def test_positive_part_of_a_sine_is_of_third_order():
    def error(samples: int) -> float:
        time = np.linspace(0.3, 7.0, samples)  # changes sign twice, at no step
        work = -np.diff(np.cos(time))
        found = positive_part(np.diff(time), np.sin(time), work).sum()
        return abs(found - (np.cos(0.3) + 1 + 1 - np.cos(7.0)))

    coarse, fine = (max(error(samples + extra) for extra in range(40)) for samples in (200, 1600))
    assert coarse < 1e-5
    assert coarse / fine > 8**2.5


def test_no_positive_part_is_less_than_the_work():
    """Nor is anything negative taken back, however much happens between two steps."""
    power, work = np.array([-1.0, 1.0, -1.0, 1.0]), np.array([5.0, -5.0, 0.0])
    assert positive_part(np.ones(3), power, work).tolist() == [5.0, 0.25, 0.25]


def test_a_link_without_gravity_gives_all_its_energy_back():
    """Rigid and undamped: the peak of the kinetic energy is spent, then recovered."""
    robot = with_gravity(all_rigid("R", seed=2), np.zeros(3))
    robot = with_actuators(
        dataclasses.replace(robot, joints=(dataclasses.replace(robot.joints[0], damping=0.0),)),
        {0: rigid(inertia=2.5, damping=0.0)},
    )
    trajectory = short_motion(1, rate=1000)
    result = inverse_dynamics(robot, trajectory)
    energy = energy_of_motion(robot, result)
    [joint] = result.report.joints
    assert joint.energy.spent == pytest.approx(energy.max() - energy[0], rel=1e-6)  # sampled peak
    assert joint.energy.recovered == pytest.approx(joint.energy.spent, rel=1e-9)
    assert joint.energy.elastic_peak == 0
    assert math.isnan(joint.energy.co_contraction)


def test_holding_still_costs_torque_but_no_work():
    """Joint 1 of Table I under no load: the deflections and torques of equations (28)-(31) at tau_e = 0."""
    still = np.tile([0.3, -0.2, 0.5], (20, 1))
    held = Trajectory.from_samples(np.linspace(0, 2, 20), still, np.tile([850.0, 1275, 1275], (20, 1)))
    result = inverse_dynamics(vsa_3r(), held)
    base = result.report.joints[0].energy
    phi = 0.0645497  # printed digits
    assert base.co_contraction == pytest.approx(26.3578, abs=1e-4)
    assert base.elastic_peak == pytest.approx(2 * (400 * phi**2 / 2 + 2000 * phi**4 / 4), rel=1e-5)
    for joint in result.report.joints:
        # rounding of the spline: 1e-14 rad in 20 steps at 100 N m
        assert abs(joint.energy.spent) + abs(joint.energy.recovered) < 2e-11
    shoulder = result.report.joints[1].energy
    assert shoulder.load == pytest.approx(np.abs(result.tau_e[0, 1]) / 2, rel=1e-12)


def test_squared_torques_split_into_load_and_co_contraction():
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    result = inverse_dynamics(robot, trajectory)
    squared = integral(result.time, (result.tau_transmission**2).sum(axis=2))[-1]
    between = integral(result.time, np.diff(result.tau_transmission, axis=2)[..., 0] ** 2 / 2)[-1]
    for index, joint in enumerate(result.report.joints):
        split = 2 * trajectory.duration * (joint.energy.co_contraction**2 + joint.energy.load**2)
        assert split == pytest.approx(squared[index], rel=1e-6)  # the trapezoidal rule at 1 kHz
        assert joint.energy.co_contraction_share == pytest.approx(between[index] / squared[index], rel=1e-6)


def test_what_is_spent_less_what_is_recovered_is_the_work():
    result = inverse_dynamics(*shipped_run("mixed_3r", "mixed_3r"))
    for index, joint in enumerate(result.report.joints):
        work = np.nansum(result.motor_energy[-1, index])
        assert joint.energy.spent - joint.energy.recovered == pytest.approx(work, abs=1e-10)
        positive = np.fmax(result.motor_power[:, index], 0)
        spent = np.nansum(trapezoid(positive, result.time, axis=0))
        assert joint.energy.spent == pytest.approx(spent, rel=1e-5)  # the trapezoidal rule at 1 kHz


@pytest.mark.slow
def test_nothing_depends_on_the_blocks():
    robot = mixed("RPR", seed=5)
    regular = short_motion(3, rate=100, stiffness=(1900, 2100))
    whole = regular.block(0, regular.samples)
    time = whole.time + 0.003 * np.sin(7 * whole.time)  # unequal steps
    trajectory = Trajectory.from_samples(time, whole.q, whole.commanded["stiffness"])
    expected = inverse_dynamics(robot, trajectory)
    for block_samples in (1, 2, 7, len(time) - 1):
        run = Run(robot, trajectory, block_samples=block_samples)
        joined = np.concatenate([block.motor_energy for block in run])
        np.testing.assert_array_equal(joined, expected.motor_energy)
        assert run.report().as_json() == expected.report.as_json()


@pytest.mark.parametrize("joints", [1, 3])
def test_sums_do_not_depend_on_how_intervals_are_divided(joints: int):
    rng = np.random.default_rng(3)
    shapes = (), (joints, 2), (joints, 2), (joints,), (joints,)
    parts = [rng.uniform(0, 1, (*shape, 1000)) for shape in shapes]
    robot = all_rigid("R" * joints, seed=1)
    reports, works = [], []
    for ends in ([0, 1000], [0, 1, 9, 400, 401, 1000]):
        meter = EnergyMeter()
        pieces = [Flow(*(part[..., slice(*each)].copy() for part in parts)) for each in pairwise(ends)]
        works.append(np.concatenate([meter.add(piece) for piece in pieces], axis=-1))
        meter.add_stored(np.zeros((joints, 1)))
        reports.append(meter.report(robot))
    np.testing.assert_array_equal(*works)
    assert [each.spent for each in reports[0]] == [each.spent for each in reports[1]]


def test_work_is_unknown_from_the_first_missing_torque_on():
    result = inverse_dynamics(vsa_3r(), motion(stiffness=(850, 850, 830), end_stiffness=(850, 850, 790)))
    infeasible = (result.flags[:, 2] & Flag.INFEASIBLE) != 0
    first = int(infeasible.argmax())
    assert 0 < first < len(infeasible) - 1
    assert np.isfinite(result.motor_energy[:first, 2]).all()
    assert np.isnan(result.motor_energy[first:, 2]).all()
    assert np.isfinite(result.motor_energy[:, :2]).all()
    base, _, elbow = (joint["energy"] for joint in result.report.as_json()["joints"])
    assert all(math.isfinite(value) for value in base.values())
    assert math.isfinite(elbow.pop("elastic_peak"))
    assert list(elbow.values()) == [None] * 5
    assert math.isnan(result.report.joints[2].energy.spent)


def test_a_run_that_stops_at_its_first_step_has_no_energy():
    trajectory = motion(stiffness=(790, 790, 790))
    result = inverse_dynamics(vsa_3r(), trajectory, stop_on_infeasible=True)
    assert len(result.time) == 1
    assert np.isnan(result.motor_energy).all()
    assert all(math.isnan(joint.energy.spent) for joint in result.report.joints)
