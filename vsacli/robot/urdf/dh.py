"""Denavit-Hartenberg rows of a URDF's chain by common normals, and the deviation of the resulting robot.

Numbers that are short ones, or multiples of pi/2, but for rounding in the file are replaced by these.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import DenavitHartenberg, Pose
from vsacli.robot.kinematics import frames
from vsacli.robot.model import Robot
from vsacli.robot.urdf.link_tree import inverse_pose, pose_matrix, transform
from vsacli.robot.urdf.serial_chain import ChainJoint, SerialChain

SNAP_ANGLE = 1e-4
"""Default angle, rad; axes closer to parallel are made parallel if their common normal is far away."""

FAR_NORMAL = 10.0
"""Distance of a common normal from the joints, m, up to which no axis is made parallel at any angle."""

FILE_ROUNDING = 1e-11
"""Rounding of the file: difference from a right angle, rad, or from a short number, over the largest one."""

SHORT_DECIMALS = 9
"""Most decimals of a short number, relative to the largest number."""


class Axis(NamedTuple):
    """A line: one of its points, m, and its unit direction, (3,) each."""

    point: FloatArray
    direction: FloatArray


class Snap(NamedTuple):
    """An axis that was made parallel to the one before it: name of its joint, and the angle removed, rad."""

    joint: str
    angle: float


@dataclass(frozen=True)
class Frames:
    """The frames of a chain at position zero.

    Attributes:
        base: pose of frame 0 in the base, (4, 4).
        rows: rows from each frame to the next.
        poses: poses of frames 1 to N in the base, each (4, 4).
        tool: pose of the tip in frame N, (4, 4).
        snaps: axes that were made parallel.
        scale: largest coordinate, m.
    """

    base: FloatArray
    rows: tuple[DenavitHartenberg, ...]
    poses: tuple[FloatArray, ...]
    tool: FloatArray
    snaps: tuple[Snap, ...]
    scale: float


def dh_frames(joints: Sequence[ChainJoint], tip: FloatArray, snap: float) -> Frames:
    """Return the Denavit-Hartenberg frames of a chain.

    Args:
        joints: joints from the base.
        tip: pose of the tip in the base at position zero, (4, 4).
        snap: angle, rad, below which axes are made parallel.
    """
    axes, snaps = _make_parallel(joints, _axes(joints), snap)
    frame = _first_frame(axes[0])
    poses = [frame]
    for axis in axes[1:]:
        frame = _next_frame(frame, axis)
        poses.append(frame)
    poses.append(_last_frame(frame, tip))
    scale = float(max(abs(pose[:3, 3]).max() for pose in (*poses, tip)))
    return Frames(
        base=poses[0],
        rows=tuple(_dh_row(inverse_pose(pose) @ next_pose, scale) for pose, next_pose in pairwise(poses)),
        poses=tuple(poses[1:]),
        tool=inverse_pose(poses[-1]) @ tip,
        snaps=snaps,
        scale=scale,
    )


def tidy(numbers: FloatArray, scale: float) -> FloatArray:
    """Return numbers, replaced by short ones from which they differ by rounding; `scale` is the largest."""
    short = np.round(numbers, SHORT_DECIMALS - _exponent(scale))
    return np.where(abs(numbers - short) <= FILE_ROUNDING * scale, short, numbers) + 0.0  # no negative zero


def _exponent(scale: float) -> int:
    return math.ceil(math.log10(scale)) if scale > 0 else 0


def tidy_angle(angle: float) -> float:
    """Return an angle, replaced by the multiple of pi/2 from which it differs by rounding."""
    right_angles = round(angle / (math.pi / 2))
    nearest = right_angles * (math.pi / 2)
    return nearest if abs(angle - nearest) <= FILE_ROUNDING else angle


def _axes(joints: Sequence[ChainJoint]) -> list[Axis]:
    """Return the axes; a prismatic joint's, whose location is arbitrary, passes through the next joint."""
    axes: list[Axis] = []
    for joint in reversed(joints):
        point = axes[-1].point if axes and not joint.is_revolute else joint.origin
        axes.append(Axis(point, joint.direction))
    return axes[::-1]


