"""Denavit-Hartenberg rows of a URDF's joints by common normals, and the deviation of the resulting robot.

Numbers that are short ones, or multiples of pi/2, but for rounding in the file are replaced by these.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import DenavitHartenberg
from vsacli.robot.kinematics import forward_kinematics
from vsacli.robot.model import Robot
from vsacli.robot.urdf.link_tree import inverse_pose, transform
from vsacli.robot.urdf.moving_tree import MovingJoint, MovingTree, Tip

SNAP_ANGLE = 1e-4
"""Default angle, rad; axes closer to parallel are made parallel if their common normal is far away."""

FAR_NORMAL_DISTANCE = 10.0
"""Distance of a common normal from the joints, m, up to which no axis is made parallel at any angle, and a
link with several joints may have its frame on it."""

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
    """The frames of a robot at position zero.

    Attributes:
        base: pose of frame 0 in the base, (4, 4).
        seats: poses in the base of the frames at which the rows begin, each (4, 4).
        rows: row of each joint, from its seat to its link frame.
        poses: poses of the link frames 1 to N in the base, each (4, 4).
        tools: pose of each tip in the frame of its link, (4, 4).
        snaps: axes that were made parallel.
        scale: largest coordinate, m.
    """

    base: FloatArray
    seats: tuple[FloatArray, ...]
    rows: tuple[DenavitHartenberg, ...]
    poses: tuple[FloatArray, ...]
    tools: tuple[FloatArray, ...]
    snaps: tuple[Snap, ...]
    scale: float


def dh_frames(joints: Sequence[MovingJoint], tips: Sequence[Tip], snap: float) -> Frames:
    """Return the Denavit-Hartenberg frames of a chain or tree.

    The frame of a link is the seat of the first joint on it whose common normal is near; the seats of others
    do not depend on that choice. So another order of the joints changes the frames of the links that carry
    several, and nothing else.

    Args:
        joints: joints from the base.
        tips: links of the end effectors.
        snap: angle, rad, below which axes are made parallel.
    """
    children = _joints_on_links(joints)
    axes, snaps = _make_parallel(joints, _axes(joints, children), children, snap)
    is_near = [
        joint.parent < 0 or len(children[joint.parent]) == 1 or not _normal_is_far(axes[joint.parent], axis)
        for joint, axis in zip(joints, axes, strict=True)
    ]
    seats: list[FloatArray] = []
    for joint, axis, uses_normal in zip(joints, axes, is_near, strict=True):
        seats.append(_seat_on_axis(seats[joint.parent] if joint.parent >= 0 else None, axis, uses_normal))
    poses: list[FloatArray] = []
    for index, seat in enumerate(seats):
        child_seats = [seats[child] for child in children[index] if is_near[child]]
        tip_frames = [
            _last_frame(seat, tip.pose) for tip in tips if tip.joint == index and not children[index]
        ]
        poses.append([*child_seats, *tip_frames, seat][0])
    scale = float(max(abs(pose[:3, 3]).max() for pose in (*seats, *poses, *(tip.pose for tip in tips))))
    relative_poses = (inverse_pose(seat) @ pose for seat, pose in zip(seats, poses, strict=True))
    return Frames(
        base=seats[0],
        seats=tuple(seats),
        rows=tuple(_dh_row(step, scale) for step in relative_poses),
        poses=tuple(poses),
        tools=tuple(inverse_pose(poses[tip.joint]) @ tip.pose for tip in tips),
        snaps=snaps,
        scale=scale,
    )


def _joints_on_links(joints: Sequence[MovingJoint]) -> dict[int, list[int]]:
    """Return the indices of the joints on the link of each joint, those on the base under -1."""
    children: dict[int, list[int]] = {index: [] for index in range(-1, len(joints))}
    for index, joint in enumerate(joints):
        children[joint.parent].append(index)
    return children


def tidy(numbers: FloatArray, scale: float) -> FloatArray:
    """Return numbers, replaced by short ones from which they differ by rounding; `scale` is the largest."""
    exponent = math.ceil(math.log10(scale)) if scale > 0 else 0
    short_numbers = np.round(numbers, SHORT_DECIMALS - exponent)
    return (
        np.where(abs(numbers - short_numbers) <= FILE_ROUNDING * scale, short_numbers, numbers) + 0.0
    )  # no negative zero


def tidy_angle(angle: float) -> float:
    """Return an angle, replaced by the multiple of pi/2 from which it differs by rounding."""
    right_angles = round(angle / (math.pi / 2))
    nearest = right_angles * (math.pi / 2)
    return nearest if abs(angle - nearest) <= FILE_ROUNDING else angle


def _axes(joints: Sequence[MovingJoint], children: Mapping[int, Sequence[int]]) -> list[Axis]:
    """Return the axes; a prismatic joint's, whose location is arbitrary, passes through the only next one."""
    axes: dict[int, Axis] = {}
    for index, joint in reversed(list(enumerate(joints))):
        child_indices = children[index]
        point = (
            axes[child_indices[0]].point
            if len(child_indices) == 1 and not joint.is_revolute
            else joint.origin
        )
        axes[index] = Axis(point, joint.direction)
    return [axes[index] for index in range(len(joints))]


