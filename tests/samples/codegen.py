"""Robots and states for the tests of generated code."""

from __future__ import annotations

import dataclasses

import numpy as np

from samples.robots import random_robot
from samples.springs import SPRINGS
from vsacli import Antagonistic, Flag, Limits, Motion, Motor, Robot, motor_torques
from vsacli.actuators.reach import margin
from vsacli.base.flags import has_flag
from vsacli.base.variables import Block
from vsacli.control.codegen.robot_functions import command_structure

SCALES = {"q": 1.0, "dq": 1.0, "ddq": 2.0, "d3q": 5.0, "d4q": 20.0, "dstiffness": 100.0, "ddstiffness": 500.0}
"""Half-widths of what is drawn, SI units."""

CLOSE = 1e-12
"""Of a variable's peak, where the margin exceeds `CLEAR`: the same operations, other roundings of math.h."""

CLEAR = 1e-3


def with_springs(law: str) -> Robot:
    """Two light joints: springs of a law alike, and unlike, with limits that some of the samples break."""
    (one, _), (other, _) = SPRINGS[law]
    robot = random_robot("RR", seed=8)
    motor = Motor(inertia=0.1, damping=0.1, max_torque=20.0, max_velocity=2.5)
    joints = tuple(
        dataclasses.replace(
            joint,
            link=dataclasses.replace(joint.link, mass=0.3),
            actuator=Antagonistic(motor=(motor, motor), spring=springs),
            limits=Limits(position=(-0.8, 0.9), velocity=(-0.9, 0.9)),
        )
        for joint, springs in zip(robot.joints, ((one, one), (one, other)), strict=True)
    )
    return dataclasses.replace(robot, name=f"two {law}", joints=joints)


def commands(robot: Robot, samples: int, seed: int) -> dict[str, np.ndarray]:
    """Random commands; stiffness from below to above what is reachable, the first ones on its border."""
    rng = np.random.default_rng(seed)
    shape = (samples, len(robot.joints))
    drawn = {name: rng.uniform(-scale, scale, shape) for name, scale in SCALES.items()}
    block = motor_torques(robot, motion_of({**drawn, "stiffness": np.ones(shape)}))
    lower = np.nan_to_num(block.stiffness_min)
    upper = np.minimum(np.nan_to_num(block.stiffness_max), 4 * lower)
    stiffness = lower + rng.uniform(-0.2, 1.2, shape) * (upper - lower)
    stiffness[:2] = lower[:2]
    stiffness[2:4] = upper[2:4]
    stiffness[4:6] = lower[4:6] * 1.004
    return {**drawn, "stiffness": stiffness}


def reachable(robot: Robot) -> np.ndarray:
    """Random commands that can be executed, (commands, signals, joints)."""
    drawn = commands(robot, 1000, seed=1)
    flags = motor_torques(robot, motion_of(drawn)).flags
    chosen = np.stack([drawn[array.name] for array in command_structure(robot).arrays], axis=1)
    return chosen[~has_flag(flags, Flag.INFEASIBLE | Flag.SINGULAR).any(axis=1)]


def motion_of(arrays: dict[str, np.ndarray]) -> Motion:
    return Motion.of(np.zeros(len(arrays["q"])), arrays)


def expected_of(block: Block, name: str) -> np.ndarray:
    """What the tool computes of an array that the generated code gives."""
    if name == "margin":
        with np.errstate(invalid="ignore"):
            return margin(block.stiffness, block.stiffness_min, block.stiffness_max)
    return np.asarray(getattr(block, name))


def clear(margin: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Where joints are away from the border, as an array of that shape; those without a margin are."""
    there = ~(margin <= CLEAR)
    return np.broadcast_to(there.reshape(there.shape + (1,) * (len(shape) - there.ndim)), shape)
