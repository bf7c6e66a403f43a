"""Export to URDF: links, joints and limits. URDF cannot express springs, and hardly motors.

URDF requires the frame of a link on the axis of its joint. The Denavit-Hartenberg frame of the link follows
from it by Tx(a) Rx(alpha).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.version import __version__
from vsacli.robot.joint import UNBOUNDED, Joint
from vsacli.robot.model import Robot
from vsacli.robot.models.exported_model import (
    Element,
    ExportedModel,
    add_element,
    exported_tool_names,
    rod_radius,
    set_attributes,
    xml_document,
)
from vsacli.robot.models.mjcf_drives import Start
from vsacli.robot.urdf.link_tree import pose_matrix, roll_pitch_yaw

ROOT = "world"
"""Name of the first link; those of joints are named `<joint>_link`, those of tools as the tools."""

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""Gravity, m/s^2, that most readers of a URDF assume."""

NO_LIMIT = 1e9
"""Value in place of a limit that URDF requires and the robot lacks; `import-urdf` reads it as none."""


def urdf_model(robot: Robot, start: Start | None = None) -> ExportedModel:
    """Return the model, with notes on parts that are left out.

    Raises:
        InputError: a start is given, which URDF cannot express.
    """
    if start is not None:
        raise InputError.one("--start needs --format mjcf; a URDF has no initial state")
    root = ElementTree.Element("robot", name=robot.name)
    links = {-1: add_element(root, "link", name=ROOT)}
    frames = {-1: pose_matrix(robot.base.xyz, robot.base.rpy)}
    radius = rod_radius(robot)
    for index, (joint, parent) in enumerate(zip(robot.joints, robot.parents, strict=True)):
        dh, seat = joint.dh, _seat_pose(frames[parent], joint)
        if math.dist(seat[:3, 3], frames[parent][:3, 3]) > radius:
            _add_rod(links[parent], frames[parent][:3, 3], seat[:3, 3], radius)
        links[index] = _add_link(root, joint, radius)
        moving = _add_joint(root, joint.name, _urdf_joint_type(joint), links[parent], links[index])
        _add_origin(moving, seat @ pose_matrix((0, 0, dh.d), (0, 0, dh.theta)))
        _add_joint_properties(moving, joint)
        frames[index] = pose_matrix((dh.a, 0, 0), (dh.alpha, 0, 0))
    for name, tool, carrier in zip(_tool_links(robot), robot.end_effectors, robot.tool_joints, strict=True):
        link = add_element(root, "link", name=name)
        fixed = _add_joint(root, f"{name}.mount", "fixed", links[carrier], link)
        _add_origin(fixed, frames[carrier] @ pose_matrix(tool.xyz, tool.rpy))
    notes = tuple(_describe_losses(robot))
    return ExportedModel(xml_document(root, f"{robot.name}, by vsacli {__version__}"), None, notes)


def _seat_pose(frame: FloatArray, joint: Joint) -> FloatArray:
    """Return the pose at which the row of a joint begins, from the frame of the link that carries it."""
    return frame if joint.mount is None else frame @ pose_matrix(joint.mount.xyz, joint.mount.rpy)


def _tool_links(robot: Robot) -> list[str]:
    """Return a link name for each tool; with a dot, which no name in a robot has, if it is taken."""
    taken = {ROOT, *map(_link_name, robot.joints)}
    return [f"{name}.tool" if name in taken else name for name in exported_tool_names(robot)]


def _link_name(joint: Joint) -> str:
    return f"{joint.name}_link"


