"""Conversion of modified Denavit-Hartenberg rows to standard ones, by moving frames, not by relabeling rows.

Row i of the modified convention, a_{i-1}, alpha_{i-1}, d_i, theta_i, leads from frame i-1 to frame i by
Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta_i) Tz(d_i), and frame i has its z axis along joint i (J. J. Craig,
Introduction to Robotics, 3rd ed., 2005, eq. (3.6); W. Khalil, J. Kleinfinger, ICRA 1986).

Regrouped, Rz(theta_i) Tz(d_i) is followed by Tx(a_i) Rx(alpha_i) of the next row: a standard row. The
transform before the first Rz belongs to the base. Standard frame i is modified frame i, translated along and
rotated about their common x axis by a_i and alpha_i; the last frame is unchanged.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise

from vsacli.compute.vector import Scalar, Vector, add, exact, mul, sub, trigonometric
from vsacli.robot.joint import DenavitHartenberg, Inertia, Joint, Link, Pose
from vsacli.robot.kinematics import rotation_matrix
from vsacli.robot.model import Robot

AFTER_LAST = DenavitHartenberg(a=0, alpha=0)
"""Row in place of the one after the last, so that the last frame is unchanged."""


def as_standard(robot: Robot) -> Robot:
    """Convert a robot with modified DH rows and link frames to standard ones.

    Zeros and right angles stay exact.

    Raises:
        InvalidRecordError: a number becomes too large.
    """
    rows = (*(joint.dh for joint in robot.joints), AFTER_LAST)
    joints = (
        _standard_joint(joint, row, next_row)
        for joint, (row, next_row) in zip(robot.joints, pairwise(rows), strict=True)
    )
    return dataclasses.replace(
        robot, base=_append_link_twist_and_length(robot.base, rows[0]), joints=tuple(joints)
    )


def modified_link(joint: Joint) -> Link:
    """Return the link of a standard joint in its modified frame, as in a file of that convention."""
    return _link_in_shifted_frame(joint.link, DenavitHartenberg(a=-joint.dh.a, alpha=-joint.dh.alpha))


def _append_link_twist_and_length(base: Pose, row: DenavitHartenberg) -> Pose:
    """Return the pose followed by Rx(alpha) Tx(a); alpha adds to the roll, which is about the same axis."""
    shift = rotation_matrix(base).times(Vector(exact(row.a), 0, 0))
    x, y, z = (float(start + step) for start, step in zip(base.xyz, shift, strict=True))
    roll, pitch, yaw = base.rpy
    return Pose(xyz=(x, y, z), rpy=(roll + row.alpha, pitch, yaw))


def _standard_joint(joint: Joint, row: DenavitHartenberg, next_row: DenavitHartenberg) -> Joint:
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
