"""Denavit-Hartenberg rows of a chain of frames, and how far the robot that they give deviates from it."""

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
from vsacli.robot.urdf.link_tree import inverse, pose_matrix, transform
from vsacli.robot.urdf.serial_chain import ChainJoint, SerialChain

SNAP_ANGLE = 1e-4
"""rad; by default, axes closer to parallel are made parallel if their common normal is far away."""

FAR_NORMAL = 10.0
"""m; a common normal this close to the joints needs no snapping, however small the angle."""

FILE_ROUNDING = 1e-11
"""rad, or relative to the largest number; less to a right angle or a short number is rounding of the file."""

SHORT_DECIMALS = 9
"""Decimals, relative to the largest number, that a short number has at most."""


class Axis(NamedTuple):
    """A line: a point of it and its unit direction, (3,) each."""

    point: FloatArray
    direction: FloatArray


class Snap(NamedTuple):
    """An axis that was made parallel to the one before it: name of its joint, and the angle in rad."""

    joint: str
    angle: float


@dataclass(frozen=True)
class Frames:
    """The frames of a chain at position zero.

    Attributes:
        base: pose of frame 0 in the base, (4, 4).
        rows: lead from each frame to the next.
        poses: of the frames 1 to N in the base, each (4, 4).
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
    """Return the frames of a chain whose tip has the pose `tip` at position zero.

    Args:
        joints: from the base.
        tip: (4, 4), in the base.
        snap: angle in rad below which axes are made parallel.
    """
    axes, snaps = _parallelled(joints, _axes(joints), snap)
    frame = _first_frame(axes[0])
    poses = [frame]
    for axis in axes[1:]:
        frame = _next_frame(frame, axis)
        poses.append(frame)
    poses.append(_last_frame(frame, tip))
    scale = float(max(abs(pose[:3, 3]).max() for pose in (*poses, tip)))
    return Frames(
        base=poses[0],
        rows=tuple(_row(inverse(pose) @ next_pose, scale) for pose, next_pose in pairwise(poses)),
        poses=tuple(poses[1:]),
        tool=inverse(poses[-1]) @ tip,
        snaps=snaps,
        scale=scale,
    )


def tidy(numbers: FloatArray, scale: float) -> FloatArray:
    """Return the numbers, each replaced by the short one of which it is rounding; `scale` is the largest."""
    short = np.round(numbers, SHORT_DECIMALS - _exponent(scale))
    return np.where(abs(numbers - short) <= FILE_ROUNDING * scale, short, numbers) + 0.0  # no negative zero


def _exponent(scale: float) -> int:
    return math.ceil(math.log10(scale)) if scale > 0 else 0


def tidy_angle(angle: float) -> float:
    """Return the angle, or the multiple of pi/2 of which it is rounding."""
    right_angles = round(angle / (math.pi / 2))
    nearest = right_angles * (math.pi / 2)
    return nearest if abs(angle - nearest) <= FILE_ROUNDING else angle


def _axes(joints: Sequence[ChainJoint]) -> list[Axis]:
    """Return the axes; the free line of a prismatic joint passes through the next joint."""
    axes: list[Axis] = []
    for joint in reversed(joints):
        point = axes[-1].point if axes and not joint.is_revolute else joint.origin
        axes.append(Axis(point, joint.direction))
    return axes[::-1]


def _parallelled(
    joints: Sequence[ChainJoint], axes: Sequence[Axis], snap: float
) -> tuple[list[Axis], tuple[Snap, ...]]:
    """Return the axes, those nearly parallel to the one before turned about their own point."""
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
    return max(map(abs, _feet(first, second))) > FAR_NORMAL


def _feet(first: Axis, second: Axis) -> tuple[float, float]:
    """Return where the common normal of two axes meets each, as distance along it from its point."""
    across = second.point - first.point
    normal = np.cross(first.direction, second.direction)
    scaled = normal / (normal @ normal)
    return (
        float(np.cross(across, second.direction) @ scaled),
        float(np.cross(across, first.direction) @ scaled),
    )


def _first_frame(axis: Axis) -> FloatArray:
    """Return the frame on the first axis that is closest to the base's own."""
    origin = axis.point - (axis.point @ axis.direction) * axis.direction
    x, y, _ = np.eye(3)
    reference = x if abs(axis.direction[0]) < math.sqrt(0.5) else y
    return _frame(axis.direction, _across(reference, axis.direction), origin)


