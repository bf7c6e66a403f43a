"""Two springs that share a given elastic torque: their state at deflections, and over the preload torque."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringLaw, state_of
from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.pairs.decoupling_matrix import Sides
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, subroutine


class PairState(NamedTuple):
    """Deflections of both sides and the states of their springs there; arrays of one shape."""

    phi_1: FloatArray
    phi_2: FloatArray
    one: SpringState
    two: SpringState

    @classmethod
    def of(cls, values: Values) -> PairState:
        """The state whose `values` these are."""
        phi_1, phi_2, *springs = values
        count = len(SpringState._fields)
        return cls(phi_1, phi_2, SpringState(*springs[:count]), SpringState(*springs[count:]))

    @property
    def values(self) -> Values:
        """All arrays in a row, as loops and branches take them."""
        return self.phi_1, self.phi_2, *self.one, *self.two

    @property
    def torque(self) -> FloatArray:
        """Elastic torque of the joint, tau_1 + tau_2."""
        return self.one.tau + self.two.tau

    @property
    def stiffness(self) -> FloatArray:
        """Joint stiffness, sigma_1 + sigma_2."""
        return self.one.sigma + self.two.sigma

    @property
    def rho(self) -> Sides:
        """Relative hardening rho = zeta/sigma of either spring."""
        return self.one.zeta / self.one.sigma, self.two.zeta / self.two.sigma

    def regularized(self) -> PairState:
        """The same with a stiffness of one where both springs are slack, so that it can be divided by."""
        slack = self.stiffness == 0
        one, two = (
            spring._replace(sigma=np.where(slack, 1.0, spring.sigma)) for spring in (self.one, self.two)
        )
        return self._replace(one=one, two=two)

    def linearization_error(self, step_1: FloatArray, step_2: FloatArray) -> FloatArray:
        """Elastic torque after short steps less what its tangent gives, to the third order of the steps."""
        return self.one.linearization_error(step_1) + self.two.linearization_error(step_2)

    def after(self, step_1: FloatArray, step_2: FloatArray) -> PairState:
        """The state after short steps of the deflections, see `SpringState.after`."""
        return PairState(
            self.phi_1 + step_1, self.phi_2 + step_2, self.one.after(step_1), self.two.after(step_2)
        )


def under(law: SpringLaw, torque: FloatArray) -> tuple[FloatArray, SpringState]:
    """Deflection and state of a spring under a torque, which code that must be short has once."""

    def found(torque: FloatArray) -> Values:
        phi, state = law.deflection_and_state(torque)
        return phi, *state

    phi, *state = subroutine(found, (torque,))
    return phi, SpringState(*state)


@dataclass(frozen=True)
class Balance:
    """Two springs, and the preload torque t between them: tau_1 = tau_e/2 + t and tau_2 = tau_e/2 - t.

    The joint stiffness G = sigma_1 + sigma_2 has the slope dG/dt = rho_1 - rho_2 with the relative hardening
    rho_k = zeta_k/sigma_k, and det A = -sigma_1 sigma_2 dG/dt. Arrays of any one shape.
    """

    first: SpringLaw
    second: SpringLaw

    @cached_property
    def domain_ends(self) -> tuple[tuple[SpringState, ...], ...]:
        """State of each spring at the two ends of its domain; scalars, unknown where there is no end."""
        with np.errstate(all="ignore"):
            return tuple(
                tuple(law.state(np.array(phi)) for phi in law.domain) for law in (self.first, self.second)
            )

    def preload_range(self, tau_e: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Smallest and largest t for which both laws hold; smallest > largest if there is none."""
        (low_1, high_1), (low_2, high_2) = self.first.torque_range, self.second.torque_range
        return (
            np.maximum(low_1 - tau_e / 2, tau_e / 2 - high_2),
            np.minimum(high_1 - tau_e / 2, tau_e / 2 - low_2),
        )

    def deflections_at(self, tau_e: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """phi_1 and phi_2 at a preload torque."""
        return self.deflections(tau_e / 2 + t, tau_e / 2 - t)

    def deflections(self, tau_1: FloatArray, tau_2: FloatArray) -> tuple[FloatArray, FloatArray]:
        """phi_1 and phi_2 under the torques of the two springs."""
        state = self.state_under(tau_1, tau_2)
        return state.phi_1, state.phi_2

    def state_under(self, tau_1: FloatArray, tau_2: FloatArray) -> PairState:
        """State of both springs under their torques."""
        (phi_1, one), (phi_2, two) = under(self.first, tau_1), under(self.second, tau_2)
        return PairState(phi_1, phi_2, one, two)

    def state(self, phi_1: FloatArray, phi_2: FloatArray) -> PairState:
        """State of both springs at deflections."""
        return PairState(phi_1, phi_2, state_of(self.first, phi_1), state_of(self.second, phi_2))

    def stiffness(self, phi_1: FloatArray, phi_2: FloatArray) -> FloatArray:
        """G at deflections."""
        return self.first.stiffness(phi_1) + self.second.stiffness(phi_2)

    def stiffness_slope(self, phi_1: FloatArray, phi_2: FloatArray) -> FloatArray:
        """dG/dt at deflections."""
        return self.first.hardening(phi_1) - self.second.hardening(phi_2)

    def is_slack(self, tau_e: FloatArray, t: FloatArray) -> BoolArray:
        """Whether a side that only pulls carries no torque."""
        if not (self.first.pulls_only or self.second.pulls_only):
            return np.zeros_like(tau_e, dtype=bool)
        slack: BoolArray = (self.first.pulls_only & (tau_e / 2 + t == 0)) | (
            self.second.pulls_only & (tau_e / 2 - t == 0)
        )
        return slack
