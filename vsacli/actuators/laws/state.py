"""The state of a spring at a deflection: its torque and three derivatives of the torque."""

from __future__ import annotations

from typing import NamedTuple

from vsacli.base.arrays import FloatArray, IndexArray


class SpringState(NamedTuple):
    """Torque, stiffness, slope and curvature of springs, (62)-(64), (66); arrays of one shape.

    Attributes:
        tau: torque, N m (N).
        sigma: stiffness, the first derivative of the torque over the deflection.
        zeta: slope of the stiffness, the second derivative.
        eta: curvature of the stiffness, the third derivative.
    """

    tau: FloatArray
    sigma: FloatArray
    zeta: FloatArray
    eta: FloatArray

    def take(self, members: IndexArray) -> SpringState:
        """The state of some of the springs, which are on the last axis."""
        return SpringState(*(values[..., members] for values in self))

    def after(self, step: FloatArray) -> SpringState:
        """The state after a short step of the deflection, by Taylor's formula with the derivatives known."""
        return SpringState(
            self.tau + step * self.sigma + self.linearization_error(step),
            self.sigma + step * (self.zeta + step / 2 * self.eta),
            self.zeta + step * self.eta,
            self.eta,
        )

    def linearization_error(self, step: FloatArray) -> FloatArray:
        """Torque after a short step less what its tangent gives, to the third order of the step."""
        return step * step / 2 * (self.zeta + step / 3 * self.eta)
