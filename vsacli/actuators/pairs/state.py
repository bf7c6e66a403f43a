"""Both springs of a pair at given deflections, and next to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.pairs.decoupling_matrix import Sides
from vsacli.base.arrays import FloatArray
from vsacli.compute.control_flow import Values


class PairState(NamedTuple):
    """Deflections of both sides and what their springs do there; arrays of one shape."""

    phi_1: FloatArray
    phi_2: FloatArray
    one: SpringState
    two: SpringState

    @classmethod
    def of(cls, values: Values) -> PairState:
        """From what `values` gives."""
        phi_1, phi_2, *springs = values
        count = len(SpringState._fields)
        return cls(phi_1, phi_2, SpringState(*springs[:count]), SpringState(*springs[count:]))

    @property
    def values(self) -> Values:
        """All arrays in a row, as loops and branches take them."""
        return self.phi_1, self.phi_2, *self.one, *self.two

    @property
    def torque(self) -> FloatArray:
        """Elastic torque."""
        return self.one.tau + self.two.tau

    @property
    def stiffness(self) -> FloatArray:
        """Joint stiffness."""
        return self.one.sigma + self.two.sigma

    @property
    def rho(self) -> Sides:
        """Relative hardening of either spring."""
        return self.one.zeta / self.one.sigma, self.two.zeta / self.two.sigma

    def kept_stiff(self) -> PairState:
        """With some stiffness where both springs are slack and have none."""
        slack = self.stiffness == 0
        one, two = (
            spring._replace(sigma=np.where(slack, 1.0, spring.sigma)) for spring in (self.one, self.two)
        )
        return self._replace(one=one, two=two)

    def bent(self, step_1: FloatArray, step_2: FloatArray) -> FloatArray:
        """By how much the elastic torque leaves its tangent over short steps, to the third order."""
        return self.one.bent(step_1) + self.two.bent(step_2)

    def moved(self, step_1: FloatArray, step_2: FloatArray) -> PairState:
        """After short steps, as `SpringState.after`."""
        return PairState(
            self.phi_1 + step_1, self.phi_2 + step_2, self.one.after(step_1), self.two.after(step_2)
        )
