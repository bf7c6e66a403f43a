"""The arm as a drawing: lines of links, places of joints, views of them, at a home configuration."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.units import LENGTH
from vsacli.robot.joint import Joint
from vsacli.robot.kinematics import Geometry, frames_in_base
from vsacli.robot.model import Robot

JOINT_SHARE, SUM_OF_JOINTS = 0.11, 0.9
"""Length of a drawn joint along its axis, relative to the size of the arm; of all joints together at most."""

VIEW_WIDTH = 1.5
"""Width of a view relative to the size of the arm."""

FLAT_SHARE = 0.05
"""Extent of an arm, relative to its size, below which it counts as flat: one view shows all of it."""

SMALLEST_SIZE = 1e-3
"""Size, m, of the drawing of a robot without lengths."""


class ArmPoints(NamedTuple):
    """Points of a tree of links in the base frame, m.

    Attributes:
        origins: origins of DH frames 0 to N, (samples, joints + 1, 3).
        seats: points of the carriers at which the rows of the joints begin, (samples, joints, 3).
        elbows: intersections of the common normal of two axes with the first, (samples, joints, 3): the
            offset d leads there along the z axis of the seat, the length a from there to the next frame.
        axes: unit vectors along the axes of the joints, (samples, joints, 3).
        tools: origins of the tools, (samples, tools, 3).
        base: axes of DH frame 0 as columns, (samples, 3, 3).
        tool_axes: axes of the tools as columns, (samples, tools, 3, 3).
        carriers: index in `origins` of the frame that carries each joint.
        tool_carriers: index in `origins` of the frame that carries each tool.
    """

    origins: FloatArray
    seats: FloatArray
    elbows: FloatArray
    axes: FloatArray
    tools: FloatArray
    base: FloatArray
    tool_axes: FloatArray
    carriers: tuple[int, ...]
    tool_carriers: tuple[int, ...]

    @classmethod
    def of(cls, geometry: Geometry, q: FloatArray) -> ArmPoints:
        """Return the points at joint positions, (samples, joints)."""
        base, seats, links, tools = frames_in_base(geometry, q)
        origins = np.stack([frame.origin for frame in (base, *links)], axis=1)
        lengths = np.array([joint.dh.a for joint in geometry.joints])
        normals = np.stack([frame.axes[..., 0] for frame in links], axis=1)
        return cls(
            origins,
            np.stack([seat.origin for seat in seats], axis=1),
            origins[:, 1:] - lengths[:, None] * normals,
            np.stack([seat.axes[..., 2] for seat in seats], axis=1),
            np.stack([origins[:, 0], *(tool.origin for tool in tools)], axis=1)[:, 1:],
            base.axes,
            np.stack([base.axes, *(tool.axes for tool in tools)], axis=1)[:, 1:],
            tuple(parent + 1 for parent in geometry.parents),
            tuple(carrier + 1 for carrier in geometry.tool_joints),
        )

    def lines(self) -> list[FloatArray]:
        """Return the corners of the links of one sample as lines, (corners, 3), the base frame first.

        A line goes on from a link to the first joint or tool that it carries; others begin lines of their
        own.
        """
        [origins], [seats], [elbows], [tools] = self.origins, self.seats, self.elbows, self.tools
        lines = [[np.zeros(3), origins[0]]]
        line_by_frame = {0: lines[0]}
        segments = [
            (carrier, [*([] if np.array_equal(seat, origins[carrier]) else [seat]), elbow, origin])
            for carrier, seat, elbow, origin in zip(self.carriers, seats, elbows, origins[1:], strict=True)
        ]
        segments += [(carrier, [tool]) for carrier, tool in zip(self.tool_carriers, tools, strict=True)]
        for frame, (carrier, corners) in enumerate(segments, 1):
            line = line_by_frame.pop(carrier, None)
            if line is None:
                line = [origins[carrier]]
                lines.append(line)
            line += corners
            if frame < len(origins):
                line_by_frame[frame] = line
        return [np.array(line) for line in lines]


def home_position(joint: Joint) -> float:
    """Return 0, or the middle of the position limits of a joint that they do not let move to both sides."""
    low, high = joint.limits.position
    return 0.0 if low < 0 < high or not math.isfinite(low + high) else (low + high) / 2


class View(NamedTuple):
    """An orthographic projection.

    Attributes:
        name: name of the view.
        right, up: unit vectors of the picture in the base frame, (3,); the viewer is at `right` x `up`.
        labels: labels of the axes; empty where lengths are foreshortened.
        flipped: whether the coordinate in the label decreases along each axis.
    """

    name: str
    right: FloatArray
    up: FloatArray
    labels: tuple[str, str] | None = None
    flipped: tuple[bool, bool] = (False, False)

    @property
    def toward(self) -> FloatArray:
        """Unit vector toward the viewer."""
        return np.asarray(np.cross(self.right, self.up))

    def project(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) in the picture, (..., 2), m."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)


class ArmChart(NamedTuple):
    """The arm at its home configuration, in the base frame, m.

    Attributes:
        title: name of the robot, and the configuration.
        joints: the joints.
        q: home configuration, (joints,).
        tool_names: names of several tools; empty for a single one.
        points: points of the links, of one sample.
        lines: corners of the links from the base to the tools, (corners, 3).
        centers: places of the joints on their axes, (joints, 3); apart from each other where several axes
            intersect.
        down: direction of gravity, (3,); zero without gravity.
        size: size of the arm.
        joint_length: length of a drawn joint along its axis.
        middle: middle of the arm, (3,).
        views: views that show it.
    """

    title: str
    joints: tuple[Joint, ...]
    q: FloatArray
    tool_names: tuple[str, ...]
    points: ArmPoints
    lines: list[FloatArray]
    centers: FloatArray
    down: FloatArray
    size: float
    joint_length: float
    middle: FloatArray
    views: tuple[View, ...]


def arm_chart(robot: Robot) -> ArmChart:
    """Return the drawing of a robot's arm."""
    q = np.array([home_position(joint) for joint in robot.joints])
    points = ArmPoints.of(robot, q[None])
    lines = points.lines()
    corners = np.concatenate(lines)
    extents = np.ptp(corners, axis=0)
    size = max(float(extents.max()), SMALLEST_SIZE)
    joint_length = size * min(JOINT_SHARE, SUM_OF_JOINTS / len(robot.joints))
    centers = _joint_centers(points, joint_length)
    down = direction_of(np.array(robot.gravity))
    drawn_points = np.concatenate((corners, centers))
    middle = (drawn_points.max(axis=0) + drawn_points.min(axis=0)) / 2
    title = f"{robot.name}: arm at {_configuration_text(robot, q)}"
    views = views_of(down, extents, size)
    size = max(size, float(np.ptp(drawn_points, axis=0).max()))
    tool_names = robot.tool_names if len(robot.tool_names) > 1 else ()
    return ArmChart(
        title, robot.joints, q, tool_names, points, lines, centers, down, size, joint_length, middle, views
    )


