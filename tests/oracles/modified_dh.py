"""Modified Denavit-Hartenberg rows: Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta_i) Tz(d_i).

`ModifiedChain` is a chain of them; `in_modified_rows` writes a tree of standard rows by modified ones.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import FRAME_0, DenavitHartenberg, Inertia, Link, Pose, Tool
from vsacli.robot.model import Robot


class ModifiedJoint(NamedTuple):
    """A row, and the link it moves: its center of mass and inertia about it in the frame the row leads to."""

    revolute: bool
    a: float
    alpha: float
    d: float
    theta: float
    mass: float
    com: FloatArray
    inertia: FloatArray


class ModifiedChain:
    """The chain in the Pinocchio library, joint i behind its row at position zero."""

    def __init__(
        self, joints: list[ModifiedJoint], gravity: FloatArray, base: pin.SE3, tool: pin.SE3
    ) -> None:
        self._model = pin.Model()
        self._model.gravity.linear = gravity
        parent, placement = 0, base
        for number, joint in enumerate(joints):
            kind = pin.JointModelRZ() if joint.revolute else pin.JointModelPZ()
            parent = self._model.addJoint(parent, kind, placement * _row(joint), f"joint_{number}")
            body = pin.Inertia(joint.mass, joint.com, joint.inertia)
            self._model.appendBodyToJoint(parent, body, pin.SE3.Identity())
            placement = pin.SE3.Identity()
        self._data, self._tool = self._model.createData(), tool

    def tool_pose(self, q: FloatArray) -> FloatArray:
        """The tool in the base, (4, 4)."""
        pin.forwardKinematics(self._model, self._data, q)
        return np.array((self._data.oMi[self._model.njoints - 1] * self._tool).homogeneous)

    def torques(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """tau_e (samples, joints), without damping."""
        rows = zip(q, dq, ddq, strict=True)
        return np.array([pin.rnea(self._model, self._data, *row).copy() for row in rows])


def _row(joint: ModifiedJoint) -> pin.SE3:
    about_x = pin.SE3(pin.rpy.rpyToMatrix(joint.alpha, 0, 0), np.array([joint.a, 0, 0]))
    about_z = pin.SE3(pin.rpy.rpyToMatrix(0, 0, joint.theta), np.array([0, 0, joint.d]))
    return about_x * about_z


def in_modified_rows(robot: Robot) -> Robot:
    """The numbers that a file of modified rows has for a robot with standard ones.

    The modified frame of a link lies before Tx(a) Rx(alpha) of its standard row. For a joint without mount
    these belong to its own row, for one with a mount to this; tools and inertia move to that frame.
    """
    behind = {
        joint.name: pin.SE3(pin.rpy.rpyToMatrix(joint.dh.alpha, 0, 0), np.array([joint.dh.a, 0, 0]))
        for joint in robot.joints
    }
    joints, before = [], FRAME_0
    for joint in robot.joints:
        parent = before if joint.parent is None else joint.parent
        carrying = None if parent == FRAME_0 else robot.joints[robot.joint_names.index(parent)]
        dh = DenavitHartenberg(a=0, alpha=0, d=joint.dh.d, theta=joint.dh.theta)
        mount = joint.mount
        if carrying is not None and mount is None:
            dh = replace(dh, a=carrying.dh.a, alpha=carrying.dh.alpha)
        elif carrying is not None and mount is not None:
            mount = _pose_of(behind[parent] * _se3(mount))
        body = pin.Inertia(joint.link.mass, np.array(joint.link.com), joint.link.inertia.tensor)
        link = _link_of(body.se3Action(behind[joint.name]))
        joints.append(replace(joint, dh=dh, mount=mount, link=link))
        before = joint.name
    tools = []
    for tool in robot.tools:
        pose = _pose_of(behind[tool.joint] * _se3(tool))
        tools.append(Tool(name=tool.name, joint=tool.joint, xyz=pose.xyz, rpy=pose.rpy))
    return replace(robot, joints=tuple(joints), tools=tuple(tools))


def _se3(pose: Pose) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*pose.rpy), np.array(pose.xyz))


def _pose_of(placement: pin.SE3) -> Pose:
    (x, y, z), (roll, pitch, yaw) = placement.translation.tolist(), pin.rpy.matrixToRpy(placement.rotation)
    return Pose(xyz=(x, y, z), rpy=(float(roll), float(pitch), float(yaw)))


def _link_of(body: pin.Inertia) -> Link:
    (x, y, z), ((xx, xy, xz), (_, yy, yz), (_, _, zz)) = body.lever.tolist(), body.inertia.tolist()
    return Link(mass=body.mass, com=(x, y, z), inertia=Inertia(xx=xx, yy=yy, zz=zz, xy=xy, xz=xz, yz=yz))
