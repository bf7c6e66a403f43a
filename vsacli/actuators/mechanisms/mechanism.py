"""Mechanisms of serial actuators: a potential with derivatives, its inverse, and the springs in motion."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np

from vsacli.actuators.elasticity import Components, ElasticState, MotorMatrix
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.spring_elements import SpringAssembly
from vsacli.base.arrays import FloatArray

SMALL_DEFLECTION = 1e-3
"""Deflection, rad (m), whose torque is large compared with rounding. The load of motor 1 passes through zero,
where the torque itself is no scale for its error."""


class Partials(NamedTuple):
    """Potential U(phi, s) and its partial derivatives at deflections and settings, arrays of one shape.

    Subscripts of the torque T = U_phi: p for phi, s for the setting theta_2.

    Attributes:
        energy: U.
        setting_torque: U_s, the torque of the springs against motor 2.
        setting_stiffness: U_ss.
        T, T_p, T_s, T_pp, T_ps, T_ss, T_ppp, T_pps, T_pss: Torque and its derivatives.
    """

    energy: FloatArray
    setting_torque: FloatArray
    setting_stiffness: FloatArray
    T: FloatArray
    T_p: FloatArray
    T_s: FloatArray
    T_pp: FloatArray
    T_ps: FloatArray
    T_ss: FloatArray
    T_ppp: FloatArray
    T_pps: FloatArray
    T_pss: FloatArray


class MechanismState(ElasticState):
    """State of a serial actuator's springs; the coordinates are phi, theta_2 and q."""

    def sizes(self, unknowns: Components) -> tuple[FloatArray, FloatArray]:
        """Return the sizes of torque and stiffness.

        The stiffness may be a small difference of two large terms, which the last digits of phi and of the
        setting determine.
        """
        stiffness_terms = np.abs(self.matrix.stiffness_1 * unknowns[0]) + np.abs(
            self.matrix.stiffness_2 * unknowns[1]
        )
        return np.abs(self.tau_e) + SMALL_DEFLECTION * self.stiffness, self.stiffness + stiffness_terms


class DeflectionState(MechanismState):
    """Springs whose potential depends on phi and s alone."""

    def __init__(self, partials: Partials) -> None:
        self._partials = partials

    @property
    def energy(self) -> FloatArray:
        """U."""
        return self._partials.energy

    @property
    def tau_e(self) -> FloatArray:
        """T."""
        return self._partials.T

    @property
    def stiffness(self) -> FloatArray:
        """T_p."""
        return self._partials.T_p

    @property
    def tau_transmission(self) -> tuple[FloatArray, ...]:
        """T against motor 1, which carries the load; U_s against motor 2."""
        return self._partials.T, self._partials.setting_torque

    @cached_property
    def matrix(self) -> MotorMatrix:
        """Derivatives of T and T_p over phi and s."""
        p = self._partials
        return MotorMatrix(p.T_p, p.T_s, p.T_pp, p.T_ps)

    def torque_rate(self, rates: Components) -> FloatArray:
        """Return T_p phi' + T_s s'."""
        return self._partials.T_p * rates[0] + self._partials.T_s * rates[1]

    def stiffness_rate(self, rates: Components) -> FloatArray:
        """Return T_pp phi' + T_ps s'."""
        return self._partials.T_pp * rates[0] + self._partials.T_ps * rates[1]

    def stiffness_curvature(self, rates: Components) -> FloatArray:
        """Return T_ppp phi'^2 + 2 T_pps phi' s' + T_pss s'^2."""
        p, dphi, ds = self._partials, rates[0], rates[1]
        return p.T_ppp * dphi * dphi + 2 * p.T_pps * dphi * ds + p.T_pss * ds * ds

    def transmission_rates(self, rates: Components) -> tuple[FloatArray, ...]:
        """Return the rates of T and U_s."""
        p = self._partials
        return self.torque_rate(rates), p.T_s * rates[0] + p.setting_stiffness * rates[1]

    def rates(self, dtau_e: FloatArray, dstiffness: FloatArray, dq: FloatArray) -> tuple[FloatArray, ...]:
        """Return A^-1 (tau_e', sigma'), and q'."""
        return *self.matrix.solve(dtau_e, dstiffness), dq

    def motor_accelerations(
        self, rates: Components, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> tuple[FloatArray, ...]:
        """Return A^-1 of (tau_e'', sigma'') minus terms quadratic in the rates; theta_1'' = phi'' + q''."""
        p, dphi, ds = self._partials, rates[0], rates[1]
        squared, mixed, setting_squared = dphi * dphi, 2 * dphi * ds, ds * ds
        ddphi, dds = self.matrix.solve(
            ddtau_e - (p.T_pp * squared + p.T_ps * mixed + p.T_ss * setting_squared),
            ddstiffness - (p.T_ppp * squared + p.T_pps * mixed + p.T_pss * setting_squared),
        )
        return ddphi + ddq, dds


Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Mechanism(SpringAssembly, ABC):
    """Springs between motor 1 and the link that motor 2 adjusts; a frozen dataclass of declared fields.

    Equal mechanisms must compute the same. If the potential depends only on phi = theta_1 - q and the setting
    s = theta_2, override `partials`, else `state`. Positions in rad (m), torques in N m (N).

    Attributes:
        joint_types: Types of joints that it can drive; a rotating lever drives no prismatic one.
    """

    joint_types: ClassVar[tuple[str, ...]] = ("revolute", "prismatic")

    def __init_subclass__(cls, **options: Any) -> None:
        """Refuse attributes of a class of users that have other names now."""
        super().__init_subclass__(**options)
        if not cls.__module__.startswith("vsacli."):
            from vsacli.base.renamed import refuse_old_names  # not needed for the mechanisms of this package

            refuse_old_names(cls, Mechanism)

    @classmethod
    @abstractmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        """Return plausible values of the fields, for a new robot file; none if there are no such."""

    @property
    def deflection_range(self) -> tuple[float, float]:
        """Range of phi in which the mechanism works."""
        return (-math.inf, math.inf)

    @property
    @abstractmethod
    def setting_range(self) -> tuple[float, float]:
        """Range of theta_2 in which the mechanism works."""

    @property
    def ranges(self) -> tuple[Range, Range]:
        """Ranges of the two coordinates of `ranged`."""
        return self.deflection_range, self.setting_range

    def ranged(self, phi: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coordinates bounded by `ranges`: phi and the setting, unless overridden."""
        return phi, s

    @abstractmethod
    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """Return the attainable range of the stiffness at an elastic torque, and phi, s for the demanded one.

        Args:
            tau_e: Elastic torque, (samples,), N m (N).
            stiffness: Demanded joint stiffness, (samples,), N m/rad (N/m).
            q: Position of the joint, (samples,); ignored if the potential depends on phi and s alone.

        Returns:
            A solution with phi as phi_1 and theta_2 as phi_2, for the stiffness clipped to the range. An end
            is critical where A is singular; the maximum of the torque and the ends of ranges are not.
        """

    def partials(self, phi: FloatArray, s: FloatArray) -> Partials:
        """Return the potential and its derivatives at deflections and settings, arrays of one shape."""
        raise NotImplementedError(f"{type(self).__name__} depends on more than phi and the setting")

    def state(self, phi: FloatArray, s: FloatArray, q: FloatArray) -> MechanismState:  # noqa: ARG002
        """Return the springs at deflections, settings and joint positions, arrays of one shape."""
        return DeflectionState(self.partials(phi, s))
