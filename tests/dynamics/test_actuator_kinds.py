"""Rigid, elastic and antagonistic joints: each against another route, and mixed in one chain."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from oracles.pinocchio import build
from samples.plants import all_rigid, elastic, rigid, with_actuators
from samples.robots import MotionArrays, random_motion, random_robot, robot_of_ones
from samples.signals import by_name

from vsacli import (
    Antagonistic,
    DenavitHartenberg,
    Elastic,
    Flag,
    Inertia,
    Joint,
    Limits,
    Link,
    Motion,
    Motor,
    Robot,
    laws,
    motor_torques,
)
from vsacli.actuators.transmission import Command
from vsacli.base.variables import VARIABLES, Block
from vsacli.dynamics.drive import drive

NAN = np.nan
OF_MOTORS = ("phi", "dphi", "theta", "dtheta", "ddtheta", "tau_transmission", "tau_motor", "motor_power")
OF_STIFFNESS = ("stiffness", "dstiffness", "ddstiffness")
OF_CORRIDOR = ("det_A", "stiffness_min", "stiffness_max")


def computed(robot: Robot, motion: MotionArrays, stiffness: float = NAN) -> Block:
    """A block of unrelated steps at a constant stiffness."""
    sigma = np.full_like(motion[0], stiffness)
    rates = np.zeros_like(sigma)
    return motor_torques(robot, Motion(np.arange(float(len(sigma))), *motion, by_name(sigma, rates, rates)))


def gentle(robot: Robot, samples: int, seed: int) -> MotionArrays:
    """Random instants slow enough that antagonistic joints carry their torques at 2000 N m/rad."""
    q, *rates = random_motion(robot, samples, seed)
    dq, ddq, d3q, d4q = (rate / 20**order for order, rate in enumerate(rates, start=1))
    return q, dq, ddq, d3q, d4q


def assert_near(found: np.ndarray, expected: np.ndarray, relative: float = 1e-12) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * np.abs(expected).max())


# Each kind by itself


def test_an_elastic_pendulum_is_its_closed_form() -> None:
    """m g l cos q + J q'' + D q' on the link side, derived twice by hand."""
    mass, length, central, damping, gravity = 2.0, 0.6, 0.05, 0.4, 9.81
    spring = elastic(stiffness=300.0, inertia=1.5, damping=0.2)
    link = Link(mass=mass, com=(length, 0, 0), inertia=Inertia(xx=0.05, yy=0.05, zz=central))
    pendulum = Joint(
        name="pendulum",
        type="revolute",
        dh=DenavitHartenberg(a=0, alpha=0),
        link=link,
        damping=damping,
        actuator=spring,
    )
    robot = Robot(name="pendulum", gravity=(0, -gravity, 0), joints=(pendulum,))
    time = np.linspace(0, 3, 50)[:, None]
    q, dq, ddq, d3q, d4q = (0.8 * 2.5**k * np.sin(2.5 * time + k * np.pi / 2) for k in range(5))
    block = computed(robot, (q, dq, ddq, d3q, d4q))

    about_axis, weight = central + mass * length**2, mass * gravity * length
    tau_e = about_axis * ddq + damping * dq + weight * np.cos(q)
    dtau_e = about_axis * d3q + damping * ddq - weight * np.sin(q) * dq
    ddtau_e = about_axis * d4q + damping * d3q - weight * (np.cos(q) * dq**2 + np.sin(q) * ddq)
    expected = {"phi": tau_e / 300, "dphi": dtau_e / 300, "tau_transmission": tau_e}
    expected |= {"theta": q + tau_e / 300, "dtheta": dq + dtau_e / 300, "ddtheta": ddq + ddtau_e / 300}
    expected["tau_motor"] = 1.5 * expected["ddtheta"] + 0.2 * expected["dtheta"] + tau_e
    for name, values in expected.items():
        assert_near(getattr(block, name)[..., 0], values)  # a dozen roundings of the largest term


