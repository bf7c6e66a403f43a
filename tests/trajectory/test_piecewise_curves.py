"""Profiles one after the other."""

from __future__ import annotations

import re

import numpy as np
import pytest

from vsacli import InputError
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.trajectory.curves import ConstantProfile, RestToRest
from vsacli.trajectory.curves.steps import Jump, PiecewiseProfile, profile_of_levels
from vsacli.trajectory.curves.via_points import ViaPoints

SPAN = (0.1, 2.8)  # times that are no binary fractions


def move(span, start, end, degree=9):
    return RestToRest(signal=POSITION, span=span, degree=degree, start=start, end=end)


def hold(span, value):
    return ConstantProfile(signal=POSITION, span=span, value=value)


def chain(*parts):
    return PiecewiseProfile(signal=POSITION, span=(parts[0].span[0], parts[-1].span[1]), parts=parts)


HERE, THERE, BACK = (0.0, 1.0), (1.0, -0.5), (0.25, 0.5)
PARTS = (
    move((0.1, 1.2), HERE, THERE),
    hold((1.2, 1.7), THERE),
    ViaPoints(signal=POSITION, span=(1.7, 2.8), degree=9, shares=(0.0, 0.4, 1.0), points=(THERE, HERE, BACK)),
)


def test_each_time_belongs_to_one_part():
    profile = chain(*PARTS)
    time = np.linspace(*SPAN, 28)
    rows = profile.at(time)
    for part in PARTS:
        inside = (time >= part.span[0]) & (time < part.span[1])
        np.testing.assert_array_equal(rows[:, :, inside], part.at(time[inside]))
    np.testing.assert_array_equal(rows[:, :, -1], PARTS[-1].at(time[-1:])[:, :, 0])
    assert profile.components == 2


def test_at_a_joint_of_parts_the_later_one_counts():
    first, second = move((0.0, 1.0), HERE, THERE, degree=7), hold((1.0, 2.0), THERE)
    at_joint = chain(first, second).at(np.array([1.0]))
    np.testing.assert_array_equal(at_joint, second.at(np.array([1.0])))
    assert first.at(np.array([1.0]))[4].all()


def test_breakpoints_are_those_of_the_parts():
    np.testing.assert_array_equal(chain(*PARTS).breakpoints, [0.1, 1.2, 1.7, PARTS[2].breakpoints[1], 2.8])


def test_samples_do_not_depend_on_the_block():
    profile = chain(*PARTS)
    time = np.linspace(*SPAN, 501)
    whole = profile.at(time)
    for size in (1, 7, 64):
        parts = [profile.at(time[start : start + size]) for start in range(0, 501, size)]
        np.testing.assert_array_equal(np.concatenate(parts, axis=2), whole)


def test_a_slower_one_has_slower_parts():
    fast, slow = chain(*PARTS), chain(*PARTS).stretched(1.7)
    assert slow.span == (0.1, 0.1 + 1.7 * (2.8 - 0.1))
    time = np.linspace(*SPAN, 57)[1:-1]
    before, after = fast.at(time), slow.at(0.1 + 1.7 * (time - 0.1))
    for order in range(5):
        expected = before[order] / 1.7**order
        # the spline's derivatives, where rounding of time moves the argument
        np.testing.assert_allclose(after[order], expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    assert list(slow.jumps(5)) == []


def test_parts_that_meet_at_rest_do_not_jump():
    assert list(chain(*PARTS).jumps(5)) == []


def test_every_value_that_jumps_is_named():
    profile = chain(move((0.0, 1.0), HERE, THERE), hold((1.0, 2.0), (1.25, -0.75)))
    assert list(profile.jumps(5)) == [Jump(1, 0, 0, 1.0, 1.25), Jump(1, 0, 1, -0.5, -0.75)]


@pytest.mark.parametrize(("degree", "order"), [(3, 2), (5, 3), (7, 4)])
def test_the_lowest_derivative_that_jumps_is_named(degree, order):
    first = move((0.0, 1.0), HERE, THERE, degree)
    profile = chain(first, hold((1.0, 2.0), THERE))
    before = first.at(np.array([1.0]))[order, 0, 0]
    assert list(profile.jumps(5)) == [Jump(1, order, 0, before, 0.0)]
    assert list(profile.jumps(order)) == []


def test_rounding_does_not_count_as_a_jump():
    almost = (1.0 + 1e-12, -0.5 - 1e-12)
    assert list(chain(move((0.0, 1.0), HERE, THERE), hold((1.0, 2.0), almost)).jumps(5)) == []
    off = (1.0 + 1e-8, -0.5)
    assert [jump.component for jump in chain(PARTS[0], hold((1.2, 1.7), off)).jumps(5)] == [0]


def test_steps_hold_their_levels():
    changes = [(1.0, 1.5), (1.5, 2.0), (2.5, 3.0)]
    levels = [(900.0,), (1200.0,), (800.0,), (1000.0,)]
    profile = profile_of_levels(STIFFNESS, (0.0, 4.0), 5, levels, changes)
    time = np.array([0.0, 0.5, 1.0, 1.25, 1.5, 2.0, 2.25, 2.75, 3.0, 4.0])
    expected = [900, 900, 900, 1050, 1200, 800, 800, 900, 1000, 1000]
    np.testing.assert_array_equal(profile.at(time)[0, 0], expected)
    np.testing.assert_array_equal(profile.breakpoints, [0, 1, 1.5, 2, 2.5, 3, 4])
    assert list(profile.jumps(3)) == []


def test_steps_may_fill_the_span():
    profile = profile_of_levels(
        STIFFNESS, (0.0, 2.0), 5, [(900.0,), (1200.0,), (800.0,)], [(0.0, 1.0), (1.0, 2.0)]
    )
    assert [type(part) for part in profile.parts] == [RestToRest, RestToRest]


def test_parts_must_adjoin():
    with pytest.raises(InputError, match="must adjoin and fill its span"):
        chain(hold((0.0, 1.0), HERE), hold((1.5, 2.0), HERE))
    with pytest.raises(InputError, match="must adjoin and fill its span"):
        PiecewiseProfile(signal=POSITION, span=(0.0, 2.0), parts=(hold((0.0, 1.0), HERE),))


def test_parts_must_have_the_same_joints():
    with pytest.raises(InputError, match=re.escape("must have the same number of components")):
        chain(hold((0.0, 1.0), HERE), hold((1.0, 2.0), (0.0,)))
