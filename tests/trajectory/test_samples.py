"""Splines through samples against analytic functions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsacli import InputError
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.trajectory.fits import INTERPOLATE, LEAST_SQUARES, FitChoice
from vsacli.trajectory.recorded.arrays import checked_array, samples_of_arrays
from vsacli.trajectory.recorded.problems import sample_problems, time_problems
from vsacli.trajectory.recorded.samples import SampledProfile

EPS = np.finfo(float).eps


def sine(time, order):
    """sin(2 t) and its derivatives, one joint, shape (samples, 1)."""
    return 2.0**order * np.sin(2 * time + order * np.pi / 2)[:, None]


def record(signal, time, *columns):
    further = [None] * (signal.orders - len(columns))
    return samples_of_arrays(signal, time, *columns, *further)


def profile(signal, time, *columns):
    return SampledProfile.of(record(signal, time, *columns), FitChoice(INTERPOLATE))


def uneven(count, seed=0):
    steps = np.random.default_rng(seed).uniform(0.5, 1.5, count - 1)
    return np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()


@pytest.mark.parametrize(("signal", "degree"), [(POSITION, 7), (STIFFNESS, 5)])
def test_spline_reproduces_polynomials_of_its_degree(signal, degree):
    polynomial = np.polynomial.Polynomial(np.arange(1.0, degree + 2))
    time = uneven(20)
    between = np.linspace(0, 1, 57)
    rows = profile(signal, time, polynomial(time)[:, None]).at(between)
    for order in range(signal.orders):
        expected = polynomial.deriv(order)(between) if order else polynomial(between)
        # rounding eps * 21 of the samples is amplified by 1 / step^order; steps are at least 0.5 / 28.5
        atol = 100 * EPS * 21 * 57**order
        np.testing.assert_allclose(rows[order, 0], expected, rtol=0, atol=atol)


@pytest.mark.parametrize(("signal", "power"), [(POSITION, 8), (STIFFNESS, 6)])
@pytest.mark.parametrize("grid", [lambda n: np.linspace(0, 1, n), uneven])
def test_spline_converges_to_the_function_and_its_derivatives(signal, power, grid):
    time = grid(81)
    between = np.linspace(0, 1, 997)
    rows = profile(signal, time, sine(time, 0)).at(between)
    step = np.diff(time).max()
    for order in range(signal.orders):
        # interpolation of degree power - 1: error of order step^(power-order) |f^(power)|, that <= 2^power;
        # the constant is below 1 inside and some times that in the spans next to the ends
        bound = 3 * 2.0**power * step ** (power - order)
        error = np.abs(rows[order, 0] - sine(between, order)[:, 0]).max()
        assert error < bound
        assert error > 1e-4 * bound  # or the bound says nothing


@pytest.mark.parametrize("signal", [POSITION, STIFFNESS])
def test_highest_derivative_is_continuous_and_the_next_is_not(signal):
    time = uneven(30)
    smooth = profile(signal, time, np.random.default_rng(1).normal(size=(30, 2)))
    knots = smooth.breakpoints[1:-1]
    gap = 1e-9
    before, after = smooth.at(knots - gap)[-1], smooth.at(knots + gap)[-1]
    slope = np.abs(np.diff(smooth.at(knots)[-1]) / np.diff(knots)).max()  # of the piecewise linear derivative
    assert np.abs(after - before).max() < 4 * gap * slope
    # not-a-knot: the second and the third sample, and the last ones, are no knots
    margin = (signal.spline_degree + 1) // 2
    np.testing.assert_array_equal(knots, time[margin:-margin])


def test_derivatives_are_smooth_to_rounding_within_a_span():
    time = np.linspace(0, 1, 1001)
    smooth = profile(POSITION, time, sine(time, 0))
    step = 2.0**-14  # a sixteenth of the sample step
    center = 0.5005
    rows = smooth.at(center + step * np.arange(-3, 4))
    for order in range(4):
        # up to the fifth degree this difference formula is exact, so only rounding of the values is left
        difference = rows[order, 0] @ np.array([-1, 9, -45, 0, 45, -9, 1]) / 60 / step
        rounding = 8 * EPS * np.abs(rows[order]).max() / step
        assert abs(difference - rows[order + 1, 0, 3]) < rounding


def test_given_columns_pass_through_and_the_others_come_from_the_spline():
    time = np.linspace(0, 1, 50)
    q, given = sine(time, 0), 1.01 * sine(time, 2)
    mixed = profile(POSITION, time, q, None, given)
    rows = mixed.samples(10, 20, time[10:20])
    np.testing.assert_array_equal(rows[0, 0], q[10:20, 0])
    np.testing.assert_array_equal(rows[2, 0], given[10:20, 0])
    np.testing.assert_array_equal(rows[[1, 3, 4]], mixed.at(time[10:20])[[1, 3, 4]])
    unreliable = "derivatives are unreliable in the first 0.143 s and the last 0.143 s"  # 7 of 49 steps
    assert mixed.warnings == (f"dq, d3q, d4q come from a C6 spline through q; {unreliable}",)


def test_at_uses_no_given_derivatives_that_do_not_belong_together():
    time = np.linspace(0, 1, 50)
    plain = profile(POSITION, time, sine(time, 0))
    full = profile(POSITION, time, *(1.01 * sine(time, order) for order in range(4)), 1.11 * sine(time, 4))
    np.testing.assert_allclose(full.at(time), 1.01 * plain.at(time), rtol=1e-9, atol=1e-4)
    given = np.stack([1.01 * sine(time, order)[:, 0] for order in range(4)])
    np.testing.assert_array_equal(full.samples(0, 50, time)[:4, 0], given)
    assert not full.known_between


def test_single_missing_derivative_is_named():
    time = np.linspace(0, 1, 50)
    unreliable = "derivatives are unreliable in the first 0.102 s and the last 0.102 s"  # 5 of 49 steps
    assert profile(STIFFNESS, time, 850 + sine(time, 0), sine(time, 1)).warnings == (
        f"ddstiffness comes from a C4 spline through stiffness; {unreliable}",
    )


@pytest.mark.parametrize(("signal", "count"), [(POSITION, 8), (STIFFNESS, 6)])
def test_fewest_samples_give_one_polynomial(signal, count):
    time = np.linspace(0, 1, count)
    few = profile(signal, time, 2 + sine(time, 0))
    assert list(sample_problems([few.record])) == []
    np.testing.assert_array_equal(few.breakpoints, [0, 1])
    # rounding of a Taylor polynomial over the whole span, with the condition of interpolation at 8 samples
    np.testing.assert_allclose(few.at(time)[0, 0], 2 + sine(time, 0)[:, 0], rtol=0, atol=1000 * EPS)

    too_few = record(signal, time[1:], sine(time, 0)[1:] + 2)
    problems = [str(problem) for problem in sample_problems([too_few])]
    words = f"has {count - 1} samples; a trajectory needs at least {count}"
    assert problems == [f"{signal.names[0]} {words}"]


def test_problems_of_values_name_the_first_sample_of_each_column():
    time = np.linspace(0, 0.7, 8)
    values = np.full((8, 2), 800.0)
    values[3:5, 1] = 0
    values[6, 0] = np.nan
    rates = np.zeros((8, 2))
    rates[2, 0] = np.inf
    problems = [str(problem) for problem in sample_problems([record(STIFFNESS, time, values, rates)])]
    assert problems == [
        "stiffness[6, 0] must be finite, not nan (t = 0.600 s)",
        "dstiffness[2, 0] must be finite, not inf (t = 0.200 s)",
        "stiffness[3, 1] must be positive, not 0 (t = 0.300 s; 2 such samples)",
    ]


def test_positions_may_be_negative():
    time = np.linspace(0, 1, 8)
    assert list(sample_problems([record(POSITION, time, -np.ones((8, 1)))])) == []


@pytest.mark.parametrize(
    ("times", "message"),
    [
        (
            [0, 1, 1, 0],
            "time[2] must increase, but 1 s appears twice (2 such rows); correct these "
            "stamps, or set rate: 1 in their place if the rows are equally spaced",
        ),
        (
            [0, 2, 1],
            "time[2] must increase, but 1 s follows 2 s; correct these "
            "stamps, or set rate: 0.5 in their place if the rows are equally spaced",
        ),
        ([0, 1, np.nan, 0], "time[2] must be finite, not nan"),
        ([-np.inf, 1], "time[0] must be finite, not -inf"),
    ],
)
def test_times_increase_strictly(times, message):
    assert [str(problem) for problem in time_problems(np.array(times, dtype=float))] == [message]


@pytest.mark.parametrize("times", [[], [1.0], [-1.0, 0.0, 1e-300]])
def test_times_without_problem(times):
    assert list(time_problems(np.array(times))) == []


@pytest.mark.parametrize(
    ("array", "message"),
    [
        ([[1.0, 2.0]] * 4, r"q has the shape \(4, 2\), expected \(3, any\)"),
        ([1.0, 2.0, 3.0], r"q has the shape \(3,\), expected \(3, any\)"),
        ([[1.0], [2.0, 3.0], [4.0]], "q must be an array of numbers"),
        ([["one"], ["two"], ["three"]], "q must be an array of numbers: could not convert"),
        (None, r"q has the shape \(\), expected \(3, any\)"),
    ],
)
def test_arrays_have_the_shape_that_is_expected(array, message):
    with pytest.raises(InputError, match=message):
        checked_array("q", array, 3, None)


def test_derivatives_have_as_many_joints_as_the_values():
    with pytest.raises(InputError, match=r"dq has the shape \(7, 1\), expected \(7, 2\)"):
        record(POSITION, np.arange(7.0), np.zeros((7, 2)), np.zeros((7, 1)))


@pytest.mark.parametrize("times", [np.arange(8) * 1e-31, np.arange(8) * 1e30])
def test_times_go_on_for_a_while(times):
    (problem,) = time_problems(times)
    assert str(problem).startswith("time must go on for 1e-30 to 1e+30 s, not ")


sizes = st.floats(-300, 99).map(lambda power: 10.0**power)
scales = st.floats(-29, 28).map(lambda power: 10.0**power)


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("_repetition", range(3))
@settings(deadline=None, max_examples=35)  # the first imports SciPy
@given(
    seed=st.integers(0, 1000),
    count=st.integers(8, 40),
    size=sizes,
    scale=scales,
    spread=st.sampled_from([0, 1, 5]),
    decimals=st.integers(0, 20),
    method=st.sampled_from([None, LEAST_SQUARES, INTERPOLATE]),
)
def test_no_record_breaks_a_fit(_repetition, seed, count, size, scale, spread, decimals, method):
    rng = np.random.default_rng(seed)
    time = scale * np.cumsum(10.0 ** (spread * rng.uniform(-1, 0, count)))
    values = size * np.round(rng.normal(size=(count, 2)), decimals)
    samples = record(POSITION, time, values, size * rng.normal(size=(count, 2)))
    if not [*time_problems(time), *sample_problems([samples])]:
        found = SampledProfile.of(samples, FitChoice(method))
        with np.errstate(over="ignore", invalid="ignore"):  # 1e99 in 1e-29 s, to the fourth power
            assert found.samples(0, count, samples.time).shape == (5, 2, count)
        assert found.breakpoints[[0, -1]].tolist() == samples.time[[0, -1]].tolist()
