"""Sums of sinusoids against symbolic derivatives."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
import sympy
from samples.marks import slow

from vsacli import InputError
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.trajectory.curves.sinusoids import Sinusoids

EPS = np.finfo(float).eps
SPAN = (0.25, 8.25)
CYCLES = 2
OFFSET = (0.5, -1.0)
SINE = ((0.25, 0.5), (-0.125, 0.25))
COSINE = ((0.5, 0.0), (0.0, -0.25), (0.125, 0.0625))
TIMES = (0.25, 0.5, 1.0, 2.0, 2.25, 3.875, 6.25, 7.0, 8.0, 8.25)


def sinusoids(ramp=0.0, span=SPAN, cycles=CYCLES, sine=SINE, cosine=COSINE, signal=POSITION):
    return Sinusoids(
        signal=signal, span=span, cycles=cycles, offset=OFFSET, sine=sine, cosine=cosine, ramp=ramp
    )


@functools.cache
def derivatives(joint, ramped):
    """Value and four derivatives as functions of time, by formulas for rise, middle and fall."""
    t, x = sympy.symbols("t x")
    w = 2 * sympy.pi * CYCLES / 8
    elapsed = t - sympy.Rational(1, 4)
    series = sum(sympy.Rational(a[joint]) * sympy.sin(k * w * elapsed) for k, a in enumerate(SINE, start=1))
    series += sum(
        sympy.Rational(a[joint]) * sympy.cos(k * w * elapsed) for k, a in enumerate(COSINE, start=1)
    )
    bell = sympy.integrate((x * (1 - x)) ** 4, (x, 0, x))
    rise = (bell / bell.subs(x, 1)).subs(x, elapsed / 2)
    fall = (bell / bell.subs(x, 1)).subs(x, (8 - elapsed) / 2)
    windows = (rise, sympy.Integer(1), fall) if ramped else (sympy.Integer(1),) * 3
    forms = [sympy.Rational(OFFSET[joint]) + window * series for window in windows]
    return [[sympy.lambdify(t, form.diff(t, order), "mpmath") for order in range(5)] for form in forms]


@pytest.mark.parametrize("signal", [POSITION, STIFFNESS], ids=lambda signal: signal.key)
@pytest.mark.parametrize("ramped", [False, True])
@pytest.mark.parametrize("joint", [0, slow(1)])
def test_derivatives_are_exact_to_rounding(joint, ramped, signal):
    rows = sinusoids(0.25 if ramped else 0.0, signal=signal).at(np.array(TIMES))
    assert len(rows) == signal.orders
    forms = derivatives(joint, ramped)
    for order in range(signal.orders):
        expected = [float(forms[0 if t < 2.25 else 1 if t <= 6.25 else 2][order](t)) for t in TIMES]
        # a few roundings, of angles up to 38 too
        atol = 60 * EPS * np.abs(expected).max()
        np.testing.assert_allclose(rows[order, joint], expected, rtol=0, atol=atol)


def test_it_repeats_with_the_period():
    time = SPAN[0] + np.linspace(0, 4, 33)
    once, again = sinusoids().at(time), sinusoids().at(time + 4)
    for order in range(5):
        np.testing.assert_allclose(again[order], once[order], atol=100 * EPS * np.abs(once[order]).max())


def test_a_ramp_begins_and_ends_at_rest_at_the_offset_exactly():
    ends = sinusoids(ramp=0.5).at(np.array(SPAN))
    np.testing.assert_array_equal(ends[0], np.transpose([OFFSET] * 2))
    assert not ends[1:].any()
    assert sinusoids().at(np.array(SPAN))[1].any()


def test_between_the_ramps_nothing_changes():
    time = np.linspace(2.25, 6.25, 17)
    np.testing.assert_array_equal(sinusoids(ramp=0.25).at(time), sinusoids().at(time))


def test_breakpoints_are_the_ends_of_the_ramps():
    np.testing.assert_array_equal(sinusoids().breakpoints, SPAN)
    np.testing.assert_array_equal(sinusoids(ramp=0.25).breakpoints, [0.25, 2.25, 6.25, 8.25])
    np.testing.assert_array_equal(sinusoids(ramp=0.5).breakpoints, [0.25, 4.25, 8.25])


def test_a_slower_one_has_a_lower_frequency_and_longer_ramps():
    fast, slow = sinusoids(0.25), sinusoids(0.25).stretched(1.5)
    np.testing.assert_array_equal(slow.breakpoints, [0.25, 3.25, 9.25, 12.25])
    time = np.linspace(*SPAN, 41)
    before, after = fast.at(time), slow.at(0.25 + 1.5 * (time - 0.25))
    for order in range(5):
        expected = before[order] / 1.5**order
        np.testing.assert_allclose(after[order], expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("ramp", [0.0, 0.25])
def test_samples_do_not_depend_on_the_block(ramp):
    profile = sinusoids(ramp)
    time = np.linspace(*SPAN, 501)
    whole = profile.at(time)
    for size in (1, 7, 64):
        parts = [profile.at(time[start : start + size]) for start in range(0, 501, size)]
        np.testing.assert_array_equal(np.concatenate(parts, axis=2), whole)


@pytest.mark.parametrize("ramp", [0.0, slow(0.02), 0.4, slow(0.5)])
@pytest.mark.parametrize("cycles", [0.3, 2, 7.4])
def test_the_lowest_value_is_that_of_a_dense_scan(cycles, ramp):
    profile = sinusoids(ramp, cycles=cycles)
    time = np.linspace(*SPAN, 40_001)
    values, _, bend, *_ = profile.at(time)
    lowest = profile.lowest()
    np.testing.assert_array_equal(profile.at(lowest.at)[0].diagonal(), lowest.value)
    # between samples 0.2 ms apart, an extreme lies at most h^2/8 |q''| beyond
    beyond = (8 / 40_000) ** 2 / 8 * 1.01 * np.abs(bend).max(axis=1)
    assert np.all(lowest.value <= values.min(axis=1) + 20 * EPS)
    assert np.all(lowest.value >= values.min(axis=1) - beyond - 20 * EPS)


def test_a_billion_periods_and_components_without_a_value_have_a_lowest_one():
    many = sinusoids(ramp=0.5, cycles=1e9).lowest()
    np.testing.assert_allclose(many.value, sinusoids().lowest().value, rtol=1e-6)
    one = Sinusoids(
        signal=STIFFNESS, span=SPAN, cycles=1.0, offset=(9.0, math.nan), sine=((2.0, 1.0),), cosine=()
    )
    np.testing.assert_array_equal(one.lowest().value, [7.0, math.nan])
    assert one.lowest().at[0] == pytest.approx(6.25, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sine": ((1.0,),)}, "offset, sine and cosine must have the same number of components"),
        ({"cycles": 0.0}, "the number of cycles must be positive, not 0"),
        ({"cycles": math.inf}, "the number of cycles must be positive, not inf"),
        ({"ramp": 0.6}, "a ramp must take at most half of the time, not 0.6 of it"),
        ({"ramp": -0.1}, "a ramp must take at most half of the time, not -0.1 of it"),
    ],
)
def test_what_no_excitation_can_be_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        sinusoids(**options)
