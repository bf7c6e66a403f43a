"""link_torques against Lagrange's equations, Pinocchio and complex steps; and its treatment of arrays."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import pinocchio
from oracles.lagrange import chain_of
from samples.paths import STEP, Path, complex_torques
from samples.robots import (
    MotionArrays,
    almost_square_robot,
    random_motion,
    random_robot,
    robot_of_ones,
    vsa_3r,
)
from samples.wrenches import random_wrench

from vsacli import InputError, Robot, link_torques

ROUNDING = 1e-12
"""Of each joint's peak: a 7-joint chain is a few hundred operations deep, so some 100 eps = 2e-14; the rest
is margin. A wrong coefficient shows at 1e-3 and above."""

SAMPLES = 60

CHAINS = ["R", "P", "RR", "RP", "PR", "PP", "RPR", "PRRP", "RRPRR", "PRPRPR", "RRRRRRR", "RPRRPRR", "PRRPRRP"]

ROBOTS = [
    *(random_robot(types, seed) for seed, types in enumerate(CHAINS, start=1)),
    robot_of_ones("RPRPRR"),
    almost_square_robot(),
    vsa_3r(),
]
robots = pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)


def assert_same(actual: np.ndarray, expected: np.ndarray) -> None:
    """Equal to rounding of each joint's peak over the samples."""
    assert actual.shape == expected.shape
    peak, gap = np.abs(expected).max(axis=0), np.abs(actual - expected).max(axis=0)
    assert (gap <= ROUNDING * peak).all(), f"gaps {gap} at peaks {peak}"


@robots
def test_torques_and_derivatives_agree_with_lagranges_equations(robot: Robot) -> None:
    motion = random_motion(robot, SAMPLES, seed=1)
    chain = chain_of(robot, motion)
    for order, actual in enumerate(link_torques(robot, *motion)):
        assert_same(actual, np.column_stack(chain.torques(order)))


@robots
def test_torques_agree_with_pinocchio(robot: Robot) -> None:
    q, dq, ddq, d3q, d4q = random_motion(robot, SAMPLES, seed=2)
    tau_e, dtau_e, _ = link_torques(robot, q, dq, ddq, d3q, d4q)
    assert_same(tau_e, pinocchio.torques(robot, q, dq, ddq))
    assert_same(dtau_e, pinocchio.torque_rates(robot, q, dq, ddq, d3q))


@pytest.mark.parametrize("types", ["RRRRR", "RPRPR", "PRPRP", "RRPPR", "PPRRR"])
@pytest.mark.parametrize("seed", [1, 2])
def test_each_derivative_is_the_rate_of_the_one_before(types: str, seed: int) -> None:
    robot, path = random_robot(types, seed), Path(len(types), seed)
    time = np.linspace(0, 3, SAMPLES, dtype=np.complex128)
    stepped = complex_torques(robot, path.motion(time + 1j * STEP))

    exact = link_torques(robot, *(array.real.T for array in path.motion(time)))

    assert_same(stepped[0].real, exact[0])
    assert_same(stepped[0].imag / STEP, exact[1])
    assert_same(stepped[1].imag / STEP, exact[2])


@pytest.fixture(scope="module")
def long_motion() -> tuple[Robot, MotionArrays]:
    robot = random_robot("RPRR", seed=8)
    return robot, random_motion(robot, 3001, seed=8)


@pytest.mark.parametrize("cuts", [[1], [1500], [1023, 1024, 1025, 2049], list(range(7, 3001, 97))])
def test_results_do_not_depend_on_the_split_into_blocks(
    long_motion: tuple[Robot, MotionArrays], cuts: list[int]
) -> None:
    robot, motion = long_motion
    blocks = zip(*(np.split(array, cuts) for array in motion), strict=True)
    joined = [np.concatenate(parts) for parts in zip(*(link_torques(robot, *b) for b in blocks), strict=True)]
    np.testing.assert_array_equal(joined, link_torques(robot, *motion))  # to the last bit


def test_results_do_not_depend_on_the_memory_layout(long_motion: tuple[Robot, MotionArrays]) -> None:
    robot, motion = long_motion
    strided = [np.repeat(np.asfortranarray(array), 2, axis=0)[::2] for array in motion]
    np.testing.assert_array_equal(link_torques(robot, *strided), link_torques(robot, *motion))


