"""Joint torques with which a tree exerts a force and a moment at a tool: virtual work, no recursion.

The torque of joint i is f . dp/dq_i + m . a_i, where p is the point of contact and a_i the axial vector of
(dR/dq_i) R^T. Everything is written in frame 0, as the list of its time derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oracles.jets import Scalar, leibniz, matrix_product
from oracles.kinematics import transform
from oracles.lagrange import Array, Chain, Derivatives
from vsacli.robot.model import Robot


@dataclass(frozen=True)
class Contact:
    """What a tool exerts at a point fixed in the frame of its link.

    Attributes:
        force, moment: components with their first and second derivatives.
        point: in the frame of the link; the moment is about it.
        in_base: whether the components are along the axes of frame 0, else of the link.
        link: index of the link, by default the last.
    """

    force: Sequence[Array]
    moment: Sequence[Array]
    point: Array
    in_base: bool
    link: int = -1


def contacts_of(robot: Robot, wrench: Sequence[Array], frames: Sequence[str | None]) -> list[Contact]:
    """The contacts at the tools of a robot under wrenches of the environment.

    Args:
        robot: robot with tools.
        wrench: components and their two derivatives, each (samples, 6 tools).
        frames: along whose axes those of each tool are, "base" or "end_effector"; None: nothing acts on it.
    """
    names = [joint.name for joint in robot.joints]
    contacts = []
    for index, (tool, frame) in enumerate(zip(robot.end_effectors, frames, strict=True)):
        turn = np.eye(3) if frame == "base" else transform(tool).real[:3, :3]
        # What the environment exerts on the tool, the tool exerts on it in the other direction.
        by_order = [-rows[:, 6 * index : 6 * index + 6] for rows in wrench]
        force, moment = ([rows[:, half] @ turn.T for rows in by_order] for half in (slice(3), slice(3, 6)))
        if frame is not None:
            point, link = np.array(tool.xyz), names.index(tool.joint)
            contacts.append(Contact(force, moment, point, frame == "base", link))
    return contacts


def contact_torques(chain: Chain, contact: Contact, order: int) -> list[Scalar]:
    """Derivative of the given order, 0 to 2, of the torque of each joint."""
    link = contact.link % len(chain.links)
    turn = [pose[..., :3, :3] for pose in chain.poses[link]]
    force, moment = (
        list(vectors) if contact.in_base else _turned(turn, vectors)
        for vectors in (contact.force, contact.moment)
    )
    torques: list[Scalar] = []
    for i in range(len(chain.links)):
        moved = chain.sensitivities(i)
        by_force, by_moment = (0, 0)
        if link in moved:
            by_force = leibniz(order, force, _shift(moved[link], contact.point), _dot)
            by_moment = leibniz(order, moment, _axis(moved[link], turn), _dot)
        torques.append(by_force + by_moment)
    return torques


def _turned(turn: Derivatives, vectors: Sequence[Array]) -> Derivatives:
    columns = matrix_product(turn, [vector[..., None] for vector in vectors])
    return [column[..., 0] for column in columns]


def _dot(a: Array, b: Array) -> Scalar:
    return (a * b).sum(axis=-1)


def _shift(sensitivity: Derivatives, point: Array) -> Derivatives:
    """dp/dq_i."""
    return [derivative[..., :3, :3] @ point + derivative[..., :3, 3] for derivative in sensitivity]


def _axis(sensitivity: Derivatives, turn: Derivatives) -> Derivatives:
    """The axial vector of (dR/dq_i) R^T."""
    back = [matrix.swapaxes(-1, -2) for matrix in turn]
    skew = matrix_product([derivative[..., :3, :3] for derivative in sensitivity], back)
    return [np.stack([m[..., 2, 1], m[..., 0, 2], m[..., 1, 0]], axis=-1) for m in skew]
