"""How far components may be off that a record does not determine."""

import dataclasses

import numpy as np
import pytest
from samples.noisy_records import MOTIONS, record
from scipy.interpolate import make_interp_spline

from vsacli.trajectory.fits import SMOOTH, fit_samples
from vsacli.trajectory.fits.fit import CAUTION, IMPULSES, SHORTEST_IMPULSE, unresolved, vibrations
from vsacli.trajectory.fits.noise import Lines, is_rounding


@pytest.fixture(scope="module")
def stepwise():
    """A fit of steps of velocity too short for the noise."""
    made = record(MOTIONS["velocity steps, 50 ms"], "12-bit encoder", 0, 250)
    return fit_samples(made.time, made.values[None], 7, 4, SMOOTH)


@pytest.mark.slow
def test_a_component_that_is_not_resolved_has_no_covariance_but_a_bound(stepwise):
    (part,) = stepwise.parts
    assert not part.smoothing.resolved
    time = np.linspace(*part.inside, 4000)
    assert np.isnan(stepwise.covariance(time)).all()
    ((members, bound),) = unresolved(stepwise, 5)
    size = np.sqrt(np.mean(part.at(time, 5)[4] ** 2))
    differ = CAUTION * np.sqrt(part.smoothing.disagreement[4, 4])
    impulses = IMPULSES * np.sqrt(part.smoothing.spread * 250) * size  # as long as a sampling interval
    assert np.sqrt(bound[0, 4, 4]) == pytest.approx(np.hypot(differ, impulses), rel=1e-3)
    assert list(members) == [0]


@pytest.mark.slow
@pytest.mark.parametrize("rate", [250, 2000])
def test_impulses_where_jerk_jumps_are_within_the_bound(rate):
    """Each as long as a sampling interval: the truth is a spline through exact samples that far apart.

    A recording states nothing on torques at frequencies that it does not contain.
    """
    shortest = max(SHORTEST_IMPULSE, 1 / rate)
    motion = MOTIONS["minimum jerk"]
    made = record(motion, "white, 1e-5 rad", 4, rate)
    time = made.time[: min(10 * rate, 8000) + 1]
    fit = fit_samples(time, made.values[None, : len(time)], 7, 4, SMOOTH)
    fine = np.arange(0, time[-1] + shortest / 2, shortest)
    exact = make_interp_spline(fine, motion(fine, 4)[0], k=9)
    start, end = fit.parts[0].inside
    fine = fine[(fine >= start) & (fine <= end)]
    error = np.sqrt(np.mean((fit.at(fine, 5)[4, 0] - exact(fine, nu=4)) ** 2))
    ((_, bound),) = unresolved(fit, 5)
    stated = 2 * np.sqrt(bound[0, 4, 4])
    assert error < stated < 2.5 * error


@pytest.mark.slow
def test_steps_of_velocity_that_are_smooth_have_no_impulses():
    made = record(MOTIONS["velocity steps, 200 ms"], "white, 1e-5 rad", 4, 250)
    (part,) = fit_samples(made.time, made.values[None], 7, 4, SMOOTH).parts
    assert part.smoothing.spread == 0


def test_what_is_resolved_needs_no_bound():
    made = record(MOTIONS["sines"], "white, 1e-4 rad", 0, 250)
    assert not list(unresolved(fit_samples(made.time, made.values[None], 7, 4, SMOOTH), 5))


@pytest.mark.slow
@pytest.mark.parametrize("follows", [False, True])
def test_a_vibration_that_may_be_motion_has_the_covariance_of_a_sine(stepwise, follows):
    (part,) = stepwise.parts
    lines = Lines(others=(3.0, 7.0), share=0.25)
    known = dataclasses.replace(part.smoothing, lines=lines, follows_lines=follows)
    fit = dataclasses.replace(stepwise, parts=(dataclasses.replace(part, smoothing=known),))
    ((member, covariance),) = vibrations(fit, 5)
    assert member == 0
    if follows:
        assert np.isnan(covariance).all()
        return
    rate = 2 * np.pi * 7
    phases = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    amplitude = np.sqrt(2 * 0.25) * stepwise.residual[0]
    sine = [amplitude * rate**k * np.sin(phases + k * np.pi / 2) for k in range(5)]
    # products of derivatives two orders apart cancel to rounding of the larger ones
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    np.testing.assert_allclose(covariance / scale, np.cov(sine, bias=True) / scale, atol=1e-12)


def test_lines_of_the_steps_of_an_encoder_are_no_vibration():
    time = np.arange(4000) / 1000
    step, turn = 2 * np.pi / 2**12, 0.13 * time  # 85 steps a second
    rounded = step * np.round(turn / step)
    assert is_rounding(rounded, rounded - turn)
    shaking = step * np.round((turn + 2 * step * np.sin(2 * np.pi * 30 * time)) / step)
    assert not is_rounding(shaking, shaking - turn)
    noisy = turn + 1e-5 * np.random.default_rng(0).standard_normal(len(time))
    assert not is_rounding(noisy, noisy - turn)
