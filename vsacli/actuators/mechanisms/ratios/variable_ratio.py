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

LARGEST_DEFLECTION = 1e3
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


class _BranchEnds(NamedTuple):
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
        smallest_scale, largest_scale = sorted(
            self.scale.at(np.array(self.setting, dtype=float)).value.tolist()
        )
        with np.errstate(all="ignore"):  # a torque of a tendon that pushes, for instance
            softest_end, stiffest_end = (
                self._end_at_scale(tau_e, smallest_scale),
                self._end_at_scale(tau_e, largest_scale),
            )
            is_carried = ~stiffest_end.limited & np.isfinite(tau_e)
            lower, upper = (
                np.where(is_carried, end.stiffness, np.nan) for end in (softest_end, stiffest_end)
            )
            demand = np.minimum(np.maximum(stiffness, lower), upper)
            ratio = tau_e / demand
            deflection_ends = (
                np.minimum(stiffest_end.phi, softest_end.phi),
                np.maximum(stiffest_end.phi, softest_end.phi),
            )
            phi = self._deflection(ratio, *deflection_ends)
            scale = np.minimum(
                np.maximum(demand / self.torque.state(phi).sigma, smallest_scale), largest_scale
            )
            setting = self.scale.setting(scale, self.setting)
        nowhere = np.zeros_like(tau_e, dtype=bool)
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=softest_end.critical & is_carried,
            upper_critical=nowhere,
            slack_below=nowhere,
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
        quotient, slope, curvature = (
            derivative / state.sigma for derivative in (state.tau, state.zeta, state.eta)
        )
        second_derivative = 2 * quotient * slope * slope - slope - quotient * curvature
        return quotient - ratio, 1 - quotient * slope, second_derivative

    def _end_at_scale(self, tau_e: FloatArray, scale: float) -> _BranchEnds:
        below, above = self._limits
        torque = tau_e / scale
        is_below, is_above = torque < below.torque, torque > above.torque
        clipped_torque = np.minimum(np.maximum(torque, below.torque), above.torque)
        phi = np.where(
            is_below, below.phi, np.where(is_above, above.phi, self.torque.deflection(clipped_torque))
        )
        state = self.torque.state(phi)
        sigma = np.where(is_below, below.stiffness, np.where(is_above, above.stiffness, state.sigma))
        factor = np.where(is_below | is_above, tau_e / state.tau, scale)
        critical = (is_below & below.critical) | (is_above & above.critical)
        return _BranchEnds(phi, factor * sigma, is_below | is_above, critical)

    @cached_property
    def _limits(self) -> tuple[_DeflectionLimit, _DeflectionLimit]:
        """Limits to the negative and to the positive side."""
        below, above = zip(self.torque.domain, self.torque.torque_range, strict=True)
        return _deflection_limit(self.torque, *below), _deflection_limit(self.torque, *above)


def _deflection_limit(law: SpringLaw | Sine, end: float, torque: float) -> _DeflectionLimit:
    """Return the limit of the deflection to one side, which ends there with a torque."""

    def stiffness_fall(phi: FloatArray) -> FloatArray:
        """Return a function that is positive where the stiffness falls along the branch."""
        state = law.state(phi)
        return state.sigma * state.sigma - state.tau * state.zeta

    phi = DEFLECTIONS * (end if np.isfinite(end) else np.copysign(LARGEST_DEFLECTION, end))
    with np.errstate(all="ignore"):  # overflow of laws that grow fast
        falling_indices = np.flatnonzero(stiffness_fall(phi) < 0)
    if not falling_indices.size:
        with np.errstate(all="ignore"):
            stiffness = 0.0 if isinstance(law, Sine) else float(law.state(np.array([end])).sigma[0])
        return _DeflectionLimit(end, torque, critical=False, stiffness=stiffness)
    first = max(int(falling_indices[0]), 1)
    extremum = bracketed_root(stiffness_fall, phi[first - 1 : first], phi[first : first + 1])
    state = law.state(extremum)
    return _DeflectionLimit(
        float(extremum[0]), float(state.tau[0]), critical=True, stiffness=float(state.sigma[0])
    )
