"""Forward kinematics of the frames of a robot by standard Denavit-Hartenberg rows, and its Jacobian."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from vsacli.base.arrays import FloatArray, checked_shape
from vsacli.base.wrench import WRENCH_AXES, check_frame
from vsacli.compute.vector import Matrix, Vector, add, exact, mul, sub, trigonometric
from vsacli.robot.joint import DenavitHartenberg, Pose
from vsacli.robot.model import Robot, check_robot

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class DhJoint(Protocol):
    """The part of a joint that determines its frame."""

    @property
    def dh(self) -> DenavitHartenberg:
        """Denavit-Hartenberg row."""

    @property
    def is_revolute(self) -> bool:
        """Whether the joint variable is an angle."""


class Geometry(Protocol):
    """The part of a robot that determines its frames."""

    @property
    def base(self) -> Pose:
        """Pose of DH frame 0 in the base frame."""

    @property
    def tool(self) -> Pose:
        """Pose of the end effector in the last DH frame."""

    @property
    def joints(self) -> Sequence[DhJoint]:
        """Joints from the base to the tip."""


class FramePose(NamedTuple):
    """A frame in another one: axes as columns, ([samples,] 3, 3), and origin, ([samples,] 3), m."""

    axes: FloatArray
    origin: FloatArray

    def point(self, local: tuple[float, float, float]) -> FloatArray:
        """Return a point of this frame in the outer frame, (samples, 3), m."""
        return np.asarray(self.axes @ np.array(local) + self.origin)

    def compose(self, inner: FramePose) -> FramePose:
        """Return a frame that is given in this one as a frame of the outer one."""
        origin = (self.axes @ inner.origin[..., None])[..., 0] + self.origin
        return FramePose(self.axes @ inner.axes, origin)


def frames(robot: Geometry, q: FloatArray) -> Iterator[FramePose]:
    """Yield frames 0 to N in DH frame 0, at joint positions q, (samples, joints)."""
    frame = FramePose(np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3)))
    yield frame
    for joint, variable in zip(robot.joints, q.T, strict=True):
        frame = frame.compose(_link_frame(joint, variable))
        yield frame


def _link_frame(joint: DhJoint, variable: FloatArray) -> FramePose:
    """Return frame i in frame i-1: Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    dh, zero = joint.dh, np.zeros_like(variable)
    theta, d = (dh.theta + variable, dh.d + zero) if joint.is_revolute else (dh.theta + zero, dh.d + variable)
    c, s, ca, sa = np.cos(theta), np.sin(theta), math.cos(dh.alpha), math.sin(dh.alpha)
    rows = [[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, zero + sa, zero + ca]]
    return FramePose(np.moveaxis(np.array(rows), -1, 0), np.stack([dh.a * c, dh.a * s, d], axis=-1))


def forward_kinematics(robot: Robot, q: ArrayLike) -> FloatArray:
    """Return the poses of the link frames (DH frames 1 to N) and of the end effector, in the base frame.

    Args:
        robot: robot with its base and tool poses.
        q: joint positions, ([samples,] joints), rad (m).

    Returns:
        Homogeneous 4x4 matrices, ([samples,] joints + 1, 4, 4): axes as columns, origin in m; the last one is
        that of the end effector.

    Raises:
        InputError: q has another shape.
        TypeError: robot is of another type.
    """
    check_robot(robot)
    positions = checked_shape("q", q, len(robot.joints))
    _, *moving = frames_in_base(robot, np.atleast_2d(positions))
    poses = np.zeros((*np.atleast_2d(positions).shape[:1], len(moving), 4, 4))
    poses[..., 3, 3] = 1
    for index, frame in enumerate(moving):
        poses[:, index, :3, :3], poses[:, index, :3, 3] = frame
    return poses.reshape(*positions.shape[:-1], *poses.shape[1:])


def jacobian(robot: Robot, q: ArrayLike, frame: str = "end_effector") -> FloatArray:
    """Return the geometric Jacobian: velocity and angular velocity of the end effector per joint velocity.

    The power of a `Wrench` w in the same frame is w^T J q', so that it changes tau_e by -J^T w.

    Args:
        robot: robot with its base and tool poses.
        q: joint positions, ([samples,] joints), rad (m).
        frame: frame along whose axes the components are, "end_effector" or "base", as of a `Wrench`.

    Returns:
        J, ([samples,] 6, joints): velocity of the tool frame's origin, then angular velocity, in the order of
        fx fy fz mx my mz; m/rad and rad/rad (m/m and 0 for a prismatic joint).

    Raises:
        InputError: q has another shape, or there is no such frame.
        TypeError: robot is of another type.
    """
    check_robot(robot)
    check_frame(frame, "Jacobian")
    positions = checked_shape("q", q, len(robot.joints))
    *driving, _, tool = frames_in_base(robot, np.atleast_2d(positions))
    columns = np.zeros((*np.atleast_2d(positions).shape[:1], len(WRENCH_AXES), len(robot.joints)))
    for index, (joint, moved) in enumerate(zip(robot.joints, driving, strict=True)):
        axis = moved.axes[..., 2]
        columns[:, :3, index] = np.cross(axis, tool.origin - moved.origin) if joint.is_revolute else axis
        columns[:, 3:, index] = axis if joint.is_revolute else 0
    if frame == "end_effector":
        turn = np.swapaxes(tool.axes, -1, -2)
        columns = np.concatenate((turn @ columns[:, :3], turn @ columns[:, 3:]), axis=1)
    return columns.reshape(*positions.shape[:-1], *columns.shape[1:])


def frames_in_base(robot: Geometry, q: FloatArray) -> Iterator[FramePose]:
    """Yield frames 0 to N and the end effector's in the base frame, at positions q, (samples, joints)."""
    base, tool = _constant_frame(robot.base), _constant_frame(robot.tool)
    for frame in frames(robot, q):
        last = base.compose(frame)
        yield last
    yield last.compose(tool)


def _constant_frame(pose: Pose) -> FramePose:
    return FramePose(np.array(rotation_matrix(pose), dtype=np.float64), np.array(pose.xyz))


def tip_position(robot: Robot, q: FloatArray) -> FloatArray:
    """Return the origin of the tool frame in DH frame 0, (samples, 3), m, at q, (samples, joints)."""
    *_, last = frames(robot, q)
    return last.point(robot.tool.xyz)


def rotation_matrix(pose: Pose) -> Matrix:
    """Return Rz(yaw) Ry(pitch) Rx(roll), with exact zeros and ones at right angles."""
    (cr, cp, cy), (sr, sp, sy) = (
        [trigonometric(function, angle) for angle in pose.rpy] for function in ("cos", "sin")
    )
    return Matrix(
        Vector(mul(cy, cp), sub(mul(mul(cy, sp), sr), mul(sy, cr)), add(mul(mul(cy, sp), cr), mul(sy, sr))),
        Vector(mul(sy, cp), add(mul(mul(sy, sp), sr), mul(cy, cr)), sub(mul(mul(sy, sp), cr), mul(cy, sr))),
        Vector(sub(0, sp), mul(cp, sr), mul(cp, cr)),
    )


def base_gravity(robot: Robot) -> Vector:
    """Return the gravity acceleration in DH frame 0, m/s^2."""
    return rotation_matrix(robot.base).transposed().times(Vector(*map(exact, robot.gravity)))
