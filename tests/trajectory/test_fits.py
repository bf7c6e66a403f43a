"""Splines for recorded samples, against analytic motions and dense linear algebra."""

from functools import cache

import numpy as np
import pytest
from samples.marks import slow, slow_but
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline

from vsacli.trajectory.fits import INTERPOLATE, LEAST_SQUARES, fit_samples
from vsacli.trajectory.fits.least_squares import BLOCK_SAMPLES, best_spans, fit_spline, most_spans
from vsacli.trajectory.fits.noise import estimated_noise
from vsacli.trajectory.fits.selection import INTERPOLATION_GAIN, LEAST_SQUARES_GAIN

EPS = np.finfo(float).eps
FREQUENCIES, AMPLITUDES = (0.3, 0.7, 1.1, 1.9), (0.8, 0.4, 0.2, 0.1)
"""Of a motion below 2 Hz, Hz and rad."""


def motion(time, order=0):
    """The motion or a derivative of it, rad/s^order."""
    rates = 2 * np.pi * np.array(FREQUENCIES)[:, None]
    phase = rates * (time + 0.1) + order * np.pi / 2
    return np.array(AMPLITUDES) @ (rates**order * np.sin(phase))


def noise(count, deviation, seed=0):
    return deviation * np.random.default_rng(seed).standard_normal(count)


def fitted(time, values, method=None, degree=7, order=4):
    return fit_samples(time, np.atleast_2d(values), degree, order, method)


def relative_error(fit, time, order=4):
    """Root mean square error of a derivative outside the unreliable stretches, relative to its own."""
    start, end = fit.unreliable
    inside = time[(time >= time[0] + start) & (time <= time[-1] - end)]
    error = fit.at(inside, 5)[order, 0] - motion(inside, order)
    return np.sqrt(np.mean(error**2) / np.mean(motion(inside, order) ** 2))


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", slow_but([0], range(5)))
def test_noisy_record_gives_the_fourth_derivative_within_two_percent(seed):
    time = np.arange(10001) / 1000
    values = motion(time) + noise(len(time), 1e-5, seed)
    fit = fitted(time, values)
    assert not fit.exact[0]
    assert relative_error(fit, time) < 0.02
    assert relative_error(fitted(time, values, INTERPOLATE), time) > 1000
    # what is left is noise of 1e-5; an estimate from 1e4 samples is good to 1 %
    assert fit.noise[0] == pytest.approx(1e-5, rel=0.05)
    assert fit.residual[0] == pytest.approx(1e-5, rel=0.05)
    assert 3e-5 < fit.largest[0] < 7e-5  # of 1e4 normal deviates


@pytest.mark.parametrize("rate", [100, slow(1000), 10000])
@pytest.mark.parametrize("decimals", [3, slow(4), 6])
def test_rounded_records(rate, decimals):
    time = np.arange(4 * rate + 1) / rate
    fit = fitted(time, np.round(motion(time), decimals))
    # 2.3 % is what three digits allow at 100 Hz
    assert relative_error(fit, time) < (0.03 if decimals == 3 else 0.01)


@pytest.mark.parametrize("decimals", [3, 4])
def test_steps_of_an_encoder_are_not_followed(decimals):
    """10 kHz and 1e-3 rad: up to a thousand equal samples in a row."""
    time = np.arange(40001) / 10000
    s = time / 4
    slow = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    fit = fitted(time, np.round(slow, decimals))
    assert not fit.exact[0]
    assert len(fit.parts[0].knots) < 40
    assert np.abs(fit.at(time, 1)[0, 0] - slow).max() < 10.0**-decimals


@pytest.mark.parametrize("rate", [50, 100, 1000])
def test_full_digits_are_interpolated(rate):
    time = np.arange(4 * rate + 1) / rate
    values = motion(time)
    fit = fitted(time, values)
    assert fit.exact[0]
    # 50 Hz: (omega h)^8 of the fastest part is 1e-5; 1 kHz: rounding times 37e12 is some 1e-3 of 400
    assert relative_error(fit, time) < 1e-4
    np.testing.assert_allclose(fit.at(time, 1)[0, 0], values, rtol=0, atol=100 * EPS)


