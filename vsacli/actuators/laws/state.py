"""The state of a spring at a deflection: its torque and the derivatives of it."""

from __future__ import annotations

from typing import NamedTuple

from vsacli.base.arrays import FloatArray, IndexArray


class SpringState(NamedTuple):
    """Torque, stiffness, slope and curvature of springs, (62)-(64), (66); arrays of one shape."""

    tau: FloatArray
    sigma: FloatArray
    zeta: FloatArray
    eta: FloatArray

    def of(self, members: IndexArray) -> SpringState:
        """Some of the springs, which are on the last axis."""
        return SpringState(*(values[..., members] for values in self))

    def after(self, step: FloatArray) -> SpringState:
        """After a short step, by Taylor's formula as far as the derivatives are known."""
        return SpringState(
            self.tau + step * self.sigma + self.bent(step),
            self.sigma + step * (self.zeta + step / 2 * self.eta),
            self.zeta + step * self.eta,
            self.eta,
        )

    def bent(self, step: FloatArray) -> FloatArray:
        """By how much the torque leaves its tangent over a short step, to the third order."""
        return step * step / 2 * (self.zeta + step / 3 * self.eta)
