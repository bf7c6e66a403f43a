"""Closed-form profiles against their definition, in exact arithmetic."""

import functools
import math
import re
from fractions import Fraction

import numpy as np
import pytest
import sympy

from vsacli import InputError
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.trajectory.curves import DEGREES, ConstantProfile, RestToRest

EPS = np.finfo(float).eps
SPAN = (0.1, 0.8)  # neither these nor their difference are binary fractions


def rest_to_rest(degree, span=SPAN, signal=POSITION, start=(0.1, -2.0, 1 / 3), end=(0.7, 1.0, 1 / 3)):
    return RestToRest(signal=signal, span=span, degree=degree, start=start, end=end)


@functools.cache
def defining_coefficients(degree):
    """Value 0 at 0 and 1 at 1, (degree-1)/2 vanishing derivatives at both: a linear system, exactly."""
    m = (degree - 1) // 2
    powers = range(m + 1, degree + 1)
    at_one = sympy.Matrix(m + 1, m + 1, lambda order, column: sympy.ff(powers[column], order))
    solution = at_one.LUsolve(sympy.Matrix([1] + [0] * m))
    return [Fraction(0)] * (m + 1) + [Fraction(int(c.p), int(c.q)) for c in solution]


def exact_rise(degree, order, s):
    coefficients = defining_coefficients(degree)
    return sum(
        math.perm(power, order) * c * s ** (power - order)
        for power, c in enumerate(coefficients)
        if power >= order
    )


def exact(profile, order, joint, t):
    first, last = (Fraction(end) for end in profile.span)
    start, end = Fraction(profile.start[joint]), Fraction(profile.end[joint])
    rise = exact_rise(profile.degree, order, (Fraction(t) - first) / (last - first))
    return (start if order == 0 else 0) + (end - start) * rise / (last - first) ** order


@pytest.mark.parametrize("degree", DEGREES)
def test_rest_to_rest_is_the_polynomial_of_its_end_conditions(degree):
    profile = rest_to_rest(degree)
    time = np.linspace(*SPAN, 41)
    rows = profile.at(time)
    for order, joint in np.ndindex(5, 3):
        expected = np.array([float(exact(profile, order, joint, t)) for t in time])
        # about 10 roundings, the most of them in the 7th power, in terms that hardly exceed the peak
        atol = 30 * EPS * np.abs(expected).max()
        np.testing.assert_allclose(rows[order, joint], expected, rtol=0, atol=atol)


@pytest.mark.parametrize("degree", DEGREES)
def test_rise_keeps_its_digits_near_the_ends(degree):
    near = 1e-5 * np.arange(1, 6)
    first = rest_to_rest(degree, (0.0, 1.0), start=(0.0,), end=(1.0,))
    last = rest_to_rest(degree, (-1.0, 0.0), start=(1.0,), end=(0.0,))
    for order in range(min(5, (degree + 1) // 2)):  # of these the leading term dominates
        expected = [float(exact_rise(degree, order, Fraction(u))) for u in near]
        # relative to the value itself, down to 1e-40: a power basis around one end keeps none at the other
        np.testing.assert_allclose(first.at(near)[order, 0], expected, rtol=100 * EPS)
        mirrored = (-1) ** order * last.at(-near)[order, 0]
        np.testing.assert_allclose(mirrored, expected, rtol=100 * EPS)


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("span", [(0.0, 4.0), SPAN, (1e6 + 0.1, 1e6 + 0.3)])
def test_rest_to_rest_ends_exactly(degree, span):
    profile = rest_to_rest(degree, span)
    rows = profile.at(np.array(span))
    np.testing.assert_array_equal(rows[0], np.transpose([profile.start, profile.end]))
    vanishing = min((degree - 1) // 2, 4)
    np.testing.assert_array_equal(rows[1 : 1 + vanishing], 0.0)


def test_degree_seven_starts_and_ends_with_840_in_the_fourth_derivative():
    rows = rest_to_rest(7, (0.0, 2.0), start=(1.0,), end=(4.0,)).at(np.array([0.0, 2.0]))
    np.testing.assert_allclose(rows[4, 0], [840 * 3 / 16, -840 * 3 / 16], rtol=4 * EPS)


def test_rest_to_rest_does_not_overshoot():
    q = rest_to_rest(15, start=(0.0,), end=(1.0,)).at(np.linspace(*SPAN, 1001))[0, 0]
    assert np.all(np.diff(q) >= -2 * EPS)  # rounding where it is flat
    assert q.min() == 0
    assert q.max() == 1


@pytest.mark.parametrize(("signal", "orders"), [(POSITION, 5), (STIFFNESS, 3)])
def test_shape_is_orders_joints_samples_with_contiguous_samples(signal, orders):
    time = np.linspace(*SPAN, 4)
    moving = rest_to_rest(7, signal=signal)
    still = ConstantProfile(signal=signal, span=SPAN, value=(1.0, 2.0, 3.0))
    for profile in (moving, still):
        rows = profile.at(time)
        assert rows.shape == (orders, 3, 4)
        assert rows.flags.c_contiguous
        assert profile.components == 3
        assert (profile.warnings, profile.notes) == ((), ())
        np.testing.assert_array_equal(profile.breakpoints, SPAN)
        np.testing.assert_array_equal(profile.samples(1, 3, time[1:3]), rows[:, :, 1:3])


@pytest.mark.parametrize("degree", DEGREES)
def test_a_single_time_has_the_values_of_one_of_many(degree):
    profile, times = rest_to_rest(degree), np.linspace(*SPAN, 23)
    one_by_one = [profile.at(times[[index]]) for index in range(len(times))]
    np.testing.assert_array_equal(np.concatenate(one_by_one, axis=2), profile.at(times))
    assert profile.at(times[:0]).shape == (5, 3, 0)


def test_constant_has_no_derivatives():
    rows = ConstantProfile(signal=STIFFNESS, span=SPAN, value=(850.0, 900.0)).at(np.linspace(*SPAN, 3))
    np.testing.assert_array_equal(rows[0], [[850.0] * 3, [900.0] * 3])
    np.testing.assert_array_equal(rows[1:], 0.0)


@pytest.mark.parametrize("degree", [1, 4, 17, 7.5])
def test_degree_is_odd_and_between_three_and_fifteen(degree):
    with pytest.raises(InputError, match=rf"must be odd, 3 to 15, not {degree}"):
        rest_to_rest(degree)


@pytest.mark.parametrize("span", [(1.0, 1.0), (2.0, 1.0), (0.0, math.inf), (math.nan, 1.0)])
def test_span_must_be_a_time_that_passes(span):
    with pytest.raises(InputError, match=re.escape(f"not from {span[0]:g} to {span[1]:g} s")):
        rest_to_rest(7, span)


def test_start_and_end_have_the_same_joints():
    with pytest.raises(InputError, match="start has 1 values, end has 2"):
        rest_to_rest(7, start=(0.0,), end=(1.0, 2.0))
