"""Forward dynamics: mass matrix and accelerations against Pinocchio, the recursion and closed forms."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from oracles import pinocchio
from samples.plants import all_rigid, elastic, random_state, rigid, torques_of, with_actuators
from samples.robots import random_robot, still_joint, vsa_3r
from samples.trees import finger, hand, reordered

from vsacli import (
    DenavitHartenberg,
    Inertia,
    InputError,
    Joint,
    Link,
    Pose,
    Robot,
    State,
    Wrench,
    link_torques,
    mass_matrix,
    state_derivative,
)

NOTHING = Link(mass=0, com=(0, 0, 0), inertia=Inertia(xx=0, yy=0, zz=0))

CHAINS = ["R", "RRR", "RPRP", "PPP", "RRRRRRR"]

EXACT = 1e-12
"""Relative to the largest entry: two different sums of some hundred terms, each good to 1e-16."""


def relative(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize("types", CHAINS)
def test_the_mass_matrix_is_that_of_pinocchio(types):
    robot = random_robot(types, seed=3)
    model = pinocchio.build(robot)
    data = model.createData()
    q = np.random.default_rng(1).uniform(-3, 3, (5, len(types)))
    expected = [pin.crba(model, data, row).copy() for row in q]
    expected = np.array([np.triu(matrix) + np.triu(matrix, 1).T for matrix in expected])
    assert relative(mass_matrix(robot, q), expected) < EXACT


def test_one_configuration_gives_what_a_block_gives():
    robot = random_robot("RPRP", seed=3)
    state, torque = random_state(robot, 4, seed=1), np.full((4, 4, 2), 7.0)
    block = state_derivative(robot, state, torque)
    alone = state_derivative(robot, State(*(part[2] for part in vars(state).values())), torque[2])
    assert mass_matrix(robot, state.q[2]) == pytest.approx(mass_matrix(robot, state.q)[2], rel=1e-14)
    for found, expected in zip(alone, block, strict=True):
        # math.cos and numpy.cos may differ by rounding, which M^-1 magnifies by its condition, some 1e2
        assert found == pytest.approx(expected[2], rel=1e-12)


@pytest.mark.parametrize("types", CHAINS)
def test_accelerations_invert_the_recursion(types):
    robot = random_robot(types, seed=5)
    state = random_state(robot, 6, seed=2)
    rates = state_derivative(robot, state, np.zeros((6, len(types), 2)))
    tau_e = torques_of(robot, state.q, state.dq, rates.ddq)
    laws = [joint.actuator.laws for joint in robot.joints]
    phi = state.theta - state.q[..., None]
    springs = np.array(
        [[law.torque(phi[:, k, side]) for side, law in enumerate(pair)] for k, pair in enumerate(laws)]
    )
    assert relative(tau_e, springs.sum(axis=1).T) < 1e-11  # EXACT, times the condition of small chains' M


@pytest.mark.parametrize("frame", ["base", "end_effector"])
def test_a_wrench_acts_on_the_accelerations(frame):
    tool = Pose(xyz=(0.1, -0.2, 0.3), rpy=(0.4, 0.2, -0.5))
    robot = dataclasses.replace(random_robot("RPR", seed=8), tool=tool)
    state, rng = random_state(robot, 3, seed=2), np.random.default_rng(4)
    wrench = Wrench(*rng.uniform(-50, 50, (3, 3, 6)), frame=frame)
    zero = np.zeros((3, 3, 2))
    rates, free = state_derivative(robot, state, zero, wrench), state_derivative(robot, state, zero)
    none = np.zeros_like(state.q)
    tau_e = link_torques(robot, state.q, state.dq, rates.ddq, none, none, wrench=wrench)[0]
    assert relative(tau_e, torques_of(robot, state.q, state.dq, free.ddq)) < 1e-11
    assert relative(rates.ddq, free.ddq) > 0.01


def test_rigid_drives_are_a_chain_with_armature():
    robot = all_rigid("RPRR", seed=2)
    model = pinocchio.build(robot)
    model.armature = np.array([1.0, 2.0, 3.0, 4.0])
    data = model.createData()
    state, torque = random_state(robot, 5, seed=3), np.zeros((5, 4, 2))
    torque[..., 0] = np.random.default_rng(1).uniform(-60, 60, (5, 4))
    damping = 0.2 + np.array([joint.damping for joint in robot.joints])
    load = torque[..., 0] - damping * state.dq
    expected = [pin.aba(model, data, *row).copy() for row in zip(state.q, state.dq, load, strict=True)]
    rates = state_derivative(robot, state, torque)
    assert relative(rates.ddq, np.array(expected)) < 1e-11  # EXACT, times the condition of M
    assert np.array_equal(rates.ddtheta[..., 0], rates.ddq)
    assert np.isnan(rates.ddtheta[..., 1]).all()


def test_a_mixture_obeys_each_actuator():
    robot = with_actuators(random_robot("RRP", seed=4), {0: elastic(700.0, 2.5, 0.3), 2: rigid(1.5, 0.4)})
    state, torque = random_state(robot, 4, seed=3), np.random.default_rng(2).uniform(-50, 50, (4, 3, 2))
    rates = state_derivative(robot, state, torque)
    tau_e = torques_of(robot, state.q, state.dq, rates.ddq)
    stretch = state.theta[:, 0, 0] - state.q[:, 0]
    assert tau_e[:, 0] == pytest.approx(700 * stretch, rel=1e-10)
    assert 2.5 * rates.ddtheta[:, 0, 0] == pytest.approx(
        torque[:, 0, 0] - 0.3 * state.dtheta[:, 0, 0] - 700 * stretch, rel=1e-12
    )
    left_by_rotor = torque[:, 2, 0] - 1.5 * rates.ddq[:, 2] - 0.4 * state.dq[:, 2]
    assert tau_e[:, 2] == pytest.approx(left_by_rotor, rel=1e-10)  # sums of the size of M, condition 1e2
    assert np.isnan(rates.ddtheta[:, [0, 2], 1]).all()


def test_a_pendulum_on_a_spring_in_closed_form():
    link = Link(mass=2.0, com=(-0.1, 0, 0), inertia=Inertia(xx=0.01, yy=0.02, zz=0.03))
    joint = Joint(
        name="only", type="revolute", dh=DenavitHartenberg(a=0.4, alpha=0), link=link, damping=0.5,
        actuator=elastic(300.0, 1.5, 0.2),
    )  # fmt: skip
    robot = Robot(name="pendulum", gravity=(0, -9.81, 0), joints=(joint,))
    q, dq, theta, dtheta, torque = 0.7, 1.1, 0.75, -0.4, 12.0
    state = State(np.array([q]), np.array([dq]), np.array([[theta, 0]]), np.array([[dtheta, 0]]))
    rates = state_derivative(robot, state, [[torque, 0]])
    gravity = 2.0 * 9.81 * 0.3 * np.cos(q)
    inertia = 0.03 + 2.0 * 0.3**2
    assert rates.ddq[0] == pytest.approx((300 * (theta - q) - gravity - 0.5 * dq) / inertia, rel=1e-13)
    assert rates.ddtheta[0, 0] == pytest.approx((torque - 0.2 * dtheta - 300 * (theta - q)) / 1.5, rel=1e-13)


@pytest.mark.parametrize(("at", "named"), [(3, "joint tip"), (2, "joint elbow")])
def test_a_joint_that_moves_no_mass_is_named(at, named):
    robot = vsa_3r()
    joints = list(robot.joints)
    if at == 3:
        joints.append(still_joint("tip"))
    else:
        joints[2] = dataclasses.replace(joints[2], link=NOTHING)
    robot = dataclasses.replace(robot, joints=tuple(joints))
    state = random_state(robot, 2, seed=1)
    with pytest.raises(
        InputError, match=f"^{named}: the inertia it moves is not positive .leading minor {len(joints)}"
    ):
        state_derivative(robot, state, np.zeros((2, len(joints), 2)))


def test_branches_without_mass_are_named_in_any_order():
    """Two of three fingers end in joints without mass; alone, such a finger names the same joint."""
    tips = ("finger_0_joint_1", "finger_2_joint_1")
    whole = hand(3, 2, palm=False)
    robot = dataclasses.replace(whole, joints=tuple(map(partial(_weightless, tips), whole.joints)))
    for ordered in (robot, reordered(robot, 1)):
        assert _named_as_massless(ordered) == set(tips)
    assert _named_as_massless(finger(robot, 0)) == {tips[0]}
    palm = hand(3, 2)
    robot = dataclasses.replace(palm, joints=tuple(map(partial(_weightless, tips), palm.joints)))
    for ordered in (robot, reordered(robot, 1)):
        assert _named_as_massless(ordered) == set(tips)


def _weightless(names: tuple[str, ...], joint: Joint) -> Joint:
    return dataclasses.replace(joint, link=NOTHING) if joint.name in names else joint


def _named_as_massless(robot: Robot) -> set[str]:
    state = random_state(robot, 2, seed=1)
    with pytest.raises(InputError, match="the inertia it moves is not positive") as raised:
        state_derivative(robot, state, np.zeros((2, len(robot.joints), 2)))
    return {problem.message.split()[1].rstrip(":") for problem in raised.value.problems}


@pytest.mark.parametrize(
    ("changes", "torque", "message"),
    [
        ({"q": np.zeros(2)}, (3, 2), r"q must have the shape \(3\) or \(samples, 3\), not \(2,\)"),
        ({"theta": np.zeros((3, 3))}, (3, 2), r"theta must have the shape \(3, 2\) or \(samples, 3, 2\)"),
        ({"dq": np.zeros((4, 3))}, (3, 2), "must have the same number of samples"),
        ({}, (2, 3), r"tau_motor must have the shape \(3, 2\)"),
    ],
)
def test_shapes_that_do_not_fit_are_refused(changes, torque, message):
    state = State(np.zeros(3), np.zeros(3), np.zeros((3, 2)), np.zeros((3, 2)))
    with pytest.raises(InputError, match=message):
        state_derivative(vsa_3r(), dataclasses.replace(state, **changes), np.zeros(torque))
