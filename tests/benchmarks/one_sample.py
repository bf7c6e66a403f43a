"""Functions for control loops, one sample at a time from Python, beside a function of CasADi."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from casadi_peer import function_of
from subjects import SEVEN_JOINTS, seven_joints
from timing import Seconds, cpu_seconds, medians

from vsacli import (
    FeedbackLinearization,
    Gains,
    State,
    link_torques,
    load_trajectory,
    motor_torques,
    state_derivative,
)
from vsacli.compute.engine.number_engine import RECORDED_FROM

PEER = "link torques, casadi.Function"
CALLS = 1000
"""Calls between two looks at the clock."""


def compare(repeats: int) -> tuple[Seconds, float, float]:
    """Processor seconds of each call by its name, and of two calls that record the robot.

    These are that of `motor_torques` at which it is recorded, and the first of `FeedbackLinearization`.
    """
    robot = seven_joints()
    trajectory = load_trajectory(SEVEN_JOINTS[1], robot)
    motion = trajectory.at(1.0)
    block = motor_torques(robot, motion)
    state = State(block.q, block.dq, block.theta, block.dtheta)
    law = FeedbackLinearization(robot, Gains.from_poles([-20] * 4, [-20] * 2))
    derivatives = [motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q]
    peer, flat = function_of(robot), np.concatenate(derivatives)
    ways: dict[str, Callable[[], object]] = {
        PEER: lambda: peer(flat),
        "`link_torques`": lambda: link_torques(robot, *derivatives),
        "`motor_torques`": lambda: motor_torques(robot, motion),
        "`state_derivative`": lambda: state_derivative(robot, state, block.tau_motor),
        "`FeedbackLinearization`": lambda: law(state, motion),
        "`Trajectory.at`": lambda: trajectory.at(1.0),
    }
    recording = max(map(_seconds, [ways["`motor_torques`"]] * RECORDED_FROM))
    first = _seconds(ways["`FeedbackLinearization`"])
    for way in ways.values():
        for _ in range(RECORDED_FROM):
            way()
    agree(derivatives, flat, peer, robot)
    taken = medians({name: cpu_seconds(way, CALLS) for name, way in ways.items()}, repeats)
    return taken, recording, first


def agree(derivatives: list[np.ndarray], flat: np.ndarray, peer: Callable, robot: object) -> None:
    """Both compute the same torques."""
    ours = np.concatenate(link_torques(robot, *derivatives))
    np.testing.assert_allclose(np.array(peer(flat)).ravel(), ours, rtol=1e-9, atol=1e-9 * np.abs(ours).max())


def _seconds(way: Callable[[], object]) -> float:
    begin = time.process_time()
    way()
    return time.process_time() - begin