@pytest.mark.slow
def test_full_digits_at_a_very_high_rate_are_noisy():
    """At 20 kHz rounding alone spoils the fourth derivative of an interpolating spline."""
    time = np.arange(40001) / 20000
    fit = fitted(time, motion(time))
    assert not fit.exact[0]
    # the change from one resolution to the next that counts as none is 2 %
    assert relative_error(fit, time) < 0.01 < relative_error(fitted(time, motion(time), INTERPOLATE), time)
    assert relative_error(fitted(time, motion(time), LEAST_SQUARES), time) < 1e-4


def test_few_samples_of_a_fast_motion_are_interpolated():
    time = np.arange(81) / 20  # ten samples to a period
    assert fitted(time, motion(time)).exact[0]


def test_each_component_is_judged_by_itself():
    time = np.arange(4001) / 1000
    clean, absent, noisy = motion(time), np.full(4001, np.nan), motion(time) + noise(4001, 1e-4)
    slow_and_noisy = np.sin(time) + noise(4001, 1e-4)
    values = np.array([clean, absent, noisy, slow_and_noisy, np.full(4001, 0.3)])
    fit = fit_samples(time, values, 7, 4, None)
    assert fit.exact.tolist() == [True, True, False, False, True]
    knots = {int(member): len(part.knots) for part in fit.parts for member in part.members}
    assert knots[3] < knots[2] < knots[0] == knots[4] == 4001 - 6
    rows = fit.at(time, 5)
    assert np.isnan(rows[:, 1]).all()
    assert np.isfinite(rows[:, [0, 2, 3, 4]]).all()
    np.testing.assert_allclose(rows[0, 0], clean, rtol=0, atol=20 * EPS)
    np.testing.assert_array_equal(fit.residual[[0, 4]], 0)


def test_a_noisy_stiffness():
    time = np.arange(4001) / 1000
    values = 1000 + 100 * np.sin(2 * time) + noise(4001, 0.1)
    fit = fitted(time, values, degree=5, order=2)
    inside = time[200:-200]
    error = fit.at(inside, 3)[2, 0] + 400 * np.sin(2 * inside)
    # on some ten knots in 4 s: 4.5 * 0.1 sqrt(0.001 / 0.4) / 0.4^2 = 0.15, and bias about as much
    assert np.sqrt(np.mean(error**2)) < 1


def test_method_that_is_asked_for():
    time = np.arange(401) / 100
    values = motion(time)
    assert not fitted(time, values, LEAST_SQUARES).exact[0]
    assert fitted(time, values + noise(401, 1e-2), INTERPOLATE).exact[0]
    few = fitted(time[:8], values[:8], LEAST_SQUARES)
    np.testing.assert_allclose(few.at(time[:8], 1)[0, 0], values[:8], atol=1e-12)  # condition of 8 samples


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize(("spans", "degree"), [(1, 7), (40, 7), (300, 5)])
def test_least_squares_are_those_of_scipy(spans, degree, uneven):
    count = BLOCK_SAMPLES + 1000  # two blocks
    steps = np.random.default_rng(0).uniform(0.1, 1.9, count - 1) if uneven else np.ones(count - 1)
    time = np.append(0, np.cumsum(steps)) / count * 10
    rows = np.array([motion(time), motion(time) ** 2]) + noise(2 * count, 1e-3).reshape(2, -1)
    ours = fit_spline(time, rows, spans, degree)
    theirs = make_lsq_spline(time, rows.T, ours.t, k=degree, method="qr")
    # rounding, times the condition of the B-splines, about 2^degree
    np.testing.assert_allclose(ours.c, theirs.c, rtol=0, atol=1000 * EPS * np.abs(theirs.c).max())


