"""Energy of the links, from where they are and how fast they move: kinetic energy, and potential energy.

No accelerations or forces occur here, so that the power of the elastic torques, which come from the recursion
of accelerations (36)-(58), can be compared with the rate of this energy.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.variables import Block
from vsacli.compute.vector import ZERO, Rotation, Vector, cross
from vsacli.dynamics.elastic_torques import link_constants
from vsacli.dynamics.shaft_balances import link_losses
from vsacli.robot.kinematics import base_gravity, rotation_matrix
from vsacli.robot.model import Robot


class _Moving(NamedTuple):
    """A link frame, all in its own components.

    Attributes:
        origin: from that of frame 0.
        velocity: of the origin.
        omega: angular velocity.
        gravity: acceleration.
        rotations: from frame 0 on.
    """

    origin: Vector
    velocity: Vector
    omega: Vector
    gravity: Vector
    rotations: tuple[Rotation, ...]


def link_energy(robot: Robot, block: Block) -> FloatArray:
    """Kinetic and potential energy of all links, (samples,), J."""
    energy = np.zeros(len(block.time))
    for joint, moving in zip(robot.joints, _link_motions(robot, block), strict=True):
        link = link_constants(joint)
        velocity = moving.velocity + cross(moving.omega, link.com)
        turning = moving.omega.dot(link.inertia.times(moving.omega))
        height = moving.gravity.dot(moving.origin + link.com)
        energy = energy + turning / 2 + link.mass * (velocity.dot(velocity) / 2 - height)
    return energy


def link_powers(robot: Robot, block: Block, frame: str | None) -> list[FloatArray]:
    """What changes `link_energy`, term by term: joints, losses between links, and the wrench; W.

    Args:
        robot: the robot.
        block: its variables.
        frame: along whose axes the wrench is given; None if there is none.
    """
    powers = []
    for index, joint in enumerate(robot.joints):
        of_joint = block.of_joint(index)
        powers.append(of_joint["tau_e"] * of_joint["dq"])
        powers.extend(-lost for lost in link_losses(joint, of_joint))
    return powers if frame is None else [*powers, _wrench_power(robot, block, frame)]


def _link_motions(robot: Robot, block: Block) -> Iterator[_Moving]:
    moving = _Moving(ZERO, ZERO, ZERO, base_gravity(robot), ())
    for joint, q, dq in zip(robot.joints, block.q.T, block.dq.T, strict=True):
        link = link_constants(joint)
        angle, offset = (
            (joint.dh.theta + q, joint.dh.d) if joint.is_revolute else (joint.dh.theta, joint.dh.d + q)
        )
        rotation = Rotation(np.cos(angle), np.sin(angle), link.cos_alpha, link.sin_alpha)
        axis = rotation.undo(Vector(0, 0, 1))
        step = Vector(link.a, 0, 0) + axis * offset
        omega = rotation.undo(moving.omega) + (axis * dq if joint.is_revolute else ZERO)
        slide = ZERO if joint.is_revolute else axis * dq
        moving = _Moving(
            origin=rotation.undo(moving.origin) + step,
            velocity=rotation.undo(moving.velocity) + cross(omega, step) + slide,
            omega=omega,
            gravity=rotation.undo(moving.gravity),
            rotations=(*moving.rotations, rotation),
        )
        yield moving


def _wrench_power(robot: Robot, block: Block, frame: str) -> FloatArray:
    """Power of the wrench on the end effector."""
    *_, last = _link_motions(robot, block)
    force, moment = Vector(*block.wrench.T[:3]), Vector(*block.wrench.T[3:])
    velocity = last.velocity + cross(last.omega, Vector(*robot.tool.xyz))
    if frame == "end_effector":
        into_link = rotation_matrix(robot.tool)
        force, moment = into_link.times(force), into_link.times(moment)
    else:
        into_frame_0 = rotation_matrix(robot.base).transposed()
        force, moment = into_frame_0.times(force), into_frame_0.times(moment)
        for rotation in last.rotations:
            force, moment = rotation.undo(force), rotation.undo(moment)
    power: FloatArray = force.dot(velocity) + moment.dot(last.omega)
    return power
