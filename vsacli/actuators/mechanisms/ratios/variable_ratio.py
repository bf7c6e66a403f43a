"""Any ratio and any torque: T = K(s) g(phi), for jack springs, leaf springs, measured levers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.laws import LAWS, SpringLaw
from vsacli.actuators.laws.law import PairSolution, SpringRecord
from vsacli.actuators.mechanisms.mechanism import Mechanism, Partials
from vsacli.actuators.mechanisms.ratios.ratio import Sine, ratio_partials
from vsacli.actuators.mechanisms.ratios.scales import SCALES, ScaleLaw, increasing_root
from vsacli.actuators.pairs.bracketing import bracketed_root
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.lazy import LazyRegistry
from vsacli.compute.control_flow import Values
from vsacli.documents.fields import OneOf, interval, value

TORQUES = LazyRegistry({**LAWS.homes, "sine": "vsacli.actuators.mechanisms.ratios.ratio:Sine"})
"""Torques by their name in a robot file: the spring laws, and one that softens."""

DEFLECTIONS = np.geomspace(1e-6, 1.0, 4000)
"""Shares of a law's domain at which the sign of g'^2 - g g'' is sampled; laws change over tenths of it."""

ENDLESS = 1e3
"""Deflection, rad (m), at which an unbounded domain is cut off: no springs deflect so far."""


class _DeflectionLimit(NamedTuple):
    """The end of the deflection to one side of rest on the branch.

    Attributes:
        phi: Last deflection, infinite if there is none.
        torque: g there.
        critical: Whether the stiffness has an extremum there, and A is singular; else the law ends.
        stiffness: g' there, exactly zero at the maximum of a sine, where rounding may give it any sign.
    """

    phi: float
    torque: float
    critical: bool
    stiffness: float


class _EndAtTorque(NamedTuple):
    """An end of the branch at given torques; arrays (samples,)."""

    phi: FloatArray
    stiffness: FloatArray
    limited: BoolArray
    critical: BoolArray


@dataclass(frozen=True)
class VariableRatio(Mechanism):
    """A spring with the torque g(phi) that motor 2 scales: T = K(theta_2) g(phi).

    At a given torque the stiffness falls with the scale while the deflection grows, up to where g'^2 = g g''.
    """

    setting: tuple[float, float] = interval(units.POSITION, "range of theta_2 that the mechanism allows")
    scale: ScaleLaw = value(
        OneOf(SCALES), "scale K over theta_2: positive, strictly increasing or decreasing"
    )
    torque: SpringLaw | Sine = value(OneOf(TORQUES), "torque g over the deflection, for K = 1")

    def _problems(self) -> Iterator[FieldProblem]:
        if not -np.inf < self.setting[0] < self.setting[1] < np.inf:
            yield FieldProblem(("setting",), "must have two ends, the smaller one first")
        else:
            yield from (FieldProblem(("scale",), reason) for reason in self.scale.problems(self.setting))
        if isinstance(self.torque, SpringLaw) and np.isfinite(self.torque.max_deflection):
            reason = (
                "is not a limit of a serial actuator; delete it (the range of a table already is a limit)"
            )
            yield FieldProblem(("torque", "max_deflection"), reason)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        """Return a spring with a length from half to twice the nominal one."""
        stiffness = 600 if joint_type == "revolute" else 6000
        return {
            "setting": [0.5, 2],
            "scale": {"type": "power", "exponent": 2},
            "torque": {"type": "polynomial", "c1": stiffness},
        }

    @property
    def parts(self) -> tuple[SpringRecord, ...]:
        """Scale and torque."""
        return (self.scale, self.torque)

    @property
    def deflection_range(self) -> tuple[float, float]:
        """The domain of the torque."""
        return self.torque.domain

    @property
    def setting_range(self) -> tuple[float, float]:
        """The given range."""
        return self.setting

    def partials(self, phi: FloatArray, s: FloatArray) -> Partials:
        """Return the derivatives of K w, with the energy w of the torque g."""
        return ratio_partials(self.scale.at(s), *self.torque.energy_and_state(phi))

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:  # noqa: ARG002
        """Solve tau_e/sigma = g/g' for phi between the ends of the scale, then K = sigma/g'."""
        least, most = sorted(self.scale.at(np.array(self.setting, dtype=float)).value.tolist())
        with np.errstate(all="ignore"):  # a torque of a tendon that pushes, for instance
            soft, stiff = self._end(tau_e, least), self._end(tau_e, most)
            carried = ~stiff.limited & np.isfinite(tau_e)
            lower, upper = (np.where(carried, end.stiffness, np.nan) for end in (soft, stiff))
            demand = np.minimum(np.maximum(stiffness, lower), upper)
            ratio = tau_e / demand
            ends = np.minimum(stiff.phi, soft.phi), np.maximum(stiff.phi, soft.phi)
            phi = self._deflection(ratio, *ends)
            scale = np.minimum(np.maximum(demand / self.torque.state(phi).sigma, least), most)
            setting = self.scale.setting(scale, self.setting)
        never = np.zeros_like(tau_e, dtype=bool)
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=soft.critical & carried,
            upper_critical=never,
            slack_below=never,
            phi_1=np.where(np.isnan(demand), np.nan, phi),
            phi_2=np.where(np.isnan(demand), np.nan, setting),
        )

    def _deflection(self, ratio: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        """Return phi at which g/g' has a value, between two ends."""
        if isinstance(self.torque, Sine):
            return np.minimum(np.maximum(self.torque.deflection_at(ratio), low), high)
        return increasing_root(self._torque_over_stiffness, low, high, ratio, (ratio,))

    def _torque_over_stiffness(self, phi: FloatArray, ratio: FloatArray) -> Values:
        """Return g/g' minus a ratio, which increases with phi along the branch, and two derivatives."""
        state = self.torque.state(phi)
        quotient, slope, curvature = (each / state.sigma for each in (state.tau, state.zeta, state.eta))
        bent = 2 * quotient * slope * slope - slope - quotient * curvature
        return quotient - ratio, 1 - quotient * slope, bent

    def _end(self, tau_e: FloatArray, scale: float) -> _EndAtTorque:
        below, above = self._limits
        torque = tau_e / scale
        under, over = torque < below.torque, torque > above.torque
        inside = np.minimum(np.maximum(torque, below.torque), above.torque)
        phi = np.where(under, below.phi, np.where(over, above.phi, self.torque.deflection(inside)))
        state = self.torque.state(phi)
        sigma = np.where(under, below.stiffness, np.where(over, above.stiffness, state.sigma))
        factor = np.where(under | over, tau_e / state.tau, scale)
        critical = (under & below.critical) | (over & above.critical)
        return _EndAtTorque(phi, factor * sigma, under | over, critical)

    @cached_property
    def _limits(self) -> tuple[_DeflectionLimit, _DeflectionLimit]:
        """Limits to the negative and to the positive side."""
        below, above = zip(self.torque.domain, self.torque.torque_range, strict=True)
        return _deflection_limit(self.torque, *below), _deflection_limit(self.torque, *above)


def _deflection_limit(law: SpringLaw | Sine, end: float, torque: float) -> _DeflectionLimit:
    """Return the limit of the deflection to one side, which ends there with a torque."""

    def falling(phi: FloatArray) -> FloatArray:
        """Return a function that is positive where the stiffness falls along the branch."""
        state = law.state(phi)
        return state.sigma * state.sigma - state.tau * state.zeta

    phi = DEFLECTIONS * (end if np.isfinite(end) else np.copysign(ENDLESS, end))
    with np.errstate(all="ignore"):  # overflow of laws that grow fast
        turned = np.flatnonzero(falling(phi) < 0)
    if not turned.size:
        with np.errstate(all="ignore"):
            stiffness = 0.0 if isinstance(law, Sine) else float(law.state(np.array([end])).sigma[0])
        return _DeflectionLimit(end, torque, critical=False, stiffness=stiffness)
    first = max(int(turned[0]), 1)
    turn = bracketed_root(falling, phi[first - 1 : first], phi[first : first + 1])
    state = law.state(turn)
    return _DeflectionLimit(
        float(turn[0]), float(state.tau[0]), critical=True, stiffness=float(state.sigma[0])
    )
