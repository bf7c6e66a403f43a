"""Simulated feedback linearization: errors obey the linear dynamics (33), whatever the robot."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from oracles import pinocchio
from samples.command_line import SEVEN_JOINTS
from samples.marks import slow_but
from samples.plants import all_rigid
from samples.robots import random_robot, vsa_3r
from samples.simulated import error_course, linearized_run, mixed_3r, short_motion

from vsacli import FeedbackLinearization, Gains, InitialError, Pose, load_robot, simulate

POSITION_POLES = [-18, -20, -15 + 8j, -15 - 8j]
STIFFNESS_POLES = [-14, -22]
GAINS = Gains.from_poles(POSITION_POLES, STIFFNESS_POLES)

TRACKING = 1e-7
"""Of the first error: the local errors of 1e-9 add up over some hundred steps."""


def with_tool(robot):
    return dataclasses.replace(robot, tool=Pose(xyz=(0.05, -0.1, 0.1), rpy=(0.2, -0.3, 0.4)))


def seven_joints():
    return load_robot(SEVEN_JOINTS)


CASES = {
    "3R": (vsa_3r, short_motion(3), 20.0),
    "3R under a wrench at the tool": (
        lambda: with_tool(vsa_3r()),
        short_motion(3, wrench="end_effector"),
        20.0,
    ),
    "3R under a wrench along the base": (lambda: with_tool(vsa_3r()), short_motion(3, wrench="base"), 20.0),
    "R-P chain, sides that differ": (
        lambda: random_robot("RP", seed=11),
        short_motion(2, size=0.2, stiffness=(1900, 2100)),
        30.0,
    ),
    "7R": (seven_joints, short_motion(7, duration=0.25, size=0.15, stiffness=(2300, 2400)), 25.0),
}


QUICK = {"3R", "3R under a wrench at the tool", "R-P chain, sides that differ"}


@pytest.mark.parametrize("case", slow_but(QUICK, CASES))
def test_errors_obey_the_linear_dynamics(case):
    make, trajectory, stiffness_error = CASES[case]
    robot = make()
    check_errors(robot, robot, trajectory, stiffness_error, np.ones(len(robot.joints), dtype=bool))


@pytest.mark.slow
def test_errors_obey_the_linear_dynamics_with_elastic_joints_among_others():
    check_errors(*mixed_3r(), short_motion(3), 20.0, np.array([True, False, True]))


def check_errors(robot, paired, trajectory, stiffness_error, has_stiffness):
    past, _ = linearized_run(robot, paired, trajectory, GAINS, InitialError(0.02, stiffness_error))
    probed = slice(None, None, 10)
    times = past.time[probed]
    assert times[-1] > 0.9 * trajectory.duration
    position = error_course(POSITION_POLES, 0.02, times)
    stiffness = error_course(STIFFNESS_POLES, stiffness_error, times)
    assert np.abs(past.q_error[probed] - position[:, None]).max() < TRACKING * 0.02
    off = past.stiffness_error[probed][:, has_stiffness] - stiffness[:, None]
    assert np.abs(off).max() < TRACKING * stiffness_error
    fixed = past.stiffness[:, ~has_stiffness]
    assert np.array_equal(fixed, np.full_like(fixed, 1200.0))


@pytest.mark.slow
def test_integral_action_adds_its_pole():
    position, stiffness = [*POSITION_POLES, -9], [*STIFFNESS_POLES, -11]
    past, _ = linearized_run(
        vsa_3r(), vsa_3r(), short_motion(3), Gains.from_poles(position, stiffness), InitialError(0.02, 20)
    )
    times = past.time[::10]
    expected = error_course(position, 0.02, times, integral=True)
    assert np.abs(past.q_error[::10] - expected[:, None]).max() < TRACKING * 0.02
    expected = error_course(stiffness, 20.0, times, integral=True)
    assert np.abs(past.stiffness_error[::10] - expected[:, None]).max() < TRACKING * 20


def test_computed_torque_obeys_its_linear_dynamics():
    """Without the inverse dynamics of rigid drives: the start at rest needs none."""
    robot = all_rigid("RPR", seed=3)
    past, _ = linearized_run(
        robot, random_robot("RPR", 3), short_motion(3, stiffness=(2000, 2000)),
        Gains.from_poles([-8 + 3j, -8 - 3j]), InitialError(0.05, 0),
    )  # fmt: skip
    # a rigid drive takes q' as commanded, but no q'' or q''': the error starts from (e, 0)
    expected = error_course([-8 + 3j, -8 - 3j], 0.05, past.time[::10])
    assert np.abs(past.q_error[::10] - expected[:, None]).max() < TRACKING * 0.05
    assert np.isnan(past.stiffness).all()


@pytest.mark.slow
@pytest.mark.parametrize("frame", [None, "base"])
def test_accelerations_and_jerks_are_the_derivatives_of_the_simulated_motion(frame):
    robot, trajectory = with_tool(vsa_3r()), short_motion(3, rate=1000, duration=0.4, wrench=frame)
    past, state = linearized_run(robot, robot, trajectory, GAINS, InitialError(0.02, 20))
    law = FeedbackLinearization(robot, GAINS, frame)
    wrench = trajectory.at(past.time).wrench
    link = law.law.link_motion(*law.plant.unpack_state(state), wrench)
    # Sixth-order differences over 1 ms: 1e-9 of local error over 1e-3 s, 1e-6 of the peak
    for values, derivative in ((past.dq, link.ddq), (link.ddq, link.d3q)):
        assert np.abs(difference(values, 1e-3) - derivative[3:-3]).max() < 3e-6 * np.abs(derivative).max()
    for values, derivative in ((link.tau_e, link.dtau_e), (link.stiffness, link.dstiffness)):
        assert np.abs(difference(values, 1e-3) - derivative[3:-3]).max() < 3e-6 * np.abs(derivative).max()
    assert past.ddq == pytest.approx(link.ddq, rel=1e-9, abs=1e-9)  # the same (34), programs apart


def difference(values, step):
    """First difference of sixth order at the inner samples."""
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
    count = len(values) - 6
    return sum(weight * values[k : k + count] for k, weight in enumerate(weights)) / step


@pytest.mark.parametrize("robot", [vsa_3r(), random_robot("RP", seed=11)], ids=["3R", "RP"])
def test_the_power_balance_holds(robot):
    """Kinetic, potential and elastic energy grow by what the motors give and the dampings take."""
    joints = len(robot.joints)
    trajectory = short_motion(joints, rate=1000, duration=0.4, stiffness=(1900, 2100))
    past = simulate(robot, trajectory, gains=GAINS, initial_error=InitialError(0.05, 40)).history
    model = pinocchio.build(robot)
    data = model.createData()
    links = [
        pin.computeKineticEnergy(model, data, q, dq) + pin.computePotentialEnergy(model, data, q)
        for q, dq in zip(past.q, past.dq, strict=True)
    ]
    motors = [joint.actuator.motor for joint in robot.joints]
    inertia, damping = (
        np.array([[getattr(motor, name) for motor in pair] for pair in motors])
        for name in ("inertia", "damping")
    )
    springs = sum(
        law.energy(past.phi[:, index, side])
        for index, joint in enumerate(robot.joints)
        for side, law in enumerate(joint.actuator.laws)
    )
    energy = np.array(links) + springs + (inertia * past.dtheta**2).sum(axis=(1, 2)) / 2
    friction = np.array([joint.damping for joint in robot.joints])
    power = (past.tau_motor * past.dtheta - damping * past.dtheta**2).sum(axis=(1, 2))
    power -= (friction * past.dq**2).sum(axis=1)
    # first differences of the energy over 1 ms, of sixth order: local errors of 1e-9 over 1e-3 s
    assert np.abs(difference(energy, 1e-3) - power[3:-3]).max() < 1e-5 * np.abs(power).max()
