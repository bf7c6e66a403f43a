"""The rigid links of a robot, chain or tree, in the Pinocchio library (Carpentier et al., 2019)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import FRAME_0, DenavitHartenberg, Pose
from vsacli.robot.model import Robot


def build(robot: Robot, *, modified: bool = False) -> pin.Model:
    """The model of a robot: one Pinocchio joint a row, which moves before the row's constant transform.

    `modified` says that its rows and link frames are meant in the modified Denavit-Hartenberg convention.
    """
    model = pin.Model()
    model.gravity.linear = np.array(robot.gravity)
    for index, joint in enumerate(robot.joints):
        carrying = _carrier(robot, index)
        placement = _pose(robot.base) if carrying < 0 else _link(robot, carrying, modified)
        if joint.mount is not None:
            placement = placement * _pose(joint.mount)
        if modified:
            placement = placement * _about_x(joint.dh) * _about_z(joint.dh)
        kind = pin.JointModelRZ() if joint.type == "revolute" else pin.JointModelPZ()
        number = model.addJoint(carrying + 1, kind, placement, joint.name)
        body = pin.Inertia(joint.link.mass, np.array(joint.link.com), joint.link.inertia.tensor)
        model.appendBodyToJoint(number, body, _link(robot, index, modified))
    return model


def _carrier(robot: Robot, index: int) -> int:
    """Index of the joint whose link carries a joint, -1 for the base."""
    parent = robot.joints[index].parent
    if parent is None or parent == FRAME_0:
        return index - 1 if parent is None else -1
    return [joint.name for joint in robot.joints].index(parent)


def _link(robot: Robot, index: int, modified: bool = False) -> pin.SE3:
    """The frame of a link in that of its Pinocchio joint."""
    return pin.SE3.Identity() if modified else _row(robot.joints[index].dh)


def torques(robot: Robot, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
    """tau_e (samples, joints); Pinocchio's recursion knows no damping, so it is added here."""
    model, damping = build(robot), _damping(robot)
    data = model.createData()
    rows = [pin.rnea(model, data, *row).copy() for row in zip(q, dq, ddq, strict=True)]
    return np.array(rows) + damping * dq


def mass_matrices(robot: Robot, q: FloatArray) -> FloatArray:
    """M(q), (samples, joints, joints), column by column.

    Pinocchio's own composition of M takes the joints of each subtree to have adjacent numbers.
    """
    model = build(robot)
    model.gravity.linear = np.zeros(3)
    data, still = model.createData(), np.zeros(model.nv)
    units = np.eye(model.nv)
    rows = [[pin.rnea(model, data, row, still, unit).copy() for unit in units] for row in q]
    return np.array(rows).swapaxes(1, 2)


def torque_regressor(robot: Robot, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
    """Derivatives of tau_e, (samples, joints, 10 joints), by inertial parameters in Pinocchio's frames."""
    model = build(robot)
    data = model.createData()
    rows = [pin.computeJointTorqueRegressor(model, data, *row).copy() for row in zip(q, dq, ddq, strict=True)]
    return np.array(rows)


def poses(robot: Robot, q: FloatArray, *, modified: bool = False) -> FloatArray:
    """Link frames and tool frames in the base frame, (samples, joints + tools, 4, 4)."""
    model = build(robot, modified=modified)
    data = model.createData()
    rows = []
    for row in q:
        pin.forwardKinematics(model, data, row)
        links = [data.oMi[index + 1] * _link(robot, index, modified) for index in range(len(robot.joints))]
        tools = [links[carrier] * _pose(tool) for tool, carrier in _tools(robot)]
        rows.append([pose.homogeneous for pose in (*links, *tools)])
    return np.array(rows)


def jacobians(robot: Robot, q: FloatArray, *, in_base: bool, tool: int = 0) -> FloatArray:
    """Of the origin of a tool, velocity first, (samples, 6, joints), along the axes of base or tool."""
    model = build(robot)
    pose, carrier = _tools(robot)[tool]
    placement = _link(robot, carrier) * _pose(pose)
    index = model.addFrame(pin.Frame("tool", carrier + 1, 0, placement, pin.OP_FRAME))
    data, axes = model.createData(), pin.LOCAL_WORLD_ALIGNED if in_base else pin.LOCAL
    rows = [pin.computeFrameJacobian(model, data, row, index, axes).copy() for row in q]
    return np.array(rows).reshape(len(q), 6, -1)  # Pinocchio leaves out the axis of a single joint


def torques_under_wrench(
    robot: Robot,
    motion: tuple[FloatArray, FloatArray, FloatArray],
    wrench: FloatArray,
    frames: Sequence[str | None],
    *,
    modified: bool = False,
) -> FloatArray:
    """tau_e (samples, joints) at q, dq, ddq while `wrench`, (samples, 6 tools), is exerted on the tools.

    `frames` says for each tool along whose axes its components are, those of "base" or "end_effector".
    """
    model, damping = build(robot, modified=modified), _damping(robot)
    data = model.createData()
    rows = []
    for q, dq, ddq, components in zip(*motion, wrench.reshape(-1, len(frames), 6), strict=True):
        pin.forwardKinematics(model, data, q)
        external = [pin.Force.Zero() for _ in range(model.njoints)]
        for (pose, carrier), frame, (*force, x, y, z) in zip(_tools(robot), frames, components, strict=True):
            tool = _link(robot, carrier, modified) * _pose(pose)
            turn = (data.oMi[carrier + 1] * tool).rotation.T if frame == "base" else np.eye(3)
            external[carrier + 1] += tool.act(pin.Force(turn @ force, turn @ [x, y, z]))
        rows.append(pin.rnea(model, data, q, dq, ddq, external).copy())
    return np.array(rows) + damping * motion[1]


def _tools(robot: Robot) -> list[tuple[Pose, int]]:
    """Each tool, and the index of the joint whose link carries it."""
    names = [joint.name for joint in robot.joints]
    if not robot.tools:
        return [(robot.tool, len(names) - 1)]
    return [(tool, names.index(tool.joint)) for tool in robot.tools]


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
    return _about_z(dh) * _about_x(dh)


def _about_z(dh: DenavitHartenberg) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(0, 0, dh.theta), np.array([0, 0, dh.d]))


def _about_x(dh: DenavitHartenberg) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(dh.alpha, 0, 0), np.array([dh.a, 0, 0]))


def _pose(pose: Pose) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*pose.rpy), np.array(pose.xyz))


def _damping(robot: Robot) -> FloatArray:
    return np.array([joint.damping for joint in robot.joints])
