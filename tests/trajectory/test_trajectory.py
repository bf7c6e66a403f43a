"""Trajectories: profiles over the same steps."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from vsacli import InputError, Trajectory
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.documents.source import Source
from vsacli.trajectory.curves import ConstantProfile, RestToRest
from vsacli.trajectory.curves.steps import PiecewiseProfile
from vsacli.trajectory.recorded.arrays import samples_of_arrays
from vsacli.trajectory.recorded.samples import SampledProfile
from vsacli.trajectory.times import RecordedTimes, UniformTimes

EPS = np.finfo(float).eps
NAMES = [*POSITION.names, *STIFFNESS.names]
JOINTS = 2


def rest_to_rest(signal, degree, span, low, high):
    return RestToRest(signal=signal, span=span, degree=degree, start=(low,) * JOINTS, end=(high, 2 * high))


def polynomial(duration=2.0, rate=50.0, **options):
    times = UniformTimes(duration, rate)
    position = rest_to_rest(POSITION, 7, times.span, -0.5, 1.0)
    stiffness = rest_to_rest(STIFFNESS, 3, times.span, 850.0, 1200.0)
    return Trajectory(times, position, {"stiffness": stiffness}, **{"name": "test", **options})


def sampled(original, *given):
    motion = original.block(0, original.samples)
    columns = {name: motion.of_joints[name] for name in given}
    return Trajectory.from_samples(motion.time, motion.q, motion.commanded["stiffness"], **columns)


def random_samples(count, joints=1):
    time = np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, count))
    q = np.sin(time[:, None] + np.arange(joints))
    return Trajectory.from_samples(time, q, 900 + 10 * q, fit="interpolate")


def test_shapes_are_samples_joints_with_contiguous_samples():
    trajectory = polynomial()
    for motion in (
        trajectory.block(10, 15),
        trajectory.at(np.linspace(0, 2, 5)),
        sampled(trajectory).block(0, 5),
    ):
        assert motion.time.shape == (5,)
        for name in NAMES:
            assert motion.of_joints[name].shape == (5, JOINTS)
            assert motion.of_joints[name].T.flags.c_contiguous


def test_block_is_the_function_at_the_steps():
    trajectory = polynomial()
    assert (trajectory.samples, trajectory.duration, trajectory.joints) == (101, 2.0, JOINTS)
    block = trajectory.block(90, 999)
    np.testing.assert_array_equal(block.time, trajectory.times.block(90, 101))
    again = trajectory.at(block.time)
    for name in NAMES:
        np.testing.assert_array_equal(block.of_joints[name], again.of_joints[name])
    assert block.time[-1] == 2.0
    np.testing.assert_array_equal(block.q[-1], [1.0, 2.0])
    np.testing.assert_array_equal(block.commanded["stiffness"][-1], [1200.0, 2400.0])


def test_warnings_and_notes_of_all_parts_and_sources_are_collected():
    times = UniformTimes(0.25, 10.0)
    still = ConstantProfile(signal=POSITION, span=times.span, value=(0.0,))
    firm = ConstantProfile(signal=STIFFNESS, span=times.span, value=(850.0,))
    source = Source("a.yaml", "0" * 64, "")
    trajectory = Trajectory(
        times, still, {"stiffness": firm}, name="hold", warnings=["odd"], notes=["first"], sources=[source]
    )
    assert trajectory.warnings == ("odd",)
    assert trajectory.notes == ("first", *times.notes)
    assert len(times.notes) == 1
    assert trajectory.sources == (source,)
    assert trajectory.name == "hold"


def test_parts_have_the_same_joints():
    times = UniformTimes(1.0, 10.0)
    still = ConstantProfile(signal=POSITION, span=times.span, value=(0.0, 0.0, 0.0))
    firm = ConstantProfile(signal=STIFFNESS, span=times.span, value=(850.0,))
    with pytest.raises(InputError, match="the position has 3 joints, the stiffness 1"):
        Trajectory(times, still, {"stiffness": firm}, name="test")


@pytest.mark.parametrize("part", ["position", "stiffness"])
def test_parts_have_the_span_of_the_steps(part):
    times = UniformTimes(1.0, 10.0)
    spans = {"position": times.span, "stiffness": times.span, part: (0.0, 2.0)}
    still = ConstantProfile(signal=POSITION, span=spans["position"], value=(0.0,))
    firm = ConstantProfile(signal=STIFFNESS, span=spans["stiffness"], value=(850.0,))
    with pytest.raises(InputError, match=f"the {part} spans 0 to 2 s, the steps 0 to 1 s"):
        Trajectory(times, still, {"stiffness": firm}, name="test")


def test_samples_that_are_given_come_back_as_they_are():
    original = polynomial()
    copy = sampled(original, *POSITION.names[1:], *STIFFNESS.names[1:])
    assert copy.warnings == ()
    for start, stop in [(0, 40), (40, 101)]:
        ours, theirs = copy.block(start, stop), original.block(start, stop)
        for name in ("time", *NAMES):
            np.testing.assert_array_equal(ours.variables()[name], theirs.variables()[name])


def test_missing_derivatives_approach_the_true_ones():
    original = polynomial(rate=200.0)
    copy = sampled(original)
    assert copy.warnings == (
        "dq, ddq, d3q, d4q come from a C6 spline through q;"
        " derivatives are unreliable in the first 0.035 s and the last 0.035 s",  # 7 steps
        "dstiffness, ddstiffness come from a C4 spline through stiffness;"
        " derivatives are unreliable in the first 0.025 s and the last 0.025 s",  # 5 steps
    )
    ours, theirs = copy.block(0, 401), original.block(0, 401)
    # a cubic stiffness is its own spline up to rounding, amplified by 1 / step^2
    for order, name in enumerate(STIFFNESS.names):
        error = np.abs(ours.of_joints[name] - theirs.of_joints[name]).max()
        assert error < 100 * EPS * 2400 * 200**order
    # so is a position of degree 7; rounding is amplified 850 times at the ends, inside 37 times
    for order, name in enumerate(POSITION.names):
        error = np.abs(ours.of_joints[name] - theirs.of_joints[name])
        assert error.max() < 1000 * EPS * 3 * 200**order
        assert error[10:-10].max() < 100 * EPS * 3 * 200**order


@pytest.mark.parametrize("recorded", ["position", "stiffness"])
def test_recorded_and_closed_form_parts_mix(recorded):
    original = polynomial()
    whole = original.block(0, 101)
    parts = {"position": original.position, "stiffness": original.commanded["stiffness"]}
    signal, values = {
        "position": (POSITION, whole.q),
        "stiffness": (STIFFNESS, whole.commanded["stiffness"]),
    }[recorded]
    record = samples_of_arrays(signal, whole.time, values, *[None] * (signal.orders - 1))
    parts[recorded] = SampledProfile.of(record)
    position, stiffness = parts.values()
    mixed = Trajectory(RecordedTimes(whole.time), position, {"stiffness": stiffness}, name="mixed")
    block = mixed.block(30, 60)
    for name in ("q", "stiffness"):
        np.testing.assert_array_equal(block.of_joints[name], whole.of_joints[name][30:60])
    assert len(mixed.warnings) == 1


def test_check_points_of_polynomials_are_spread_evenly():
    time, reach = polynomial(duration=2.0).check_points(4)
    np.testing.assert_array_equal(time, [0.25, 0.75, 1.25, 1.75])
    np.testing.assert_array_equal(reach, [0.25, 0.75, 0.75, 0.25])


@pytest.mark.slow
def test_check_points_of_many_knots_are_the_middles_of_their_spans():
    trajectory = random_samples(1000)
    time, reach = trajectory.check_points(50)
    ends = trajectory.times.time
    before = np.searchsorted(ends, time) - 1
    np.testing.assert_allclose(time, (ends[before] + ends[before + 1]) / 2, rtol=2 * EPS)
    np.testing.assert_allclose(reach, np.diff(ends)[before] / 2, rtol=1e-12)  # difference of times up to 1000
    even = ends[0] + trajectory.duration * (np.arange(50) + 0.5) / 50
    assert np.abs(time - even).max() < 0.75  # half the longest span: each stays in its own


@pytest.mark.parametrize("count", [1, 7, 50])
@pytest.mark.parametrize("samples", [8, 10, 30])
def test_check_points_keep_within_one_analytic_piece(samples, count):
    trajectory = random_samples(samples)
    time, reach = trajectory.check_points(count)
    assert time.shape == reach.shape == (count,)
    assert np.all(np.diff(time) > 0) or samples < count
    assert np.all(reach > 0)
    profiles = trajectory.position, trajectory.commanded["stiffness"]
    knots = trajectory.start + np.concatenate([profile.breakpoints for profile in profiles])
    nearest = np.abs(knots[:, None] - time).min(axis=0)
    np.testing.assert_allclose(reach, nearest, rtol=1e-12)  # differences of times up to 45
    # no point is lost in a corner of its piece: it has at least half an even share
    share = np.minimum(np.diff(np.unique(knots)).min(), trajectory.duration / count)
    assert reach.min() > share / 4


def test_check_points_pass_over_pieces_as_narrow_as_rounding():
    """Knots of two splines coincide but for rounding, and an evenly spread time falls just there."""
    level = (1.0,) * JOINTS

    def halves(signal, middle):
        spans = (0.0, middle), (middle, 2.0)
        parts = tuple(ConstantProfile(signal=signal, span=span, value=level) for span in spans)
        return PiecewiseProfile(signal=signal, span=(0.0, 2.0), parts=parts)

    stiffness = halves(STIFFNESS, 1.0 + EPS)
    trajectory = Trajectory(
        UniformTimes(2.0, 50.0), halves(POSITION, 1.0), {"stiffness": stiffness}, name="halves"
    )
    time, reach = trajectory.check_points(1)
    assert (time.item(), reach.item()) == (0.5, 0.5)


@pytest.mark.slow
def test_stamps_since_1970_give_the_motion_from_zero():
    time = np.arange(1001) / 1000
    q, stiffness = np.sin(3 * time)[:, None], 900 + 10 * np.cos(2 * time)[:, None]
    zero, late = (Trajectory.from_samples(start + time, q, stiffness, fit="lsq") for start in (0, 1.7e9))
    here, there = zero.block(0, 1001), late.block(0, 1001)
    np.testing.assert_array_equal(there.time, 1.7e9 + time)
    inside = slice(300, 700)
    # stamps are rounded by up to 1.2e-7 s, but even but for that
    np.testing.assert_array_equal(there.d4q, here.d4q)
    # between the steps times are rounded as well, d4q changes by 240 a second
    between = late.at(1.7e9 + time[inside] + 5e-4)
    np.testing.assert_allclose(between.d4q, zero.at(time[inside] + 5e-4).d4q, atol=5e-5)
    assert late.from_zero().times.span == (0.0, pytest.approx(1.0, abs=2.4e-7))


@pytest.mark.slow
def test_differences_within_reach_confirm_the_derivatives():
    trajectory = random_samples(200, joints=2)
    time, reach = trajectory.check_points(40)
    step = reach / 4
    stencil = [trajectory.at(time + k * step) for k in range(-4, 5)]
    for names in (POSITION.names, STIFFNESS.names):
        for name, derivative in pairwise(names):
            weights = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840
            difference = (
                sum(w * m.of_joints[name] for w, m in zip(weights, stencil, strict=True)) / step[:, None]
            )
            peak = np.abs(stencil[4].of_joints[name]).max()
            # the formula is exact for degree 7: rounding of the values and of the times (up to 200) is left
            bound = 20 * EPS * (peak + 200 * np.abs(stencil[4].of_joints[derivative]).max()) / step.min()
            np.testing.assert_allclose(difference, stencil[4].of_joints[derivative], rtol=0, atol=bound)


def test_from_samples_names_everything_that_does_not_fit():
    time = np.array([0.0, 0.1, 0.2, 0.2, 0.4, 0.5, 0.6, 0.7])
    q = np.zeros((8, 2))
    q[4, 1] = np.nan
    stiffness = np.full((8, 2), 800.0)
    stiffness[1, 0] = -3
    with pytest.raises(InputError) as caught:
        Trajectory.from_samples(time, q, stiffness)
    assert str(caught.value).splitlines() == [
        "time[3] must increase, but 0.2 s appears twice; correct these stamps, or set rate: 10 in their "
        "place if the rows are equally spaced",
        "q[4, 1] must be finite, not nan (t = 0.400 s)",
        "stiffness[1, 0] must be positive, not -3 (t = 0.100 s)",
    ]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"q": np.zeros((7, 2))}, r"q has the shape \(7, 2\), expected \(8, any\)"),
        ({"q": np.zeros(8)}, r"q has the shape \(8,\), expected \(8, any\)"),
        ({"stiffness": np.ones((8, 3))}, "the position has 2 joints, the stiffness 3"),
        ({"d3q": np.zeros((8, 3))}, r"d3q has the shape \(8, 3\), expected \(8, 2\)"),
        ({"time": np.zeros((8, 1))}, r"time has the shape \(8, 1\), expected \(any\)"),
        ({"time": []}, r"q has the shape \(8, 2\), expected \(0, any\)"),
        ({"time": ["a"] * 8}, "time must be an array of numbers"),
    ],
)
def test_from_samples_checks_shapes(changed, message):
    arrays = {"time": np.arange(8.0), "q": np.zeros((8, 2)), "stiffness": np.ones((8, 2)), **changed}
    with pytest.raises(InputError, match=message):
        Trajectory.from_samples(**arrays)


def test_from_samples_needs_samples():
    with pytest.raises(InputError, match="q has 0 samples; a trajectory needs at least 8"):
        Trajectory.from_samples([], np.zeros((0, 2)), np.ones((0, 2)))


@pytest.mark.slow
def test_scipy_is_loaded_only_for_splines():
    script = """
import sys
import numpy as np
from vsacli.trajectory.curves import ConstantProfile
from vsacli.base.signals import POSITION
from vsacli.trajectory.times import UniformTimes
from vsacli import Trajectory
times = UniformTimes(7.0, 1.0)
still = ConstantProfile(signal=POSITION, span=times.span, value=(0.0,))
closed = Trajectory(times, still, {}, name="still")
closed.block(0, 8), closed.check_points(3), closed.at(np.arange(8.0))
assert "scipy" not in sys.modules
Trajectory.from_samples(np.arange(8.0), np.zeros((8, 1)))
assert "scipy" in sys.modules
"""
    subprocess.run([sys.executable, "-c", script], check=True)