@pytest.mark.parametrize("types", ["R", "RPR", "PRRP", "RRRRRR"])
def test_a_rigid_chain_is_the_one_of_pinocchio_with_rotors(types: str) -> None:
    robot = all_rigid(types, seed=len(types))
    q, dq, ddq, d3q, d4q = random_motion(robot, 20, seed=5)
    model = build(robot)
    model.armature = np.array([joint.actuator.motor.inertia for joint in robot.joints])
    damping = np.array([joint.damping + joint.actuator.motor.damping for joint in robot.joints])
    data = model.createData()
    rows = [pin.rnea(model, data, *row).copy() for row in zip(q, dq, ddq, strict=True)]
    block = computed(robot, (q, dq, ddq, d3q, d4q))
    assert_near(block.tau_motor[..., 0], np.array(rows) + damping * dq)  # both recursions round alike
    np.testing.assert_array_equal(block.phi[..., 0], 0)
    np.testing.assert_array_equal(block.dphi[..., 0], 0)
    np.testing.assert_array_equal(block.tau_transmission[..., 0], block.tau_e)
    for motor, joint in zip(("theta", "dtheta", "ddtheta"), (q, dq, ddq), strict=True):
        np.testing.assert_array_equal(getattr(block, motor)[..., 0], joint)


def test_an_elastic_chain_becomes_rigid_as_its_springs_stiffen() -> None:
    robot = random_robot("RPR", seed=3)
    motion = gentle(robot, 20, seed=4)

    def torques(kind: Elastic | None) -> np.ndarray:
        actuators = dict.fromkeys(range(3), kind or rigid())
        return computed(with_actuators(robot, actuators), motion).tau_motor[..., 0]

    def away(stiffness: float) -> float:
        return float(np.abs(torques(elastic(stiffness=stiffness)) - torques(None)).max())

    # B tau_e''/K + Dm tau_e'/K is exactly inverse in K, up to rounding of the torques
    assert away(1e7) == pytest.approx(away(1e5) / 100, rel=1e-4)
    assert away(1e13) < 1e-6


def test_a_pair_of_quadratic_springs_is_an_elastic_joint() -> None:
    """Springs of any k at a constant stiffness: only their motors add up."""
    sigma = 700.0
    motor = Motor(inertia=1.7, damping=0.3)
    pair = Antagonistic(motor=(motor, motor), spring=(laws.Quadratic(k=900), laws.Quadratic(k=900)))
    spring = elastic(stiffness=sigma, inertia=2 * motor.inertia, damping=2 * motor.damping)
    joint = random_robot("R", seed=1).joints[0]
    rng = np.random.default_rng(2)
    rows = rng.uniform(-1, 1, (6, 200)) * np.array([[2], [3], [20], [100], [900], [9000]])
    q, dq, ddq, tau_e, dtau_e, ddtau_e = rows  # |tau_e| up to sigma^2/(4 k) = 136 N m can be carried
    still = np.zeros_like(q)
    command = Command(q, dq, ddq, tau_e, dtau_e, ddtau_e, by_name(still + sigma, still, still))
    two, one = (drive(dataclasses.replace(joint, actuator=actuator), command) for actuator in (pair, spring))
    assert not two.flags.any()
    # 1e-11: the accelerations of the two sides are larger than their mean
    for name in ("phi", "theta", "dtheta", "ddtheta"):
        assert_near(getattr(two, name).mean(axis=0), getattr(one, name)[0], relative=1e-11)
    assert_near(two.tau_motor.sum(axis=0), one.tau_motor[0], relative=1e-11)


# Mixed


KINDS = {
    "antagonistic": {},
    "elastic": dict.fromkeys(range(3), elastic()),
    "rigid": dict.fromkeys(range(3), rigid()),
}
MIXED = {1: elastic(), 2: rigid()}


