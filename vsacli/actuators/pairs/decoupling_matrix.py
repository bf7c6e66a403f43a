"""The decoupling matrix A of a joint with two springs, and what follows from it: (67)-(68), (70)-(72).

Written for one joint with scalars or arrays of any one shape, and any kind of number.
"""

from __future__ import annotations

from vsacli.actuators.laws.state import SpringState
from vsacli.base.arrays import FloatArray

Sides = tuple[FloatArray, FloatArray]
"""A quantity of side 1, its motor or its spring, and of side 2."""


def determinant(one: SpringState, two: SpringState) -> FloatArray:
    """Det A (67); zero where A is singular."""
    return one.sigma * two.zeta - two.sigma * one.zeta


def solve(
    one: SpringState, two: SpringState, divisor: FloatArray, torque_row: FloatArray, stiffness_row: FloatArray
) -> Sides:
    """A^-1 times a right-hand side, as (68) and (72) need.

    The divisor is det A, or NaN where there is no solution.
    """
    return (
        (two.zeta * torque_row - two.sigma * stiffness_row) / divisor,
        (one.sigma * stiffness_row - one.zeta * torque_row) / divisor,
    )


def beta(
    one: SpringState,
    two: SpringState,
    dphi: Sides,
    ddtau_e: FloatArray,
    ddstiffness: FloatArray,
    ddq: FloatArray,
) -> Sides:
    """Right-hand side of (72), with the sums (11) and (65)."""
    squared_1, squared_2 = dphi[0] * dphi[0], dphi[1] * dphi[1]
    return (
        ddtau_e - (one.zeta * squared_1 + two.zeta * squared_2) + (one.sigma + two.sigma) * ddq,  # (70)
        ddstiffness - (one.eta * squared_1 + two.eta * squared_2) + (one.zeta + two.zeta) * ddq,  # (71)
    )
