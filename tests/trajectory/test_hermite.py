"""Samples with all their derivatives are one function, at the samples and between them."""

from __future__ import annotations

import numpy as np
import pytest

from vsacli import Trajectory
from vsacli.trajectory.recorded.hermite import interpolate_hermite

FREQUENCY = 3.0
GIVEN = ("dq", "ddq", "d3q", "d4q", "dstiffness", "ddstiffness")


def sine(time, order, amplitude=1.0):
    phase = FREQUENCY * time + order * np.pi / 2
    return (amplitude * FREQUENCY**order * np.sin(phase))[:, None]


def recorded(rate=500.0, duration=2.0, digits=17, **wrong):
    time = np.arange(round(rate * duration) + 1) / rate
    columns = {name: sine(time, order) for order, name in enumerate(("q", *GIVEN[:4]))}
    columns |= {name: sine(time, order, 50.0) for order, name in enumerate(GIVEN[4:], 1)}
    columns |= {name: factor * columns[name] for name, factor in wrong.items()}
    rounded = {
        name: np.array([[float(f"{each:.{digits}g}")] for each in rows[:, 0]])
        for name, rows in columns.items()
    }
    return Trajectory.from_samples(time, stiffness=800.0 + sine(time, 0, 50.0), **rounded)


def test_between_samples_it_is_the_motion_that_was_sampled():
    trajectory = recorded()
    time = np.linspace(0, 2.0, 5417)
    motion = trajectory.at(time)
    # interpolation leaves h^6/46080 of the sixth derivative of ddq, 8e-19 of it here, and of the fourth
    # derivative h^4/384 of the same; rounding 60/h^2 of that of ddq
    for order, bound in enumerate((1e-14, 1e-13, 1e-12, 1e-9, 1e-7)):
        found = (motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q)[order]
        np.testing.assert_allclose(found, sine(time, order), atol=bound * FREQUENCY**order)
    found = motion.commanded["ddstiffness"]
    np.testing.assert_allclose(found, sine(time, 2, 50.0), atol=1e-7 * 450)
    assert trajectory.known_between


def test_samples_are_what_was_given():
    trajectory = recorded()
    given, found = trajectory.block(0, 1001), trajectory.at(trajectory.block(0, 1001).time)
    for name, rows in given.of_joints.items():
        np.testing.assert_allclose(found.of_joints[name], rows, rtol=1e-13, atol=1e-13, err_msg=name)


@pytest.mark.parametrize(
    "trajectory",
    [recorded(digits=5), recorded(ddq=1.1), recorded(dq=180 / np.pi), recorded(d4q=-1.0), recorded(q=2.0)],
    ids=["few digits", "ddq", "degrees", "sign", "values"],
)
def test_derivatives_that_do_not_belong_together_say_nothing_between_samples(trajectory):
    assert not trajectory.known_between


def test_a_constant_is_one_function_although_its_derivatives_are_rounding():
    """A profile along a limit: a spline takes back the polynomial that was commanded."""
    time, rng = np.arange(1001) / 500, np.random.default_rng(0)
    columns = {name: sine(time, order) for order, name in enumerate(("q", *GIVEN[:4]))}
    # less than the spacing of doubles at 8100, 9e-13, over the square of the interval of 2 ms
    noise = [share * rng.standard_normal((1001, 1)) for share in (1e-10, 1e-7)]
    trajectory = Trajectory.from_samples(
        time, stiffness=np.full((1001, 1), 8100.0), dstiffness=noise[0], ddstiffness=noise[1], **columns
    )
    assert trajectory.known_between


def test_uneven_samples_are_met_at_both_ends():
    time = np.sort(np.random.default_rng(0).uniform(0, 1, 200))
    rows = np.stack([sine(time, order).T for order in range(5)])
    before = interpolate_hermite(time, rows, np.nextafter(time[1:], 0))
    # the gap is up to 0.03 s: h^7 of the ninth derivative over 7! 46080/720
    for order in range(5):
        np.testing.assert_allclose(before[order], rows[order][:, 1:], atol=1e-11 * FREQUENCY**order)
