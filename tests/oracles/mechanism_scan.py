"""The corridor of a mechanism, and what its springs do along a motion, from the potential alone.

At a given torque the level curve of T is followed over the setting; the stiffness along it is the corridor.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import sympy
from scipy.optimize import minimize_scalar

Array = npt.NDArray[np.float64]
Range = tuple[float, float]

SETTINGS, DEFLECTIONS = 151, 401
"""Points of the scan; features of a device are some tenths of its ranges."""

NEWTON_STEPS = 8
"""From a cell of the scan four are enough."""


RESOLUTION = 1e-9
"""Relative difference of stiffness that a minimum found between the last two settings cannot be rounding."""

NO_STIFFNESS = 1e-7
"""Share of the other end below which a stiffness is the root of rounding, where no pretension is left."""


class Corridor(NamedTuple):
    """Reachable stiffness, NaN if the torque cannot be carried, and which ends are turning points."""

    lower: float
    upper: float
    lower_turns: bool
    upper_turns: bool


class Level:
    """The level curve of a torque: deflection and stiffness over the setting, nearest to rest.

    Args:
        springs: at q, theta_1, theta_2, what `samples.full_model.springs_of` returns.
        tau_e: the torque.
        deflections: where to look for phi.
        settings: range of theta_2.
        q: of the joint.
    """

    def __init__(
        self, springs: Callable[..., Any], tau_e: float, deflections: Range, settings: Range, q: float
    ) -> None:
        self._springs, self._tau_e, self._q, self._deflections = springs, tau_e, q, deflections
        self.settings = np.linspace(*settings, SETTINGS)
        self.stiffness = self.at(self.settings)

    def at(self, settings: Array) -> Array:
        """The stiffness at settings; NaN where the torque is beyond what they carry."""
        phi, s = np.meshgrid(np.linspace(*self._deflections, DEFLECTIONS), settings)
        missing = self._missing(phi, s)
        rises = (missing[:, :-1] <= 0) & (missing[:, 1:] > 0)
        distance = np.where(rises, np.abs(phi[:, :-1] + phi[:, 1:]), np.inf)
        cell = distance.argmin(axis=1)[:, None]
        left, right = (np.take_along_axis(phi, at, axis=1)[:, 0] for at in (cell, cell + 1))
        found = (left + right) / 2
        for _ in range(NEWTON_STEPS):
            found = found - self._missing(found, settings) / self._at(found, settings).stiffness
        converged = rises.any(axis=1) & (left <= found + 1e-12) & (found <= right + 1e-12)
        return np.where(converged, self._at(found, settings).stiffness, np.nan)

    def _at(self, phi: Array, s: Array) -> Any:
        return self._springs(np.full_like(phi, self._q), self._q + phi, s)

    def _missing(self, phi: Array, s: Array) -> Array:
        return np.broadcast_to(-self._at(phi, s).link, phi.shape) - self._tau_e


def scanned_corridor(level: Level, anchor: int, *, falls: bool) -> Corridor:
    """The monotone piece of the stiffness from one end of the settings on: the first if 0, the last if -1.

    If it must fall and does not, or the torque cannot be carried there, it is not the branch.
    """
    order = slice(None, None, 1 if anchor == 0 else -1)
    settings, stiffness = level.settings[order], level.stiffness[order]
    there = np.flatnonzero(stiffness > 0)
    if not there.size:
        return Corridor(np.nan, np.nan, lower_turns=False, upper_turns=False)
    first = int(there[0])
    slopes = np.sign(np.diff(stiffness[first:]))
    if falls and (first > 0 or slopes[0] > 0):
        return Corridor(np.nan, np.nan, lower_turns=False, upper_turns=False)
    broken = np.flatnonzero(~(slopes == slopes[0]) | ~(stiffness[first + 1 :] > 0))
    last = first + int(broken[0]) if broken.size else SETTINGS - 1
    # elsewhere than at an end of the settings the torque has its maximum, and there is no stiffness
    near, far = stiffness[first] * (first == 0), stiffness[last] * (last == SETTINGS - 1)
    turns = False
    if last == SETTINGS - 1 or stiffness[last + 1] > 0:
        around = settings[last - 1], settings[min(last + 1, SETTINGS - 1)]
        turning_point = _turning_point(level, *sorted(around), slopes[0])
        turns = last < SETTINGS - 1 or bool(slopes[0] * (turning_point - far) > RESOLUTION * abs(far))
        far = turning_point if turns else far
    if far < NO_STIFFNESS * near:
        far, turns = 0.0, False
    lower, upper = sorted((near, far))
    return Corridor(lower, upper, lower_turns=turns and far == lower, upper_turns=turns and far == upper)


def _turning_point(level: Level, low: float, high: float, slope: float) -> float:
    """The largest stiffness between two settings, or the smallest if the slope is negative."""
    found = minimize_scalar(
        lambda s: float(-slope * level.at(np.array([s]))[0]),
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-10},
    )
    return float(-slope * found.fun)


def along(potential: Callable[..., Any], motion: Array) -> Array:
    """tau_e, sigma and the torques against both motors, with two derivatives over time, (4, 3, samples).

    Args:
        potential: U(q, theta_1, theta_2) in sympy's functions.
        motion: of q, theta_1 and theta_2, with two derivatives, (3, 3, samples).
    """
    variables = sympy.symbols("q theta_1 theta_2", real=True)
    energy = potential(*variables)
    q, *theta = variables
    wanted = [-energy.diff(q), energy.diff(q, 2), *(energy.diff(each) for each in theta)]
    flat = [
        each
        for value in wanted
        for each in (value, *(value.diff(x) for x in variables), *sympy.hessian(value, variables))
    ]
    at, rate, acceleration = np.moveaxis(motion, 1, 0)
    computed = sympy.lambdify(variables, flat, "numpy", cse=True)(*at)
    parts = np.array([np.broadcast_to(each, at.shape[1:]) for each in computed]).reshape(4, 13, -1)
    values, gradients, hessians = parts[:, 0], parts[:, 1:4], parts[:, 4:].reshape(4, 3, 3, -1)
    rates = np.einsum("fin,in->fn", gradients, rate)
    bent = np.einsum("fijn,in,jn->fn", hessians, rate, rate)
    return np.stack((values, rates, np.einsum("fin,in->fn", gradients, acceleration) + bent), axis=1)
