import numpy as np
import pytest

from vsacli import InputError
from vsacli.trajectory.times import RecordedTimes, ResampledTimes, UniformTimes


@pytest.mark.parametrize(("duration", "rate"), [(4.0, 1000.0), (0.3, 1000.0), (0.1, 30.0), (1 / 3, 12345.0)])
def test_uniform_times_are_k_duration_over_n_and_end_exactly(duration, rate):
    times = UniformTimes(duration, rate)
    n = round(duration * rate)
    assert times.samples == n + 1
    assert times.span == (0.0, duration)
    whole = times.block(0, times.samples)
    np.testing.assert_array_equal(whole[:-1], [k * duration / n for k in range(n)])
    assert whole[-1] == duration


def test_last_time_is_the_duration_even_where_k_duration_over_n_is_not():
    duration, n = next(
        (duration, n)
        for n in range(3, 100)
        for duration in (0.1, 0.3, 0.7, 1.1)
        if n * duration / n != duration
    )
    assert UniformTimes(duration, n / duration).block(0, n + 1)[-1] == duration


@pytest.mark.parametrize(
    "times", [UniformTimes(1.0, 10.0), ResampledTimes(2.0, 3.0, 10.0), RecordedTimes(np.linspace(0, 1, 11))]
)
def test_blocks_are_slices_of_the_whole(times):
    whole = times.block(0, 11)
    for start, stop in [(0, 4), (4, 8), (8, 11), (8, 99), (11, 12), (3, 3)]:
        np.testing.assert_array_equal(times.block(start, stop), whole[start:stop])


def test_resampled_times_keep_their_rate_and_their_ends():
    times = ResampledTimes(1.7e9, 1.7e9 + 0.5, 500.0)
    slower = times.stretched(1.028)
    assert (times.samples, slower.samples) == (251, 258)
    assert slower.span == (1.7e9, 1.7e9 + 0.514)
    whole = slower.block(0, 258)
    assert (whole[0], whole[-1]) == slower.span
    # stamps since 1970 are multiples of 2.4e-7 s
    np.testing.assert_allclose(np.diff(whole), 0.002, rtol=0, atol=5e-7)
    assert ResampledTimes(2.0, 2.25, 10.0).notes == (
        "the rate is 8 Hz, not 10 Hz, for a whole number of intervals in 0.25 s",
    )
    with pytest.raises(InputError, match="duration and rate must be positive"):
        ResampledTimes(0.0, 1.0, 0.0)


def test_rate_that_does_not_fit_is_noted():
    assert UniformTimes(4.0, 1000.0).notes == ()
    assert UniformTimes(0.3, 1000.0).notes == ()  # 0.3 * 1000 is a whole number but for rounding
    assert UniformTimes(0.25, 10.0).notes == (
        "the rate is 8 Hz, not 10 Hz, for a whole number of intervals in 0.25 s",
    )


def test_there_is_at_least_one_step():
    times = UniformTimes(0.01, 10.0)
    np.testing.assert_array_equal(times.block(0, 2), [0.0, 0.01])
    assert times.notes == ("the rate is 100 Hz, not 10 Hz, for a whole number of intervals in 0.01 s",)


@pytest.mark.parametrize(
    ("duration", "rate"), [(0.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (np.nan, 1.0), (1.0, np.inf)]
)
def test_duration_and_rate_are_positive(duration, rate):
    with pytest.raises(InputError, match="duration and rate must be positive"):
        UniformTimes(duration, rate)


def test_number_of_steps_is_limited():
    with pytest.raises(InputError, match=r"gives 1e\+300 samples; at most 1e\+09"):
        UniformTimes(1e297, 1e3)


def test_recorded_times_span_from_first_to_last():
    times = RecordedTimes(np.array([0.5, 0.6, 2.0]))
    assert (times.span, times.samples, times.notes) == ((0.5, 2.0), 3, ())
