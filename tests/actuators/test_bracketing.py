"""Bracketed roots: to rounding, at an end, and where there is none."""

from __future__ import annotations

import numpy as np

from vsacli.actuators.pairs.bracketing import bracketed_root

EPS = float(np.finfo(float).eps)


def test_bracketed_root_is_found_to_rounding():
    shift = np.geomspace(1e-12, 1e12, 49)
    low, high = np.zeros_like(shift), np.full_like(shift, 1e5)
    found = bracketed_root(lambda x, shift: x**3 - shift, low, high, (shift,))
    # A third of the rounding of x^3, and the resolution of the method.
    np.testing.assert_allclose(found, np.cbrt(shift), rtol=4 * EPS)


def test_roots_at_an_end_and_outside():
    low, high = np.array([1.0, -5.0, 2.0, -9.0]), np.array([5.0, 1.0, 5.0, -2.0])
    found = bracketed_root(lambda x: x - 1, low, high)
    np.testing.assert_array_equal(found, [1, 1, 2, -2])
