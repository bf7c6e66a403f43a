"""How well a robot's forward kinematics repeats that of the chain it was made from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import Pose
from vsacli.robot.kinematics import frames
from vsacli.robot.model import Robot
from vsacli.robot.urdf.rigid_motion import inverse, pose_matrix
from vsacli.robot.urdf.serial_chain import ChainJoint, SerialChain

SAMPLES = 256
SEED = 1
DRAWN_HALF_WIDTH = {True: np.pi, False: 1.0}
"""Half the range of the drawn positions of a revolute (rad) or prismatic (m) joint without limits."""


class Residual(NamedTuple):
    """Largest distance in m and angle in rad between the tips, over random positions of the joints."""

    position: float
    orientation: float


def kinematic_residual(chain: SerialChain, robot: Robot) -> Residual:
    """Compare the tips at random positions within the limits."""
    q = _positions(chain.joints)
    expected, found = _chain_tips(chain, q), _robot_tips(robot, q)
    shift = np.linalg.norm(found[:, :3, 3] - expected[:, :3, 3], axis=1)
    turn = np.linalg.norm(found[:, :3, :3] - expected[:, :3, :3], axis=(1, 2)) / np.sqrt(2)
    return Residual(float(shift.max()), float(turn.max()))


def _positions(joints: Sequence[ChainJoint]) -> FloatArray:
    """Random positions, (samples, joints)."""
    rng = np.random.default_rng(SEED)
    reach = np.array([DRAWN_HALF_WIDTH[joint.is_revolute] for joint in joints])
    given = [joint.urdf.limit.position for joint in joints]
    bounds = [limits or (-1e9, 1e9) for limits in given]
    lower, upper = np.clip(np.array(bounds).T, -reach, reach)
    return rng.uniform(lower, upper, (SAMPLES, len(joints)))


def _chain_tips(chain: SerialChain, q: FloatArray) -> FloatArray:
    """The tip's poses, (samples, 4, 4), by moving every joint in its own URDF frame."""
    poses = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    before = np.eye(4)
    for joint, positions in zip(chain.joints, q.T, strict=True):
        poses = poses @ (inverse(before) @ joint.frame) @ joint.urdf.motions(positions)
        before = joint.frame
    result: FloatArray = poses @ (inverse(before) @ chain.tip_pose)
    return result


def _robot_tips(robot: Robot, q: FloatArray) -> FloatArray:
    *_, last = frames(robot, q)
    poses = np.tile(np.eye(4), (len(q), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = last.axes, last.origin
    result: FloatArray = _matrix(robot.base) @ poses @ _matrix(robot.tool)
    return result


def _matrix(pose: Pose) -> FloatArray:
    return pose_matrix(pose.xyz, pose.rpy)