def test_refined_solution_keeps_the_digits():
    """A polynomial of degree 7 on one span: the Gram matrix has the condition 1e8."""
    time = np.linspace(0, 1, 2001)
    exact = np.polynomial.Polynomial(np.arange(1.0, 9.0))
    spline = fit_spline(time, exact(time)[None], 1, 7)
    np.testing.assert_allclose(spline(time)[:, 0], exact(time), rtol=1e-14)
    inside = np.linspace(0.1, 0.9, 50)
    # rounding of values up to 36, times 1e4 of the fourth derivative of the basis; 3e-9 without refinement
    np.testing.assert_allclose(spline(inside, nu=4)[:, 0], exact.deriv(4)(inside), rtol=0, atol=2e-10)


def score(time, row, spans, degree=7):
    """Generalized cross-validation, a coefficient counting 1.4 times."""
    knots = np.concatenate([[0] * degree, np.linspace(0, time[-1], spans + 1), [time[-1]] * degree])
    error = row - make_lsq_spline(time, row, knots, k=degree)(time)
    return np.sum(error**2) / (1 - 1.4 * (spans + degree) / len(time)) ** 2


def test_choice_is_the_minimum_of_the_score():
    time = np.arange(2001) / 1000
    row = motion(time) + noise(2001, 1e-4)
    (chosen,) = best_spans(time, row[None], 7)
    least = min(score(time, row, spans) for spans in range(1, 61))
    assert score(time, row, chosen) < 1.002 * least  # the finest ratio tried is 1.19
    assert chosen < most_spans(2001, 7)


@pytest.mark.parametrize("seed", range(16))
def test_choice_for_a_short_record_is_that_of_all_numbers(seed):
    """Ten coefficients for a hundred samples: their price decides; at 1.3 or 1.45 some of these differ."""
    time = np.arange(101) / 100
    row = motion(time) + noise(101, 1e-2, seed)
    (chosen,) = best_spans(time, row[None], 7)
    assert chosen == min(range(1, most_spans(101, 7) + 1), key=lambda spans: score(time, row, spans))


def test_a_fast_motion_gets_almost_half_as_many_knots_as_samples():
    count = np.arange(401)
    row = np.sin(2 * np.pi * count / 7) + noise(401, 0.1)  # seven samples to a period
    fit = fitted(count / 100, row)
    assert not fit.exact[0]
    assert 401 / 3 < len(fit.parts[0].knots) < 401 / 2


@pytest.mark.parametrize(("share", "exact"), [(0.003, True), (0.03, False)])
def test_noise_of_a_percent_of_the_highest_derivative_is_too_much(share, exact):
    time = np.arange(4001) / 1000
    size = np.sqrt(np.mean(motion(time, 4) ** 2))
    deviation = share * size * 1e-3**4 / INTERPOLATION_GAIN[7][4]
    assert fitted(time, motion(time) + noise(4001, deviation)).exact.tolist() == [exact]


def test_rounding_of_a_component_that_rests_beside_one_that_moves_is_no_noise():
    time = np.arange(2001) / 1000
    resting = 0.01 + noise(2001, 3e-17)
    assert not fitted(time, resting).exact[0]
    assert fit_samples(time, np.array([motion(time), resting]), 7, 4, None).exact.all()


def test_gaps_leave_no_span_without_samples():
    time = np.concatenate([np.arange(0, 2000), np.arange(3000, 4000)]) / 1000
    values = motion(time) + noise(len(time), 1e-5)
    fit = fitted(time, values, LEAST_SQUARES)
    assert not fit.exact[0]
    counts = np.histogram(time, fit.parts[0].knots)[0]
    assert counts.min() >= 2
    assert np.abs(fit.at(time, 1)[0, 0] - motion(time)).max() < 1e-4


