"""Chains of modified Denavit-Hartenberg rows: Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta_i) Tz(d_i)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from vsacli.base.arrays import FloatArray


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
