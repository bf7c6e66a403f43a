"""Compliance of tools with the motors held, against equations that share no code, and MuJoCo at rest."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.paths import STEP, complex_torques
from samples.robots import random_robot
from samples.shipped import shipped_robot, shipped_run
from samples.trees import SMALL, random_tree, without_resistance
from samples.wrenches import held

from vsacli import (
    InputError,
    Motor,
    Rigid,
    Trajectory,
    Wrench,
    forward_kinematics,
    inverse_dynamics,
    jacobian,
    tip_compliance,
)
from vsacli.base.variables import Block

ROUNDING = 1e-13
"""Of the largest entry: a product of a few sums, and a well conditioned system of few equations."""

SAMPLES = 5

CHAINS = [held(random_robot(types, seed)) for seed, types in enumerate(("RRRR", "RPRR", "PRR", "RPP"))]
TREES = [without_resistance(random_tree(seed)) for seed in SMALL]


def drawn(robot, tools=1, *, moments=True):
    """Poses, stiffness of the size of the load, and wrenches in base axes."""
    rng = np.random.default_rng(3)
    joints = len(robot.joints)
    wrench = rng.uniform(-50, 50, (SAMPLES, tools, 6)) * ([1] * 3 + [moments] * 3)
    q, stiffness = rng.uniform(-3, 3, (SAMPLES, joints)), rng.uniform(2000, 3000, (SAMPLES, joints))
    return q, stiffness, wrench.reshape(SAMPLES, -1)


def in_base(robot, wrench):
    tools = len(robot.tool_names)
    return Wrench.constant(wrench, ("base",) * tools if tools > 1 else "base")


def load_slope(robot, q, wrench):
    """dg/dq by complex steps of the recursion, (samples, joints, joints)."""
    columns = []
    for unit in np.eye(len(robot.joints)):
        motion = [(q + 1j * STEP * unit).T, *[np.zeros_like(q.T)] * 4]
        components = [row.astype(complex) for row in (wrench.wrench.T, *[0 * wrench.wrench.T] * 2)]
        columns.append(complex_torques(robot, motion, components, wrench.frame)[0].imag / STEP)
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("robot", [*CHAINS, *TREES], ids=lambda robot: robot.name)
def test_it_is_the_slope_of_the_balance_at_rest(robot):
    q, stiffness, components = drawn(robot, len(robot.tool_names))
    wrench = in_base(robot, components)
    matrix = load_slope(robot, q, wrench) + stiffness[:, None] * np.eye(len(robot.joints))
    yielding = [index for index, joint in enumerate(robot.joints) if joint.actuator.sprung]
    matrix = matrix[:, yielding][:, :, yielding]
    for name in robot.tool_names:
        columns = jacobian(robot, q, "base", tool=name)[..., yielding]
        expected = columns @ np.linalg.inv(matrix) @ columns.swapaxes(1, 2)
        actual = tip_compliance(robot, q, stiffness, name, wrench)
        np.testing.assert_allclose(actual, expected, rtol=0, atol=10 * ROUNDING * np.abs(expected).max())


def test_without_load_and_gravity_it_is_that_of_the_springs():
    robot = dataclasses.replace(CHAINS[1], gravity=(0, 0, 0))
    q, stiffness, _ = drawn(robot)
    columns = jacobian(robot, q, "base")
    expected = columns / stiffness[:, None] @ columns.swapaxes(1, 2)
    actual = tip_compliance(robot, q, stiffness)
    np.testing.assert_allclose(actual, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
    np.testing.assert_array_equal(tip_compliance(robot, q[0], stiffness[0]), actual[0])


def test_only_moments_make_it_asymmetric():
    robot = CHAINS[0]
    for moments, bounds in ((False, (0, ROUNDING)), (True, (1e-4, 1))):
        q, stiffness, components = drawn(robot, moments=moments)
        compliance = tip_compliance(robot, q, stiffness, wrenches=in_base(robot, components))
        asymmetry = np.abs(compliance - compliance.swapaxes(1, 2)).max() / np.abs(compliance).max()
        assert bounds[0] <= asymmetry <= bounds[1]


def test_a_wrench_in_the_frame_of_the_tool_keeps_its_directions_while_the_tool_yields():
    robot = CHAINS[0]
    q, stiffness, components = drawn(robot)
    axes = forward_kinematics(robot, q)[:, -1, :3, :3]
    turned = np.einsum("sij,swj->swi", axes, components.reshape(-1, 2, 3)).reshape(-1, 6)
    np.testing.assert_allclose(
        tip_compliance(robot, q, stiffness, wrenches=Wrench.constant(components, "end_effector")),
        tip_compliance(robot, q, stiffness, wrenches=in_base(robot, turned)),
        rtol=1e-10,  # sums of both orders, over all entries
        atol=1e-15,
    )


def test_a_branch_on_the_base_that_buckles_is_the_only_one():
    robot = TREES[1]
    q, stiffness, components = drawn(robot, len(robot.tool_names))
    wrench = in_base(robot, components)
    before = [tip_compliance(robot, q, stiffness, name, wrench) for name in robot.tool_names]
    roots = [robot.paths[joint][0] for joint in robot.tool_joints]
    assert len(set(roots)) == len(roots)
    stiffness[:, roots[0]] = -1e5
    after = [tip_compliance(robot, q, stiffness, name, wrench) for name in robot.tool_names]
    assert np.isfinite(before[0]).all()
    assert np.isnan(after[0]).all()
    np.testing.assert_array_equal(after[1:], before[1:])


def test_joints_without_springs_do_not_yield():
    robot = CHAINS[0]
    stiff = dataclasses.replace(robot.joints[1], actuator=Rigid(motor=Motor(inertia=1.0)))
    stiffened = dataclasses.replace(robot, joints=(robot.joints[0], stiff, *robot.joints[2:]))
    q, stiffness, _ = drawn(robot)
    stiffness[:, 1] = 1e14
    expected = tip_compliance(robot, q, stiffness)
    stiffness[:, 1] = np.nan
    np.testing.assert_allclose(tip_compliance(stiffened, q, stiffness), expected, rtol=1e-8, atol=1e-12)
    rigid = dataclasses.replace(robot, joints=(stiff,))
    assert not tip_compliance(rigid, [0.3], [np.nan]).any()


def test_an_upright_rod_buckles_below_m_g_l():
    """An inverted pendulum: the spring of its joint must have more stiffness than m g l."""
    robot = random_robot("R", 1).replace(
        {"gravity": [0, -9.81, 0], "joints.0.dh": {"a": 0.5, "alpha": 0, "d": 0, "theta": 0}}
    )
    robot = robot.replace({"joints.0.link.com": [0, 0, 0], "joints.0.link.mass": 2.0})
    upright, critical = [[np.pi / 2]], 2 * 9.81 * 0.5
    assert np.isnan(tip_compliance(robot, upright, [[critical * (1 - 1e-9)]])).all()
    compliance = tip_compliance(robot, upright, [[critical + 10]])
    np.testing.assert_allclose(compliance[0, 0, 0], 0.5**2 / 10, rtol=1e-12)  # a difference of 1e-15
    assert np.isnan(tip_compliance(robot, [[np.nan]], [[100]])).all()


def test_what_does_not_fit_is_refused():
    robot = TREES[0]
    q, stiffness, components = drawn(robot, 2)
    for arguments, problem in (
        ((q, stiffness), "has the tools tool_0, tool_1; say which one"),
        ((q[:, 1:], stiffness, "tool_0"), "q must have the shape"),
        ((q, stiffness[:, 1:], "tool_0"), "stiffness must have the shape"),
        ((q, stiffness[1:], "tool_0"), "stiffness must have the shape"),
        ((q, stiffness, "tool_0", in_base(robot, components[1:])), "the wrench must have the shape"),
        ((q, stiffness, "tool_0", Wrench.constant(components[:, :6])), "is for 1 tool"),
    ):
        with pytest.raises(InputError, match=problem):
            tip_compliance(robot, *arguments)


OF_MUJOCO = 1e-4
"""Of the largest entry: differences by 1e-3 N, of springs whose stiffness changes with their deflection."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "robot",
    [
        *map(shipped_robot, ("vsa_3r", "lwr_7r_vsa", "mixed_3r")),
        *(held(random_robot(types, seed)) for types, seed in (("RRR", 8), ("RPRR", 9))),
    ],
    ids=lambda robot: robot.name,
)
def test_mujoco_yields_as_much_at_rest(robot):
    models = pytest.importorskip("samples.mujoco_models")
    rng = np.random.default_rng(4)
    q, wrench = rng.uniform(-1, 1, len(robot.joints)), rng.uniform(-3, 3, 6)
    least = at_rest(robot, q, np.full_like(q, 1000), wrench).stiffness_min[0]
    result = at_rest(robot, q, 1.3 * least, wrench)
    assert not result.flags.any()
    expected = tip_compliance(robot, q, result.stiffness[0], wrenches=Wrench.constant(wrench, "base"))
    actual = models.settled_compliance(robot, result, wrench, 1e-3)
    np.testing.assert_allclose(actual, expected, rtol=0, atol=OF_MUJOCO * np.abs(expected).max())


