"""Where a motion begins: a key frame of MJCF, from which the motors' springs carry the load at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.robot.model import Robot
from vsacli.robot.models.mjcf_rotor import motor_name
from vsacli.robot.models.xml_text import Element, element

KEY = "start"
"""Name of the key frame."""


class Start(NamedTuple):
    """The first step of a run.

    Attributes:
        q, dq: positions and velocities of the joints, (joints,).
        theta, dtheta: those of the motors, joint side of the gear, (joints, 2).
    """

    q: FloatArray
    dq: FloatArray
    theta: FloatArray
    dtheta: FloatArray


def add_start(root: Element, world: Element, robot: Robot, start: Start) -> None:
    """A key frame with positions and velocities in the order in which the world has the coordinates.

    Raises:
        InputError: a motor has no position there, since the step is infeasible or singular.
    """
    states: dict[str, tuple[float, float]] = {}
    for index, joint in enumerate(robot.joints):
        for motor in range(joint.actuator.motor_count):
            states[motor_name(joint, motor + 1)] = start.theta[index, motor], start.dtheta[index, motor]
        states[joint.name] = start.q[index], start.dq[index]
    lost = [name for name, state in states.items() if not np.isfinite(state).all()]
    if lost:
        raise InputError.one(f"no motion begins where {', '.join(lost)} has no position or velocity")
    in_order = [states[str(coordinate.get("name"))] for coordinate in world.iter("joint")]
    positions, velocities = zip(*in_order, strict=True)
    key = element(root, "keyframe")
    element(key, "key", name=KEY, qpos=map(float, positions), qvel=map(float, velocities))
