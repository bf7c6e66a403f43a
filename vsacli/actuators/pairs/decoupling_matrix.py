"""The decoupling matrix A of a joint with two springs, and what follows from it: (67)-(68), (70)-(72).

Written for one joint with scalars or arrays of any one shape, and any kind of number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from vsacli.base.arrays import FloatArray, IndexArray

if TYPE_CHECKING:
    from vsacli.actuators.laws.law import SpringLaw


Sides = tuple[FloatArray, FloatArray]
"""A quantity of side 1, its motor or its spring, and of side 2."""


class Springs(NamedTuple):
    """Torque, stiffness, slope and curvature of springs, (62)-(64), (66); arrays of one shape."""

    tau: FloatArray
    sigma: FloatArray
    zeta: FloatArray
    eta: FloatArray

    def of(self, members: IndexArray) -> Springs:
        """Some of the springs, which are on the last axis."""
        return Springs(*(values[..., members] for values in self))

    def after(self, step: FloatArray) -> Springs:
        """After a short step, by Taylor's formula as far as the derivatives are known."""
        return Springs(
            self.tau + step * self.sigma + self.bent(step),
            self.sigma + step * (self.zeta + step / 2 * self.eta),
            self.zeta + step * self.eta,
            self.eta,
        )

    def bent(self, step: FloatArray) -> FloatArray:
        """By how much the torque leaves its tangent over a short step, to the third order."""
        return step * step / 2 * (self.zeta + step / 3 * self.eta)


def spring_state(law: SpringLaw, phi: FloatArray) -> Springs:
    """A spring at deflections."""
    return Springs(*law.derivatives(phi, 3))


def determinant(one: Springs, two: Springs) -> FloatArray:
    """Det A (67); zero where A is singular."""
    return one.sigma * two.zeta - two.sigma * one.zeta


def solve(one: Springs, two: Springs, divisor: FloatArray, upper: FloatArray, lower: FloatArray) -> Sides:
    """A^-1 (upper, lower), as (68) and (72) need; the divisor is det A, or NaN where there is no solution."""
    return (
        (two.zeta * upper - two.sigma * lower) / divisor,
        (one.sigma * lower - one.zeta * upper) / divisor,
    )


def beta(
    one: Springs,
    two: Springs,
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
