"""Mass matrix, accelerations and energies of random trees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from oracles import pinocchio
from samples.marks import slow_but
from samples.plants import random_state, rigid, torques_of
from samples.robots import random_motion
from samples.trees import SMALL, hand, random_tree, random_wrenches, without_resistance

from vsacli import Robot, link_torques, mass_matrix, state_derivative
from vsacli.compute.tracing import Program, Tape, TracedArray
from vsacli.compute.tracing.python_functions import StateFunction
from vsacli.dynamics.rigid_body import link_dynamics

EXACT = 1e-12
"""Relative to the largest entry: two different sums of some thousand terms, each good to 1e-16."""

pytestmark = pytest.mark.cases(4)

trees = pytest.mark.parametrize("seed", slow_but(SMALL, range(50)))


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def all_rigid(robot: Robot) -> Robot:
    joints = (
        replace(joint, actuator=rigid(1.0 + index, 0.2))
        for index, joint in enumerate(without_resistance(robot).joints)
    )
    return replace(robot, joints=tuple(joints))


def on_one_path(robot: Robot) -> np.ndarray:
    """Whether of two joints one is above the other, (joints, joints)."""
    joints = range(len(robot.joints))
    return np.array([[i in robot.paths[k] or k in robot.paths[i] for k in joints] for i in joints])


@trees
def test_the_mass_matrix_is_that_of_pinocchio_and_zero_between_branches(seed: int) -> None:
    robot = random_tree(seed)
    q = random_motion(robot, 5, seed)[0]
    found = mass_matrix(robot, q)
    assert relative(found, pinocchio.mass_matrices(robot, q)) < EXACT
    assert not found[:, ~on_one_path(robot)].any()


@trees
def test_accelerations_of_rigid_drives_are_those_of_pinocchio(seed: int) -> None:
    robot = all_rigid(random_tree(seed))
    joints = len(robot.joints)
    model = pinocchio.build(robot)
    model.armature = 1.0 + np.arange(joints)
    data = model.createData()
    state, torque = random_state(robot, 5, seed), np.zeros((5, joints, 2))
    torque[..., 0] = np.random.default_rng(seed).uniform(-60, 60, (5, joints))
    load = torque[..., 0] - (0.2 + np.array([joint.damping for joint in robot.joints])) * state.dq
    expected = [pin.aba(model, data, *row).copy() for row in zip(state.q, state.dq, load, strict=True)]
    rates = state_derivative(robot, state, torque)
    assert relative(rates.ddq, np.array(expected)) < EXACT  # 1e-15 is seen: heavy rotors condition M well


@trees
def test_accelerations_invert_the_recursion(seed: int) -> None:
    robot = all_rigid(random_tree(seed))
    joints = len(robot.joints)
    state, wrench = random_state(robot, 4, seed), random_wrenches(robot, 4, seed)
    rates = state_derivative(robot, state, np.zeros((4, joints, 2)), wrench)
    none = np.zeros_like(state.q)
    tau_e = link_torques(robot, state.q, state.dq, rates.ddq, none, none, wrench).tau_e
    of_rotors = -(1.0 + np.arange(joints)) * rates.ddq - 0.2 * state.dq
    scale = np.abs(torques_of(robot, state.q, state.dq, rates.ddq)).max()
    assert np.abs(tau_e - of_rotors).max() < 1e-11 * scale  # EXACT, times what sums cancel


@trees
def test_recorded_solutions_from_the_tips_are_those_of_dense_matrices(seed: int) -> None:
    robot = random_tree(seed)
    joints, rng = len(robot.joints), np.random.default_rng(seed)
    above = np.array([[k in path for k in range(joints)] for path in robot.paths])
    lower = np.where(above, rng.uniform(-0.5, 0.5, (joints, joints)), 0)
    np.fill_diagonal(lower, 1)
    matrix, torque = lower.T @ (rng.uniform(1, 9, (joints, 1)) * lower), rng.normal(size=joints)
    # Both err by rounding times the condition.
    bound = 1e-15 * np.linalg.cond(matrix)
    assert relative(recorded_solution(robot, matrix, torque), np.linalg.solve(matrix, torque)) < bound


@trees
def test_recorded_solutions_for_the_mass_matrix(seed: int) -> None:
    robot = random_tree(seed)
    q = random_motion(robot, 1, seed)[0][0]
    matrix, torque = mass_matrix(robot, q), np.random.default_rng(seed).normal(size=len(q))
    bound = 1e-15 * np.linalg.cond(matrix)
    assert relative(recorded_solution(robot, matrix, torque), np.linalg.solve(matrix, torque)) < bound


def recorded_solution(robot: Robot, matrix: np.ndarray, torque: np.ndarray) -> np.ndarray:
    return np.array(StateFunction(solving_program(robot))(np.concatenate([matrix.ravel(), torque])))


def solving_program(robot: Robot) -> Program:
    """The program that solves for accelerations, whose inputs are M row by row, and torques."""
    tape, joints = Tape(), len(robot.joints)
    cells = np.array(tape.inputs(joints * joints + joints), dtype=object)
    matrix = TracedArray(tape, cells[: joints**2].reshape(joints, joints))
    solution = link_dynamics(robot).solve(matrix, TracedArray(tape, cells[joints**2 :]))  # type: ignore[arg-type]
    return tape.program(list(solution.cells))  # type: ignore[attr-defined]


def test_branches_do_not_fill_in() -> None:
    """Each further finger of a palm costs as much as the second, however many there are before it."""
    costs = [len(solving_program(hand(fingers, 3)).operations) for fingers in (1, 2, 3, 6)]
    one, two, three, six = costs
    assert three - two == two - one
    assert six - two == 4 * (two - one)
