"""Forward kinematics of a robot by standard Denavit-Hartenberg rows and mounts; Jacobians of its tools."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
    def mount(self) -> Pose | None:
        """Pose of the beginning of the row on the link that carries the joint; None if at its frame."""

    @property
    def is_revolute(self) -> bool:
        """Whether the joint variable is an angle."""


class Geometry(Protocol):
    """The part of a robot that determines its frames."""

    @property
    def base(self) -> Pose:
        """Pose of DH frame 0 in the base frame."""

    @property
    def joints(self) -> Sequence[DhJoint]:
        """Joints, each after the one that carries it."""

    @property
    def parents(self) -> Sequence[int]:
        """Index of the joint whose link carries each joint; -1 for frame 0."""

    @property
    def end_effectors(self) -> Sequence[Pose]:
        """Pose of each tool in the frame of its link."""

    @property
    def tool_joints(self) -> Sequence[int]:
        """Index of the joint whose link carries each tool."""


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


class RobotFrames(NamedTuple):
    """Frames of a robot, all in the same frame.

    Attributes:
        base: frame 0.
        seats: for each joint the frame at which its row begins; its z is the axis of the joint.
        links: frame of each link.
        tools: frame of each tool.
    """

    base: FramePose
    seats: tuple[FramePose, ...]
    links: tuple[FramePose, ...]
    tools: tuple[FramePose, ...]


def frames(robot: Geometry, q: FloatArray) -> RobotFrames:
    """Return the frames of a robot in DH frame 0, at joint positions q, (samples, joints)."""
    base = FramePose(np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3)))
    seats, links = list[FramePose](), list[FramePose]()
    for joint, parent, variable in zip(robot.joints, robot.parents, q.T, strict=True):
        carrier = links[parent] if parent >= 0 else base
        seats.append(carrier if joint.mount is None else carrier.compose(_constant_frame(joint.mount)))
        links.append(seats[-1].compose(_link_frame(joint, variable)))
    return RobotFrames(base, tuple(seats), tuple(links), _tool_frames(robot, links))


def frames_in_base(robot: Geometry, q: FloatArray) -> RobotFrames:
    """Return the frames of a robot in the base frame, at joint positions q, (samples, joints)."""
    base = _constant_frame(robot.base)
    frame_0, seats, links, _ = frames(robot, q)
    links_in_base = tuple(map(base.compose, links))
    tools = _tool_frames(robot, links_in_base)  # not composed from frame 0: other rounding than ever
    return RobotFrames(base.compose(frame_0), tuple(map(base.compose, seats)), links_in_base, tools)


def _tool_frames(robot: Geometry, links: Sequence[FramePose]) -> tuple[FramePose, ...]:
    return tuple(
        links[carrier].compose(_constant_frame(tool))
        for carrier, tool in zip(robot.tool_joints, robot.end_effectors, strict=True)
    )


def _link_frame(joint: DhJoint, variable: FloatArray) -> FramePose:
    """Return frame i in frame i-1: Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    dh, zero = joint.dh, np.zeros_like(variable)
    theta, d = (dh.theta + variable, dh.d + zero) if joint.is_revolute else (dh.theta + zero, dh.d + variable)
    c, s, ca, sa = np.cos(theta), np.sin(theta), math.cos(dh.alpha), math.sin(dh.alpha)
    rows = [[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, zero + sa, zero + ca]]
    return FramePose(np.moveaxis(np.array(rows), -1, 0), np.stack([dh.a * c, dh.a * s, d], axis=-1))


def forward_kinematics(robot: Robot, q: ArrayLike) -> FloatArray:
    """Return the poses of the link frames (DH frames 1 to N) and of the tools, in the base frame.

    Args:
        robot: robot with its base and tool poses.
        q: joint positions, ([samples,] joints), rad (m).

    Returns:
        Homogeneous 4x4 matrices, ([samples,] joints + tools, 4, 4): axes as columns, origin in m; the last
        ones are those of the tools, of a chain that of its end effector.

    Raises:
        InputError: q has another shape.
        TypeError: robot is of another type.
    """
    check_robot(robot)
    positions = checked_shape("q", q, len(robot.joints))
    _, _, links, tools = frames_in_base(robot, np.atleast_2d(positions))
    poses = np.zeros((*np.atleast_2d(positions).shape[:1], len(links) + len(tools), 4, 4))
    poses[..., 3, 3] = 1
    for index, frame in enumerate((*links, *tools)):
        poses[:, index, :3, :3], poses[:, index, :3, 3] = frame
    return poses.reshape(*positions.shape[:-1], *poses.shape[1:])


def jacobian(
    robot: Robot, q: ArrayLike, frame: str = "end_effector", *, tool: str | None = None
) -> FloatArray:
    """Return the geometric Jacobian: velocity and angular velocity of a tool per joint velocity.

    The power of a `Wrench` w on the tool in the same frame is w^T J q', so that it changes tau_e by -J^T w.

    Args:
        robot: robot with its base and tool poses.
        q: joint positions, ([samples,] joints), rad (m).
        frame: frame along whose axes the components are, "end_effector" or "base", as of a `Wrench`.
        tool: name of the tool, if the robot has several.

    Returns:
        J, ([samples,] 6, joints): velocity of the tool frame's origin, then angular velocity, in the order of
        fx fy fz mx my mz; m/rad and rad/rad (m/m and 0 for a prismatic joint); 0 for joints that do not move
        the tool.

    Raises:
        InputError: q has another shape, or there is no such frame or tool.
        TypeError: robot is of another type.
    """
    check_robot(robot)
    check_frame(frame, "Jacobian")
    tool_index = robot.end_effector(tool)
    positions = checked_shape("q", q, len(robot.joints))
    in_base = frames_in_base(robot, np.atleast_2d(positions))
    columns = jacobian_in_base(robot, in_base, tool_index)
    if frame == "end_effector":
        base_to_tool = np.swapaxes(in_base.tools[tool_index].axes, -1, -2)
        columns = np.concatenate((base_to_tool @ columns[:, :3], base_to_tool @ columns[:, 3:]), axis=1)
    return columns.reshape(*positions.shape[:-1], *columns.shape[1:])


def jacobian_in_base(robot: Robot, frames: RobotFrames, tool: int) -> FloatArray:
    """Return the Jacobian of a tool by index in base axes, (samples, 6, joints), as `jacobian` does.

    Args:
        robot: robot.
        frames: its frames in the base frame.
        tool: index of the tool among the end effectors.
    """
    tool_frame = frames.tools[tool]
    columns = np.zeros((len(tool_frame.origin), len(WRENCH_AXES), len(robot.joints)))
    for index in robot.paths[robot.tool_joints[tool]]:
        seat, is_revolute = frames.seats[index], robot.joints[index].is_revolute
        axis = seat.axes[..., 2]
        columns[:, :3, index] = np.cross(axis, tool_frame.origin - seat.origin) if is_revolute else axis
        columns[:, 3:, index] = axis if is_revolute else 0
    return columns


def _constant_frame(pose: Pose) -> FramePose:
    return FramePose(np.array(rotation_matrix(pose), dtype=np.float64), np.array(pose.xyz))


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
