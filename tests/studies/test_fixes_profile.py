"""The nearest smooth stiffness profile."""

from __future__ import annotations

import dataclasses
from itertools import product

import numpy as np
import pytest
from samples.fixes import (
    BASE,
    CUBIC,
    SHOULDER,
    accepted,
    changed,
    lowest_stiffness,
    pendulum,
    rest_to_rest,
)
from samples.marks import slow
from samples.robots import vsa_3r
from scipy.integrate import trapezoid

from vsacli import Limits, Trajectory, fixes, inverse_dynamics, laws, link_torques
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.studies.search.acceptance import Acceptance
from vsacli.studies.search.fix_report import NotPossible
from vsacli.studies.search.nearest_profile import Bounds, NoSplineError, nearest_spline
from vsacli.studies.search.task import AS_IT_IS, Task
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.times import UniformTimes

MARGIN = 0.01


def profile(robot, trajectory):
    """The fix that changes the profile alone, and the change of each joint."""
    fix = Task(Acceptance(robot, MARGIN), trajectory).with_profiles(AS_IT_IS)
    return fix.trajectory, fix.stiffness_profile


def reason(robot, trajectory):
    found = fixes(robot, trajectory, MARGIN).stiffness_profile
    assert isinstance(found, NotPossible)
    (only,) = found.reasons
    return only


def stiffness_needed(robot, motion):
    tau_e, _, _ = link_torques(robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q)
    return lowest_stiffness(tau_e) / (1 - MARGIN)


def change(fixed, trajectory):
    steps = trajectory.samples
    return fixed.block(0, steps).commanded["stiffness"] - trajectory.block(0, steps).commanded["stiffness"]


def bump(time, height, at, width):
    return height * (2 * np.exp(-(((time - at) / width) ** 2)) - 1)


def test_spline_through_one_point_is_the_green_function():
    """Least integral of x^2 + T^6 x'''^2 with x(0) = 1, for s = |t|/T and c = sqrt(3)/2.

    2 x = e^-s + e^(-s/2) (cos c s + 2 c sin c s), with x' = x''' = 0 at 0, of x - T^6 x^(6) = 0.
    """
    smoothing = 0.1
    time = np.linspace(-3, 3, 6001)
    low = np.where(time == 0, 1.0, -10.0)
    spline = nearest_spline(Bounds(time, low, np.full_like(time, np.inf)), smoothing)
    s, c = np.abs(time) / smoothing, np.sqrt(3) / 2
    expected = (np.exp(-s) + np.exp(-s / 2) * (np.cos(c * s) + 2 * c * np.sin(c * s))) / 2
    # The fifth derivative jumps at 0, where a knot need not be; pieces of T/2 leave (1/2)^5/120 of it.
    np.testing.assert_allclose(spline(time), expected, atol=2e-3)


def test_no_other_function_between_the_bounds_is_smaller():
    smoothing, center = 0.15, 1.5
    time = np.linspace(0, 4, 1601)
    bounds = Bounds(time, bump(time, 30.0, center, 0.4), np.full_like(time, np.inf))

    def size(values, bend):
        return trapezoid(values**2 + smoothing**6 * bend**2, time)

    spline = nearest_spline(bounds, smoothing)
    least = size(spline(time), spline(time, nu=3))
    others = []
    for height, width in product(np.linspace(30, 40, 11), np.linspace(0.2, 0.6, 41)):
        u = (time - center) / width
        bell = height * np.exp(-u * u)
        if bounds.missed_by(bell).max() <= 0:
            others.append(size(bell, bell * (12 * u - 8 * u**3) / width**3))
    assert least < min(others) < 1.2 * least  # a bell is not far from the best


