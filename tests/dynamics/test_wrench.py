"""Link torques under a wrench at the end effector."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from oracles import pinocchio
from oracles.kinematics import jacobian, tool_pose
from samples.paths import STEP, Path, complex_torques
from samples.robots import random_motion, random_robot, robot_of_ones, vsa_3r
from samples.wrenches import held, random_wrench

from vsacli import InputError, Robot, Wrench, link_torques
from vsacli.base.wrench import WRENCH_FRAMES, WRENCH_NAMES

ROUNDING = 1e-12
"""Of each joint's peak: a few hundred operations, so some 100 eps; the rest is margin."""

SAMPLES = 40


CHAINS = ["R", "P", "RP", "PR", "RPR", "PRRP", "RRPRR", "RRRRRRR"]
ROBOTS = [
    *(held(random_robot(types, seed)) for seed, types in enumerate(CHAINS, start=1)),
    robot_of_ones("RPRPRR"),
    vsa_3r(),
]
robots = pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
frames = pytest.mark.parametrize("frame", WRENCH_FRAMES)


def assert_same(actual: np.ndarray, expected: np.ndarray, scale: np.ndarray | None = None) -> None:
    """Equal to rounding of each joint's peak over the samples (or that of `scale`)."""
    assert actual.shape == expected.shape
    peak = np.abs(expected if scale is None else scale).max(axis=0)
    gap = np.abs(actual - expected).max(axis=0)
    assert (gap <= ROUNDING * peak).all(), f"gaps {gap} at peaks {peak}"


@robots
@frames
def test_tau_e_changes_by_minus_the_jacobian_transposed_times_the_wrench(robot: Robot, frame: str) -> None:
    motion = random_motion(robot, SAMPLES, seed=1)
    wrench = random_wrench(SAMPLES, frame, seed=1)
    free, *_ = link_torques(robot, *motion)
    loaded, *_ = link_torques(robot, *motion, wrench)
    expected = []
    for q, components in zip(motion[0], wrench.wrench, strict=True):
        turn = tool_pose(robot, q).real[:3, :3] if frame == "end_effector" else np.eye(3)
        expected.append(-jacobian(robot, q).T @ np.kron(np.eye(2), turn) @ components)
    assert_same(loaded - free, np.array(expected), scale=np.abs(loaded) + np.abs(free))


@robots
@frames
def test_torques_under_a_wrench_agree_with_pinocchio(robot: Robot, frame: str) -> None:
    motion = random_motion(robot, SAMPLES, seed=2)
    wrench = random_wrench(SAMPLES, frame, seed=2)
    tau_e, *_ = link_torques(robot, *motion, wrench)
    expected = pinocchio.torques_under_wrench(robot, motion[:3], wrench.wrench, [frame])
    assert_same(tau_e, expected)


@pytest.mark.parametrize("types", ["RRRRR", "RPRPR", "PRPRP", "PPRRR"])
@frames
def test_each_derivative_is_the_rate_of_the_one_before(types: str, frame: str) -> None:
    robot = held(random_robot(types, seed=3))
    path, course = Path(len(types), seed=3), Path(6, seed=4)
    time = np.linspace(0, 3, SAMPLES, dtype=np.complex128)
    later = time + 1j * STEP
    stepped = complex_torques(robot, path.motion(later), course.motion(later)[:3], frame)

    wrench = Wrench(*(array.real.T for array in course.motion(time)[:3]), frame=frame)
    exact = link_torques(robot, *(array.real.T for array in path.motion(time)), wrench)

    assert_same(stepped[0].real, exact[0])
    assert_same(stepped[0].imag / STEP, exact[1])
    assert_same(stepped[1].imag / STEP, exact[2])


@robots
@frames
def test_a_wrench_of_zero_is_none(robot: Robot, frame: str) -> None:
    motion = random_motion(robot, SAMPLES, seed=5)
    zero = Wrench(*np.zeros((3, SAMPLES, 6)), frame=frame)
    np.testing.assert_array_equal(link_torques(robot, *motion, zero), link_torques(robot, *motion))


@frames
def test_results_do_not_depend_on_the_split_into_blocks(frame: str) -> None:
    robot = held(random_robot("RPR", seed=6))
    motion, wrench = random_motion(robot, 5001, seed=6), random_wrench(5001, frame, seed=6)
    whole = link_torques(robot, *motion, wrench)
    parts = [
        link_torques(
            robot, *(array[part] for array in motion), wrench.mapped(lambda rows, _, part=part: rows[part])
        )
        for part in (slice(0, 1777), slice(1777, 5001))
    ]
    np.testing.assert_array_equal([np.concatenate(pair) for pair in zip(*parts, strict=True)], whole)


@pytest.mark.parametrize("name", WRENCH_NAMES)
@pytest.mark.parametrize("shape", [(5,), (5, 3), (4, 6), (6, 5)], ids=str)
def test_a_wrench_of_another_shape_is_refused(name: str, shape: tuple[int, ...]) -> None:
    robot = random_robot("RP", seed=1)
    wrench = dataclasses.replace(random_wrench(5, "base", seed=1), **{name: np.zeros(shape)})
    with pytest.raises(InputError) as refusal:
        link_torques(robot, *random_motion(robot, 5, seed=1), wrench)
    assert str(refusal.value) == f"{name} must have the shape (5, 6), not {shape}"


def test_a_constant_wrench_has_derivatives_that_are_zero() -> None:
    push = Wrench.constant([1, 2, 3, 4, 5, 6], "base")
    np.testing.assert_array_equal(push.wrench, [1, 2, 3, 4, 5, 6])
    assert not push.dwrench.any()
    assert push.ddwrench.shape == (6,)
    assert push.frame == "base"


def test_an_unknown_frame_is_refused() -> None:
    with pytest.raises(InputError, match=r"unknown frame 'bas' of the wrench; did you mean 'base'\?"):
        Wrench(*np.zeros((3, 1, 6)), frame="bas")
