"""Collocation at Radau's points: polynomials that solve an implicit differential equation in cells of time.

Radau IIA methods are L-stable and stiffly accurate (Hairer & Wanner, Solving Ordinary Differential Equations
II, IV.5), so that a fast motion that has died away does not shorten the cells. Their polynomial is the dense
output.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray

STAGES = 12
"""With so many, a motion of half a second from rest to rest is exact to rounding in some forty cells."""


class _Rule(NamedTuple):
    """Collocation in the cell [-1, 1].

    Attributes:
        nodes: (stages,), the last at 1.
        to_coefficients: of Chebyshev's polynomials, from values at -1 and at the nodes.
        through_nodes: the same from values at the nodes alone.
        slopes: derivatives at the nodes from values at -1 and at the nodes.
    """

    nodes: FloatArray
    to_coefficients: FloatArray
    through_nodes: FloatArray
    slopes: FloatArray


def _rule(stages: int) -> _Rule:
    from numpy.polynomial import chebyshev
    from scipy.special import roots_jacobi

    nodes = np.append(roots_jacobi(stages - 1, 1, 0)[0], 1.0)
    to_coefficients = np.linalg.inv(chebyshev.chebvander(np.append(-1.0, nodes), stages))
    slopes: FloatArray = chebyshev.chebvander(nodes, stages - 1) @ chebyshev.chebder(to_coefficients)
    through_nodes = np.linalg.inv(chebyshev.chebvander(nodes, stages - 1))
    return _Rule(nodes, to_coefficients, through_nodes, slopes)


class Collocation:
    """The rule, ready for use."""

    def __init__(self, stages: int = STAGES) -> None:
        self._rule = _rule(stages)

    def times(self, start: float, end: float) -> FloatArray:
        """The nodes of a cell, (stages,), s."""
        return start + (end - start) / 2 * (1 + self._rule.nodes)

    def slopes(self, start: float, end: float) -> FloatArray:
        """Rates at the nodes from values at the start and at the nodes, (stages, stages + 1), 1/s."""
        return self._rule.slopes * (2 / (end - start))

    def coefficients(self, values: FloatArray) -> FloatArray:
        """Of the polynomial with these values at the start and at the nodes, (..., stages + 1)."""
        return values @ self._rule.to_coefficients.T

    def coefficients_of_rates(self, values: FloatArray) -> FloatArray:
        """Of the polynomial with these values at the nodes, (..., stages)."""
        return values @ self._rule.through_nodes.T


class Piecewise:
    """A function in cells, each with the coefficients of Chebyshev's polynomials.

    Args:
        ends: of the cells, ascending, (cells + 1,), s.
        coefficients: (cells, rows, degree + 1).
    """

    def __init__(self, ends: FloatArray, coefficients: FloatArray) -> None:
        self.ends, self._coefficients = ends, coefficients

    def at(self, time: FloatArray) -> FloatArray:
        """Its values, (rows, samples); beyond the ends those of the nearest cell."""
        from numpy.polynomial import chebyshev

        cell = np.clip(np.searchsorted(self.ends, time, side="right") - 1, 0, len(self.ends) - 2)
        left, right = self.ends[cell], self.ends[cell + 1]
        place = np.clip(2 * (time - left) / (right - left) - 1, -1.0, 1.0)
        basis = chebyshev.chebvander(place, self._coefficients.shape[2] - 1)
        return np.asarray(np.einsum("srd,sd->rs", self._coefficients[cell], basis), dtype=np.float64)
