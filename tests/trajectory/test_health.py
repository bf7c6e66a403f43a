"""What a sensor or a log file spoiled is named, with its time; clean records give no warning."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from samples.clean_records import MOTIONS, SENSORS, clean_records

from vsacli.base.signals import POSITION, STIFFNESS, WRENCH
from vsacli.trajectory.recorded.health import check_health, unit_doubts
from vsacli.trajectory.recorded.problems import SampleProblem
from vsacli.trajectory.recorded.samples import (
    SignalSamples,
    elapsed_times,
    even_rate,
    rounding_notes,
    stamp_resolution,
)

RATE = 1000
TIME = np.arange(5001) / RATE
DEVIATION = 1e-5


def record(time: np.ndarray, *rows: np.ndarray, signal=POSITION) -> SignalSamples:
    labels = tuple(map(str, range(len(rows))))
    return SignalSamples.recorded(signal, time, np.array(rows), (None,) * (signal.orders - 1), labels)


def found(time: np.ndarray, *rows: np.ndarray, signal=POSITION) -> list[SampleProblem]:
    return check_health(time, [record(time, *rows, signal=signal)]).problems


def messages(time: np.ndarray, *rows: np.ndarray, signal=POSITION) -> list[str]:
    return list(map(str, found(time, *rows, signal=signal)))


def noisy(seed: int = 0, time: np.ndarray = TIME) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, DEVIATION, len(time))
    return 0.5 * np.sin(2 * np.pi * 0.4 * time) + noise


# Clean records


def test_clean_records_give_no_warning():
    assert [f"{name}: {m}" for name, time, q in clean_records(range(1)) for m in messages(time, q)] == []


@pytest.mark.slow
def test_hundreds_of_clean_records_give_no_warning():
    records = list(clean_records(range(1, 16)))
    assert len(records) == 600
    assert [f"{name}: {m}" for name, time, q in records for m in messages(time, q)] == []


@pytest.mark.parametrize("sensor", SENSORS)
def test_clean_stiffness_and_wrench_give_no_warning(sensor: str):
    rng = np.random.default_rng(1)
    unit = [SENSORS[sensor](rng, MOTIONS[motion](rng)(TIME)) for motion in MOTIONS]
    assert messages(TIME, *(1000 + 100 * row for row in unit), signal=STIFFNESS) == []
    assert messages(TIME, *(20 * row for row in unit), *unit[:2], signal=WRENCH) == []


@pytest.mark.parametrize("start", [0.0, 1.7e9])
@pytest.mark.parametrize("digits", [3, 4, 15])
def test_digits_that_were_cut_off_stamps_are_no_jitter(start: float, digits: int):
    time = np.arange(2001) / 700
    assert messages(start + np.round(time, digits), noisy(time=time)) == []


def test_constants_and_few_samples_give_no_warning():
    assert messages(TIME, np.full_like(TIME, 0.3)) == []
    assert messages(TIME[:4], TIME[:4]) == []


# Outliers


@pytest.mark.parametrize("sample", [0, 1, 2, 17, 2500, 4998, 4999, 5000])
def test_an_outlier_is_named_with_its_time(sample: int):
    q = noisy()
    q[sample] += 62 * DEVIATION
    (problem,) = found(TIME, q)
    assert (problem.quantity, problem.joint, problem.sample) == ("q", 0, sample)
    assert problem.message.startswith(f"is off at t = {TIME[sample]:.3f} s, by 0.0006")


def test_several_outliers_are_summed_up():
    q, samples = noisy(), [300, 301, 1000, 1500, 1504, 4700]
    q[samples] += np.array([50, 60, 100, -300, 80, 60]) * DEVIATION
    (message,) = messages(TIME, q)
    count, farthest = "is off 6 times, first at t = 0\\.300 s", "by up to 0\\.00(29|30)\\d"
    assert re.match(rf"q\[300, 0\] {count}, {farthest} \(at t = 1\.500 s\) from a smooth curve", message)


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_times_are_those_of_the_stamps(start: float):
    q = noisy()
    q[1234] += 0.01
    (message,) = messages(start + TIME, q)
    assert f"at t = {start + 1.234:.3f} s" in message


def test_kinks_and_jumps_are_no_outliers():
    # A kink between samples, a kink at one, a jump.
    q = noisy() + np.maximum(TIME - 1.0004, 0) - np.maximum(TIME - 2, 0) + 0.2 * (TIME > 3)
    assert messages(TIME, q) == []


def test_outliers_of_uneven_stamps():
    time = TIME + 3e-4 * np.random.default_rng(0).uniform(-1, 1, len(TIME))
    q = noisy(time=time)
    q[777] -= 62 * DEVIATION
    jitter, outlier = found(time, q)
    assert jitter.quantity == "time"
    assert outlier.sample == 777


# Frozen and saturated


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_frozen_sensor_is_named(sensor: str):
    q = SENSORS[sensor](np.random.default_rng(0), np.sin(2 * TIME))
    q[1500:1600] = q[1500]
    (problem,) = found(TIME, q)
    assert problem.sample == pytest.approx(1500, abs=3)  # encoders have some equal samples before
    assert re.match(r"is frozen at t = 1\.(500|49\d) s, for (99|10\d) ms,", problem.message)


def test_a_sensor_that_freezes_until_the_end_or_from_the_start():
    q = noisy()
    q[:300] = q[300]
    q[4700:] = q[4700]
    (message,) = messages(TIME, q)
    assert message.startswith("q[0, 0] is frozen 2 times, first at t = 0.000 s, for up to 300 ms (at t = ")


@pytest.mark.parametrize(
    ("samples", "advice"),
    [
        (slice(1500, 1505), "delete all but the first of these rows"),
        (slice(1500, 1506), "cut the recording in two there"),
        (slice(4700, None), "delete these rows"),
    ],
)
def test_a_frozen_sensor_is_cut_out_where_deleted_rows_would_be_a_gap(samples: slice, advice: str):
    q = noisy()
    q[samples] = q[samples.start]
    (message,) = messages(TIME, q)
    count = len(q[samples])
    assert f"{count} equal samples, while the motion goes on: " in message
    assert message.endswith(f"these samples were lost; {advice}, or record again")
    repeated = np.arange(len(q))[samples][1:]
    left = messages(np.delete(TIME, repeated), np.delete(q, repeated))
    assert bool(left) == advice.startswith("cut")


@pytest.mark.parametrize("rows", [2, 3, 5])
def test_values_that_stand_in_several_rows_each(rows: int):
    (message,) = messages(TIME, noisy()[np.arange(len(TIME)) // rows * rows])
    stands = f"has each value in {rows} rows: its sensor is slower than the stamps"
    assert message == f"q[0, 0] {stands}; keep one row in {rows}"


def test_true_pauses_are_not_frozen():
    s = np.clip((TIME - 1) / 2, 0, 1)
    q = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)  # rest to rest in the middle
    for digits in (3, 6, 15):
        assert messages(TIME, np.round(q, digits)) == []


@pytest.mark.parametrize("level", [0.3, -0.3])
def test_a_saturated_sensor_is_named(level: float):
    q = 0.5 * np.sin(2 * np.pi * 0.5 * TIME)
    cut = np.minimum(q, level) if level > 0 else np.maximum(q, level)
    (message,) = messages(TIME, cut)
    first = int(np.argmax(cut == level))
    times = 3 if level > 0 else 2
    assert message.startswith(
        f"q[{first}, 0] is cut off at {level} {times} times, first at t = {TIME[first]:.3f} s, for up to 59"
    )


# Wrapped angles and units


def test_jumps_by_two_pi_are_counted_for_positions_only():
    q = noisy() + 2 * TIME
    wrapped = (q + np.pi) % (2 * np.pi) - np.pi
    (message,) = messages(TIME, wrapped)
    first = int(np.argmax(np.abs(np.diff(wrapped)) > 3)) + 1
    assert message.startswith(f"q[{first}, 0] jumps by 2 pi 2 times, first at t = {TIME[first]:.3f} s")
    assert messages(TIME, 10 + wrapped, signal=STIFFNESS) == []


def test_positions_of_many_turns_look_like_degrees():
    turning = record(TIME, 90 * noisy(), 2 * noisy(), 90 * noisy())
    (doubt,) = unit_doubts([turning], {0: "revolute", 1: "revolute"})
    assert (doubt.joint, doubt.message.startswith("goes to 45 rad, 7.16 turns; are these degrees?")) == (
        0,
        True,
    )
    (doubt,) = unit_doubts([turning], {1: "prismatic", 2: "prismatic"})
    assert (doubt.joint, doubt.message.startswith("goes to 45 m; are these mm?")) == (2, True)


# Stamps


def test_a_gap_is_named():
    kept = (TIME < 2) | (TIME >= 2.4)
    (problem,) = found(TIME[kept], noisy()[kept])
    assert (problem.quantity, problem.sample) == ("time", 2000)
    assert problem.message.startswith("has a gap of 401 ms from t = 1.999 s on; rows are usually 1 ms apart.")


@pytest.mark.parametrize(
    ("factor", "text"),
    [
        (1e3, "looks like ms: rows are 1 s apart, and the recording lasts 5000 s; if rows are 1 ms apart"),
        (1e6, "looks like us: rows are 1000 s apart, and the recording lasts 5e+06 s"),
        (1e9, "looks like ns: "),
        (1e-3, "is hardly in seconds: rows are 1e-06 s apart"),
    ],
)
def test_stamps_in_another_unit(factor: float, text: str):
    (problem,) = found(factor * TIME, noisy())
    assert problem.message.startswith(text)


@pytest.mark.parametrize(
    ("start", "digits", "rate"), [(1.7e9, 6, 1000), (1.7e9, 6, 300), (0, 4, 300), (5, 3, 60)]
)
@pytest.mark.parametrize("lost", [0, 3])
def test_rounded_stamps_of_even_samples_are_even(start: float, digits: int, rate: float, lost: int):
    time = np.delete(np.arange(2001), np.arange(700, 700 + lost)) / rate
    stamps = np.round(start + time, digits)
    # The step is known from the ends, each rounded.
    np.testing.assert_allclose(elapsed_times(stamps), time, atol=2 * stamp_resolution(stamps), rtol=0)
    even = np.diff(elapsed_times(stamps)) * rate
    assert np.abs(even - np.round(even)).max() < 1e-3
    assert rounding_notes(stamps)[0].endswith("s from even, which is their rounding, and are taken for even")


@pytest.mark.parametrize("rate", [1000, 963, 500, 1e4 / 3, 29.97])
@pytest.mark.parametrize(("start", "digits"), [(0, 17), (5, 6), (1.7e9, 7)])
def test_the_rate_of_even_stamps_is_the_one_of_fewest_digits(start: float, digits: int, rate: float):
    found = even_rate(np.round(start + np.arange(501) / rate, digits))
    assert found is not None
    if rate == 1e4 / 3:  # has no few digits; as good as the ends are known
        assert found == pytest.approx(rate, rel=2e-5)
    else:
        assert found == rate


def test_stamps_that_are_not_even_or_miss_some_have_no_rate():
    rng = np.random.default_rng(0)
    time = np.arange(500) / 500
    for stamps in (time + 1e-4 * rng.uniform(-1, 1, 500), np.delete(time, 100), time**1.1):
        assert even_rate(stamps) is None


def test_other_stamps_stay_as_they_are():
    rng = np.random.default_rng(0)
    uneven = np.cumsum(rng.uniform(1, 2, 500)) / 1000
    for stamps in (TIME, uneven, np.round(uneven, 6), TIME**1.1, 1.7e9 + uneven):
        np.testing.assert_array_equal(elapsed_times(stamps), stamps - stamps[0])
        assert rounding_notes(stamps) == ()


def test_stamps_that_jitter():
    late = TIME + np.random.default_rng(0).exponential(2e-4, len(TIME)).clip(max=9e-4)
    message = found(late, noisy())[0].message
    assert re.match(
        r"jitters: steps of about \d\.?\d* (ms|us) change by \d\d % from one to the next\.", message
    )
    assert re.search(r"set rate: (99\d|1000|10\d\d) in a trajectory file$", message)


# Every fault on every sensor

Spoil = Callable[[np.random.Generator, np.ndarray, float], int]


def outlier(rng: np.random.Generator, q: np.ndarray, size: float) -> int:
    sample = int(rng.integers(20, len(q) - 20))
    q[sample] += size * rng.choice([-1, 1])
    return sample


def first_sample(_rng: np.random.Generator, q: np.ndarray, size: float) -> int:
    q[0] += size
    return 0


def frozen(_rng: np.random.Generator, q: np.ndarray, _size: float) -> int:
    sample = int(np.argmax(np.abs(q[40:-40] - q[:-80]))) + 20
    q[sample : sample + 11] = q[sample]
    return sample


SPOILED = {"is off": outlier, "is off at t = 0.000": first_sample, "is frozen": frozen}


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("word", SPOILED)
def test_faults_are_named_on_every_sensor(word: str):
    """Outliers of ten deviations of fourth differences, and ten steps of the encoder; ten frozen steps."""
    total = named = 0
    for name, time, q in clean_records(range(3)):
        if "sweep" in name and "100 Hz" in name:
            continue  # hardly twenty samples a period
        rng = np.random.default_rng(7)
        size = 10 * np.median(np.abs(np.diff(q, 4))) + 10 * 2 * np.pi / 2 ** (12 if "12" in name else 14)
        sample = SPOILED[word](rng, q, size)
        near = [m for m in found(time, q) if word in m.message and abs(m.sample - sample) <= 5]
        total, named = total + 1, named + bool(near)
    assert named >= 0.9 * total
