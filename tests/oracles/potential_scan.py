"""The reachable stiffness of a potential by a dense scan: no steps along a curve, derivatives by sympy.

On a fine grid of phi and theta_2, cells are told apart by the signs of the stiffness and of det A; those that
are connected with the start are the branch. Where grid lines between two of its nodes cross a torque, the
stiffness is one that can be reached.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import sympy
from scipy import ndimage

Array = npt.NDArray[np.float64]
Range = tuple[float, float]

Q, THETA_1, THETA_2 = sympy.symbols("q theta_1 theta_2", real=True)


class Point(NamedTuple):
    """What a potential says at states of joint and motors."""

    tau_e: Array
    stiffness: Array
    det_a: Array


class Crossings(NamedTuple):
    """The stiffness where a level curve crosses grid lines, and by how much it changes within a cell."""

    stiffness: Array
    resolution: Array


class Potential:
    """A potential U(q, theta_1, theta_2), as an expression of sympy."""

    def __init__(self, energy: str, constants: dict[str, float]) -> None:
        q, one, two = Q, THETA_1, THETA_2
        names = {"q": q, "theta_1": one, "theta_2": two, "phi": one - q, **constants}
        self.energy = sympy.sympify(energy.replace("^", "**"), locals=names)
        tau_e, stiffness = -sympy.diff(self.energy, q), sympy.diff(self.energy, q, 2)
        matrix = sympy.Matrix([tau_e, stiffness]).jacobian([one, two])
        self._point = sympy.lambdify((q, one, two), [tau_e, stiffness, matrix.det()], "numpy", cse=True)

    def at(self, q: Array | float, phi: Array, theta_2: Array) -> Point:
        """The point at a deflection and a position of motor 2."""
        with np.errstate(all="ignore"):
            return Point(*(np.broadcast_to(each, phi.shape) for each in self._point(q, phi + q, theta_2)))


class Scan:
    """All nodes of a grid at one position of the joint, and which of them belong to a branch."""

    def __init__(self, potential: Potential, q: float, phi: Range, theta_2: Range, nodes: int = 600) -> None:
        self.phi, self.theta_2 = np.meshgrid(
            np.linspace(*phi, nodes), np.linspace(*theta_2, nodes), indexing="ij"
        )
        self.point = potential.at(q, self.phi, self.theta_2)

    def branch(self, phi: float, theta_2: float) -> npt.NDArray[np.bool_]:
        """The nodes that are connected with the one next to a point."""
        near = np.unravel_index(
            np.argmin(np.abs(self.phi - phi) + np.abs(self.theta_2 - theta_2)), self.phi.shape
        )
        sign = np.sign(self.point.det_a[near])
        regular = (self.point.stiffness > 0) & (self.point.det_a * sign > 0)
        labels, _ = ndimage.label(regular)
        assert labels[near], "the point is not regular"
        connected: npt.NDArray[np.bool_] = labels == labels[near]
        return connected

    def reached(self, tau_e: float, branch: npt.NDArray[np.bool_]) -> Crossings:
        """All crossings of grid lines with the level curve of a torque on a branch."""
        sigma = self.point.stiffness
        cell = sum(np.abs(change) for change in np.gradient(sigma))
        stiffness, resolution = [], []
        for axis in (0, 1):
            tau, here, size, there = (
                np.moveaxis(grid, axis, 0) for grid in (self.point.tau_e, sigma, cell, branch)
            )
            crossed = ((tau[:-1] - tau_e) * (tau[1:] - tau_e) <= 0) & there[:-1] & there[1:]
            share = ((tau_e - tau[:-1]) / (tau[1:] - tau[:-1]))[crossed]
            stiffness.append(here[:-1][crossed] * (1 - share) + here[1:][crossed] * share)
            resolution.append(size[:-1][crossed])
        return Crossings(np.concatenate(stiffness), np.concatenate(resolution))
