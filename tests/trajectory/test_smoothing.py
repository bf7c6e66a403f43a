"""Smoothing splines for records with noise of any color: right, or said not to be."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from samples.marks import slow, slow_but
from samples.noisy_records import (
    COLORS,
    FILTERED,
    MOTIONS,
    Record,
    first_order,
    pauses,
    random_motion,
    record,
    sines,
    sweep,
    twice_filtered,
    velocity_steps,
)
from scipy.interpolate import BSpline

from vsacli import Trajectory
from vsacli.trajectory.fits import INTERPOLATE, LEAST_SQUARES, SMOOTH, fit_samples, resolution
from vsacli.trajectory.fits.bins import BinMoments, Bins, uniform_basis
from vsacli.trajectory.fits.noise import Lines, filtered_noise, spectral_lines
from vsacli.trajectory.fits.penalized import Model

EPS = np.finfo(float).eps


def error(fit, record):
    """Root mean square error of the fourth derivative away from the ends, where filters err too, relative."""
    time, fourth = record.time, record.truth[1]
    inside = (time > 0.5) & (time < time[-1] - 0.5)
    found = fit.at(time, 5)[4, 0]
    return np.sqrt(np.mean((found - fourth)[inside] ** 2) / np.mean(fourth[inside] ** 2))


def fitted(of, method=None, **known):
    return fit_samples(of.time, of.values[None], 7, 4, method, **known)


def alarmed(fit):
    known = fit.parts[0].smoothing
    return known is not None and bool(not known.determined or known.lines.others)


@pytest.mark.slow
@pytest.mark.parametrize(
    "color",
    slow_but(
        ["white, 1e-4 rad", "hum of 50 Hz"],
        ["white, 1e-4 rad", "12-bit encoder", *list(COLORS)[5:9:3], "hum of 50 Hz"],
    ),
)
def test_sines_with_noise_of_any_color(color):
    of = record(sines, color, 0)
    for method in (SMOOTH, None):
        fit = fitted(of, method)
        assert fit.parts[0].smooth
        # the error was at most 1.6 % for twelve colors and five seeds
        assert error(fit, of) < 0.03
        assert not alarmed(fit)


@pytest.mark.parametrize("rate", [100, slow(1000)])
@pytest.mark.parametrize("motion", MOTIONS.values())
def test_clean_samples_are_interpolated_in_silence(motion, rate):
    time = np.arange(10 * rate + 1) / rate
    for decimals in (17, 11):
        values = np.round(motion(time, 0)[0], decimals)
        assert not filtered_noise(time, values[None], 8).any()
    (part,) = fit_samples(time, motion(time, 0)[0][None], 7, 4, None).parts
    assert part.exact
    assert part.smoothing is None


@pytest.mark.cases(8)
@pytest.mark.parametrize("motion", slow_but({"sweep to 4 Hz", "velocity steps, 50 ms"}, MOTIONS))
@pytest.mark.parametrize("color", FILTERED)
def test_filtered_noise_is_found(color, motion):
    for seed in range(2):
        of = record(MOTIONS[motion], color, seed)
        assert filtered_noise(of.time, of.values[None], 8).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "color"),
    [
        (pauses, "12 bits, zero-phase 50 Hz"),
        pytest.param(velocity_steps, "zero-phase low-pass, 20 Hz", marks=pytest.mark.slow),
    ],
)
def test_what_a_record_does_not_determine_is_said(motion, color):
    of = record(motion, color, 1)
    fit = fitted(of)
    # 15 and 30 to 60 %
    assert error(fit, of) > 0.1
    assert alarmed(fit)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "color"), [(INTERPOLATE, "zero-phase low-pass, 20 Hz"), (LEAST_SQUARES, "first order 0.9")]
)
def test_a_fit_that_was_asked_for_is_judged_all_the_same(method, color):
    of = record(sines, color, 2)
    trajectory = Trajectory.from_samples(of.time, of.values[:, None], fit=method)
    assert trajectory.fits[0]["columns"][0]["method"] == method
    undetermined = "d4q of column 0 is not determined by the record to 10 %"
    assert any(undetermined in each for each in trajectory.warnings)


@pytest.mark.slow
def test_least_squares_are_as_uncertain_as_their_difference_from_a_smoothing_spline():
    of = record(sines, "white, 1e-5 rad", 3)
    fit = fitted(of, LEAST_SQUARES)
    assert not alarmed(fit)
    deviation = np.sqrt(fit.covariance(of.time[1000:-1000])[0, 4, 4])
    size = np.sqrt(np.mean(of.truth[1] ** 2))
    # their bias, 0.2 %, is six times what noise adds
    assert 0.5 * error(fit, of) < np.sqrt(np.mean(deviation**2)) / size < 0.02


@pytest.mark.slow
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


@pytest.mark.slow
def test_spline_is_six_times_continuously_differentiable_and_stretches():
    of = record(sines, "zero-phase low-pass, 20 Hz", 0)
    fit = fit_samples(3 + of.time, of.values[None], 7, 4, SMOOTH)
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
    """The penalized least squares of whitened bins, the restricted likelihood, and the deviations."""
    time = np.sort(np.random.default_rng(1).uniform(0, 2, 300))
    row = np.sin(3 * time) + 0.01 * np.random.default_rng(2).standard_normal(300)
    bins = Bins.of(BinMoments.of(time, row, 40, degree))
    penalties = np.geomspace(1e-3, 1e2, bins.coefficients - degree)
    model = Model(bins, bins.whitened(0.4), penalties, 1)
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
    coefficients = np.linalg.lstsq(stacked, np.append(y, np.zeros(len(penalty))), rcond=None)[0]
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
    np.testing.assert_allclose(np.sqrt(model.variances(2) * model.noise_variance), deviations, rtol=1e-6)


def test_uniform_basis_adds_up_to_one():
    np.testing.assert_allclose(np.sum(uniform_basis(np.linspace(0, 1, 9), 7), axis=0), 1, rtol=1e-14)


def test_lines_of_a_residual():
    time = np.arange(10001) / 1000
    noise = np.random.default_rng(0).standard_normal(10001)
    assert spectral_lines(time, noise, 4, 1.0) == Lines()
    tones = noise + np.sin(2 * np.pi * 50 * time) + 2 * np.sin(2 * np.pi * 33 * time)
    lines = spectral_lines(time, tones, 4, 1.0)
    # a bin is 0.1 Hz
    assert lines.hum == pytest.approx([50], abs=0.1)
    assert lines.others == pytest.approx([33], abs=0.1)
    assert 0.4 < lines.share < 0.7  # 2 of 3.5


@pytest.mark.slow
def test_what_is_said():
    time, values, _ = record(pauses, "12 bits, zero-phase 50 Hz", 0)
    trajectory = Trajectory.from_samples(time, values[:, None], fit="smooth")
    source, doubt = trajectory.warnings
    assert source.startswith("q, dq, ddq, d3q, d4q come from a C6 smoothing spline near the samples of q: ")
    assert doubt.startswith("d4q of column 0 is not determined by the record")
    (column,) = trajectory.fits[0]["columns"]
    assert column["method"] == "smooth"
    assert column["deviation"] > 0.1
    time, values, _ = record(sines, "hum of 50 Hz", 0)
    trajectory = Trajectory.from_samples(time, values[:, None])
    assert any(note.startswith("mains hum of 50 Hz in q of column 0") for note in trajectory.notes)


@pytest.mark.parametrize("count", [8, 9, 30, 100, 300])
def test_short_records(count):
    time = np.arange(count) / 100
    fit = fit_samples(time, np.array([np.sin(time), np.full(count, 0.3)]), 7, 4, SMOOTH)
    assert np.isfinite(fit.at(time, 5)).all()
    assert np.abs(fit.at(time, 1)[0, 1] - 0.3).max() < 100 * EPS


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_vibration_that_may_be_motion_is_kept_by_default_and_said(noise):
    time = np.arange(10001) / 1000
    amplitude, rate = 3e-4, 2 * np.pi * 15
    motion, fourth = sines(time, 0)
    values = motion + amplitude * np.sin(rate * time)
    values += noise * np.random.default_rng(0).standard_normal(len(time))
    with_vibration = fourth + amplitude * rate**4 * np.sin(rate * time)
    size = np.sqrt(np.mean(fourth**2))
    inside = slice(500, -500)
    fit = fit_samples(time, values[None], 7, 4, None)
    assert fit.parts[0].smoothing.lines.others == pytest.approx([15], abs=0.1)
    # nine tenths of the derivative are the vibration
    assert np.sqrt(np.mean((fit.at(time, 5)[4, 0] - with_vibration)[inside] ** 2)) < 0.06 * np.sqrt(
        np.mean(with_vibration**2)
    )
    said = Trajectory.from_samples(time, values[:, None]).warnings
    assert any(
        "a vibration at 15 Hz beyond a smooth motion; if it is noise, set bandwidth: 7.5" in each
        for each in said
    )
    without = Trajectory.from_samples(time, values[:, None], fit="smooth")
    assert any(
        "15 Hz, which is taken for noise; if it is motion, set bandwidth: 30" in each
        for each in without.warnings
    )
    # 8 Hz of noise remain
    smooth = fit_samples(time, values[None], 7, 4, SMOOTH)
    assert np.sqrt(np.mean((smooth.at(time, 5)[4, 0] - fourth)[inside] ** 2)) < 0.05 * size


@pytest.mark.slow
def test_a_bandwidth_says_what_is_motion():
    of = record(sines, "17-bit encoder", 4)
    rate = 2 * np.pi * 15
    shaken = of._replace(values=of.values + 3e-4 * np.sin(rate * of.time))
    narrow, wide = fitted(shaken, bandwidth=4.0), fitted(shaken, bandwidth=30.0)
    assert error(narrow, of) < 0.1
    shaking = of._replace(truth=of.truth + np.array([[0], [3e-4]]) * rate**4 * np.sin(rate * of.time))
    # 17 bits are noise of a tenth of the vibration
    assert error(wide, shaking) < 0.5 < error(narrow, shaking)


@pytest.mark.slow
def test_noise_that_is_known_is_not_estimated():
    """A motion of 2 Hz too small for the noise: one that is said to be small makes it motion."""
    time = np.arange(10001) / 1000
    row = 1e-3 * np.random.default_rng(0).standard_normal(len(time))
    for color, correlation in (("white", 0.0), ("first order", 0.9)):
        values = np.sin(time) + (first_order(row, correlation) if correlation else row)
        free = fit_samples(time, values[None], 7, 4, SMOOTH)
        known = fit_samples(time, values[None], 7, 4, SMOOTH, noise=np.array([1e-3]))
        # what is known of it is true, so little changes
        deviations = [fit.parts[0].smoothing.deviations[0] for fit in (free, known)]
        assert deviations[1] == pytest.approx(deviations[0], rel=0.5), color
        assert known.noise[0] == 1e-3


@pytest.mark.slow
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


@pytest.mark.cases(2)
@pytest.mark.slow
@pytest.mark.parametrize("color", COLORS)
def test_no_record_is_wrong_in_silence(color):
    """A part of the tables of the documentation, which tests/benchmarks/torques.py makes."""
    shown = []
    for motion in (sines, pauses, sweep):
        of = record(motion, color, 300)
        fit = fitted(of)
        assert alarmed(fit) or error(fit, of) < 0.1
        assert motion is pauses or not alarmed(fit)
        inside = (of.time > 0.5) & (of.time < of.time[-1] - 0.5)
        deviation = np.sqrt(fit.covariance(of.time[inside])[0, 4, 4])
        off = fit.at(of.time, 5)[4, 0][inside] - of.truth[1][inside]
        shown.append(np.mean(np.abs(off) < 2 * deviation))
    # of single records it was 80 % at least, of all of a color 96 % and more
    assert min(shown) > 0.8
    assert np.mean(shown) > 0.9


def test_bins_of_half_the_resolution_are_those_of_the_samples():
    time = np.sort(np.random.default_rng(3).uniform(0, 2, 500))
    row = np.cos(time)
    fine, coarse = BinMoments.of(time, row, 64, 7), BinMoments.of(time, row, 32, 7)
    for name in ("powers", "time", "row"):
        # sums of some fifteen positive numbers
        np.testing.assert_allclose(getattr(fine.halved, name), getattr(coarse, name), rtol=100 * EPS)
    bins = Bins.of(coarse)
    place = (time - time[0]) / bins.span
    which = np.minimum((2 * place).astype(int), 31)
    splines = np.stack(uniform_basis(place - which // 2, 7), axis=1)
    sums = np.array([splines[which == k].mean(axis=0) for k in range(32) if (which == k).any()])
    # polynomials of degree 7 whose coefficients are up to some 10
    np.testing.assert_allclose(bins.design, sums, rtol=0, atol=1000 * EPS)


@pytest.mark.slow
def test_long_records_start_from_stretches(monkeypatch):
    """With stretches as short as a second the search ends where that of the whole does."""
    for motion in (pauses, sweep):
        of = record(motion, "white, 1e-5 rad", 5)
        whole = fitted(of)
        monkeypatch.setattr(resolution, "MAX_GRID_SPANS", 64)
        parts = fitted(of)
        monkeypatch.undo()
        assert len(parts.parts[0].knots) == len(whole.parts[0].knots)
        assert error(parts, of) < 1.3 * error(whole, of)  # a tenth of what is stated
        stated = [fit.parts[0].smoothing.relative for fit in (whole, parts)]
        assert stated[1] == pytest.approx(stated[0], rel=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("motion", [sines, random_motion])
def test_the_bias_is_that_of_the_motion(motion):
    """Sines have none at the cut-off; a spectrum that falls slowly has more than the prior expects."""
    of = record(motion, "white, 1e-4 rad", 1)
    fit = fitted(of, SMOOTH)
    inside = of.time[1000:-1000]
    off = fit.at(inside, 5)[4, 0] - of.truth[1][1000:-1000]
    deviation = np.sqrt(fit.covariance(inside)[0, 4, 4])
    assert np.mean(np.abs(off) < 2 * deviation) > 0.85
    # errors are 0.6 and 1.4 of the posterior's own deviation
    assert 0.5 < np.sqrt(np.mean(off**2) / np.mean(deviation**2)) < 1.2


@pytest.mark.slow
def test_filtered_noise_is_said_where_no_resolution_is_accepted():
    of = record(velocity_steps, "zero-phase low-pass, 20 Hz", 0)
    fit = fitted(of)
    # the spline goes through the samples, 29 % off
    assert fit.parts[0].exact
    assert alarmed(fit)


@pytest.mark.slow
def test_a_bandwidth_says_which_lines_are_noise():
    of = record(sines, "17-bit encoder", 4)
    shaken = of.values + 3e-4 * np.sin(2 * np.pi * 15 * of.time)
    for bandwidth, lines in ((8.0, ()), (None, (15,))):
        fit = fit_samples(of.time, shaken[None], 7, 4, SMOOTH, bandwidth=bandwidth)
        assert fit.parts[0].smoothing.lines.others == pytest.approx(lines, abs=0.1)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("samples", [4001, 6001])
def test_hum_of_mains_is_not_followed_where_knots_are_close_enough(samples):
    """At 2 kHz there are four to a period, and two resolutions agree on it as on a motion."""
    of = record(MOTIONS["velocity steps, 200 ms"], "hum of 50 Hz", 61, 2000)
    of = Record(of.time[:samples], of.values[:samples], of.truth[:, :samples])
    fit = fitted(of)
    assert fit.parts[0].smoothing.lines.hum == pytest.approx([50], abs=0.1)
    assert error(fit, of) < 0.5  # a thousand where it was followed


@pytest.mark.slow
def test_the_bias_is_measured_over_a_wide_band():
    """Of this record that at the very cut-off is too small by chance: 65 % of the samples were right then."""
    of = record(MOTIONS["random"], "zero-phase low-pass, 20 Hz", 60, 250)
    fit = fitted(of)
    inside = (of.time > 0.5) & (of.time < of.time[-1] - 0.5)
    off = np.abs(fit.at(of.time, 5)[4, 0] - of.truth[1])
    assert 0.85 < np.mean((off < 2 * np.sqrt(fit.covariance(of.time)[0, 4, 4]))[inside]) < 0.99


@pytest.mark.slow
def test_fitting_tells_how_far_it_is():
    of = record(sines, "white, 1e-4 rad", 0)
    values = np.array([of.values, of.truth[0], np.full(len(of.time), np.nan)])
    for method in (SMOOTH, None):
        counted: list[int] = []

        def progress(steps, counted=counted):
            counted.append(steps)
            return nullcontext(SimpleNamespace(update=counted.append))

        fit_samples(of.time, values, 7, 4, method, progress=progress)
        assert counted == [2 * len(of.time), len(of.time), len(of.time)]


def test_few_samples_are_said_to_be_taken_for_exact():
    for count, said in ((31, True), (32, False)):
        time = np.arange(count) / 10
        trajectory = Trajectory.from_samples(time, np.sin(time)[:, None])
        notes = [note for note in trajectory.notes if "is taken for exact: 31 samples are too few" in note]
        assert bool(notes) is said
