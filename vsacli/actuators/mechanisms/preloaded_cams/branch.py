"""The branch of a preloaded cam: the monotone piece of the stiffness that reaches the largest pretension.

At a given torque the deflection grows while the pretension falls, as long as the stiffness is positive. The
branch begins at the largest pretension and ends at the first of four: a fold, where the stiffness turns
around; the peak of the torque, where it is zero; the smallest pretension; the end of the profile. Each of
them is a fixed curve over deflection and torque, so that which one it is, and where, depends on the torque
alone: `branch_map` finds it out once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.control_flow import look_up

PRETENSION, FOLD, PEAK, DOMAIN = range(4)
"""What the branch ends at."""


class Cells(NamedTuple):
    """Both ends of the branch over the cube root of the torque, by cubics; arrays (cells,).

    What is kept is the deflection from rest over that root: it is smooth, also where a cam without pretension
    has the third power of the deflection as its torque.

    Attributes:
        root: cube root of the torque at which a cell begins.
        outer: at the largest pretension: coefficients over the distance from there, (4, cells).
        inner: the same at the other end of the branch.
        end: what that is.
        sign: 1 where the stiffness falls with the pretension along the branch, -1 where it rises.
    """

    root: FloatArray
    outer: FloatArray
    inner: FloatArray
    end: FloatArray
    sign: FloatArray


class Ends(NamedTuple):
    """Deflections from rest between which the branch lies, see `Cells`; arrays (samples,)."""

    outer: FloatArray
    inner: FloatArray
    end: FloatArray
    sign: FloatArray


class Branch(NamedTuple):
    """The branch at every torque.

    Attributes:
        cells: of the torque.
        torque_range: the torques that can be carried.
    """

    cells: Cells
    torque_range: tuple[float, float]

    def ends(self, tau_e: FloatArray) -> Ends:
        """Both ends but for a relative error of some 1e-5."""
        root = np.cbrt(tau_e)
        cell = np.searchsorted(self.cells.root[1:], root, side="right")
        start, end, sign, *cubics = look_up(
            (self.cells.root, self.cells.end, self.cells.sign, *self.cells.outer, *self.cells.inner), cell
        )
        x = root - start
        outer, inner = (a + x * (b + x * (c + x * d)) for a, b, c, d in (cubics[:4], cubics[4:]))
        return Ends(root * outer, root * inner, end, sign)
