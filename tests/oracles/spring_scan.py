"""Two springs on a joint by brute force: the reachable stiffness from dense scans along the torque balance.

A spring is its torque as a formula; the stiffness is a complex step, the inverse a table lookup with Newton
steps. The scan knows nothing of hardening or of where critical points may lie: it walks in from the largest
preload until the joint stiffness turns around.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray

STEP = 1e-200
LARGEST_TORQUE = 1e5
"""N m; what springs without an end are scanned up to."""

ROUNDING = 1e-12
"""Relative changes of the stiffness that are none."""
CLOSE = np.concatenate(([0.0], np.geomspace(1e-6, 0.1, 200)))
"""Shares of the torque at an end that are scanned there; closer, the stiffness of a four-bar is rounding."""


@dataclass(frozen=True)
class Curve:
    """Torque over deflection of one side, by a formula that complex numbers pass through.

    Attributes:
        torque: the formula.
        ends: smallest and largest deflection; infinite if the spring has none.
    """

    torque: Callable[[Any], Any]
    ends: tuple[float, float] = (-math.inf, math.inf)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Derivative of the torque by a complex step, exact to rounding."""
        derivative: FloatArray = self.torque(phi + 1j * STEP).imag / STEP
        return derivative

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Inverse of the torque; its ends beyond them."""
        phis, torques = self._table
        phi = np.interp(torque, torques, phis)
        for _ in range(2):  # each squares the relative error of the lookup, 1e-5
            stiffness = self.stiffness(phi)
            step = np.divide(
                self.torque(phi) - torque, stiffness, out=np.zeros_like(phi), where=stiffness > 0
            )
            phi = np.clip(phi - step, phis[0], phis[-1])
        return phi

    @cached_property
    def torque_ends(self) -> tuple[float, float]:
        """Torques at the ends."""
        low, high = self.ends
        return (
            float(self.torque(low)) if math.isfinite(low) else -math.inf,
            float(self.torque(high)) if math.isfinite(high) else math.inf,
        )

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        up, down = self._reach(self.ends[1], 1), self._reach(self.ends[0], -1)
        small = np.geomspace(1e-18, 0.1, 3000)
        shares = np.concatenate((small, np.linspace(0.1, 0.9, 3000)[1:-1], 1 - small[:1000:-1], [1.0]))
        phi = (
            np.concatenate((-down * shares[::-1], [0.0], up * shares))
            if down
            else np.append(0.0, up * shares)
        )
        return phi, np.asarray(self.torque(phi), dtype=float)

    def _reach(self, end: float, sign: int) -> float:
        if math.isfinite(end):
            return abs(end)
        reach = 1e-3
        while abs(self.torque(sign * reach)) < LARGEST_TORQUE:
            reach *= 1.1
        return reach


def polynomial(*coefficients: float) -> Curve:
    """Odd, from the linear coefficient on."""
    return Curve(lambda phi: sum(c * phi ** (2 * n + 1) for n, c in enumerate(coefficients)))


def sinh(k: float, a: float) -> Curve:
    return Curve(lambda phi: k * np.sinh(a * phi))


def exponential(c: float, a: float) -> Curve:
    return Curve(lambda phi: c * np.expm1(a * phi), (0.0, math.inf))


def quadratic(k: float) -> Curve:
    return Curve(lambda phi: k * phi**2, (0.0, math.inf))


def four_bar(k: float, ratio: float) -> Curve:
    def torque(phi: Any) -> Any:
        sin_psi = ratio * np.sin(phi / 2)
        beta = np.arcsin(sin_psi) - phi / 2
        return k * beta * (ratio * np.cos(phi / 2) / (2 * np.sqrt(1 - sin_psi**2)) - 0.5)

    end = 2 * math.asin((1 - 1e-6) / ratio)
    return Curve(torque, (-end, end))


def turned(curve: Curve) -> Curve:
    """The spring pulling the other way."""
    low, high = curve.ends
    return Curve(lambda phi: -curve.torque(-phi), (-high, -low))


class Corridor(NamedTuple):
    """Reachable stiffness; NaN if the torque cannot be carried."""

    lower: float
    upper: float


@dataclass(frozen=True)
class Springs:
    """The two sides of a joint, side 1 preloaded upward."""

    first: Curve
    second: Curve

    def stiffness(self, tau_1: FloatArray, tau_e: float | FloatArray) -> FloatArray:
        """Joint stiffness where side 1 has a torque and side 2 the rest."""
        phi_1, phi_2 = self.first.deflection(tau_1), self.second.deflection(tau_e - tau_1)
        return self.first.stiffness(phi_1) + self.second.stiffness(phi_2)

    def preload_range(self, tau_e: float) -> tuple[float, float]:
        """Smallest and largest torque of side 1."""
        (low_1, high_1), (low_2, high_2) = self.first.torque_ends, self.second.torque_ends
        return max(low_1, tau_e - high_2), min(high_1, tau_e - low_2)

    def corridor(self, tau_e: float) -> Corridor:
        """Stiffness at the two ends of the piece that reaches the largest preload."""
        least, largest = self.preload_range(tau_e)
        if least > largest:
            return Corridor(math.nan, math.nan)
        nodes = _nodes(tau_e, least, largest)
        outer, inner = self._monotone_piece(nodes, tau_e)
        if math.isinf(largest):
            return Corridor(inner, math.inf)
        return Corridor(min(outer, inner), max(outer, inner))

    def _monotone_piece(self, nodes: FloatArray, tau_e: float) -> tuple[float, float]:
        """Stiffness at the outer and the inner end, scanned ever finer where it turns around."""
        values = self.stiffness(nodes, tau_e)
        outer, sign = values[0], 0.0
        for _ in range(5):
            change = np.diff(values)
            noticed = np.abs(change) > ROUNDING * values[1:]
            if not sign:
                sign = float(np.sign(change[noticed.argmax()])) if noticed.any() else -1.0
            turning = np.flatnonzero(noticed & (sign * change < 0))
            if not turning.size:
                break
            cell = slice(max(turning[0] - 1, 0), turning[0] + 3)
            nodes = np.linspace(nodes[cell][0], nodes[cell][-1], 41)
            values = self.stiffness(nodes, tau_e)
        return float(outer), float(values.min() if sign < 0 else values.max())

    def on_branch(self, tau_1: FloatArray, tau_e: FloatArray, nodes: int) -> BoolArray:
        """Whether the stiffness is monotone from a torque of side 1 to the largest preload; (samples,)."""
        shares = np.unique(np.concatenate((np.geomspace(1e-6, 1, nodes), np.linspace(0, 1, nodes))))[:, None]
        (_, high_1), (low_2, _) = self.first.torque_ends, self.second.torque_ends
        largest = np.minimum(np.minimum(high_1, tau_e - low_2), 2 * np.maximum(np.abs(tau_1), np.abs(tau_e)))
        values = self.stiffness(tau_1 + shares * (largest - tau_1), tau_e)
        change = np.diff(values, axis=0)
        rounding = ROUNDING * values[1:]
        monotone: BoolArray = np.all(change >= -rounding, axis=0) | np.all(change <= rounding, axis=0)
        return monotone


def _nodes(tau_e: float, least: float, largest: float) -> FloatArray:
    """Torques of side 1 from the largest to the least, dense where a side is relaxed."""
    size = max(abs(tau_e), 1.0)
    near = size * np.geomspace(1e-13, 4, 700)
    nodes = np.concatenate([center + sign * near for center in (0.0, tau_e) for sign in (-1, 1)])
    inwards = [(least, 1), (largest, -1)]
    ends = [end + sign * abs(end) * CLOSE for end, sign in inwards if math.isfinite(end)]
    nodes = np.concatenate((nodes, np.linspace(-abs(tau_e), 2 * abs(tau_e), 1500), [0.0, tau_e], *ends))
    return np.unique(nodes[(nodes >= least) & (nodes <= largest)])[::-1]
