"""Splines through points against the linear system of their conditions, in exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from oracles.via_spline import spline_pieces, spline_value
from scipy.integrate import trapezoid

from vsacli import InputError
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.curves.via_points import ViaPoints, passing_shares

EPS = np.finfo(float).eps
SPAN = (0.5, 2.5)
SHARES = (0.0, 0.25, 0.375, 0.75, 1.0)  # binary fractions, as the times that follow from them
POINTS = ((0.0, 1.0), (1.0, -0.5), (1.25, 2.0), (-0.75, 2.0), (0.5, 0.0))
DEGREES = (3, 5, 7, 9)


def via(degree=7, points=POINTS, shares=SHARES, span=SPAN, signal=POSITION):
    return ViaPoints(signal=signal, span=span, degree=degree, shares=tuple(shares), points=points)


@pytest.mark.parametrize("degree", DEGREES)
def test_it_is_the_spline_of_its_conditions(degree):
    profile = via(degree)
    times = [Fraction(time) for time in profile.breakpoints.tolist()]
    assert [float(time) for time in times] == [0.5, 1.0, 1.25, 2.0, 2.5]
    time = np.linspace(*SPAN, 33)
    rows = profile.at(time)
    for joint, values in enumerate(zip(*POINTS, strict=True)):
        pieces = spline_pieces(times, [Fraction(value) for value in values], degree)
        for order in range(min(5, degree + 1)):
            exact = [float(spline_value(times, pieces, Fraction(t), order)) for t in time.tolist()]
            # the banded system of degree 9 loses three digits
            atol = 2000 * EPS * np.abs(exact).max()
            where = time < SPAN[1] if order == degree else time > 0  # it jumps at the points
            np.testing.assert_allclose(rows[order, joint, where], np.array(exact)[where], rtol=0, atol=atol)


@pytest.mark.parametrize("degree", DEGREES)
def test_points_are_taken_exactly_and_the_ends_are_at_rest_exactly(degree):
    profile = via(degree)
    np.testing.assert_array_equal(profile.at(profile.breakpoints)[0].T, POINTS)
    ends = profile.at(np.array(SPAN))
    vanishing = (degree - 1) // 2
    assert not ends[1 : vanishing + 1].any()
    assert degree == 9 or ends[vanishing + 1].all()


@pytest.mark.parametrize("degree", DEGREES)
def test_two_points_give_the_rest_to_rest_polynomial(degree):
    start, end = (0.1, -2.0), (0.7, 1.0)
    polynomial = RestToRest(signal=POSITION, span=SPAN, degree=degree, start=start, end=end)
    time = np.linspace(*SPAN, 57)
    expected, found = polynomial.at(time), via(degree, (start, end), (0.0, 1.0)).at(time)
    for order in range(min(5, degree + 1)):
        # the spline's own system, of condition up to 1e4
        np.testing.assert_allclose(
            found[order], expected[order], rtol=0, atol=1e-11 * np.abs(expected[order]).max()
        )


@pytest.mark.parametrize("degree", DEGREES)
def test_evenly_spaced_points_on_a_line_give_the_rest_to_rest_polynomial(degree):
    points = tuple((0.5 * k, 1.0 - 0.25 * k) for k in range(6))
    shares = passing_shares(points, degree)
    polynomial = RestToRest(signal=POSITION, span=SPAN, degree=degree, start=points[0], end=points[-1])
    time = np.linspace(*SPAN, 57)
    expected, found = polynomial.at(time), via(degree, points, shares).at(time)
    for order in range(min(5, degree)):
        np.testing.assert_allclose(
            found[order], expected[order], rtol=0, atol=1e-10 * np.abs(expected[order]).max()
        )


def test_near_points_are_passed_soon_but_not_at_once():
    shares = passing_shares(((0.0,), (1.0,), (1.01,), (2.01,)), 7)
    assert shares[0] == 0
    assert shares[-1] == 1
    np.testing.assert_allclose(shares + shares[::-1], 1, atol=1e-14)  # the points are symmetric
    assert 0.01 < shares[2] - shares[1] < 0.1  # the square root of 0.01 of a way that counts 2.1


def test_joints_that_have_no_stiffness_do_not_count():
    points = ((900.0, np.nan), (1000.0, np.nan), (800.0, np.nan))
    shares = passing_shares(points, 5)
    np.testing.assert_array_equal(shares, passing_shares([point[:1] for point in points], 5))
    rows = via(5, points, shares, signal=STIFFNESS).at(np.linspace(*SPAN, 9))
    assert rows.shape == (3, 2, 9)
    assert np.isfinite(rows[:, 0]).all()
    assert np.isnan(rows[:, 1]).all()


def test_the_mean_square_of_the_snap_is_least():
    """Adding to the motion anything that vanishes at the points, smoothly at the ends, only enlarges it."""
    profile = via(7)
    times = profile.breakpoints
    time = np.linspace(*SPAN, 4001)
    bump = np.polynomial.Polynomial.fromroots([*times, *[SPAN[0], SPAN[1]] * 3])
    snap, change = profile.at(time)[4, 0], bump.deriv(4)(time)
    change *= np.abs(snap).max() / np.abs(change).max()
    product = trapezoid(snap * change, time) / np.sqrt(trapezoid(snap**2, time) * trapezoid(change**2, time))
    assert abs(product) < 1e-4  # but for the trapezoids: orthogonal, so any share of it adds to the integral


def test_samples_do_not_depend_on_the_block():
    profile = via(9)
    time = np.linspace(*SPAN, 1001)
    whole = profile.at(time)
    for size in (1, 7, 64):
        parts = [profile.at(time[start : start + size]) for start in range(0, 1001, size)]
        np.testing.assert_array_equal(np.concatenate(parts, axis=2), whole)


def test_a_slower_one_passes_the_same_points_later():
    slower = via(7).stretched(3.0)
    np.testing.assert_allclose(slower.breakpoints, [0.5, 2.0, 2.75, 5.0, 6.5], rtol=EPS)
    time = np.linspace(*SPAN, 33)
    before, after = via(7).at(time), slower.at(0.5 + 3.0 * (time - 0.5))
    for order in range(5):
        expected = before[order] / 3.0**order
        np.testing.assert_allclose(after[order], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("degree", DEGREES)
def test_extremes_are_those_of_many_samples(degree):
    profile = via(degree)
    lowest, lowest_at, highest, highest_at = profile.extremes()
    q = profile.at(np.linspace(*SPAN, 20001))[0]
    np.testing.assert_allclose(
        lowest, q.min(axis=1), atol=1e-6
    )  # samples miss a peak by its curvature 1e-4^2
    np.testing.assert_allclose(highest, q.max(axis=1), atol=1e-6)
    for joint in range(2):
        assert profile.at(lowest_at)[0, joint, joint] == lowest[joint]
        assert profile.at(highest_at)[0, joint, joint] == highest[joint]


def test_the_extremes_of_what_does_not_move_are_its_value():
    assert via(7, ((2.0,),) * 3, (0.0, 0.5, 1.0)).extremes() == (2.0, 0.5, 2.0, 0.5)


@pytest.mark.parametrize("shares", [(0, 1e-7, 0.5, 0.8, 1), (0, 0.5, 0.5 + 1e-13, 0.8, 1)])
def test_points_too_close_in_time_are_refused(shares):
    with pytest.raises(
        InputError, match="too unevenly spaced in time for a spline of degree 7; space them more"
    ):
        via(7, shares=shares).at(np.array([1.0]))


def test_points_beyond_numbers_are_refused():
    with pytest.raises(InputError, match="too unevenly spaced"):
        via(7, ((-1e308,), (1e308,), (-1e308,)), (0, 0.5, 1)).at(np.array([1.0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"degree": 11}, "the degree must be odd, 3 to 9, not 11"),
        ({"degree": 4}, "the degree must be odd, 3 to 9, not 4"),
        ({"points": POINTS[:1], "shares": (0.0,)}, "not 1 points and 1 times"),
        ({"shares": SHARES[:-1]}, "as many times are needed, not 5 points and 4 times"),
        ({"points": ((0.0,), *POINTS[1:])}, "different numbers of values"),
        ({"shares": (0.0, 0.5, 0.5, 0.75, 1.0)}, "must increase strictly"),
        ({"shares": (0.1, 0.2, 0.5, 0.75, 1.0)}, "must increase strictly, from the start to the end"),
        ({"span": (0.0, 1e200)}, r"must last a positive time \(1e-30 to 1e\+30 s\), not from 0 to 1e\+200 s"),
    ],
)
def test_what_no_spline_can_be_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        via(**options)
