"""Smoothing splines for records with noise of any colour: right, or said not to be."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BSpline
from scipy.signal import butter, filtfilt, lfilter

from vsacli.trajectory.fits import LEAST_SQUARES, SMOOTH, fit_samples
from vsacli.trajectory.fits.bins import Bins, uniform_basis
from vsacli.trajectory.fits.penalised import Model
from vsacli.trajectory.fits.residual import spectral_lines
from vsacli.trajectory.trajectory import Trajectory

EPS = np.finfo(float).eps
DURATION = 10.0

FREQUENCIES, AMPLITUDES = (0.3, 0.7, 1.1, 1.9), (0.8, 0.4, 0.2, 0.1)
"""Of a motion below 2 Hz, Hz and rad."""


def sines(time, seed):
    """Four sines with phases of their own; value and fourth derivative."""
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 4)[:, None]
    rates = 2 * np.pi * np.array(FREQUENCIES)[:, None]
    turns = np.sin(rates * time + phases)
    return AMPLITUDES @ turns, AMPLITUDES @ (rates**4 * turns)


def pauses(time, seed):
    """From rest to rest with polynomials of degree 9, and pauses between."""
    rng = np.random.default_rng(seed)
    bump = (Polynomial([0, 1]) * Polynomial([1, -1])) ** 4
    blend = bump.integ() / bump.integ()(1)
    return _steps(time, blend, rng, (0.8, 2.0), (0.2, 0.8))


def _steps(time, blend, rng, durations, pause):
    value, fourth, start = np.zeros_like(time), np.zeros_like(time), 0.0
    while start < time[-1]:
        duration, size = rng.uniform(*durations), rng.uniform(-1.2, 1.2)
        place = np.clip((time - start) / duration, 0, 1)
        value += size * blend(place)
        fourth += size * blend.deriv(4)(place) / duration**4 * ((place > 0) & (place < 1))
        start += duration + rng.uniform(*pause)
    return value, fourth


def velocity_steps(time, seed):
    """Steps of the velocity, each smoothed over 50 ms."""
    rng = np.random.default_rng(seed)
    bump = (Polynomial([0, 1]) * Polynomial([1, -1])) ** 4
    blend = bump.integ() / bump.integ()(1)
    ramp, duration, start = blend.integ(), 0.05, 1.0
    value, fourth = np.zeros_like(time), np.zeros_like(time)
    while start < time[-1] - 1:
        size, place = rng.uniform(-1, 1), (time - start) / duration
        inside, after = np.clip(place, 0, 1), np.maximum(place - 1, 0)
        value += size * duration * (ramp(inside) + after)
        fourth += size * blend.deriv(3)(inside) / duration**3 * ((place > 0) & (place < 1))
        start += rng.uniform(0.6, 1.5)
    return value, fourth


def rounded(values, bits):
    resolution = 2 * np.pi / 2**bits
    return resolution * np.round(values / resolution)


def first_order(white, correlation):
    return lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], white)


def twice_filtered(values, cutoff, rate):
    return filtfilt(*butter(2, 2 * cutoff / rate), values)


COLOURS = {
    "white": lambda q, e, _rate: q + 1e-4 * e,
    "white-small": lambda q, e, _rate: q + 1e-5 * e,
    "encoder-12": lambda q, _e, _rate: rounded(q, 12),
    "encoder-17": lambda q, _e, _rate: rounded(q, 17),
    "first-order-0.9": lambda q, e, _rate: q + 1e-4 * first_order(e, 0.9),
    "first-order-0.99": lambda q, e, _rate: q + 1e-4 * first_order(e, 0.99),
    "causal-30": lambda q, e, rate: q + 1e-4 * lfilter(*butter(2, 60 / rate), e),
    "zero-phase-50": lambda q, e, rate: q + 1e-4 * twice_filtered(e, min(50, rate / 5), rate),
    "zero-phase-20": lambda q, e, rate: q + 1e-4 * twice_filtered(e, 20, rate),
    "encoder-12-zero-phase-50": lambda q, _e, rate: twice_filtered(rounded(q, 12), min(50, rate / 5), rate),
    "encoder-12-zero-phase-20": lambda q, _e, rate: twice_filtered(rounded(q, 12), 20, rate),
    "hum": lambda q, e, rate: q + 1e-4 * np.sin(2 * np.pi * 50 * np.arange(len(q)) / rate + 1) + 1e-6 * e,
}
"""Noise by name: what a record of q becomes with white noise e of deviation 1 at a rate in Hz."""

WHITE = ("white", "white-small", "encoder-12", "encoder-17")


def record(motion, colour, seed, rate=1000):
    """Times, samples, and the true fourth derivative."""
    time = np.arange(round(DURATION * rate) + 1) / rate
    value, fourth = motion(time, seed)
    white = np.random.default_rng(100 + seed).standard_normal(len(time))
    return time, COLOURS[colour](value, white, rate), fourth


def error(fit, time, fourth):
    """Root mean square error of the fourth derivative away from the ends, where filters err too, relative."""
    inside = (time > 0.5) & (time < time[-1] - 0.5)
    found = fit.at(time, 5)[4, 0]
    return np.sqrt(np.mean((found - fourth)[inside] ** 2) / np.mean(fourth[inside] ** 2))


def alarmed(fit):
    known = fit.parts[0].smoothing
    return known is not None and bool(not known.determined or known.lines.others)


@pytest.mark.parametrize("colour", ["white", "zero-phase-20", "encoder-12-zero-phase-50", "first-order-0.99"])
def test_sines_with_noise_of_any_colour(colour):
    time, values, fourth = record(sines, colour, 0)
    fit = fit_samples(time, values[None], 7, 4, SMOOTH)
    # the error was at most 1.6 % for twelve colours and five seeds
    assert error(fit, time, fourth) < 0.03
    assert not alarmed(fit)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [250, 1000])
@pytest.mark.parametrize("motion", [sines, pauses, velocity_steps])
@pytest.mark.parametrize("colour", COLOURS)
def test_right_or_alarmed(colour, motion, rate):
    for seed in range(3):
        time, values, fourth = record(motion, colour, seed, rate)
        fit = fit_samples(time, values[None], 7, 4, SMOOTH)
        assert alarmed(fit) or error(fit, time, fourth) < 0.1
        if motion is sines:
            assert not alarmed(fit)


@pytest.mark.parametrize("colour", ["zero-phase-20", "encoder-12-zero-phase-50", "first-order-0.9", "hum"])
def test_noise_that_is_not_white_is_found_by_default(colour):
    time, values, fourth = record(sines, colour, 1)
    fit = fit_samples(time, values[None], 7, 4, None)
    assert fit.parts[0].smooth
    assert error(fit, time, fourth) < 0.03
    assert not alarmed(fit)


@pytest.mark.parametrize("colour", WHITE)
@pytest.mark.parametrize("motion", [sines, pauses])
def test_white_noise_and_encoders_keep_their_least_squares(colour, motion):
    time, values, _ = record(motion, colour, 1)
    (part,) = fit_samples(time, values[None], 7, 4, None).parts
    (asked,) = fit_samples(time, values[None], 7, 4, LEAST_SQUARES).parts
    np.testing.assert_array_equal(part.spline.c, asked.spline.c)
    np.testing.assert_array_equal(part.spline.t, asked.spline.t)
    if motion is sines:
        assert part.smoothing is None


@pytest.mark.parametrize("motion", [sines, pauses, velocity_steps])
def test_clean_samples_keep_their_interpolation(motion):
    time = np.arange(10001) / 1000
    (part,) = fit_samples(time, motion(time, 0)[0][None], 7, 4, None).parts
    assert part.exact
    assert part.smoothing is None


def test_joints_with_different_noise_and_uneven_stamps():
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 8000))
    time = np.delete(time, np.arange(3000, 3020))  # a gap of a quarter of a knot span
    motions = [sines(time, seed) for seed in range(2)]
    noises = rng.standard_normal(len(time)), first_order(rng.standard_normal(len(time)), 0.95)
    values = np.array([q + 1e-4 * noise for (q, _), noise in zip(motions, noises, strict=True)])
    fit = fit_samples(time, np.insert(values, 1, np.nan, axis=0), 7, 4, SMOOTH)
    inside = (time > 0.6) & (time < time[-1] - 0.6)
    rows = fit.at(time, 5)[4][:, inside]
    assert np.isnan(rows[1]).all()
    for row, (_, fourth) in zip(rows[[0, 2]], motions, strict=True):
        # as with even stamps
        assert np.sqrt(np.mean((row - fourth[inside]) ** 2) / np.mean(fourth**2)) < 0.03
    assert all(part.smoothing.determined for part in fit.parts)


def test_spline_is_six_times_continuously_differentiable_and_stretches():
    time, values, _ = record(sines, "zero-phase-20", 0)
    fit = fit_samples(3 + time, values[None], 7, 4, SMOOTH)
    knots = fit.parts[0].knots
    assert knots[[0, -1]] == pytest.approx([3, 13], rel=1e-14)
    spline = fit.parts[0].spline
    near = 1e-9
    for order in range(7):
        below, above = spline(knots[5:-5] - near, nu=order), spline(knots[5:-5] + near, nu=order)
        scale = np.abs(spline(knots[5:-5], nu=min(7, order + 1))).max() + np.abs(above).max()
        assert np.abs(above - below).max() < 1e-6 * scale
    slower = fit.stretched(2.0)
    probes = np.linspace(3.1, 12.9, 50)
    np.testing.assert_allclose(
        slower.at(3 + 2 * (probes - 3), 5)[4], fit.at(probes, 5)[4] / 16, rtol=1e-9, atol=1e-6
    )
    assert slower.parts[0].smoothing.deviations[4] == fit.parts[0].smoothing.deviations[4] / 16


@pytest.mark.parametrize("degree", [5, 7])
def test_estimate_is_that_of_dense_algebra(degree):
    """The penalised least squares of whitened bins, the restricted likelihood, and the deviations."""
    time = np.sort(np.random.default_rng(1).uniform(0, 2, 300))
    row = np.sin(3 * time) + 0.01 * np.random.default_rng(2).standard_normal(300)
    bins = Bins.of(time, row, 20, degree)
    penalties = np.geomspace(1e-3, 1e2, bins.coefficients - degree)
    model = Model(bins, 0.4, penalties, 1)
    lag = 0.4**bins.gaps
    differences = np.eye(len(bins.means))
    differences[np.arange(1, len(lag) + 1), np.arange(len(lag))] = -lag
    differences /= np.sqrt(1 - np.append(0, lag) ** 2)[:, None]
    design = np.zeros((len(bins.means), bins.coefficients))
    for i, first in enumerate(bins.first):
        design[i, first : first + degree + 1] = bins.design[i]
    penalty = np.diff(np.eye(bins.coefficients), degree, axis=0)
    x, y = differences @ design, differences @ bins.means
    stacked = np.vstack([x, np.sqrt(penalties)[:, None] * penalty])
    triangle = np.linalg.qr(stacked, mode="r")
    inverse = np.linalg.inv(triangle)
    coefficients = np.linalg.lstsq(stacked, np.append(y, np.zeros(len(penalty))))[0]
    # rounding, times the condition of the rows, some 1e5
    np.testing.assert_allclose(model.coefficients, coefficients, rtol=0, atol=1e-9)
    rest = np.sum((stacked @ coefficients - np.append(y, np.zeros(len(penalty)))) ** 2)
    freedom = len(y) - degree
    deviance = freedom * np.log(rest / freedom) + 2 * np.log(np.abs(np.diag(triangle))).sum()
    deviance -= np.log(penalties).sum()
    deviance -= 2 * np.linalg.slogdet(differences)[1]
    assert model.deviance == pytest.approx(deviance, rel=1e-6)
    rows = BSpline(bins.knots, np.eye(bins.coefficients), degree)(model.probes, nu=2)
    deviations = np.linalg.norm(rows @ inverse, axis=1) * np.sqrt(rest / freedom)
    np.testing.assert_allclose(model.deviations(2), deviations, rtol=1e-6)


def test_uniform_basis_adds_up_to_one():
    np.testing.assert_allclose(np.sum(uniform_basis(np.linspace(0, 1, 9), 7), axis=0), 1, rtol=1e-14)


def test_lines_of_a_residual():
    time = np.arange(10001) / 1000
    noise = np.random.default_rng(0).standard_normal(10001)
    assert spectral_lines(time, noise, 4, 1.0) == ((), (), 0.0)
    tones = noise + np.sin(2 * np.pi * 50 * time) + 2 * np.sin(2 * np.pi * 33 * time)
    lines = spectral_lines(time, tones, 4, 1.0)
    # a bin is 0.1 Hz
    assert lines.hum == pytest.approx([50], abs=0.1)
    assert lines.others == pytest.approx([33], abs=0.1)
    assert 0.4 < lines.share < 0.7  # 2 of 3.5


def test_what_is_said():
    time, values, _ = record(pauses, "encoder-12-zero-phase-50", 0)
    trajectory = Trajectory.from_samples(time, values[:, None], fit="smooth")
    source, doubt = trajectory.warnings
    assert source.startswith("q, dq, ddq, d3q, d4q come from a C6 smoothing spline near the samples of q: ")
    assert doubt.startswith("d4q of column 0 is not determined by the record")
    (column,) = trajectory.fits[0]["columns"]
    assert column["method"] == "smooth"
    assert column["deviation"] > 0.1
    time, values, _ = record(sines, "hum", 0)
    trajectory = Trajectory.from_samples(time, values[:, None])
    assert any(note.startswith("mains hum of 50 Hz in q of column 0") for note in trajectory.notes)
    time, values, _ = record(sines, "white-small", 0)
    vibrating = values + 3e-4 * np.sin(2 * np.pi * 15 * time)
    trajectory = Trajectory.from_samples(time, vibrating[:, None], fit="smooth")
    assert "q of column 0 has a vibration at 15 Hz, which is taken for noise" in trajectory.warnings


@pytest.mark.parametrize("count", [8, 9, 30, 100, 300])
def test_short_records(count):
    time = np.arange(count) / 100
    fit = fit_samples(time, np.array([np.sin(time), np.full(count, 0.3)]), 7, 4, SMOOTH)
    assert np.isfinite(fit.at(time, 5)).all()
    assert np.abs(fit.at(time, 1)[0, 1] - 0.3).max() < 100 * EPS


@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_vibration_that_may_be_motion_is_kept_by_default_and_said(noise):
    time = np.arange(10001) / 1000
    values = sines(time, 0)[0] + 3e-4 * np.sin(2 * np.pi * 15 * time)
    values += noise * np.random.default_rng(0).standard_normal(len(time))
    fit = fit_samples(time, values[None], 7, 4, None)
    assert not fit.parts[0].smooth
    assert fit.parts[0].smoothing.lines.others == pytest.approx([15], abs=0.1)
    (_, said) = Trajectory.from_samples(time, values[:, None]).warnings
    assert "has a vibration at 15 Hz beyond a smooth motion" in said


def test_a_stiffness_with_filtered_noise():
    time = np.arange(10001) / 1000
    values = 1000 + 100 * np.sin(2 * time)
    values += twice_filtered(np.random.default_rng(0).standard_normal(len(time)), 20, 1000)
    for method in (SMOOTH, None):
        fit = fit_samples(time, values[None], 5, 2, method)
        assert fit.parts[0].smooth
        assert fit.parts[0].smoothing.determined
        inside = time[500:-500]
        error = fit.at(inside, 3)[2, 0] + 400 * np.sin(2 * inside)
        # 1 N m/rad of noise; the deviation that is stated is 1 to 3 %
        assert np.sqrt(np.mean(error**2)) < 0.03 * 400 / np.sqrt(2)