def test_inputs_are_left_alone_and_may_be_lists(long_motion: tuple[Robot, MotionArrays]) -> None:
    robot, motion = long_motion
    few = [array[:5].copy() for array in motion]
    before = [array.copy() for array in few]
    from_arrays = link_torques(robot, *few)
    np.testing.assert_array_equal(few, before)
    np.testing.assert_array_equal(link_torques(robot, *(array.tolist() for array in few)), from_arrays)


@pytest.mark.parametrize("samples", [0, 1, 5])
def test_each_result_has_the_shape_of_the_motion(samples: int) -> None:
    robot = random_robot("RP", seed=1)
    for array in link_torques(robot, *random_motion(robot, samples, seed=1)):
        assert array.shape == (samples, 2)
        assert array.dtype == np.float64


@pytest.mark.parametrize("wrong", [(5,), (5, 3), (2, 5), (5, 2, 1), ()], ids=str)
@pytest.mark.parametrize("position", range(5))
def test_a_wrong_shape_is_refused_with_the_one_expected(position: int, wrong: tuple[int, ...]) -> None:
    robot = random_robot("RP", seed=1)
    motion: list[np.ndarray] = list(random_motion(robot, 5, seed=1))
    motion[position] = np.zeros(wrong)
    name = ("q", "dq", "ddq", "d3q", "d4q")[position]
    with pytest.raises(InputError) as refusal:
        link_torques(robot, *motion)
    assert str(refusal.value) == f"{name} must have the shape (2) or (samples, 2), not {wrong}"


def test_unequal_numbers_of_samples_are_refused() -> None:
    robot = random_robot("RP", seed=1)
    q, dq, ddq, d3q, d4q = random_motion(robot, 5, seed=1)
    with pytest.raises(InputError, match=r"must have one shape, not \(5, 2\), \(5, 2\), \(4, 2\), \(5, 2\)"):
        link_torques(robot, q, dq, ddq[:4], d3q, d4q)


def test_a_robot_that_holds_still_needs_its_position_alone() -> None:
    robot = random_robot("RPR", seed=2)
    q, *_ = random_motion(robot, 5, seed=2)
    still = np.zeros_like(q)
    held = link_torques(robot, q)
    np.testing.assert_array_equal(held.tau_e, link_torques(robot, q, still, still, still, still).tau_e)
    assert held.dtau_e is None
    assert held.ddtau_e is None


def test_derivatives_are_computed_from_what_is_given_alone() -> None:
    robot = random_robot("RPR", seed=2)
    motion = random_motion(robot, 5, seed=2)
    whole = link_torques(robot, *motion)
    for given, computed in ((3, 1), (4, 2), (5, 3)):
        found = link_torques(robot, *motion[:given])
        for array, expected in zip(found[:computed], whole, strict=False):
            np.testing.assert_array_equal(array, expected)
        assert found[computed:] == (None,) * (3 - computed)


@pytest.mark.parametrize(
    ("names", "clause"),
    [
        (["dq"], "dq is given without ddq"),
        (["ddq"], "ddq is given without dq"),
        (["d3q"], "d3q is given without dq and ddq"),
        (["dq", "ddq", "d4q"], "d4q is given without d3q"),
    ],
)
def test_a_motion_with_a_gap_is_refused(names: list[str], clause: str) -> None:
    robot = random_robot("RPR", seed=2)
    q = np.zeros((5, 3))
    with pytest.raises(InputError, match=f"{clause}; give q alone if the robot holds still, else q, dq and"):
        link_torques(robot, q, **dict.fromkeys(names, q))


def test_one_instant_is_a_row_of_many() -> None:
    robot = random_robot("RPR", seed=2)
    motion, wrench = random_motion(robot, 1, seed=2), random_wrench(1, "base", seed=2)
    once = link_torques(robot, *(array[0] for array in motion), wrench.mapped(lambda rows, _: rows[0]))
    for array, expected in zip(once, link_torques(robot, *motion, wrench), strict=True):
        np.testing.assert_array_equal(array, expected[0])


def test_an_instant_and_samples_do_not_mix() -> None:
    robot = random_robot("RPR", seed=2)
    with pytest.raises(InputError, match=r"q, dq, ddq must have one shape, not \(5, 3\), \(3,\), \(3,\)"):
        link_torques(robot, np.zeros((5, 3)), np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match=r"wrench must have the shape \(6,\), not \(5, 6\)"):
        link_torques(robot, np.zeros(3), wrench=random_wrench(5, "base", seed=2))
