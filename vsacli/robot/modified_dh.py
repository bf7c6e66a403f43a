"""Conversion of modified Denavit-Hartenberg rows to standard ones, by moving frames, not by relabeling rows.

Row i of the modified convention, a_{i-1}, alpha_{i-1}, d_i, theta_i, leads from frame i-1 to frame i by
Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta_i) Tz(d_i), and frame i has its z axis along joint i (J. J. Craig,
Introduction to Robotics, 3rd ed., 2005, eq. (3.6); W. Khalil, J. Kleinfinger, ICRA 1986).

Regrouped, Rz(theta_i) Tz(d_i) is followed by Tx(a_i) Rx(alpha_i) of the next row: a standard row. The
transform before the first Rz belongs to the base. Standard frame i is modified frame i, translated along and
rotated about their common x axis by a_i and alpha_i, with the tools on its link; the last frame is unchanged.

A link that carries several joints, or one with a mount, keeps its modified frame too; the transform before
the Rz of such a joint belongs to its mount.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence

import numpy as np

from vsacli.compute.vector import Scalar, Vector, add, exact, mul, sub, trigonometric
from vsacli.robot.joint import DenavitHartenberg, Inertia, Joint, Link, Pose, Tool
from vsacli.robot.kinematics import rotation_matrix
from vsacli.robot.model import Robot
from vsacli.robot.urdf.link_tree import roll_pitch_yaw

UNCHANGED = DenavitHartenberg(a=0, alpha=0)
"""Row in place of the next one for a link that keeps its frame."""


def as_standard(robot: Robot) -> Robot:
    """Convert a robot with modified DH rows and link frames to standard ones.

    Zeros and right angles stay exact.

    Raises:
        InvalidRecordError: a number becomes too large.
    """
    next_joints = joints_without_mount(robot.joints, robot.parents)
    rows = {link: robot.joints[following].dh for link, following in next_joints.items()}
    joints = []
    for index, joint in enumerate(robot.joints):
        if index not in next_joints.values() and (joint.mount or joint.dh.a or joint.dh.alpha):
            joint = dataclasses.replace(joint, mount=_before_row(joint.mount or Pose(), joint.dh))
        joints.append(_standard_joint(joint, rows.get(index, UNCHANGED)))
    return dataclasses.replace(
        robot,
        base=_before_row(robot.base, rows.get(-1, UNCHANGED)),
        joints=tuple(joints),
        tools=tuple(
            _in_shifted_frame(tool, rows.get(robot.joint_names.index(tool.joint), UNCHANGED))
            for tool in robot.tools
        ),
    )


def joints_without_mount(joints: Sequence[Joint], parents: Sequence[int]) -> dict[int, int]:
    """Return the joint that each link carries, if it carries only one, without a mount; -1 is frame 0.

    For them the rows of both conventions are regrouped alike, so that the result is the same for a robot with
    modified rows and for the standard one.
    """
    count = Counter(parents)
    return {
        parent: index
        for index, parent in enumerate(parents)
        if count[parent] == 1 and joints[index].mount is None
    }


def modified_link(joint: Joint) -> Link:
    """Return the link of a standard joint in its modified frame, as in a file of that convention."""
    return _link_in_shifted_frame(joint.link, DenavitHartenberg(a=-joint.dh.a, alpha=-joint.dh.alpha))


def _before_row(pose: Pose, row: DenavitHartenberg) -> Pose:
    """Return the pose followed by Rx(alpha) Tx(a); alpha adds to the roll, which is about the same axis."""
    shift = rotation_matrix(pose).times(Vector(exact(row.a), 0, 0))
    x, y, z = (float(start + step) for start, step in zip(pose.xyz, shift, strict=True))
    roll, pitch, yaw = pose.rpy
    return Pose(xyz=(x, y, z), rpy=(roll + row.alpha, pitch, yaw))


def _in_shifted_frame(tool: Tool, row: DenavitHartenberg) -> Tool:
    """Return the tool expressed in the frame at Tx(a) Rx(alpha)."""
    if row == UNCHANGED:
        return tool
    c, s = trigonometric("cos", row.alpha), trigonometric("sin", row.alpha)
    xyz = (tool.xyz[0] - row.a, *_rotate_about_x(c, s, *tool.xyz[1:]))
    if row.alpha == 0:
        return dataclasses.replace(tool, xyz=xyz)
    axes = rotation_matrix(tool).transposed()  # the axes of the tool
    turned = [(axis.x, *_rotate_about_x(c, s, axis.y, axis.z)) for axis in axes]
    return dataclasses.replace(tool, xyz=xyz, rpy=roll_pitch_yaw(np.array(turned, dtype=np.float64).T))


def _standard_joint(joint: Joint, next_row: DenavitHartenberg) -> Joint:
    row = joint.dh
    dh = DenavitHartenberg(a=next_row.a, alpha=next_row.alpha, d=row.d, theta=row.theta)
    return dataclasses.replace(joint, dh=dh, link=_link_in_shifted_frame(joint.link, next_row))


def _link_in_shifted_frame(link: Link, row: DenavitHartenberg) -> Link:
    """Return the link expressed in the frame at Tx(a) Rx(alpha)."""
    c, s = trigonometric("cos", row.alpha), trigonometric("sin", row.alpha)
    x, (y, z) = link.com[0] - row.a, _rotate_about_x(c, s, *link.com[1:])
    return Link(mass=link.mass, com=(x, y, z), inertia=_rotate_inertia_about_x(link.inertia, c, s))


def _rotate_about_x(c: Scalar, s: Scalar, y: float, z: float) -> tuple[float, float]:
    """Return components y and z in axes rotated about x by the angle with this cosine and sine."""
    return float(add(mul(c, y), mul(s, z))), float(sub(mul(c, z), mul(s, y)))


def _rotate_inertia_about_x(inertia: Inertia, c: Scalar, s: Scalar) -> Inertia:
    xy, xz = _rotate_about_x(c, s, inertia.xy, inertia.xz)
    yy, zy = _rotate_about_x(c, s, inertia.yy, inertia.yz)
    yz, zz = _rotate_about_x(c, s, inertia.yz, inertia.zz)
    (new_yy, new_yz), (_, new_zz) = _rotate_about_x(c, s, yy, yz), _rotate_about_x(c, s, zy, zz)
    return Inertia(xx=inertia.xx, yy=new_yy, zz=new_zz, xy=xy, xz=xz, yz=new_yz)