def _make_parallel(
    joints: Sequence[MovingJoint], axes: Sequence[Axis], children: Mapping[int, Sequence[int]], snap: float
) -> tuple[list[Axis], tuple[Snap, ...]]:
    """Return the axes, rotated about their own points if nearly parallel to the ones before.

    Of several joints on a link, a mount takes those whose common normal is far away.
    """
    parallel_axes: list[Axis] = []
    snaps: list[Snap] = []
    for joint, axis in zip(joints, axes, strict=True):
        if joint.parent >= 0:
            previous_axis = parallel_axes[joint.parent]
            sine = _sine_between(previous_axis, axis)
            is_only = len(children[joint.parent]) == 1
            if sine <= FILE_ROUNDING or (is_only and sine < snap and _normal_is_far(previous_axis, axis)):
                direction = previous_axis.direction * math.copysign(
                    1, previous_axis.direction @ axis.direction
                )
                axis = Axis(axis.point, direction)
                snaps += [Snap(joint.urdf.name, sine)] if sine > FILE_ROUNDING else []
        parallel_axes.append(axis)
    return parallel_axes, tuple(snaps)


def _sine_between(first: Axis, second: Axis) -> float:
    return float(np.linalg.norm(np.cross(first.direction, second.direction)))


def _normal_is_far(first: Axis, second: Axis) -> bool:
    """Return whether the common normal is far away; that of parallel axes is not."""
    is_parallel = _sine_between(first, second) <= FILE_ROUNDING
    return not is_parallel and max(map(abs, _common_normal_feet(first, second))) > FAR_NORMAL_DISTANCE


def _common_normal_feet(first: Axis, second: Axis) -> tuple[float, float]:
    """Return the feet of the common normal of two axes, as distances along each axis from its point, m."""
    between_points = second.point - first.point
    normal = np.cross(first.direction, second.direction)
    scaled_normal = normal / (normal @ normal)
    return (
        float(np.cross(between_points, second.direction) @ scaled_normal),
        float(np.cross(between_points, first.direction) @ scaled_normal),
    )


def _seat_on_axis(carrier_seat: FloatArray | None, axis: Axis, is_near: bool) -> FloatArray:
    """Return the frame at which the row of a joint begins: on its axis, where the frames before suggest.

    Args:
        carrier_seat: seat of the joint before; None on the base.
        axis: axis of the joint.
        is_near: whether the common normal with the axis before is to be used.
    """
    if carrier_seat is None:
        origin = axis.point - (axis.point @ axis.direction) * axis.direction  # the closest to the base's
        return _frame_facing(np.eye(4), Axis(origin, axis.direction))
    return _next_frame(carrier_seat, axis) if is_near else _frame_facing(carrier_seat, axis)


def _frame_facing(frame: FloatArray, axis: Axis) -> FloatArray:
    """Return the frame at the point of an axis with the x axis closest to a frame's x axis, or its y axis."""
    x, y = frame[:3, 0], frame[:3, 1]
    reference = x if abs(axis.direction @ x) < math.sqrt(0.5) else y
    return _frame_from_axes(axis.direction, _perpendicular_part(reference, axis.direction), axis.point)


def _next_frame(frame: FloatArray, axis: Axis) -> FloatArray:
    """Return the frame on an axis, at the common normal with the z axis of the frame before."""
    previous_axis = Axis(frame[:3, 3], frame[:3, 2])
    normal = np.cross(previous_axis.direction, axis.direction)
    if np.linalg.norm(normal) <= FILE_ROUNDING:
        return _parallel_frame(frame, axis)
    foot_before, foot = _common_normal_feet(previous_axis, axis)
    origin = axis.point + foot * axis.direction
    across = origin - (previous_axis.point + foot_before * previous_axis.direction)
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
    return part / np.linalg.norm(part)


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
    """Largest distance, m, and angle, rad, between tools and tips, over random joint positions."""

    position: float
    orientation: float


def kinematic_residual(tree: MovingTree, robot: Robot) -> KinematicResidual:
    """Compare the tools of the robot with the tips of the URDF at random positions within the limits."""
    q = _random_joint_positions(tree.joints)
    expected, tools = _tip_poses(tree, q), forward_kinematics(robot, q)[:, len(robot.joints) :]
    shift = np.linalg.norm(tools[..., :3, 3] - expected[..., :3, 3], axis=-1)
    turn = np.linalg.norm(tools[..., :3, :3] - expected[..., :3, :3], axis=(-1, -2)) / np.sqrt(2)
    return KinematicResidual(float(shift.max()), float(turn.max()))


def _random_joint_positions(joints: Sequence[MovingJoint]) -> FloatArray:
    """Return random positions, (samples, joints), rad (m)."""
    rng = np.random.default_rng(SEED)
    reach = np.array([DRAWN_HALF_WIDTH[joint.is_revolute] for joint in joints])
    file_limits = [joint.urdf.limit.position for joint in joints]
    bounds = [limits or (-1e9, 1e9) for limits in file_limits]
    lower, upper = np.clip(np.array(bounds).T, -reach, reach)
    return rng.uniform(lower, upper, (SAMPLES, len(joints)))


def _tip_poses(tree: MovingTree, q: FloatArray) -> FloatArray:
    """Return the poses of the tips, (samples, tips, 4, 4), by moving every joint in its own URDF frame."""
    poses: list[FloatArray] = []  # motion of each joint's link from its pose at position zero
    for joint, positions in zip(tree.joints, q.T, strict=True):
        carrying = poses[joint.parent] if joint.parent >= 0 else np.eye(4)
        poses.append(carrying @ joint.frame @ joint.urdf.motions(positions) @ inverse_pose(joint.frame))
    return np.stack([poses[tip.joint] @ tip.pose for tip in tree.tips], axis=1)
