"""Trajectories made slower by a factor."""

import math

import numpy as np
import pytest
from samples.fixes import pendulum

from vsacli import InputError, Trajectory, load_trajectory
from vsacli.base.signals import DAMPING, POSITION, STIFFNESS
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.times import RecordedTimes, UniformTimes

NAMES = [*POSITION.names, *STIFFNESS.names]
ORDERS = {name: order for signal in (POSITION, STIFFNESS) for order, name in enumerate(signal.names)}
FACTOR = 1.7


def polynomial(times):
    span = (0.0, times.span[1] - times.span[0])
    return Trajectory(
        times,
        RestToRest(signal=POSITION, span=span, degree=7, start=(0.0, 1.0), end=(1.0, -1.0)),
        {
            "stiffness": RestToRest(
                signal=STIFFNESS, span=span, degree=3, start=(850.0,) * 2, end=(900.0, 800.0)
            )
        },
        name="test",
    )


def recorded(*given):
    motion = polynomial(RecordedTimes(2.0 + np.linspace(0, 1, 101) ** 1.1)).block(0, 101)
    columns = {name: motion.of_joints[name] for name in given}
    return Trajectory.from_samples(motion.time, motion.q, motion.commanded["stiffness"], **columns)


@pytest.mark.parametrize(
    "trajectory",
    [
        polynomial(UniformTimes(1.0, 100.0)),
        polynomial(RecordedTimes(np.linspace(3.0, 4.0, 101))),
        recorded(),
        recorded("dq", "dstiffness", "ddstiffness"),
    ],
    ids=["uniform", "recorded times", "recorded", "recorded with derivatives"],
)
def test_same_values_at_stretched_times_and_smaller_derivatives(trajectory):
    first = trajectory.times.span[0]
    slower = trajectory.stretched(FACTOR)
    assert slower.duration == pytest.approx(FACTOR * trajectory.duration)
    time = np.linspace(*trajectory.times.span, 57)[1:-1]
    before, after = trajectory.at(time), slower.at(first + FACTOR * (time - first))
    for name, order in ORDERS.items():
        expected = before.of_joints[name] / FACTOR**order
        # rounding of time, amplified by the derivatives: 1e-16 times 1e8 for the spline's d4q
        np.testing.assert_allclose(
            after.of_joints[name], expected, atol=1e-7 * np.abs(expected).max() + 1e-12
        )


def test_uniform_steps_keep_their_rate():
    slower = polynomial(UniformTimes(1.0, 100.0)).stretched(FACTOR)
    assert (slower.samples, slower.times.block(0, 2)[1]) == (171, pytest.approx(0.01))


def test_recorded_steps_keep_their_number_and_first_time():
    slower = recorded().stretched(FACTOR)
    assert (slower.samples, slower.times.span[0]) == (101, 2.0)


def test_given_derivatives_are_scaled_at_the_steps():
    trajectory = recorded(*(name for name in NAMES if ORDERS[name]))
    before, after = trajectory.block(20, 40), trajectory.stretched(FACTOR).block(20, 40)
    for name, order in ORDERS.items():
        np.testing.assert_array_equal(after.of_joints[name], before.of_joints[name] / FACTOR**order)


def test_factor_one_changes_nothing():
    trajectory = recorded("dq")
    same = trajectory.stretched(1.0)
    np.testing.assert_array_equal(same.block(0, 101).time, trajectory.block(0, 101).time)
    assert math.isclose(same.duration, trajectory.duration, rel_tol=0)


@pytest.mark.parametrize("rate", ["", "rate: 50\n"])
@pytest.mark.parametrize("source", ["formula", "record"])
def test_slow_down_of_a_file_stretches_all_of_it(tmp_path, source, rate):
    robot = pendulum()
    time = 3.0 + np.linspace(0.0, 2.0, 101)
    rows = np.stack([time, 0.3 * np.sin(time) + 1e-4 * np.random.default_rng(3).standard_normal(101)], axis=1)
    np.savetxt(tmp_path / "swing.csv", rows, delimiter=",", header="time,swing.q", comments="", fmt="%.17g")
    declared = {
        "formula": "duration: 2\nposition: {type: polynomial, degree: 7, start: 0, end: 1}\n",
        "record": "position: {type: csv, file: swing.csv, bandwidth: 5}\n",
    }
    text = f"format: vsacli-trajectory/1\nname: swing\n{rate}{declared[source]}"
    text += "stiffness: {type: polynomial, degree: 5, start: 900, end: 950}\n"
    (tmp_path / "as-it-is.yaml").write_text(text)
    (tmp_path / "slower.yaml").write_text(text + "slow_down: 1.7\n")
    expected = load_trajectory(tmp_path / "as-it-is.yaml", robot).stretched(1.7)
    found = load_trajectory(tmp_path / "slower.yaml", robot)
    assert found.samples == expected.samples
    assert found.warnings == load_trajectory(tmp_path / "as-it-is.yaml", robot).warnings
    for name, array in expected.block(0, expected.samples).variables().items():
        np.testing.assert_array_equal(found.block(0, found.samples).variables()[name], array)


@pytest.mark.parametrize(
    ("factor", "problem"),
    [("0", "slow_down: must be positive"), ("1e9", "times rate 1000 Hz gives 1e\\+12 samples")],
)
def test_impossible_slow_downs_are_refused_with_their_line(tmp_path, factor, problem):
    (tmp_path / "slower.yaml").write_text(
        "format: vsacli-trajectory/1\nname: swing\nduration: 1\nposition: {type: constant, value: 0}\n"
        f"stiffness: {{type: constant, value: 900}}\nslow_down: {factor}\n"
    )
    with pytest.raises(InputError, match=rf"slower.yaml:\d: .*{problem}"):
        load_trajectory(tmp_path / "slower.yaml", pendulum())


DERIVED = {
    "stretched": lambda trajectory: trajectory.stretched(FACTOR),
    "changed": lambda trajectory: trajectory.changed(lambda _, profile: profile, trajectory.times),
    "sampled": lambda trajectory: trajectory.sampled(RecordedTimes(np.linspace(2, 3, 5))),
    "from zero": lambda trajectory: trajectory.from_zero(),
}


@pytest.mark.parametrize("derive", DERIVED.values(), ids=DERIVED)
def test_a_derived_trajectory_keeps_what_is_said_of_its_recording(derive):
    time = np.linspace(2, 3, 101)
    q = np.sin(4 * time)
    q[50:56] = q[50]
    trajectory = Trajectory.from_samples(time, q[:, None], np.full((101, 1), 900.0))
    told = trajectory.commanding(DAMPING, (1.0,), "no damping is commanded")
    assert "frozen" in " ".join(told.warnings)
    derived = derive(told)
    assert (derived.warnings, derived.notes) == (told.warnings, told.notes)
    assert "no damping is commanded" in derived.notes