def test_estimate_of_noise_does_not_depend_on_the_steps():
    steps = np.random.default_rng(3).uniform(0.2, 1.8, 20000)
    time = np.cumsum(steps) / 1000
    for deviation in (1e-7, 1e-3):
        rows = np.array([motion(time), np.zeros_like(time)]) + noise(40000, deviation).reshape(2, -1)
        np.testing.assert_allclose(estimated_noise(time, rows, 8), deviation, rtol=0.05)
    assert estimated_noise(time[:8], rows[:, :8], 8).tolist() == [0, 0]


@pytest.mark.parametrize("degree", [5, 7])
def test_gain_of_interpolation(degree):
    count = 81
    spline = make_interp_spline(np.arange(count), np.eye(count), k=degree)
    gains = [np.linalg.norm(spline(40.0, nu=order)) for order in range(len(INTERPOLATION_GAIN[degree]))]
    np.testing.assert_allclose(gains, INTERPOLATION_GAIN[degree], rtol=1e-3)


@cache
def least_squares_deviation(degree, order, spans=32, samples=30):
    """Standard deviation of a derivative, at 16 places in each span, for unit noise, spans of length 1."""
    time = np.linspace(0, spans, spans * samples + 1)
    knots = np.concatenate([[0] * degree, np.arange(spans + 1.0), [spans] * degree])
    design = BSpline.design_matrix(time, knots, degree).toarray()
    places = np.linspace(0, spans, spans * 16 + 1)
    derivative = BSpline(knots, np.eye(spans + degree), degree)(places, nu=order)
    return places, np.sqrt(samples) * np.linalg.norm(derivative @ np.linalg.pinv(design), axis=1)


@pytest.mark.parametrize("degree", [5, 7])
def test_gain_of_least_squares(degree):
    for order, gain in enumerate(LEAST_SQUARES_GAIN[degree]):
        places, deviation = least_squares_deviation(degree, order)
        inside = (places >= 13) & (places < 19)
        assert np.sqrt(np.mean(deviation[inside] ** 2)) == pytest.approx(gain, rel=0.02)


@pytest.mark.parametrize(("degree", "order"), [(5, 2), (7, 4)])
def test_unreliable_stretch_is_where_noise_counts_more(degree, order):
    places, deviation = least_squares_deviation(degree, order)
    largest_inside = deviation[(places >= 13) & (places < 19)].max()
    fit = fitted(np.arange(8001) / 1000, motion(np.arange(8001) / 1000), LEAST_SQUARES, degree, order)
    start, end = fit.unreliable
    spans = (degree + 1) // 2
    assert start == pytest.approx(np.ptp(fit.parts[0].knots[: spans + 1]))
    assert end == pytest.approx(start)
    assert deviation[(places >= spans) & (places <= 16)].max() < 1.4 * largest_inside
    assert deviation[0] > 40 * largest_inside


def test_stretched_fit_is_the_same_course():
    time = 3 + np.arange(2001) / 1000
    values = np.array([motion(time), motion(time) + noise(2001, 1e-4)])
    fit = fit_samples(time, values, 7, 4, None)
    slower = fit.stretched(2.0)  # a power of two: exact
    assert slower.breakpoints[[0, -1]].tolist() == [3.0, 7.0]
    probes = np.linspace(3, 5, 57)
    for order in range(5):
        expected = fit.at(probes, 5)[order] / 2**order
        np.testing.assert_allclose(slower.at(3 + 2 * (probes - 3), 5)[order], expected, rtol=1e-9, atol=1e-6)


def test_values_do_not_depend_on_the_block():
    time = np.arange(3001) / 1000
    values = np.array([motion(time), motion(time) + noise(3001, 1e-4)])
    fit = fit_samples(time, values, 7, 4, None)
    whole = fit.at(time, 5)
    for size in (1, 7, 1000):
        blocks = [fit.at(time[i : i + size], 5) for i in range(0, 3001 if size > 1 else 50, size)]
        joined = np.concatenate(blocks, axis=2)
        np.testing.assert_array_equal(joined, whole[:, :, : joined.shape[2]])