def _add_link(root: Element, joint: Joint, radius: float) -> Element:
    """Add a link and return it.

    The inertia tensor keeps the axes of the Denavit-Hartenberg frame, and so its entries.
    """
    link, whole = joint.link, add_element(root, "link", name=_link_name(joint))
    body = add_element(whole, "inertial")
    end = pose_matrix((joint.dh.a, 0, 0), (joint.dh.alpha, 0, 0))
    com = end[:3, :3] @ np.array(link.com) + end[:3, 3]
    add_element(body, "origin", xyz=com, rpy=(joint.dh.alpha, 0, 0))
    add_element(body, "mass", value=link.mass)
    inertia = link.inertia
    entries = {f"i{name}": getattr(inertia, name) for name in ("xx", "xy", "xz", "yy", "yz", "zz")}
    add_element(body, "inertia", **entries)
    _add_rod(whole, np.array([0, 0, -joint.dh.d]), np.array([joint.dh.a, 0, 0]), radius)
    return whole


def _add_rod(link: Element, start: FloatArray, end: FloatArray, radius: float) -> None:
    """Draw a rod from point to point, a ball if they are close, without collision geometry."""
    x, y, z = map(float, end - start)
    visual = add_element(link, "visual")
    slope = (math.atan2(-y, math.hypot(x, z)), math.atan2(x, z), 0)
    add_element(visual, "origin", xyz=(start + end) / 2, rpy=slope)
    length = math.hypot(x, y, z)
    if length > radius:
        add_element(add_element(visual, "geometry"), "cylinder", radius=radius, length=length)
    else:
        add_element(add_element(visual, "geometry"), "sphere", radius=radius)


def _add_joint(root: Element, name: str, kind: str, parent: Element, child: Element) -> Element:
    joint = add_element(root, "joint", name=name, type=kind)
    add_element(joint, "parent", link=parent.get("name", ""))
    add_element(joint, "child", link=child.get("name", ""))
    return joint


def _add_origin(joint: Element, pose: FloatArray) -> None:
    add_element(joint, "origin", xyz=pose[:3, 3], rpy=roll_pitch_yaw(pose[:3, :3]))


def _urdf_joint_type(joint: Joint) -> str:
    if not joint.is_revolute:
        return "prismatic"
    return "continuous" if joint.limits.position == UNBOUNDED else "revolute"


def _add_joint_properties(moving: Element, joint: Joint) -> None:
    """Add axis, damping, friction and limits of a joint; two motors together have no effort limit."""
    add_element(moving, "axis", xyz=(0, 0, 1))
    friction = {} if joint.friction is None else {"friction": max(joint.friction.coulomb)}
    add_element(moving, "dynamics", damping=joint.damping, **friction)
    motors = joint.actuator.motors
    effort = motors[0].max_torque if len(motors) == 1 else math.inf
    speed = min(map(abs, joint.limits.velocity))
    limit = add_element(moving, "limit", effort=min(effort, NO_LIMIT), velocity=min(speed, NO_LIMIT))
    if _urdf_joint_type(joint) != "continuous":
        lower, upper = (max(-NO_LIMIT, min(NO_LIMIT, end)) for end in joint.limits.position)
        set_attributes(limit, lower=lower, upper=upper)


def _describe_losses(robot: Robot) -> Iterator[str]:
    yield f"motors and springs are left out: URDF has no place for them ({', '.join(robot.joint_names)})"
    if robot.gravity != STANDARD_GRAVITY:
        gravity = ", ".join(f"{each:g}" for each in robot.gravity)
        yield f"gravity, [{gravity}] m/s^2, is left out: who reads a URDF says what it is, along -z as a rule"
    reduced = {
        "dry friction but for its size": [joint for joint in robot.joints if joint.friction is not None],
        "variable dampers": [joint for joint in robot.joints if joint.damper is not None],
        "limits of the stiffness": [joint for joint in robot.joints if joint.limits.stiffness != UNBOUNDED],
        "the larger of two limits of the velocity": [
            joint for joint in robot.joints if joint.limits.velocity[0] != -joint.limits.velocity[1]
        ],
    }
    for what, joints in reduced.items():
        if joints:
            yield f"left out: {what} ({', '.join(joint.name for joint in joints)})"
