"""The rigid chain in the Pinocchio library (Carpentier et al., 2019)."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import DenavitHartenberg, Pose
from vsacli.robot.model import Robot


def build(robot: Robot) -> pin.Model:
    """The model of a robot: one Pinocchio joint a row, which moves before the row's constant transform."""
    model = pin.Model()
    model.gravity.linear = np.array(robot.gravity)
    parent, placement = 0, _pose(robot.base)
    for joint in robot.joints:
        kind = pin.JointModelRZ() if joint.type == "revolute" else pin.JointModelPZ()
        parent = model.addJoint(parent, kind, placement, joint.name)
        placement = _row(joint.dh)
        body = pin.Inertia(joint.link.mass, np.array(joint.link.com), joint.link.inertia.tensor)
        model.appendBodyToJoint(parent, body, placement)
    return model


def torques(robot: Robot, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
    """tau_e (samples, joints); Pinocchio's recursion knows no damping, so it is added here."""
    model, damping = build(robot), _damping(robot)
    data = model.createData()
    rows = [pin.rnea(model, data, *row).copy() for row in zip(q, dq, ddq, strict=True)]
    return np.array(rows) + damping * dq


def torque_regressor(robot: Robot, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
    """Derivatives of tau_e, (samples, joints, 10 joints), by inertial parameters in Pinocchio's frames."""
    model = build(robot)
    data = model.createData()
    rows = [pin.computeJointTorqueRegressor(model, data, *row).copy() for row in zip(q, dq, ddq, strict=True)]
    return np.array(rows)


def poses(robot: Robot, q: FloatArray) -> FloatArray:
    """Link frames and tool frame in the base frame, (samples, joints + 1, 4, 4)."""
    model, data = build(robot), build(robot).createData()
    rows = []
    for row in q:
        pin.forwardKinematics(model, data, row)
        links = [data.oMi[joint + 1] * _row(each.dh) for joint, each in enumerate(robot.joints)]
        rows.append([pose.homogeneous for pose in (*links, links[-1] * _pose(robot.tool))])
    return np.array(rows)


def jacobians(robot: Robot, q: FloatArray, *, in_base: bool) -> FloatArray:
    """Of the tool's origin, velocity first, (samples, 6, joints), along the axes of base or tool."""
    model = build(robot)
    placement = _row(robot.joints[-1].dh) * _pose(robot.tool)
    index = model.addFrame(pin.Frame("tool", len(robot.joints), 0, placement, pin.OP_FRAME))
    data, axes = model.createData(), pin.LOCAL_WORLD_ALIGNED if in_base else pin.LOCAL
    rows = [pin.computeFrameJacobian(model, data, row, index, axes).copy() for row in q]
    return np.array(rows).reshape(len(q), 6, -1)  # Pinocchio leaves out the axis of a single joint


def torques_under_wrench(
    robot: Robot, motion: tuple[FloatArray, FloatArray, FloatArray], wrench: FloatArray, *, in_base: bool
) -> FloatArray:
    """tau_e (samples, joints) at q, dq, ddq while `wrench`, (samples, 6), is exerted on the tool."""
    model, damping = build(robot), _damping(robot)
    data = model.createData()
    tool = _row(robot.joints[-1].dh) * _pose(robot.tool)
    external = [pin.Force.Zero() for _ in range(model.njoints)]
    rows = []
    for q, dq, ddq, components in zip(*motion, wrench, strict=True):
        pin.forwardKinematics(model, data, q)
        turn = (data.oMi[model.njoints - 1] * tool).rotation.T if in_base else np.eye(3)
        external[-1] = tool.act(pin.Force(turn @ components[:3], turn @ components[3:]))
        rows.append(pin.rnea(model, data, q, dq, ddq, external).copy())
    return np.array(rows) + damping * motion[1]


def torque_rates(robot: Robot, q: FloatArray, dq: FloatArray, ddq: FloatArray, d3q: FloatArray) -> FloatArray:
    """dtau_e (samples, joints), by the chain rule from Pinocchio's analytical derivatives."""
    model, damping = build(robot), _damping(robot)
    data = model.createData()
    rows = []
    for q_k, dq_k, ddq_k, d3q_k in zip(q, dq, ddq, d3q, strict=True):
        by_q, by_dq, by_ddq = pin.computeRNEADerivatives(model, data, q_k, dq_k, ddq_k)
        mass_matrix = np.triu(by_ddq) + np.triu(by_ddq, 1).T
        rows.append(by_q @ dq_k + by_dq @ ddq_k + mass_matrix @ d3q_k)
    return np.array(rows) + damping * ddq


def _row(dh: DenavitHartenberg) -> pin.SE3:
    """Rz(theta) Tz(d) Tx(a) Rx(alpha) at joint variable 0."""
    about_z = pin.SE3(pin.rpy.rpyToMatrix(0, 0, dh.theta), np.array([0, 0, dh.d]))
    about_x = pin.SE3(pin.rpy.rpyToMatrix(dh.alpha, 0, 0), np.array([dh.a, 0, 0]))
    return about_z * about_x


def _pose(pose: Pose) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*pose.rpy), np.array(pose.xyz))


def _damping(robot: Robot) -> FloatArray:
    return np.array([joint.damping for joint in robot.joints])