def direction_of(gravity: FloatArray) -> FloatArray:
    """Return the unit vector along gravity, (3,); zero without gravity."""
    strength = float(np.linalg.norm(gravity))
    return gravity / strength if strength else np.zeros(3)


def _configuration_text(robot: Robot, q: FloatArray) -> str:
    """Return the home configuration in words."""
    moved_joints = [joint.name for joint, position in zip(robot.joints, q, strict=True) if position != 0]
    if not moved_joints:
        return "q = 0"
    if len(moved_joints) == len(q):
        return "the middle of the position limits"
    return f"q = 0, {', '.join(moved_joints)} at the middle of the limits"


def _joint_centers(points: ArmPoints, joint_length: float) -> FloatArray:
    """Return the places of the joints: where the offset d is long, in the middle of it.

    Joints in the place of an earlier one move along their axes: the first one backward, others forward.
    """
    seats, elbows, axes = points.seats[0], points.elbows[0], points.axes[0]
    is_offset_long = np.linalg.norm(elbows - seats, axis=1) > 2 * joint_length
    centers: FloatArray = np.where(is_offset_long[:, None], (seats + elbows) / 2, seats)
    for index in range(1, len(centers)):
        overlapping = np.flatnonzero(np.linalg.norm(centers[:index] - centers[index], axis=1) < joint_length)
        if overlapping.tolist() == [0]:
            centers[0] -= 1.1 * joint_length * axes[0]
        elif overlapping.size:
            centers[index] += 1.1 * joint_length * axes[index]
    return centers


def views_of(down: FloatArray, extents: FloatArray, size: float) -> tuple[View, ...]:
    """Return an isometric view, a side view, and a top view of an arm that is not flat.

    Their axes are those of the base frame: up is the one most opposite to gravity, and the longer extent of
    the others is to the right.
    """
    up_axis = int(np.argmax(np.abs(down))) if down.any() else 2
    up = np.zeros(3)
    up[up_axis] = -1.0 if down[up_axis] > 0 else 1.0
    level_axes = [axis for axis in range(3) if axis != up_axis]
    right_axis = level_axes[int(np.argmax(extents[level_axes]))]
    right = np.zeros(3)
    right[right_axis] = 1.0
    side = _along_axes("side view", right, up)
    views = [_isometric(right, up), side]
    depth = int(np.argmax(np.abs(side.toward)))
    if extents[depth] > FLAT_SHARE * size:
        views.append(_along_axes("top view", right, -side.toward))
    return tuple(views)


def _isometric(right: FloatArray, up: FloatArray) -> View:
    """Return the view from right, front and above, at equal angles to all three axes."""
    front = np.cross(right, up)
    return View("isometric view", (right - front) / math.sqrt(2), (2 * up - right - front) / math.sqrt(6))


def _along_axes(name: str, right: FloatArray, up: FloatArray) -> View:
    """Return a view along an axis of the base frame."""
    axes: list[IndexArray] = [np.flatnonzero(direction) for direction in (right, up)]
    labels = tuple(f"{'xyz'[axis[0]]} [{LENGTH}]" for axis in axes)
    flipped = tuple(bool(direction.sum() < 0) for direction in (right, up))
    return View(name, right, up, (labels[0], labels[1]), (flipped[0], flipped[1]))