def _next_frame(frame: FloatArray, axis: Axis) -> FloatArray:
    """Return the frame on an axis, by the common normal with the z axis of the frame before."""
    before = Axis(frame[:3, 3], frame[:3, 2])
    normal = np.cross(before.direction, axis.direction)
    if np.linalg.norm(normal) <= FILE_ROUNDING:
        return _parallel_frame(frame, axis)
    foot_before, foot = _feet(before, axis)
    origin = axis.point + foot * axis.direction
    across = origin - (before.point + foot_before * before.direction)
    x = _across(normal, axis.direction)
    distance = float(x @ across)
    if distance < 0 if abs(distance) > _negligible(origin) else _turns_back(x, frame):
        x = -x
    return _frame(axis.direction, x, origin)


def _parallel_frame(frame: FloatArray, axis: Axis) -> FloatArray:
    """No offset along parallel axes, and no turn if they coincide."""
    across = axis.point - frame[:3, 3]
    across = across - (across @ axis.direction) * axis.direction
    distance = float(np.linalg.norm(across))
    if distance <= _negligible(axis.point):
        return _frame(axis.direction, frame[:3, 0], frame[:3, 3])
    return _frame(axis.direction, across / distance, frame[:3, 3] + across)


def _turns_back(x: FloatArray, frame: FloatArray) -> bool:
    """Return whether -x is closer to the x axis before, or to its y axis if x is at right angles to that."""
    along_x, along_y = float(x @ frame[:3, 0]), float(x @ frame[:3, 1])
    return along_x < -FILE_ROUNDING or (abs(along_x) <= FILE_ROUNDING and along_y < 0)


def _negligible(point: FloatArray) -> float:
    """m; distances below are rounding of coordinates of this size."""
    return 1e-13 * max(1.0, float(np.abs(point).max()))


def _last_frame(frame: FloatArray, tip: FloatArray) -> FloatArray:
    """Return the frame on the last axis beside the tip, turned as the tip if that needs no tilt."""
    axis = frame[:3, 2]
    origin = frame[:3, 3] + (axis @ (tip[:3, 3] - frame[:3, 3])) * axis
    along = abs(float(axis @ tip[:3, 0]))
    x = _across(tip[:3, 0], axis) if along < math.sqrt(0.5) else frame[:3, 0]
    return _frame(axis, x, origin)


def _across(vector: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the unit vector along the part of a vector at right angles to an axis."""
    part = vector - (vector @ axis) * axis
    result: FloatArray = part / np.linalg.norm(part)
    return result


def _frame(z: FloatArray, x: FloatArray, origin: FloatArray) -> FloatArray:
    return transform(np.column_stack([x, np.cross(z, x), z]), origin)


def _row(step: FloatArray, scale: float) -> DenavitHartenberg:
    """Return the row of the transform between two frames that obey the convention."""
    theta = tidy_angle(math.atan2(step[1, 0], step[0, 0]))
    alpha = tidy_angle(math.atan2(step[2, 1], step[2, 2]))
    along_x = math.cos(theta) * step[0, 3] + math.sin(theta) * step[1, 3]
    a, d = tidy(np.array([along_x, step[2, 3]]), scale).tolist()
    return DenavitHartenberg(a=a, alpha=alpha, d=d, theta=theta)


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
    """Return the tip's poses, (samples, 4, 4), by moving every joint in its own URDF frame."""
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