def _make_parallel(
    joints: Sequence[ChainJoint], axes: Sequence[Axis], snap: float
) -> tuple[list[Axis], tuple[Snap, ...]]:
    """Return the axes, rotated about their own points if nearly parallel to the ones before."""
    result, snaps = [axes[0]], []
    for joint, axis in zip(joints[1:], axes[1:], strict=True):
        before = result[-1]
        sine = float(np.linalg.norm(np.cross(before.direction, axis.direction)))
        if sine <= FILE_ROUNDING or (sine < snap and _normal_is_far(before, axis)):
            direction = before.direction * math.copysign(1, before.direction @ axis.direction)
            axis = Axis(axis.point, direction)
            snaps += [Snap(joint.urdf.name, sine)] if sine > FILE_ROUNDING else []
        result.append(axis)
    return result, tuple(snaps)


def _normal_is_far(first: Axis, second: Axis) -> bool:
    return max(map(abs, _common_normal_feet(first, second))) > FAR_NORMAL


def _common_normal_feet(first: Axis, second: Axis) -> tuple[float, float]:
    """Return the feet of the common normal of two axes, as distances along each axis from its point, m."""
    across = second.point - first.point
    normal = np.cross(first.direction, second.direction)
    scaled = normal / (normal @ normal)
    return (
        float(np.cross(across, second.direction) @ scaled),
        float(np.cross(across, first.direction) @ scaled),
    )


def _first_frame(axis: Axis) -> FloatArray:
    """Return the frame on the first axis with origin and x axis closest to the base frame's."""
    origin = axis.point - (axis.point @ axis.direction) * axis.direction
    x, y, _ = np.eye(3)
    reference = x if abs(axis.direction[0]) < math.sqrt(0.5) else y
    return _frame_from_axes(axis.direction, _perpendicular_part(reference, axis.direction), origin)


def _next_frame(frame: FloatArray, axis: Axis) -> FloatArray:
    """Return the frame on an axis, at the common normal with the z axis of the frame before."""
    before = Axis(frame[:3, 3], frame[:3, 2])
    normal = np.cross(before.direction, axis.direction)
    if np.linalg.norm(normal) <= FILE_ROUNDING:
        return _parallel_frame(frame, axis)
    foot_before, foot = _common_normal_feet(before, axis)
    origin = axis.point + foot * axis.direction
    across = origin - (before.point + foot_before * before.direction)
    x = _perpendicular_part(normal, axis.direction)
    distance = float(x @ across)
    if distance < 0 if abs(distance) > _negligible(origin) else _turns_back(x, frame):
        x = -x
    return _frame_from_axes(axis.direction, x, origin)


def _parallel_frame(frame: FloatArray, axis: Axis) -> FloatArray:
    """Return the frame on a parallel axis, without offset along it, and without rotation if they coincide."""
    across = axis.point - frame[:3, 3]
    across = across - (across @ axis.direction) * axis.direction
    distance = float(np.linalg.norm(across))
    if distance <= _negligible(axis.point):
        return _frame_from_axes(axis.direction, frame[:3, 0], frame[:3, 3])
    return _frame_from_axes(axis.direction, across / distance, frame[:3, 3] + across)


def _turns_back(x: FloatArray, frame: FloatArray) -> bool:
    """Return whether -x is closer to the previous x axis, or to the previous y axis if x is normal to x."""
    along_x, along_y = float(x @ frame[:3, 0]), float(x @ frame[:3, 1])
    return along_x < -FILE_ROUNDING or (abs(along_x) <= FILE_ROUNDING and along_y < 0)


def _negligible(point: FloatArray) -> float:
    """Return the distance, m, below which two points like this differ only by rounding."""
    return 1e-13 * max(1.0, float(np.abs(point).max()))


