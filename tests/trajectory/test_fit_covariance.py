"""Covariances of fits, against dense linear algebra."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.signal import butter, filtfilt

from vsacli.trajectory.fits import INTERPOLATE, LEAST_SQUARES, SMOOTH, fit_samples
from vsacli.trajectory.fits.least_squares import local_basis


def uneven_times(count, seed=0):
    return 3 + np.cumsum(np.random.default_rng(seed).uniform(0.5e-2, 1.5e-2, count))


def motion(time):
    return np.sin(3 * time) + 0.3 * np.sin(7 * time)


def noisy(time, deviation, seed=1):
    return motion(time) + deviation * np.random.default_rng(seed).standard_normal(len(time))


def dense_rows(spline, time, orders):
    """Value and derivatives of all B-splines, (orders, times, coefficients)."""
    each = BSpline(spline.t, np.eye(len(spline.c)), spline.k)
    return np.array([each(time, nu=order) for order in range(orders)])


@pytest.mark.parametrize(("degree", "orders"), [(7, 5), (5, 3)])
def test_local_basis_is_that_of_scipy(degree, orders):
    knots = np.concatenate([[0] * degree, np.sort(np.random.default_rng(0).uniform(0, 1, 20)), [1] * degree])
    spline = BSpline(knots, np.zeros(len(knots) - degree - 1), degree)
    time = np.linspace(knots[degree], knots[-degree - 1], 99)
    first, rows = local_basis(knots, degree, time, orders)
    expected = dense_rows(spline, time, orders)
    for i in range(len(time)):
        within = slice(first[i], first[i] + degree + 1)
        scale = np.abs(expected[:, i]).max(axis=1, keepdims=True)
        # rounding, times some steps of the recurrence
        np.testing.assert_allclose(rows[i] / scale, expected[:, i, within] / scale, rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("method", [LEAST_SQUARES, INTERPOLATE])
@pytest.mark.parametrize(("degree", "orders"), [(7, 5), (5, 3)])
def test_independent_noise_is_carried_to_derivatives(method, degree, orders):
    """sigma^2 R (X'X)^-1 R', with X the B-splines at the samples and R their derivatives."""
    time = uneven_times(200)
    values = np.array([noisy(time, 1e-3), np.full(200, np.nan), noisy(time, 1e-2, 2)])
    fit = fit_samples(time, values, degree, orders - 1, method)
    probes = np.linspace(time[0], time[-1], 31)
    found = fit.covariance(probes)
    assert found.shape == (3, orders, orders, 31)
    assert np.isnan(found[1]).all()
    for part in fit.parts:
        part = replace(part, smoothing=None, noise=None)  # which make the deviation larger
        unjudged = replace(fit, parts=(part,))
        found = unjudged.covariance(probes)
        inverse = np.linalg.pinv(dense_rows(part.spline, time, 1)[0])
        passed = dense_rows(part.spline, probes, orders) @ inverse
        unit = np.einsum("atn,btn->abt", passed, passed)
        size = np.sqrt(np.einsum("aat->at", unit))
        scale = size[:, None] * size
        for member in part.members:
            relative = found[member] / fit.noise[member] ** 2 / scale
            # rounding, times the condition of the Gram matrix, some 1e8
            np.testing.assert_allclose(relative, unit / scale, rtol=0, atol=1e-7)


def filtered(count, seed=1):
    """Noise of 1e-3 before it is filtered."""
    return filtfilt(*butter(2, 0.4), 1e-3 * np.random.default_rng(seed).standard_normal(count))


def test_a_smoothing_spline_has_the_deviation_that_is_stated():
    time = np.arange(2001) / 100
    fit = fit_samples(time, (motion(time) + filtered(2001))[None], 7, 4, SMOOTH)
    known = fit.parts[0].smoothing
    assert known.determined
    inside = time[(time > 1) & (time < 19)]
    covariance = fit.covariance(inside)[0]
    for order in range(5):
        deviation = np.sqrt(np.mean(covariance[order, order]))
        # the change to the next resolution is an error of the derivatives alike; probes differ
        assert known.deviations[order] * 0.99 < deviation < 2 * known.deviations[order]
    np.testing.assert_allclose(covariance, np.swapaxes(covariance, 0, 1), rtol=0)
    assert np.linalg.eigvalsh(np.moveaxis(covariance, 2, 0)).min() > 0


@pytest.mark.parametrize("method", [LEAST_SQUARES, SMOOTH])
def test_a_slower_course_is_as_uncertain(method):
    time = 3 + np.arange(1001) / 100
    fit = fit_samples(time, noisy(time, 1e-3)[None], 7, 4, method)
    probes = np.linspace(3, 13, 57)
    slower = fit.stretched(2.0).covariance(3 + 2 * (probes - 3))
    powers = 2.0 ** np.add.outer(np.arange(5), np.arange(5))
    np.testing.assert_allclose(slower * powers[:, :, None], fit.covariance(probes), rtol=1e-6)


@pytest.mark.slow
def test_what_no_two_resolutions_agree_on_has_no_deviation():
    time = np.arange(1001) / 100
    rough = np.cumsum(np.random.default_rng(0).standard_normal(1001))
    fit = fit_samples(time, np.array([rough, motion(time)]), 7, 4, SMOOTH)
    assert [part.smoothing.resolved for part in fit.parts] == [False, True]
    covariance = fit.covariance(time[::10])
    assert np.isnan(covariance[0]).all()
    assert np.isfinite(covariance[1]).all()


def test_computed_samples_are_certain_to_rounding():
    time = np.arange(401) / 100
    fit = fit_samples(time, motion(time)[None], 7, 4, None)
    deviation = np.sqrt(fit.covariance(time)[0, 4, 4])
    # less than the hundredth from which on they would not be interpolated
    assert np.sqrt(np.mean(deviation[20:-20] ** 2)) < 0.01 * 7**4 * 0.3