@pytest.mark.slow
def test_mujoco_yields_as_much_at_both_hands_of_a_torso():
    models = pytest.importorskip("samples.mujoco_models")
    robot, trajectory = shipped_run("torso_2x3r", "torso_2x3r")
    result = inverse_dynamics(robot, trajectory)
    held = Block(**result.arrays()).taken(slice(-1, None))  # at rest, while the right hand is pushed
    wrench = Wrench.constant(held.wrench[0].ravel(), ("base", "base"))
    for tool, name in enumerate(robot.tool_names):
        expected = tip_compliance(robot, held.q[0], held.stiffness[0], name, wrench)
        actual = models.settled_compliance(robot, held, held.wrench[0], 1e-3, tool)
        np.testing.assert_allclose(actual, expected, rtol=0, atol=OF_MUJOCO * np.abs(expected).max())


def at_rest(robot, q, stiffness, wrench):
    """Eight samples of a held pose."""
    rows = {"q": q, "stiffness": stiffness, "wrench": wrench}
    rates = ("dq", "ddq", "d3q", "d4q", "dstiffness", "ddstiffness", "dwrench", "ddwrench")
    rows |= {name: 0 * (wrench if name.endswith("wrench") else q) for name in rates}
    samples = {name: np.tile(row, (8, 1)) for name, row in rows.items()}
    trajectory = Trajectory.from_samples(np.arange(8) / 10, **samples, wrench_frame="base")
    return inverse_dynamics(robot, trajectory)
