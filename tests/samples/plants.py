"""Robots with other actuators, and states of robots, for the tests of forward dynamics and control."""

from __future__ import annotations

import dataclasses

import numpy as np

from samples.robots import random_robot
from vsacli import Elastic, Motor, Rigid, Robot, State, link_torques


def with_actuators(robot: Robot, actuators: dict[int, Elastic | Rigid]) -> Robot:
    """The robot with other actuators at some joints."""
    joints = tuple(
        dataclasses.replace(joint, actuator=actuators.get(index, joint.actuator))
        for index, joint in enumerate(robot.joints)
    )
    return dataclasses.replace(robot, joints=joints)


def elastic(stiffness: float = 900.0, inertia: float = 2.5, damping: float = 0.3) -> Elastic:
    return Elastic(motor=Motor(inertia=inertia, damping=damping), stiffness=stiffness)


def rigid(inertia: float = 2.5, damping: float = 0.3) -> Rigid:
    return Rigid(motor=Motor(inertia=inertia, damping=damping))


def all_rigid(types: str, seed: int) -> Robot:
    robot = random_robot(types, seed)
    return with_actuators(robot, {index: rigid(1 + index, 0.2) for index in range(len(types))})


def random_state(robot: Robot, samples: int, seed: int) -> State:
    """Springs deflected so that side 1 is up and side 2 down."""
    rng = np.random.default_rng(seed)
    shape = (samples, len(robot.joints))
    q, dq = rng.uniform(-2, 2, shape), rng.uniform(-3, 3, shape)
    phi = rng.uniform(0.05, 0.2, (*shape, 2)) * [1, -1]
    return State(q=q, dq=dq, theta=q[..., None] + phi, dtheta=rng.uniform(-3, 3, (*shape, 2)))


def torques_of(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """tau_e by the inverse recursion, whose route to it is another one."""
    zero = np.zeros_like(q)
    return link_torques(robot, q, dq, ddq, zero, zero)[0]
