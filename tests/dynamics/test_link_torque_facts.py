"""Laws of mechanics and published numbers that the link torques must meet."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from oracles.jets import leibniz
from oracles.lagrange import chain_of
from oracles.point_masses import Cloud, random_cloud, torques
from samples.robots import (
    MotionArrays,
    at_rest,
    random_motion,
    random_robot,
    still_joint,
    vsa_3r,
    with_gravity,
)

from vsacli import DenavitHartenberg, Inertia, Joint, Link, Robot, link_torques

ROUNDING = 1e-12
"""Of the largest term compared: some hundred operations of eps = 2e-16 each, and a margin of ten or more."""

SAMPLES = 40

chains = pytest.mark.parametrize("types", ["R", "RPR", "PRRP", "RRRRRRR"])


def still(motion: MotionArrays, at: int, position: float) -> MotionArrays:
    """The motion with one more joint, held at a position."""
    q, *rates = motion
    dq, ddq, d3q, d4q = (np.insert(rate, at, 0, axis=1) for rate in rates)
    return np.insert(q, at, position, axis=1), dq, ddq, d3q, d4q


def with_joints(robot: Robot, joints: tuple[Joint, ...]) -> Robot:
    return dataclasses.replace(robot, joints=joints)


def mass_matrix_from(robot: Robot, q: np.ndarray, order: int) -> np.ndarray:
    """M (samples, joints, joints); a column is the cost of a unit derivative of order 2 to 4 at one joint."""
    weightless = with_gravity(robot, (0, 0, 0))
    columns = []
    for joint in range(len(robot.joints)):
        motion = [q, *(np.zeros_like(q) for _ in range(4))]
        motion[order][:, joint] = 1
        columns.append(link_torques(weightless, *motion)[order - 2])
    return np.stack(columns, axis=-1)


# Table I


@pytest.mark.parametrize(
    ("index", "length", "density", "along"), [(0, 0.4, 8000, "y"), (1, 0.3, 8000, "x"), (2, 0.3, 6000, "x")]
)
def test_table_one_is_three_tubes(index: int, length: float, density: float, along: str) -> None:
    outer, inner = 0.05, 0.04
    mass = density * math.pi * (outer**2 - inner**2) * length
    axial = mass * (outer**2 + inner**2) / 2
    transverse = mass * (3 * (outer**2 + inner**2) + length**2) / 12
    moments = {axis: axial if axis == along else transverse for axis in "xyz"}

    link = vsa_3r().joints[index].link
    assert link.mass == round(mass, 4)  # the digits printed
    assert (link.inertia.xx, link.inertia.yy, link.inertia.zz) == tuple(round(moments[a], 4) for a in "xyz")


def test_largest_static_loads_of_the_3r() -> None:
    angles = np.linspace(-math.pi, math.pi, 73)  # contains 0, where each arm is stretched out horizontally
    q = np.stack(np.meshgrid([0.4], angles, angles), axis=-1).reshape(-1, 3)
    tau_e, dtau_e, ddtau_e = link_torques(vsa_3r(), *at_rest(vsa_3r(), q))
    loads = np.abs(tau_e).max(axis=0)
    assert loads == pytest.approx([0, 32.45, 7.49], abs=0.005)  # N m; the digits of the published loads
    assert not dtau_e.any()
    assert not ddtau_e.any()


# Inertia


def link_of(cloud: Cloud) -> Link:
    return Link(mass=cloud.mass, com=tuple(cloud.com), inertia=Inertia(**cloud.inertia))


@pytest.mark.parametrize("types", ["R", "P", "RPR", "PRRP"])
def test_a_body_of_point_masses_costs_what_its_points_cost(types: str) -> None:
    rng = np.random.default_rng(5)
    clouds = [random_cloud(rng, points=12) for _ in types]
    robot = random_robot(types, seed=5)
    bodies = zip(robot.joints, clouds, strict=True)
    robot = with_joints(
        robot, tuple(dataclasses.replace(joint, link=link_of(cloud), damping=0) for joint, cloud in bodies)
    )
    motion = random_motion(robot, SAMPLES, seed=5)
    expected = torques(chain_of(robot, motion), clouds)
    tau_e, _, _ = link_torques(robot, *motion)
    np.testing.assert_allclose(tau_e, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


def test_a_product_of_inertia_has_the_sign_of_urdf() -> None:
    """Two masses of 1 kg at (1, 1, 0) m and (-1, -1, 0) m, turning about y at 2 rad/s.

    The mass at (1, 1, 0) needs the centripetal force (-4, 0, 0) N, whose moment about z is +4 N m; the other
    one needs as much. A locked joint about z carries both.
    """
    dumbbell = Link(mass=2, com=(0, 0, 0), inertia=Inertia(xx=2, yy=2, zz=4, xy=-2))
    upright = DenavitHartenberg(a=0, alpha=math.pi / 2)  # the axis of the spindle is the next frame's y
    lock = dataclasses.replace(still_joint("lock"), link=dumbbell)
    robot = Robot(name="dumbbell", gravity=(0, 0, 0), joints=(still_joint("spindle", dh=upright), lock))
    q, _, *higher = at_rest(robot, np.zeros((1, 2)))
    tau_e, _, _ = link_torques(robot, q, np.array([[2.0, 0.0]]), *higher)
    np.testing.assert_array_equal(tau_e, [[0, 8]])  # whole numbers all the way


# Mass matrix


@chains
def test_the_mass_matrix_is_symmetric_and_positive_definite(types: str) -> None:
    robot = random_robot(types, seed=6)
    q = random_motion(robot, SAMPLES, seed=6)[0]
    mass_matrix = mass_matrix_from(robot, q, order=2)
    asymmetry = np.abs(mass_matrix - mass_matrix.swapaxes(1, 2)).max()
    assert asymmetry <= ROUNDING * np.abs(mass_matrix).max()
    assert np.linalg.eigvalsh(mass_matrix).min() > 0


@chains
def test_from_rest_each_derivative_of_the_torque_is_the_mass_matrix_times_the_motions(types: str) -> None:
    robot = random_robot(types, seed=7)
    q = random_motion(robot, SAMPLES, seed=7)[0]
    mass_matrix = mass_matrix_from(robot, q, order=2)
    for order in (3, 4):
        np.testing.assert_array_equal(mass_matrix_from(robot, q, order), mass_matrix)  # the same operations


@pytest.mark.parametrize(("end", "sign"), [(0.0, 1), (4.0, -1)])
def test_rest_to_rest_of_degree_seven_begins_and_ends_with_a_jump_of_snap(end: float, sign: int) -> None:
    duration, start, stop = 4.0, np.zeros(3), np.radians([90, 45, -60])
    path = Polynomial([0, 0, 0, 0, 35, -84, 70, -20], domain=[0, duration], window=[0, 1])
    rates = [path.deriv(order)(end) if order else path(end) for order in range(5)]
    motion = [start * (order == 0) + rate * (stop - start) for order, rate in enumerate(rates)]

    robot = vsa_3r()
    q = motion[0][None]
    snap = sign * 840 * (stop - start) / duration**4
    _, dtau_e, ddtau_e = link_torques(robot, *(row[None] for row in motion))

    expected = mass_matrix_from(robot, q, order=2)[0] @ snap
    np.testing.assert_allclose(ddtau_e[0], expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
    np.testing.assert_allclose(dtau_e[0], 0, rtol=0, atol=ROUNDING * np.abs(expected).max())


# Energy


@chains
@pytest.mark.parametrize("order", [0, 1, 2])
def test_power_goes_into_energy_and_damping(types: str, order: int) -> None:
    robot = random_robot(types, seed=8)
    motion = random_motion(robot, SAMPLES, seed=8)
    damping = np.array([joint.damping for joint in robot.joints])
    rates = motion[1:]
    conservative = [
        torque - damping * rate for torque, rate in zip(link_torques(robot, *motion), rates, strict=False)
    ]
    power = leibniz(order, rates, conservative, lambda a, b: (a * b).sum(axis=1))

    chain = chain_of(robot, motion)
    kinetic, potential = chain.kinetic_energy(order + 1), chain.potential_energy(order + 1)
    scale = np.abs(kinetic).max() + np.abs(potential).max()
    np.testing.assert_allclose(power, kinetic + potential, rtol=0, atol=ROUNDING * scale)


# Gravity, base and massless joints


@chains
def test_torques_are_linear_in_gravity(types: str) -> None:
    robot = random_robot(types, seed=9)
    motion = random_motion(robot, SAMPLES, seed=9)
    first, second = np.array([4.0, -7.0, 2.0]), np.array([-9.0, 1.0, 5.0])

    def derivatives(gravity: np.ndarray) -> np.ndarray:
        return np.array(link_torques(with_gravity(robot, gravity), *motion))

    combined = derivatives(2 * first - 3 * second)
    expected = 2 * derivatives(first) - 3 * derivatives(second) + 2 * derivatives(np.zeros(3))
    peak = np.abs(combined).max(axis=(1, 2), keepdims=True)
    assert (np.abs(combined - expected) <= ROUNDING * peak).all()


@chains
@pytest.mark.parametrize("base", ["RR", "RP", "PR"])
def test_rotating_base_and_gravity_together_changes_nothing(types: str, base: str) -> None:
    robot = random_robot(types, seed=10)
    motion = random_motion(robot, SAMPLES, seed=10)
    rows = (
        DenavitHartenberg(a=0.4, alpha=0.7, d=0.2, theta=-0.9),
        DenavitHartenberg(a=-0.3, alpha=-1.1, d=0.5),
    )
    mounts = tuple(
        still_joint(f"mount_{number}", letter, dh=row)
        for number, (letter, row) in enumerate(zip(base, rows, strict=True))
    )
    mounting = with_joints(robot, mounts)
    positions = np.array([[0.6, -1.3]])
    rotation = chain_of(mounting, at_rest(mounting, positions)).poses[-1][0][0, :3, :3]

    mounted = with_gravity(with_joints(robot, mounts + robot.joints), rotation @ robot.gravity)
    moved = still(still(motion, 0, positions[0, 1]), 0, positions[0, 0])
    for actual, expected in zip(link_torques(mounted, *moved), link_torques(robot, *motion), strict=True):
        np.testing.assert_allclose(actual[:, 2:], expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


@pytest.mark.parametrize("at", [0, 1, 2, 3], ids=["base", "second", "third", "tip"])
@pytest.mark.parametrize("letter", ["R", "P"])
def test_a_massless_joint_without_extent_held_still_changes_nothing(at: int, letter: str) -> None:
    robot = random_robot("RPR", seed=11)
    motion = random_motion(robot, SAMPLES, seed=11)
    joints = list(robot.joints)
    joints.insert(at, still_joint("extra", letter))
    longer = with_joints(robot, tuple(joints))
    for actual, expected in zip(
        link_torques(longer, *still(motion, at, 0.0)), link_torques(robot, *motion), strict=True
    ):
        np.testing.assert_array_equal(np.delete(actual, at, axis=1), expected)  # it turns by exactly 0
        if at == len(robot.joints):
            assert not actual[:, at].any()
