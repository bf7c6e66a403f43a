"""The fastest pace along a path: the chain rule, what is refused, and the paper's arm within 110 N m."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
import sympy
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT
from samples.fixes import pendulum, rest_to_rest

from vsacli import InputError, inverse_dynamics, load_robot, load_trajectory, optimize
from vsacli.studies.search.paced_motion import PACE_ORDERS, retimed
from vsacli.studies.search.path_commands import Speeds
from vsacli.studies.search.splines import SplineSpace


@pytest.fixture(scope="module")
def arm():
    return load_robot(ROBOT)


@pytest.fixture(scope="module")
def motion(arm):
    return load_trajectory(REST_TO_REST, arm)


@pytest.mark.parametrize(
    ("of_time", "time"), [("t + t**2", "(sqrt(1 + 4*s) - 1)/2"), ("exp(t) - 1", "log(1 + s)")]
)
def test_rates_along_a_path_are_those_of_the_composition(of_time, time):
    """Of sin(s): the pace dt/ds and its derivatives by s, and what SymPy differentiates.

    Along t + t^2 the speed's square is linear in s, so that a term of its third derivative vanishes.
    """
    t, s = sympy.symbols("t s", positive=True)
    at = 0.7
    along, passed = sympy.sympify(of_time, {"t": t}), sympy.sympify(time, {"s": s})
    place = along.subs(t, at)
    pace = [float(sympy.diff(passed, s, order + 1).subs(s, place)) for order in range(PACE_ORDERS)]
    by_s = [float(sympy.diff(sympy.sin(s), s, order).subs(s, place)) for order in range(5)]
    rates = Speeds.of(pace).rates(by_s)
    expected = [float(sympy.diff(sympy.sin(along), t, order).subs(t, at)) for order in range(5)]
    np.testing.assert_allclose(rates, expected, rtol=1e-12)


def test_a_pace_that_is_the_same_everywhere_stretches(motion):
    space = SplineSpace.free((0.0, motion.duration), 4)
    slower = retimed(motion, space.spline(np.full(space.size, 1.5)), {}, "slower")
    there, expected = slower.block(0, slower.samples), motion.stretched(1.5).at(slower.times.block(0, 10**6))
    for name, rows in expected.variables().items():
        np.testing.assert_allclose(there.variables()[name], rows, rtol=1e-9, atol=1e-9)
    assert slower.samples == motion.stretched(1.5).samples


def test_what_has_no_timing_to_choose_is_refused(arm, motion):
    with pytest.raises(InputError, match="time needs --vary timing or both, not stiffness"):
        optimize(arm, motion, "time", "stiffness")
    with pytest.raises(InputError, match="must be stiffness, timing or both, not 'pace'"):
        optimize(arm, motion, "torque", "pace")


@pytest.mark.slow
def test_a_motion_that_repeats_itself_has_the_fastest_period(tmp_path):
    """Two periods of a swing whose velocity is limited: none is shorter than its way at that velocity."""
    path, amplitude, fastest = tmp_path / "swing.yaml", 0.2, 2.0
    path.write_text(
        "format: vsacli-trajectory/1\nname: swing\nduration: 2\nrate: 500\n"
        "stiffness: {type: constant, value: 4000}\n"
        f"position: {{type: sinusoids, frequency: 1, offset: 0, sine: [{amplitude}]}}\n"
    )
    robot = pendulum().replace({"joints.0.limits.velocity": fastest})
    found = optimize(robot, load_trajectory(path, robot), "time", "timing")
    # a sinusoid is fastest half-way; bounds are kept with 1e-4 to spare
    assert found.timing.uniform == pytest.approx(2 * 2 * math.pi * amplitude / fastest, rel=2e-4)
    assert 2 * 4 * amplitude / fastest < found.timing.after < 0.9 * found.timing.uniform
    run = inverse_dynamics(robot, found.trajectory)
    assert run.report.verdict == "ok"
    half = len(run.time) // 2
    if len(run.time) % 2:
        for rows in (run.q, run.dq, run.ddq, run.d3q):
            np.testing.assert_allclose(rows[half:], rows[: half + 1], atol=1e-6 * np.abs(rows).max())
    np.testing.assert_allclose(run.d4q[0], run.d4q[-1], atol=1e-6 * np.abs(run.d4q).max())


def test_what_nothing_holds_back_is_no_optimum():
    free = rest_to_rest(1.0, (1e7,), start=(0.0,), end=(0.5,), rate=100.0)
    found = optimize(pendulum(), free, "time", "timing")
    assert not found.possible
    assert "no limit keeps the motion from being 50 times as fast" in str(found)


@pytest.mark.slow
def test_a_motion_rests_on_its_way_as_long_as_commanded(arm):
    """No motor has a limit: what holds the motion back between its dwells are the ends of the corridors."""
    motion = load_trajectory(REPOSITORY / "trajectories" / "vsa_3r_pick_and_place.yaml", arm, {"rate": 100})
    found = optimize(arm, motion, "time", "timing")

    def resting(trajectory):
        moving = np.abs(trajectory.block(0, trajectory.samples).dq).max(axis=1) > 1e-9
        return np.count_nonzero(~moving) * trajectory.duration / (trajectory.samples - 1)

    assert found.timing.found
    assert found.timing.after < 0.4 * found.timing.uniform
    assert resting(found.trajectory) > 0.98 * resting(motion)
    bounding = {name for shares in found.timing.bounding.values() for name in shares}
    assert bounding == {"minimum attainable stiffness"}
    assert inverse_dynamics(arm, found.trajectory).report.verdict == "ok"


@pytest.mark.slow
def test_the_papers_arm_is_faster_than_any_uniform_motion_and_keeps_its_torques_between_the_steps(
    arm, motion
):
    limited = arm.replace({f"joints.{joint}.actuator.motor.max_torque": 110.0 for joint in range(3)})
    found = optimize(limited, motion, "time", "timing")
    assert found.timing.after < 0.9 * found.timing.uniform
    assert (found.timing.agreeing, found.timing.starts) == (3, 3)
    # The fastest uniform motion by itself: at its limit, and a little faster it is beyond.
    for factor, kept in ((1.0001, True), (0.999, False)):
        uniform = motion.stretched(factor * found.timing.uniform / motion.duration)
        assert (inverse_dynamics(limited, uniform).report.verdict == "ok") == kept
    fine = found.trajectory
    between = np.linspace(0, fine.duration, 10 * (fine.samples - 1) + 1)
    result = inverse_dynamics(arm, _sampled(fine, between))
    # Between the steps the trajectory is a spline through them, good to 1e-6 of its fourth derivative.
    assert np.abs(result.tau_motor).max() < 110 * 1.0001
    assert min(joint.margin for joint in result.report.joints) >= 0.01


def _sampled(trajectory, time):
    from vsacli import Trajectory

    motion = trajectory.at(trajectory.start + time)
    rates = {name: getattr(motion, name) for name in ("dq", "ddq", "d3q", "d4q")}
    return Trajectory.from_samples(
        time,
        motion.q,
        motion.commanded["stiffness"],
        **rates,
        dstiffness=motion.commanded["dstiffness"],
        ddstiffness=motion.commanded["ddstiffness"],
        fit="interpolate",
    )


@pytest.mark.slow
def test_the_fastest_motion_is_read_as_it_was_written(vsacli):
    """Its fourth derivative falls to 0 within a sample at the end, which was taken for an outlier."""
    robot, motion = (REPOSITORY / folder / "devices" / "fsj.yaml" for folder in ("robots", "trajectories"))
    slow_ends = ("--set", "position.degree=9", "--set", "duration=2")
    done = vsacli("optimize", robot, motion, "--minimize", "time", *slow_ends, "-o", "fast.yaml")
    assert done.code == 0, done.err
    read = vsacli("validate", robot, "fast.yaml")
    assert (read.code, "warning" in read.out + read.err) == (0, False)
    header, *rows = csv.reader(Path("fast.csv").read_text().splitlines())
    written = np.array(rows, dtype=float)
    used = load_trajectory("fast.yaml", load_robot(robot)).block(0, len(written)).variables()
    for name in ("q", "dq", "ddq", "d3q", "d4q"):
        assert (used[name][:, 0] == written[:, header.index(f"joint.{name}")]).all()
