"""Joint torques with which a chain exerts a force and a moment at its tip: virtual work, no recursion.

The torque of joint i is f . dp/dq_i + m . a_i, where p is the point of contact and a_i the axial vector of
(dR/dq_i) R^T. Everything is written in frame 0, as the list of its time derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oracles.jets import Scalar, leibniz, matrix_product
from oracles.lagrange import Array, Chain, Derivatives


@dataclass(frozen=True)
class Contact:
    """What the end effector exerts at a point fixed in the last frame.

    Attributes:
        force, moment: components with their first and second derivatives.
        point: in the last frame; the moment is about it.
        in_base: whether the components are along the axes of frame 0, else of the last frame.
    """

    force: Sequence[Array]
    moment: Sequence[Array]
    point: Array
    in_base: bool


def contact_torques(chain: Chain, contact: Contact, order: int) -> list[Scalar]:
    """Derivative of the given order, 0 to 2, of the torque of each joint."""
    turn = [pose[:3, :3] for pose in chain.poses[-1]]
    force, moment = (
        list(vectors) if contact.in_base else matrix_product(turn, vectors)
        for vectors in (contact.force, contact.moment)
    )
    return [
        leibniz(order, force, _shift(tip, contact.point), np.dot)
        + leibniz(order, moment, _axis(tip, turn), np.dot)
        for tip in (chain.sensitivities(i)[-1] for i in range(len(chain.links)))
    ]


def _shift(sensitivity: Derivatives, point: Array) -> Derivatives:
    """dp/dq_i."""
    return [derivative[:3, :3] @ point + derivative[:3, 3] for derivative in sensitivity]


def _axis(sensitivity: Derivatives, turn: Derivatives) -> Derivatives:
    """The axial vector of (dR/dq_i) R^T."""
    skew = matrix_product([derivative[:3, :3] for derivative in sensitivity], [matrix.T for matrix in turn])
    return [np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0]]) for matrix in skew]
