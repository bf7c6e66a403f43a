"""Dry friction in the equations of motion: smooth at joints, and sharp in motors, which stick and slip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.actuators.friction import Friction, FrictionLaws, sign_of_motion
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.vector import Scalar, exact, mul, sub
from vsacli.dynamics.recursion_inputs import TorqueDerivatives


def joint_friction(friction: Friction | None, rates: Sequence[Scalar]) -> TorqueDerivatives:
    """Return F tanh(q'/w) + F_o and its derivatives, with tanh' = 1 - tanh^2.

    Args:
        friction: Friction of the joint; None without friction.
        rates: q', q'', q''', q''''; scalars of any kind with tanh; exact zeros are integers.
    """
    if friction is None:
        return TorqueDerivatives(0, 0, 0)
    dq, ddq, d3q, _ = rates
    coulomb, steepness = exact(friction.coulomb[0]), 1 / friction.width if friction.width else 0
    at_rest = type(dq) is int and dq == 0
    tanh = 0 if at_rest else np.tanh(dq * steepness)
    dx, ddx = mul(steepness, ddq), mul(steepness, d3q)
    slope = mul(coulomb, sub(1, mul(tanh, tanh)))
    return TorqueDerivatives(
        tau=mul(coulomb, tanh) + friction.offset,
        dtau=mul(slope, dx),
        ddtau=mul(slope, sub(ddx, mul(mul(2, tanh), mul(dx, dx)))),
    )


class Response(NamedTuple):
    """Accelerations caused by motor torques.

    Attributes:
        ddq: Acceleration of the joints, (..., joints).
        ddtheta: Acceleration of the motors with springs, (..., springs).
        friction: Dry friction of all motors, (..., motors); None without friction.
    """

    ddq: FloatArray
    ddtheta: FloatArray
    friction: FloatArray | None


AccelerationLaw = Callable[[FloatArray, BoolArray | None], tuple[FloatArray, FloatArray, FloatArray]]
"""Function from the torques of all motors, (..., motors), and a mask of held motors (None if none can be
held) to accelerations of joints and of sprung motors, and to holding torques, (..., motors), 0 for others."""


def response_with_friction(
    laws: FrictionLaws,
    torque: FloatArray,
    velocity: FloatArray,
    slip: FloatArray | None,
    accelerate: AccelerationLaw,
) -> Response:
    """Return the accelerations under motor torques and dry friction.

    Args:
        laws: Dry friction of all motors.
        torque: Torques of all motors, (..., motors).
        velocity: Velocities of all motors, (..., motors).
        slip: Direction in which each motor with sharp friction slides, 0 while it is held, (motors,). If
            None, a motor at rest is held as long as its friction suffices.
        accelerate: Equations of motion without friction.
    """

    def respond(direction: FloatArray) -> tuple[Response, FloatArray]:
        friction = laws.torque(velocity, direction)
        ddq, ddtheta, holding = accelerate(torque - friction, laws.sharp & (direction == 0))
        return Response(ddq, ddtheta, friction + holding), laws.direction_beyond(friction + holding)

    if not laws.sticks:
        friction = laws.torque(velocity)
        ddq, ddtheta, _ = accelerate(torque - friction, None)
        return Response(ddq, ddtheta, friction)
    if slip is not None:
        return respond(np.broadcast_to(slip, velocity.shape))[0]
    direction = sign_of_motion(velocity)
    response, breakaway = respond(direction)
    # A motor at rest whose holding torque exceeds its friction begins to slide in that direction.
    released_direction = np.where(direction == 0, breakaway, 0.0)
    return respond(direction + released_direction)[0] if released_direction.any() else response
