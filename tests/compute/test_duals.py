"""Dual numbers: every function's derivative against the complex step or a central difference."""

from __future__ import annotations

import numpy as np
import pytest

from vsacli.compute.control_flow import cell_of
from vsacli.compute.duals import (
    ARITHMETIC_OPERATORS,
    PARTIAL_DERIVATIVES,
    PIECEWISE_CONSTANT,
    Dual,
    seeds,
    tangent_of,
    tangents_of,
)
from vsacli.compute.vector import exact, trigonometric

POINTS = np.array([0.21, 0.47, 0.83])
OTHERS = np.array([0.62, 0.35, 0.9])
REAL_ONLY = {np.absolute, np.arctan2, np.hypot, np.maximum, np.minimum, np.copysign}
"""Functions that NumPy has for real numbers alone, or that are not analytic."""


def differences(function, points, step=1e-6):
    """Of second order: of the size of the cube of the step, over the step, beside rounding."""
    return (function(points + step) - function(points - step)) / (2 * step)


@pytest.mark.parametrize(
    "ufunc", sorted({*PARTIAL_DERIVATIVES, *ARITHMETIC_OPERATORS}, key=lambda each: each.__name__)
)
def test_slopes_of_functions(ufunc):
    arguments = [POINTS, OTHERS][: ufunc.nin]
    for place in range(ufunc.nin):
        given = list(arguments)
        (given[place],) = seeds([arguments[place]], first=1)
        found = ufunc(*given)

        def varied(values, place=place):
            return ufunc(*[*arguments[:place], values, *arguments[place + 1 :]])

        np.testing.assert_array_equal(found.value, ufunc(*arguments))
        assert list(found.tangents) == [1]
        if ufunc in REAL_ONLY:
            np.testing.assert_allclose(found.tangents[1], differences(varied, arguments[place]), atol=1e-9)
        else:
            exact = varied(arguments[place] + 1e-30j).imag / 1e-30
            np.testing.assert_allclose(found.tangents[1], exact, rtol=4e-16 * 10)  # some ten roundings


@pytest.mark.parametrize("ufunc", sorted(PIECEWISE_CONSTANT, key=lambda each: each.__name__))
def test_functions_that_only_jump_have_no_slope(ufunc):
    found = ufunc(*seeds([POINTS, OTHERS][: ufunc.nin]))
    assert not isinstance(found, Dual)
    np.testing.assert_array_equal(found, ufunc(*[POINTS, OTHERS][: ufunc.nin]))


def test_a_parameter_meets_rows_of_samples():
    k, x = seeds([3.0, POINTS])
    found = k * x * x - POINTS / k
    np.testing.assert_allclose(found.tangents[0], POINTS**2 + POINTS / 9, rtol=1e-15)
    np.testing.assert_allclose(found.tangents[1], 6 * POINTS, rtol=1e-15)


def test_choices_are_made_by_the_values():
    (x,) = seeds([POINTS])
    found = np.where(x > 0.4, x * x, 2.0)
    np.testing.assert_allclose(found.tangents[0], [0, 2 * POINTS[1], 2 * POINTS[2]], rtol=1e-15)
    np.testing.assert_array_equal(np.clip(x, 0.3, 0.6).tangents[0], [0, 1, 0])
    assert cell_of(10 * x, 5).tolist() == [2, 4, 4]


def test_arranging_keeps_tangents_with_their_values():
    x, y = seeds([POINTS, OTHERS])
    stacked = np.stack((x, y, POINTS))
    np.testing.assert_array_equal(stacked.value, [POINTS, OTHERS, POINTS])
    np.testing.assert_array_equal(stacked.tangents[0], [np.ones(3), np.zeros(3), np.zeros(3)])
    np.testing.assert_array_equal(np.stack((x, y), axis=-1).T.tangents[1], stacked.tangents[1][:2])
    np.testing.assert_array_equal(tangent_of(stacked.sum(axis=0), 2, (3,)), np.ones((2, 3)))
    np.testing.assert_array_equal(np.concatenate((x, POINTS)).tangents[0], [1, 1, 1, 0, 0, 0])
    np.testing.assert_array_equal(np.full_like(POINTS[:, None], 7).shape, (3, 1))
    np.testing.assert_array_equal(tangent_of(np.full_like(x, y[0]), 2, (3,)), [np.zeros(3), np.ones(3)])
    np.testing.assert_array_equal(tangent_of(POINTS, 2, (3,)), np.zeros((2, 3)))
    np.testing.assert_array_equal(tangent_of(x[1:], 1, (2,)), np.ones((1, 2)))


def test_a_number_carries_what_it_depends_on():
    x, y, k = seeds([POINTS, OTHERS, 2.0])
    assert list(tangents_of(x * k)) == [0, 2]
    assert list(tangents_of(Dual.of(POINTS, np.stack((0 * POINTS, POINTS))) + y)) == [1]
    assert not tangents_of(POINTS)


@pytest.mark.parametrize("angle", [0.0, np.pi / 2, -np.pi, 0.3])
def test_constants_that_are_exact_fold_and_keep_their_derivatives(angle):
    (alpha,) = seeds([angle])
    cos, sin = trigonometric("cos", alpha), trigonometric("sin", alpha)
    assert (cos.value, sin.value) == (trigonometric("cos", angle), trigonometric("sin", angle))
    np.testing.assert_allclose(tangent_of(cos, 1, ()), [-np.sin(angle)], atol=1e-15)
    np.testing.assert_allclose(tangent_of(sin, 1, ()), [np.cos(angle)], atol=1e-15)
    one = exact(seeds([1.0])[0])
    assert type(one.value) is int
    assert (one * POINTS).value is POINTS


def test_a_zero_that_may_change_is_not_left_out():
    zero, nothing = seeds([0.0])[0], Dual(0.0, {0: np.zeros(1)})
    assert zero
    assert not nothing


@pytest.mark.parametrize("function", [np.add.reduce, np.linalg.inv, np.floor_divide, np.sort])
def test_what_carries_no_derivative_is_refused(function):
    (x,) = seeds([POINTS])
    with pytest.raises(NotImplementedError, match="carries no derivatives along"):
        function(x) if function is not np.floor_divide else function(x, 2)
