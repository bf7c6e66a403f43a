"""The recordings that judge fits are what they say, and the torques they are judged by are right."""

from itertools import pairwise

import numpy as np
import pytest
from oracles.one_joint import motor_torque
from oracles.wiener import attainable_error
from samples.laboratory_filters import FAMILIES, SINGLE, Stage
from samples.random_recordings import NOISES, SHAPES, draw
from samples.recorded_torques import robot_of
from scipy.signal import bessel, butter, cheby1, cheby2, firwin, lfilter, sosfilt

from vsacli import Motion, motor_torques

SEEDS = range(0, 24, 2)


@pytest.mark.parametrize("seed", SEEDS)
def test_torques_in_closed_form_are_those_of_the_recursion(seed):
    recording = draw(seed)
    q, stiffness = recording.truth
    commanded = np.full((3, len(recording.time)), np.nan) if stiffness is None else stiffness
    names = ("q", "dq", "ddq", "d3q", "d4q", "stiffness", "dstiffness", "ddstiffness")
    arrays = {name: row[:, None] for name, row in zip(names, (*q, *commanded), strict=True)}
    found = motor_torques(robot_of(recording.arm), Motion.of(recording.time, arrays)).tau_motor[:, 0]
    expected = motor_torque(recording.arm, q, stiffness).T
    # rounding: at most 1e-15 of the largest was seen
    np.testing.assert_allclose(found[:, : expected.shape[1]], expected, atol=1e-13 * np.abs(expected).max())


def test_a_seed_determines_the_recording_and_others_differ():
    first, again, other = draw(4), draw(4), draw(6)
    assert np.array_equal(first.position.recorded, again.position.recorded)
    assert first.facts == again.facts != other.facts


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_design_half_has_every_filter_noise_and_motion():
    drawn = [draw(seed) for seed in range(0, 240, 2)]
    assert {each.filter.family for each in drawn} == set(FAMILIES)
    assert {each.noise.kind for each in drawn} == set(NOISES)
    assert {each.motion for each in drawn} == set(SHAPES)
    assert {stage.kind for each in drawn for stage in each.filter.stages} == {
        name.removesuffix(" zero-phase").removesuffix(" causal") for name in SINGLE
    }


@pytest.mark.parametrize("seed", SEEDS)
def test_derivatives_are_those_of_the_values_before(seed):
    recording = draw(seed)
    for rows in (each for each in recording.truth if each is not None):
        for lower, upper in pairwise(rows):
            integral = np.cumsum((upper[1:] + upper[:-1]) / 2) / recording.rate
            # the trapezoidal rule at some 10 samples a wave and more
            assert (
                np.abs(lower[1:] - lower[0] - integral).max()
                <= 0.05 * np.ptp(lower) + 1e-12 * np.abs(lower).max()
            )


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_is_as_large_as_drawn_before_the_filter(seed):
    signal, level = draw(seed).position, draw(seed).noise.level
    assert np.sqrt(signal.density.mean()) == pytest.approx(level, rel=0.1)


def test_a_stage_filters_as_scipy_does_once_its_transient_is_over():
    rng, rate, period = np.random.default_rng(1), 500.0, 4000
    values = rng.standard_normal(period)
    designs = {
        "Butterworth": butter(4, 20, fs=rate, output="sos"),
        "Chebyshev I": cheby1(4, 0.5, 20, fs=rate, output="sos"),
        "Chebyshev II": cheby2(4, 0.5, 20, fs=rate, output="sos"),
        "Bessel": bessel(4, 20, fs=rate, output="sos", norm="mag"),
    }
    for kind, sections in designs.items():
        gain = Stage(kind, 4, 20.0, False, 0.5, "hann").response(period, rate)
        expected = sosfilt(sections, np.tile(values, 3))[2 * period :]
        np.testing.assert_allclose(np.fft.irfft(gain * np.fft.rfft(values), period), expected, atol=1e-9)
    gain = Stage("FIR", 51, 20.0, False, 0.5, "hann").response(period, rate)
    expected = lfilter(firwin(51, 20, window="hann", fs=rate), 1, np.tile(values, 2))[period:]
    np.testing.assert_allclose(np.fft.irfft(gain * np.fft.rfft(values), period), expected, atol=1e-12)


@pytest.mark.slow
def test_the_oracle_is_better_the_smaller_the_noise_is():
    recording = draw(0)
    position = recording.position
    exact = np.fft.irfft(position.series, len(position.values))
    errors = []
    for share in (1.0, 0.1):
        less = position._replace(
            values=exact + share * (position.values - exact), density=share**2 * position.density
        )
        errors.append(attainable_error(recording._replace(position=less)))
    assert errors[1] < 0.7 * errors[0] < 0.03