@pytest.mark.parametrize("smoothing", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("half_width", [0.5, 3.0, np.inf])
def test_spline_stays_between_bounds(smoothing, half_width):
    time = np.linspace(0, 4, 4001)
    middle = 30 * np.sin(2 * time)
    bounds = Bounds(time, middle - min(half_width, 5.0), middle + half_width)
    spline = nearest_spline(bounds, smoothing)
    assert bounds.missed_by(spline(time)).max() < 1e-5  # 1e-7 of the largest miss, 35


def test_spline_vanishes_far_from_where_it_is_needed():
    time = np.linspace(0, 100, 20_001)
    spline = nearest_spline(Bounds(time, bump(time, 10.0, 40.0, 0.5), np.full_like(time, np.inf)), 0.1)
    x = spline(time)
    assert x.max() >= 10 - 1e-5
    np.testing.assert_array_equal(x[np.abs(time - 40) > 2.5], 0.0)


def test_bounds_too_fast_for_any_spline_are_refused():
    time = np.linspace(0, 4, 4001)
    middle = np.where(np.arange(4001) % 2, 1.0, -1.0)
    with pytest.raises(NoSplineError):
        nearest_spline(Bounds(time, middle - 0.1, middle + 0.1), 0.1)


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize(("duration", "stiffness"), [(4.0, 790.0), (4.0, 820.0), (0.5, 850.0), (0.3, 850.0)])
def test_profile_follows_the_corridor_and_is_nearer_than_the_offset(duration, stiffness):
    robot, trajectory = vsa_3r(), rest_to_rest(duration, stiffness, rate=800 / duration)
    alternatives = fixes(robot, trajectory, MARGIN)
    fixed, found = profile(robot, trajectory)
    # the one of a fix also minds instants between steps, which moves the fourth digit
    for fix, first in zip(alternatives.stiffness_profile.changes, found.changes, strict=True):
        assert fix.joint == first.joint
        assert fix.largest == pytest.approx(first.largest, rel=1e-3)
    assert accepted(robot, fixed, MARGIN)
    constants = {each.joint: each.value for each in alternatives.stiffness_offset.offsets}
    for joint in found.changes:
        assert 0 < joint.rms <= constants[joint.joint]
    moved = change(fixed, trajectory)
    motion = trajectory.block(0, trajectory.samples)
    least = np.maximum(stiffness_needed(robot, motion) - motion.commanded["stiffness"], 0)
    # where nothing is needed nothing is gained, and the excess is small: a few percent of the largest change,
    # more where the motion is so fast that a change is still large at the ends, where it begins flat
    assert np.mean(moved - least) < (0.15 if duration > 0.3 else 0.2) * moved.max()
    assert moved.min() > -0.1 * moved.max()


def test_joints_that_are_fine_are_left_alone():
    trajectory = rest_to_rest(4.0, (850.0, 820.0, 850.0))
    fixed, found = profile(vsa_3r(), trajectory)
    assert [joint.joint for joint in found.changes] == ["shoulder"]
    np.testing.assert_array_equal(change(fixed, trajectory)[:, [0, 2]], 0.0)


def test_profile_and_its_derivatives_belong_together():
    trajectory = rest_to_rest(0.5, rate=10_000)
    motion = profile(vsa_3r(), trajectory)[0].block(0, trajectory.samples)
    step = 1e-4
    for values, rates in (("stiffness", "dstiffness"), ("dstiffness", "ddstiffness")):
        value, rate = motion.of_joints[values], motion.of_joints[rates]
        difference = (value[2:] - value[:-2]) / (2 * step)
        # second order in the step over pieces of 0.001 s and more, at whose ends the third derivative jumps
        np.testing.assert_allclose(difference, rate[1:-1], atol=0.03 * np.abs(rate).max())


@pytest.mark.parametrize("duration", [0.3, 0.5, 4.0])
def test_rest_to_rest_stays_rest_to_rest(duration):
    trajectory = rest_to_rest(duration, 790.0, rate=800 / duration)
    fixed = profile(vsa_3r(), trajectory)[0]
    commanded = fixed.block(0, fixed.samples).commanded
    for rate in ("dstiffness", "ddstiffness"):
        # three coefficients are equal there, which leaves their rounding over the square of a short piece
        assert np.abs(commanded[rate][[0, -1]]).max() < 1e-8 * np.abs(commanded[rate]).max()
    report = inverse_dynamics(vsa_3r(), fixed).report
    for joint in report.joints:
        assert max(np.abs((joint.start_dtheta, joint.end_dtheta)).flat) < 1e-12 * min(joint.peak_dtheta)
    assert "motors move" not in str(report)


@pytest.mark.parametrize(("duration", "stiffness"), [(0.3, 850.0), (0.5, 850.0), (0.4, 790.0)])
def test_samples_resolve_the_second_derivative(duration, stiffness):
    """It begins at zero and reaches its peak in many samples, where the range is exceeded at once as well."""
    trajectory = rest_to_rest(duration, stiffness, rate=1000)
    rates = profile(vsa_3r(), trajectory)[0].block(0, trajectory.samples).commanded["ddstiffness"]
    # a smoothing time has at least ten sampling intervals, of which a third derivative takes a few
    assert np.all(np.abs(np.diff(rates, axis=0)).max(axis=0) <= 0.25 * np.abs(rates).max(axis=0))


def test_moving_ends_keep_the_rates_that_were_commanded():
    """A sinusoid that starts at full speed, with a stiffness that falls at the start."""
    position = Sinusoids(
        signal=POSITION, span=(0.0, 2.0), cycles=1.5, offset=(0.0,), sine=((0.6,),), cosine=((0.2,),)
    )
    stiffness = Sinusoids(
        signal=STIFFNESS, span=(0.0, 2.0), cycles=0.75, offset=(805.0,), sine=((-8.0,),), cosine=((3.0,),)
    )
    trajectory = Trajectory(UniformTimes(2.0, 500.0), position, {"stiffness": stiffness}, name="swing")
    fixed = profile(pendulum(), trajectory)[0]
    for time in (0, -1):
        before, after = (each.block(0, 1001).commanded for each in (trajectory, fixed))
        for rate in ("dstiffness", "ddstiffness"):
            # the spline vanishes there but for the rounding of equal coefficients
            np.testing.assert_allclose(after[rate][time], before[rate][time], rtol=1e-9)


def test_profile_holds_between_the_steps():
    robot, trajectory = vsa_3r(), rest_to_rest(0.5, rate=100)
    fixed = profile(robot, trajectory)[0]
    motion = fixed.at(np.linspace(0, 0.5, 101))  # steps and the instants half-way
    gap = motion.commanded["stiffness"] - stiffness_needed(robot, motion)
    # half-way the file is read as a spline through its steps, off by step^4/384 of the fourth derivative
    assert gap.min() > -0.02


def test_motor_limit_asks_for_a_smoother_or_wider_profile():
    trajectory = rest_to_rest(0.5)
    fastest, free = profile(vsa_3r(), trajectory)
    peak = float(np.abs(inverse_dynamics(vsa_3r(), fastest).tau_motor[:, BASE]).max())
    robot = changed(BASE, motor={"max_torque": 0.8 * peak})
    fixed, found = profile(robot, trajectory)
    assert accepted(robot, fixed, MARGIN)
    assert found.changes[0].rms > free.changes[0].rms


def test_springs_that_differ_on_a_prismatic_joint():
    robot = changed(0, robot=pendulum(letter="P"), spring=(CUBIC, laws.Sinh(k=80, a=5)))
    fixed, found = profile(robot, rest_to_rest(0.2, 850.0, start=(0.0,), end=(0.3,)))
    assert accepted(robot, fixed, MARGIN)
    assert found.sentence.startswith("reshape the stiffness of lift by up to +")
    assert " N/m (at t = " in found.sentence


def test_deflection_limit_bounds_the_profile_from_above():
    robot = changed(SHOULDER, spring=(dataclasses.replace(CUBIC, max_deflection=0.08),) * 2)
    fixed, found = profile(robot, rest_to_rest(4.0, (850.0, 900.0, 850.0)))
    assert accepted(robot, fixed, MARGIN)
    assert found.changes[0].largest < 0


def rising(end: float) -> Trajectory:
    """A motion of the pendulum that starts near its least stiffness, 800 N m/rad, and ends stiffer."""
    asked = rest_to_rest(2.0, start=(0.0,), end=(0.5,))
    profile = RestToRest(signal=STIFFNESS, span=asked.times.span, degree=5, start=(840.0,), end=(end,))
    return Trajectory(asked.times, asked.position, {"stiffness": profile}, name="rising")


@pytest.mark.parametrize("end", [1400.0, slow(2500.0)])
def test_torque_limits_bound_the_profile_from_above_where_no_constant_helps(end):
    robot = changed(0, robot=pendulum(), motor={"max_torque": 100.0})
    found = fixes(robot, rising(end), MARGIN)
    assert isinstance(found.stiffness_offset, NotPossible)
    (cause,) = found.causes
    assert "since lowered by" in cause.text or "since raised by" in cause.text
    fixed = found.fixes[0].trajectory
    assert accepted(robot, fixed, MARGIN)
    held = inverse_dynamics(robot, fixed)
    # Its end uses the torque that there is, but for the thousandth left to the rates of the profile.
    assert 0.998 < np.abs(held.tau_motor[-1]).max() / 100.0 <= 1.0


def test_stiffness_limit_below_what_the_load_needs():
    robot = changed(SHOULDER, limits=Limits(stiffness=(0.0, 820.0)))
    assert reason(robot, rest_to_rest(4.0, (850.0, 810.0, 850.0))) == (
        "shoulder: stiffness is 810 N m/rad at t = 0.000 s, even at rest, below the 827.8 N m/rad needed for "
        "a margin of 1 % (minimum 819.4): no slower motion and no constant stiffness helps, since with "
        "827.8 N m/rad, the least it may have, stiffness is 827.7 N m/rad at t = 0.000 s, above its limit "
        "of 820 N m/rad"
    )


def test_limits_of_the_motion_are_none_of_the_stiffness():
    robot = changed(BASE, limits=Limits(position=(-1.0, 1.0)))
    assert reason(robot, rest_to_rest(1.0)) == (
        "base: position is 1.571 rad at t = 1.000 s, above its limit of 1 rad: "
        "timing and stiffness have no effect on that: change the path or the limit"
    )


@pytest.mark.slow
def test_motor_limit_that_no_profile_keeps():
    robot = changed(BASE, motor={"max_velocity": 1.0})
    assert reason(robot, rest_to_rest(1.0)).startswith(
        "none that was tried keeps every limit of base; with the nearest, the joint-side velocity of motor 1"
    )