def test_each_joint_of_a_mixed_chain_is_that_of_a_chain_of_its_kind() -> None:
    robot = robot_of_ones("RPR")
    motion = gentle(robot, 30, seed=8)
    mixed = computed(with_actuators(robot, MIXED), motion, 2000.0)
    for joint, actuators in enumerate(KINDS.values()):
        alone = computed(with_actuators(robot, actuators), motion, 2000.0)
        for name, array in mixed.arrays().items():
            if "joint" in VARIABLES[name].dims:
                np.testing.assert_array_equal(array[:, joint], getattr(alone, name)[:, joint], err_msg=name)


def test_what_a_joint_does_not_have_is_nan_and_nothing_else() -> None:
    robot = robot_of_ones("RRR")
    block = computed(with_actuators(robot, MIXED), gentle(robot, 5, seed=8), 2000.0)
    absent = {(name, joint, 1) for name in OF_MOTORS for joint in (1, 2)}
    absent |= {(name, joint, 0) for name in OF_CORRIDOR for joint in (1, 2)}
    absent |= {(name, 2, 0) for name in OF_STIFFNESS}
    found = set()
    for name, array in block.arrays().items():
        if "joint" in VARIABLES[name].dims:
            columns = np.isnan(array).reshape(5, 3, -1)
            assert (columns.all(axis=0) == columns.any(axis=0)).all()
            found |= {(name, joint, column) for joint, column in np.argwhere(columns[0]).tolist()}
    assert found == absent
    np.testing.assert_array_equal(block.stiffness[:, 1], elastic().stiffness)
    np.testing.assert_array_equal(block.dstiffness[:, 1], 0)
    np.testing.assert_array_equal(block.ddstiffness[:, 1], 0)


def test_an_infeasible_joint_leaves_its_neighbors_alone() -> None:
    robot = with_actuators(robot_of_ones("RRR"), MIXED)
    motion = gentle(robot, 5, seed=8)
    block, soft = computed(robot, motion, 2000.0), computed(robot, motion, 1.0)
    assert (soft.flags == [[Flag.INFEASIBLE, 0, 0]]).all()
    assert np.isnan(soft.tau_motor[:, 0]).all()
    np.testing.assert_array_equal(soft.tau_motor[:, 1:], block.tau_motor[:, 1:])


# Limits


def limited(actuator: object, **limits: object) -> int:
    """All bits of a joint that moves at 0.5 rad/s and carries 30 N m."""
    joint = dataclasses.replace(
        random_robot("R", seed=1).joints[0], actuator=actuator, limits=Limits(**limits)
    )
    values = np.array([[0.1], [0.5], [0.0], [30.0], [0.0], [0.0], [NAN], [NAN], [NAN]])
    return int(drive(joint, Command(*values[:6], by_name(*values[6:]))).flags[0])


@pytest.mark.parametrize("kind", [elastic(stiffness=900.0), rigid()], ids=["elastic", "rigid"])
def test_limits_of_the_only_motor_are_flagged(kind: Elastic) -> None:
    def with_motor(**limits: float) -> object:
        return dataclasses.replace(kind, motor=dataclasses.replace(kind.motor, **limits))

    assert limited(kind) == 0
    assert limited(with_motor(max_torque=31.0, max_velocity=0.6)) == 0
    assert limited(with_motor(max_torque=30.1)) == Flag.MOTOR_TORQUE_LIMIT  # 30 + 0.3 * 0.5 N m
    assert limited(with_motor(max_velocity=0.4)) == Flag.MOTOR_VELOCITY_LIMIT
    assert limited(kind, position=(-1.0, 0.05), velocity=(-0.4, 0.4)) == (
        Flag.POSITION_LIMIT | Flag.VELOCITY_LIMIT
    )


def test_the_constant_of_an_elastic_joint_is_held_to_its_stiffness_limit() -> None:
    assert limited(elastic(stiffness=900.0), stiffness=(800.0, 1000.0)) == 0
    assert limited(elastic(stiffness=900.0), stiffness=(950.0, 1000.0)) == Flag.STIFFNESS_LIMIT
