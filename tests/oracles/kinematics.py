"""Forward kinematics by 4x4 matrices, and the Jacobian of the tool by complex steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import Joint, Pose
from vsacli.robot.model import Robot

STEP = 1e-30
"""A complex step has no cancellation, and the square of this one vanishes against 1."""


def tool_pose(robot: Robot, q: npt.NDArray[Any]) -> npt.NDArray[np.complex128]:
    """The tool frame in the base frame, (4, 4), at joint positions (joints,) that may be complex."""
    pose = transform(robot.base)
    for joint, position in zip(robot.joints, q, strict=True):
        pose = pose @ _row(joint, position)
    return pose @ transform(robot.tool)


def jacobian(robot: Robot, q: FloatArray) -> FloatArray:
    """Velocity of the tool origin, and angular velocity, by joint velocities; base axes, (6, joints)."""
    columns = []
    for unit in np.eye(len(q)):
        pose = tool_pose(robot, q + 1j * STEP * unit)
        rate = pose.imag / STEP
        spin = rate[:3, :3] @ pose.real[:3, :3].T
        columns.append([*rate[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]])
    return np.array(columns).T


def transform(pose: Pose) -> npt.NDArray[np.complex128]:
    """Of a pose as in URDF: turned about the fixed x axis, then y, then z."""
    roll, pitch, yaw = pose.rpy
    return _shift(*pose.xyz) @ _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)


def _row(joint: Joint, q: complex) -> npt.NDArray[np.complex128]:
    turn, slide = (q, 0) if joint.is_revolute else (0, q)
    about_z = _turn(2, joint.dh.theta + turn) @ _shift(0, 0, joint.dh.d + slide)
    return about_z @ _shift(joint.dh.a, 0, 0) @ _turn(0, joint.dh.alpha)


def _turn(axis: int, angle: complex) -> npt.NDArray[np.complex128]:
    second, third = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4, dtype=np.complex128)
    matrix[second, second] = matrix[third, third] = np.cos(angle)
    matrix[third, second] = np.sin(angle)
    matrix[second, third] = -np.sin(angle)
    return matrix


def _shift(x: complex, y: complex, z: complex) -> npt.NDArray[np.complex128]:
    matrix = np.eye(4, dtype=np.complex128)
    matrix[:3, 3] = x, y, z
    return matrix
