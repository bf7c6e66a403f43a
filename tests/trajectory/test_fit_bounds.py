"""How far components may be off that a record does not determine."""

import dataclasses

import numpy as np
import pytest
from samples.noisy_records import MOTIONS, record

from vsacli.trajectory.fits import SMOOTH, fit_samples
from vsacli.trajectory.fits.bounds import CAUTION, unresolved, vibrations
from vsacli.trajectory.fits.spectral_lines import Lines, is_rounding


@pytest.fixture(scope="module")
def stepwise():
    """A fit of steps of velocity too short for the noise."""
    made = record(MOTIONS["velocity steps, 50 ms"], "12-bit encoder", 0, 250)
    return fit_samples(made.time, made.values[None], 7, 4, SMOOTH)


def test_a_component_that_is_not_resolved_has_no_covariance_but_a_bound(stepwise):
    (part,) = stepwise.parts
    assert not part.smoothing.resolved
    time = np.linspace(*part.inside, 500)
    assert np.isnan(stepwise.covariance(time)).all()
    (bound,) = unresolved(stepwise, 5)
    found = np.sqrt(np.mean(bound.covariance(time)[0, 4, 4]))
    size = np.sqrt(np.mean(part.at(time, 5)[4] ** 2))
    assert found == pytest.approx(CAUTION * part.smoothing.relative * size)
    assert list(bound.members) == [0]


def test_what_is_resolved_needs_no_bound():
    made = record(MOTIONS["sines"], "white, 1e-4 rad", 0, 250)
    assert not list(unresolved(fit_samples(made.time, made.values[None], 7, 4, SMOOTH), 5))


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
