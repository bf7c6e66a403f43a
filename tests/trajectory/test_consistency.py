"""Given derivatives that follow from their position, and those that do not."""

import re

import numpy as np
import pytest
from samples.marks import slow

from vsacli import Trajectory
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.trajectory.fits import FitChoice
from vsacli.trajectory.recorded.arrays import samples_of_arrays
from vsacli.trajectory.recorded.samples import SampledProfile, SignalSamples

TIME = np.arange(4001) / 1000
RATES = np.array([3.0, 5.0])


def columns(order, time=TIME):
    """Of two joints, (samples, 2)."""
    return RATES**order * np.sin(RATES * time[:, None] + order * np.pi / 2)


def complaints(*given, q=None, noise=0.0, time=TIME, method=None):
    """What is said of derivatives, each (samples, 2) or None, of the joints `base` and `elbow`."""
    q = columns(0, time) if q is None else q
    q = q + noise * np.random.default_rng(0).standard_normal(q.shape)
    missing = [None] * (4 - len(given))
    record = samples_of_arrays(POSITION, time, q, *given, *missing)
    named = SignalSamples(**{**vars(record), "labels": ("base", "elbow")})
    return [w for w in SampledProfile.of(named, FitChoice(method)).warnings if "follow" in w]


@pytest.mark.cases(4)
@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("step", [slow(1), 10, slow(40)])
def test_true_derivatives_follow(noise, step):
    time = TIME[::step]
    true = [columns(order, time) for order in range(1, 5)]
    assert complaints(*true, noise=noise, time=time) == []
    if noise:
        assert complaints(*true, noise=noise, time=time, method="interpolate") == []


@pytest.mark.slow
def test_true_derivatives_follow_a_slow_motion_on_a_few_knots():
    s = TIME[:, None] / 4 * np.ones(2)
    course = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
    true = [course.deriv(order)(s) / 4**order for order in range(1, 5)]
    for noise in (1e-6, 1e-4, 1e-3):
        assert complaints(*true, q=course(s), noise=noise) == []


def test_measured_derivatives_may_be_noisy():
    true = columns(1)
    rough = true + 0.03 * np.random.default_rng(1).standard_normal(true.shape)  # 1.4 and 0.8 % of the peak
    assert complaints(rough) == []


@pytest.mark.cases(4)
@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (180 / np.pi, r"57.3 times as large throughout \(degrees instead of radians\?\)"),
        (np.pi / 180, r"0.0175 times as large throughout \(are the values in degrees\?\)"),
        (-1, r"-1 times as large throughout \(opposite sign\?\)"),
        (1000, r"1e\+03 times as large throughout \(milli-units\?\)"),
        (2, "2 times as large throughout"),
    ],
)
@pytest.mark.parametrize("order", [slow(1), 2, slow(4)])
def test_another_scale_is_recognized(order, factor, said):
    given = [columns(k) for k in range(1, order + 1)]
    given[-1][:, 1] *= factor
    (sentence,) = complaints(*given, noise=1e-6)
    name = POSITION.names[order]
    assert sentence.startswith(f"{name} of elbow does not follow from q: it is ")
    assert re.search(said + "$", sentence)


def test_amounts_and_time_of_a_local_mismatch():
    dq = columns(1)
    dq[2000:2400, 0] += 2.0
    dq[2300, 0] += 0.5
    (sentence,) = complaints(dq)
    assert sentence.startswith("dq of base does not follow from q: it differs by up to 2.5 (")
    assert sentence.endswith(" at t = 2.300 s)")


def test_columns_of_joints_that_were_exchanged():
    exchanged = columns(1)[:, ::-1]
    assert [sentence[:11] for sentence in complaints(exchanged)] == ["dq of base ", "dq of elbow"]


def test_a_joint_that_rests_has_no_rate_to_differ_from():
    q = columns(0)
    q[:, 1] = 0.3
    dq = columns(1)
    dq[:, 1] = 1e-9
    assert complaints(dq, q=q) == []
    dq[:, 1] = 0.5
    (sentence,) = complaints(dq, q=q)
    assert sentence.startswith("dq of elbow does not follow from q: it differs by up to 0.5 (0.5 instead of ")


def test_a_stiffness_and_a_component_without_one():
    stiffness = 1000 + 50 * columns(0)
    rate = 40 * columns(1)
    stiffness[:, 0] = rate[:, 0] = np.nan
    profile = SampledProfile.of(samples_of_arrays(STIFFNESS, TIME, stiffness, rate, None))
    (sentence,) = (w for w in profile.warnings if "follow" in w)
    assert (
        sentence
        == "dstiffness of column 1 does not follow from stiffness: it is 0.8 times as large throughout"
    )


@pytest.mark.parametrize("order", [1, slow(2), 4])
def test_single_false_derivatives_are_left_out_and_said(order):
    true = [columns(k) for k in range(5)]
    given = [rows.copy() for rows in true]
    given[order][[1500, 2200], 1] += 2 * RATES[1] ** order
    trajectory = Trajectory.from_samples(
        TIME, given[0], **dict(zip(POSITION.names[1:], given[1:], strict=True))
    )
    (warning,) = trajectory.warnings
    assert re.search(
        rf"^{POSITION.names[order]}\[1500, 1\] is off 2 times, first at t = 1.500 s, by up to .* left out",
        warning,
    )
    used = getattr(trajectory.block(0, len(TIME)), POSITION.names[order])
    # a polynomial of degree 4 through six samples on either side, 6 ms of a sine of 5 rad/s
    np.testing.assert_allclose(used, true[order], atol=1e-6 * RATES[1] ** order)


def test_false_velocities_near_the_ends_and_false_positions_are_left_out():
    q, dq = columns(0), columns(1)
    dq[3, 0] = dq[-1, 1] = dq[2000, 0] = 0
    q[1000, 0] += 0.01
    trajectory = Trajectory.from_samples(TIME, q, dq=dq)
    assert sum("left out" in warning for warning in trajectory.warnings) == 3
    motion = trajectory.block(0, len(TIME))
    np.testing.assert_allclose(motion.dq, columns(1), atol=1e-4)  # extrapolated by a cubic at the end
    np.testing.assert_allclose(motion.q, columns(0), atol=1e-8)


@pytest.mark.parametrize("difference", [np.gradient, lambda q, t: np.append(np.diff(q) / np.diff(t), 0.0)])
def test_velocities_from_the_steps_of_an_encoder_stay(difference):
    time = np.arange(8001) / 4000
    q = np.round(0.3 * np.sin(2 * time) / 1.5e-3) * 1.5e-3
    dq = difference(q, time)
    dq[-1] = dq[-2]
    trajectory = Trajectory.from_samples(time, q[:, None], dq=dq[:, None])
    np.testing.assert_array_equal(trajectory.block(0, len(time)).dq[:, 0], dq)