def _last_frame(frame: FloatArray, tip: FloatArray) -> FloatArray:
    """Return the frame on the last axis at the height of the tip, with the tip's x axis if possible."""
    axis = frame[:3, 2]
    origin = frame[:3, 3] + (axis @ (tip[:3, 3] - frame[:3, 3])) * axis
    along = abs(float(axis @ tip[:3, 0]))
    x = _perpendicular_part(tip[:3, 0], axis) if along < math.sqrt(0.5) else frame[:3, 0]
    return _frame_from_axes(axis, x, origin)


def _perpendicular_part(vector: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the unit vector along the component of a vector normal to an axis."""
    part = vector - (vector @ axis) * axis
    result: FloatArray = part / np.linalg.norm(part)
    return result


def _frame_from_axes(z: FloatArray, x: FloatArray, origin: FloatArray) -> FloatArray:
    return transform(np.column_stack([x, np.cross(z, x), z]), origin)


def _dh_row(step: FloatArray, scale: float) -> DenavitHartenberg:
    """Return the row of a transform between two frames that follow the convention."""
    theta = tidy_angle(math.atan2(step[1, 0], step[0, 0]))
    alpha = tidy_angle(math.atan2(step[2, 1], step[2, 2]))
    along_x = math.cos(theta) * step[0, 3] + math.sin(theta) * step[1, 3]
    a, d = tidy(np.array([along_x, step[2, 3]]), scale).tolist()
    return DenavitHartenberg(a=a, alpha=alpha, d=d, theta=theta)


SAMPLES = 256
SEED = 1
DRAWN_HALF_WIDTH = {True: np.pi, False: 1.0}
"""Half the range of random positions of a revolute (rad) or prismatic (m) joint without limits."""


class KinematicResidual(NamedTuple):
    """Largest distance, m, and angle, rad, between the tips, over random joint positions."""

    position: float
    orientation: float


def kinematic_residual(chain: SerialChain, robot: Robot) -> KinematicResidual:
    """Compare the tips of chain and robot at random positions within the limits."""
    q = _random_joint_positions(chain.joints)
    expected, tips = _chain_tips(chain, q), _robot_tips(robot, q)
    shift = np.linalg.norm(tips[:, :3, 3] - expected[:, :3, 3], axis=1)
    turn = np.linalg.norm(tips[:, :3, :3] - expected[:, :3, :3], axis=(1, 2)) / np.sqrt(2)
    return KinematicResidual(float(shift.max()), float(turn.max()))


def _random_joint_positions(joints: Sequence[ChainJoint]) -> FloatArray:
    """Return random positions, (samples, joints), rad (m)."""
    rng = np.random.default_rng(SEED)
    reach = np.array([DRAWN_HALF_WIDTH[joint.is_revolute] for joint in joints])
    file_limits = [joint.urdf.limit.position for joint in joints]
    bounds = [limits or (-1e9, 1e9) for limits in file_limits]
    lower, upper = np.clip(np.array(bounds).T, -reach, reach)
    return rng.uniform(lower, upper, (SAMPLES, len(joints)))


def _chain_tips(chain: SerialChain, q: FloatArray) -> FloatArray:
    """Return the poses of the tip, (samples, 4, 4), by moving every joint in its own URDF frame."""
    poses = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    before = np.eye(4)
    for joint, positions in zip(chain.joints, q.T, strict=True):
        poses = poses @ (inverse_pose(before) @ joint.frame) @ joint.urdf.motions(positions)
        before = joint.frame
    result: FloatArray = poses @ (inverse_pose(before) @ chain.tip_pose)
    return result


def _robot_tips(robot: Robot, q: FloatArray) -> FloatArray:
    last = frames(robot, q).links[-1]
    poses = np.tile(np.eye(4), (len(q), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = last.axes, last.origin
    result: FloatArray = _matrix_of_pose(robot.base) @ poses @ _matrix_of_pose(robot.tool)
    return result


def _matrix_of_pose(pose: Pose) -> FloatArray:
    return pose_matrix(pose.xyz, pose.rpy)
