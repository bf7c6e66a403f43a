"""Smooth dry friction between two links, part of the elastic torque, with its first two derivatives."""

from __future__ import annotations

import numpy as np

from vsacli.actuators.friction import Friction
from vsacli.compute.vector import Scalar, exact, mul, sub
from vsacli.dynamics.chain import TorqueDerivatives


def joint_friction(
    friction: Friction | None, rates: tuple[Scalar, Scalar, Scalar, Scalar]
) -> TorqueDerivatives:
    """F tanh(q'/w) + F_o and its derivatives, of which tanh' = 1 - tanh^2.

    Args:
        friction: of the joint; None if there is none.
        rates: q', q'', q''', q''''; scalars of any kind that has a tanh, integers where they are exact.
    """
    if friction is None:
        return TorqueDerivatives(0, 0, 0)
    dq, ddq, d3q, _ = rates
    size, steepness = exact(friction.coulomb[0]), 1 / friction.width if friction.width else 0
    at_rest = type(dq) is int and dq == 0
    tanh = 0 if at_rest else np.tanh(dq * steepness)
    once, twice = mul(steepness, ddq), mul(steepness, d3q)
    slope = mul(size, sub(1, mul(tanh, tanh)))
    return TorqueDerivatives(
        tau=mul(size, tanh) + friction.offset,
        dtau=mul(slope, once),
        ddtau=mul(slope, sub(twice, mul(mul(2, tanh), mul(once, once)))),
    )
