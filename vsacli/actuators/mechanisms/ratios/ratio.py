"""The potential K(s) w(phi), and its closed solution where a lever stretches a spring by its turn.

tau_e/sigma = g/g' gives phi whatever the setting is; then K = sigma/g' gives the setting.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.actuators.laws.pair import PairSolution
from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.mechanisms.mechanism import Mechanism
from vsacli.actuators.mechanisms.ratios.scales import Scale
from vsacli.actuators.mechanisms.ratios.sine import Sine
from vsacli.actuators.mechanisms.state import Partials
from vsacli.base.arrays import FloatArray

TURN = Sine(k=2.0, ratio=2.0)
"""g = sin 2phi, of w = sin^2(phi)."""


def ratio_partials(scale: Scale, energy: FloatArray, form: SpringState) -> Partials:
    """Partial derivatives of the potential K(s) w(phi).

    Args:
        scale: K and two derivatives.
        energy: w.
        form: g and three derivatives.
    """
    value, slope, curvature = scale
    return Partials(
        energy=value * energy,
        setting_torque=slope * energy,
        setting_stiffness=curvature * energy,
        T=value * form.tau,
        T_p=value * form.sigma,
        T_s=slope * form.tau,
        T_pp=value * form.zeta,
        T_ps=slope * form.sigma,
        T_ss=curvature * form.tau,
        T_ppp=value * form.eta,
        T_pps=slope * form.zeta,
        T_pss=curvature * form.sigma,
    )


@dataclass(frozen=True)
class SineRatio(Mechanism):
    """U = K(s) sin^2(phi): a spring that a lever stretches by its turn. Singular nowhere.

    With T = K sin 2phi and sigma = 2 K cos 2phi the solution is closed: 2K is the hypotenuse over the sides
    sigma and 2 tau_e, and 2phi the angle between it and sigma.
    """

    joint_types: ClassVar[tuple[str, ...]] = ("revolute",)

    @abstractmethod
    def scale(self, s: FloatArray) -> Scale:
        """K(s) with its derivatives, positive and monotone over the range of the setting."""

    @abstractmethod
    def setting(self, scale: FloatArray) -> FloatArray:
        """The setting s at which K(s) has a value."""

    @property
    @abstractmethod
    def scale_range(self) -> tuple[float, float]:
        """The smallest and the largest K."""

    def partials(self, phi: FloatArray, s: FloatArray) -> Partials:
        """Those of K(s) sin^2(phi)."""
        return ratio_partials(self.scale(s), *TURN.energy_and_state(phi))

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:  # noqa: ARG002
        """(2 K_min)^2 <= sigma^2 + (2 tau_e)^2 <= (2 K_max)^2, cut at sigma = 0."""
        load = 2 * np.abs(np.where(np.isfinite(tau_e), tau_e, np.nan))
        least, most = ((2 * scale - load) * (2 * scale + load) for scale in self.scale_range)
        carried = most >= 0
        lower, upper = (np.sqrt(np.where(carried, np.maximum(each, 0), np.nan)) for each in (least, most))
        demand = np.minimum(np.maximum(stiffness, lower), upper)
        never = np.zeros_like(carried)
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=never,
            upper_critical=never,
            slack_below=never,
            phi_1=np.arctan2(2 * tau_e, demand) / 2,
            phi_2=self.setting(np.hypot(demand, load) / 2),
        )
