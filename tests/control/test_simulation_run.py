"""Conditions of a simulation: saturation, early ends, measured positions, what is refused, and the report."""

from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest
from samples.command_line import rest_to_rest
from samples.drives import motion
from samples.plants import rigid, with_actuators
from samples.robots import vsa_3r
from samples.simulated import mixed_3r, short_motion

from vsacli import (
    Antagonistic,
    Flag,
    Gains,
    InitialError,
    InputError,
    Motor,
    Sensors,
    Tolerances,
    Trajectory,
    laws,
    load_trajectory,
    perturbed,
    simulate,
)
from vsacli.base.simulation_variables import SIMULATION_VARIABLES
from vsacli.base.units import time_text
from vsacli.control.simulation.boundaries import Singularity
from vsacli.control.simulation.closed_loop import ClosedLoop, Feedforward, Phase
from vsacli.control.simulation.history import RateFilter
from vsacli.control.simulation.start import start_state
from vsacli.control.simulation.tabulated import TabulatedReference
from vsacli.trajectory.times import RecordedTimes

GAINS = Gains.from_poles([-20] * 4, [-20] * 2)


def with_torque_limit(robot, limit):
    """At the base."""
    joint = robot.joints[0]
    motors = tuple(dataclasses.replace(motor, max_torque=limit) for motor in joint.actuator.motor)
    joint = dataclasses.replace(joint, actuator=dataclasses.replace(joint.actuator, motor=motors))
    return dataclasses.replace(robot, joints=(joint, *robot.joints[1:]))


@pytest.mark.slow
def test_motors_saturate():
    conditions = {"gains": GAINS, "initial_error": InitialError(0.02, 20)}
    free = simulate(vsa_3r(), short_motion(3), **conditions).report.joints[0].peak_tau_motor[0]
    limit = 0.8 * free
    simulation = simulate(with_torque_limit(vsa_3r(), limit), short_motion(3), **conditions)
    past, base = simulation.history, simulation.report.joints[0]
    beyond = np.abs(past.tau_motor_cmd[:, 0]) > limit
    assert base.peak_tau_motor[0] == limit
    assert np.array_equal(past.tau_motor[:, 0], np.clip(past.tau_motor_cmd[:, 0], -limit, limit))
    flagged = (past.flags[:, 0] & Flag.MOTOR_TORQUE_LIMIT) != 0
    assert flagged.any()
    assert np.array_equal(flagged, beyond.any(axis=1))
    assert base.samples_over_limit == flagged.sum()
    assert simulation.report.verdict == "off_target"  # without the torque asked for; worse than a limit
    worst = base.worst["motor_torque_limit"]
    assert abs(worst.bound) == limit
    assert abs(worst.value) == np.abs(past.tau_motor_cmd[:, 0]).max()
    said = re.search(
        rf"base: joint-side torque of motor {worst.motor} is (\S+) N m at", str(simulation.report)
    )
    assert said
    assert float(said[1]) == pytest.approx(worst.value, rel=1e-3)


def test_stamps_since_1970_do_as_well_as_those_from_zero():
    """An integrator that counted so would step by 2.4e-7 s at the least, and see its times rounded so."""
    original = short_motion(3)
    stamps = original.times.block(0, original.samples)
    zero, late = (
        simulate(
            vsa_3r(),
            Trajectory(RecordedTimes(start + stamps), original.position, original.commanded, name="test"),
            initial_error=InitialError(0.001),
        )
        for start in (0.0, 1.7e9)
    )
    np.testing.assert_array_equal(late.history.time, 1.7e9 + stamps)
    # the steps themselves are rounded by 1.2e-7 s, at speeds below 3 rad/s
    np.testing.assert_allclose(late.history.q, zero.history.q, rtol=0, atol=4e-7)


@pytest.mark.slow
def test_a_run_ends_where_the_decoupling_matrix_becomes_singular():
    """The stiffness is driven to 805, below what the loaded joints can have."""
    trajectory = motion((850.0,) * 3, (805.0,) * 3)
    simulation = simulate(vsa_3r(), trajectory, gains=GAINS)
    past, report = simulation.history, simulation.report
    assert report.verdict == "singular"
    assert not report.complete
    assert past.time[-1] < trajectory.duration
    assert report.ending == (
        f"shoulder: its decoupling matrix became singular; ended at t = {time_text(float(past.time[-1]))}"
    )
    assert past.flags[-1].tolist() == [0, Flag.SINGULAR, 0]
    assert not past.flags[:-1].any()
    # at 1e-4 of the first determinant, to what the event's root finder leaves
    assert past.det_A[-1, 1] / past.det_A[0, 1] == pytest.approx(1e-4, rel=1e-3)


def test_a_boundary_lies_where_its_distance_is_no_number_any_more():
    """The root finder of an event needs numbers; a law may have none beyond its end."""
    trajectory, robot = short_motion(3), vsa_3r()
    reference = TabulatedReference(trajectory)
    loop = ClosedLoop(robot, Feedforward(robot, trajectory), reference)
    start = loop.packing.pack(*loop.plant.unpack_state(start_state(robot, trajectory, InitialError())))
    boundary = Singularity(loop, start)
    assert boundary.distance(start) == pytest.approx(1 - 1e-4, rel=1e-12)
    assert boundary.distance(np.where(np.arange(len(start)) == 7, np.nan, start)) == -1


def test_feedforward_ends_where_there_are_no_torques():
    trajectory = motion((850.0,) * 3, (790.0,) * 3)
    simulation = simulate(vsa_3r(), trajectory)
    assert simulation.report.verdict == "infeasible"
    assert "cannot be executed, so there are no torques to apply" in simulation.report.ending
    assert 0.5 < simulation.history.time[-1] < trajectory.duration
    assert np.isfinite(simulation.history.tau_motor_cmd).all()
    assert (simulation.history.flags[-1] & Flag.INFEASIBLE).any()


def test_a_tendon_that_goes_slack_ends_the_run():
    motor = Motor(inertia=3.0, damping=1e-4)
    actuator = Antagonistic(motor=(motor, motor), spring=(laws.Quadratic(k=2000), laws.Quadratic(k=2000)))
    robot = vsa_3r()
    joints = tuple(dataclasses.replace(joint, actuator=actuator) for joint in robot.joints)
    robot = dataclasses.replace(robot, joints=joints)
    # 509 N m/rad is what the shoulder's load takes; open loop, the error at the start swings below
    simulation = simulate(robot, motion((530.0,) * 3, (530.0,) * 3), initial_error=InitialError(0.02, 50))
    assert simulation.report.verdict == "infeasible"
    assert "a spring left the range" in simulation.report.ending
    phi = simulation.history.phi[-1]
    assert np.abs(phi * [1, -1]).min() == pytest.approx(0, abs=1e-9)  # the event's root in deflection


def test_feedforward_that_only_has_torques_at_the_start_ends_there():
    simulation = simulate(vsa_3r(), motion((850.0,) * 3, (1275.0,) * 3, duration=0.1))
    assert simulation.report.verdict == "infeasible"
    assert "cannot be executed, so there are no torques to apply" in simulation.report.ending
    assert simulation.history.time.tolist() == [0]
    assert np.isfinite(simulation.history.tau_motor_cmd).all()


@pytest.mark.slow
def test_measured_positions_cost_accuracy_and_the_report_says_how_much():
    conditions = {"gains": GAINS, "initial_error": InitialError(0.01, 5)}
    losses = {}
    for rate in (250, 1000):
        trajectory = short_motion(3, rate=rate, duration=0.3)
        simulation = simulate(vsa_3r(), trajectory, feedback="positions", **conditions)
        ideal = simulate(vsa_3r(), trajectory, **conditions)
        assert simulation.report.complete
        assert simulation.report.with_full_state == tuple(joint.q for joint in ideal.report.joints)
        assert np.array_equal(simulation.history.time, ideal.history.time)
        losses[rate] = np.abs(simulation.history.q - ideal.history.q).max()
    # delay and hold are proportional to the step
    assert 1e-6 < losses[1000] < losses[250] / 2
    header, _, base, *_ = str(simulation.report).split("\n\n")[1].splitlines()
    assert header.split("  ")[-1].strip() == "q error with full state"
    assert base.split("  ")[-1].strip().startswith("0.01 / ")


def test_rates_of_a_ramp_are_found():
    start = Phase(*(np.zeros(1) for _ in range(4)), integral=None)
    rates = RateFilter(start)
    for step in range(1, 60):
        rates.add(start._replace(q=np.array([0.3 * step]), theta=np.array([-0.2 * step])), 0.1)
    assert rates.phase.dq == pytest.approx([3.0], rel=1e-14)  # 0.53^59 = 6e-17 of the first error is left
    assert rates.phase.dtheta == pytest.approx([-2.0], rel=1e-14)


@pytest.mark.parametrize("step", [0.1, 0.001])
def test_rates_follow_a_step_as_a_low_pass_at_a_tenth_of_the_sampling_rate_does(step):
    """1 - exp(-2 pi f t), at f = 0.1/step and t = k step."""
    start = Phase(*(np.zeros(1) for _ in range(4)), integral=None)
    rates = RateFilter(start)
    for k in range(1, 6):
        rates.add(start._replace(q=np.array([3.0 * step * k]), theta=np.array([-2.0 * step * k])), step)
        reached = 1 - np.exp(-2 * np.pi * 0.1 * k)
        assert rates.phase.dq == pytest.approx([3.0 * reached], rel=1e-12)  # rounding of differences
        assert rates.phase.dtheta == pytest.approx([-2.0 * reached], rel=1e-12)


def test_rigid_joints_can_be_driven_by_feedforward_but_not_linearized():
    with pytest.raises(InputError, match="needs springs at all joints or at none: elbow is rigid"):
        simulate(with_actuators(vsa_3r(), {2: rigid()}), short_motion(3), gains=GAINS)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (
            InitialError([0.1, 0.2]),
            r"initial position error: expected 1 value, or 3 \(base, shoulder, elbow\), found 2",
        ),
        (InitialError(np.nan), "initial position error: expected finite values"),
        (
            InitialError(0, -100),
            r"shoulder: stiffness 750 N m/rad at the start is below the minimum of 819\.4 N m/rad at this "
            r"load; increase it, or choose smaller initial errors\nelbow: ",
        ),
    ],
)
def test_starts_that_cannot_be_had_are_refused(error, message):
    with pytest.raises(InputError, match=message):
        simulate(vsa_3r(), motion(), initial_error=error)


def test_a_start_beyond_the_springs_names_the_trajectory(tmp_path):
    path = rest_to_rest(tmp_path / "soft.yaml")
    path.write_text(path.read_text().replace("start: 850", "start: 700"))
    with pytest.raises(InputError) as refused:
        simulate(vsa_3r(), load_trajectory(path, vsa_3r()))
    assert [problem.file for problem in refused.value.problems] == [str(path)] * 3
    assert refused.value.problems[0].message == (
        "base: stiffness 700 N m/rad at the start is below the minimum of 800 N m/rad at this load; "
        "increase it"
    )


def test_initial_errors_of_more_than_a_turn_are_questioned():
    short = short_motion(3, duration=0.1)
    warnings = simulate(vsa_3r(), short, initial_error=InitialError([10.0, 0.0, 10.0])).report.warnings
    asked = [warning for warning in warnings if "turns" in warning]
    assert asked == ["the initial position error of 10 rad is 1.6 turns; did you mean 10 deg (0.1745 rad)?"]
    assert not simulate(vsa_3r(), short, initial_error=InitialError(1.0)).report.warnings


def test_conditions_that_contradict_themselves_are_refused():
    with pytest.raises(InputError, match="positions as feedback need the controller feedback-linearization"):
        simulate(vsa_3r(), short_motion(3), feedback="positions")
    with pytest.raises(InputError, match="unknown feedback 'position'; did you mean 'positions'"):
        simulate(vsa_3r(), short_motion(3), gains=GAINS, feedback="position")
    with pytest.raises(InputError, match=r"the relative tolerance must be from 1e-13 to 0\.001, not 1e-15"):
        Tolerances(rtol=1e-15)
    with pytest.raises(InputError, match=r"the model error must be at least 0 and below 1, e\.g\. .* not 1"):
        perturbed(vsa_3r(), 1.0, seed=0)
    with pytest.raises(InputError, match="the seed must be zero or positive, not -1"):
        perturbed(vsa_3r(), 0.1, seed=-1)


def test_perturbation_touches_every_dynamic_parameter_and_nothing_else():
    robot = mixed_3r()[0]
    other = perturbed(robot, 0.1, seed=0)
    for before, after in zip(robot.joints, other.joints, strict=True):
        assert (after.name, after.dh, after.limits) == (before.name, before.dh, before.limits)
        factor = after.link.inertia.xx / before.link.inertia.xx
        assert factor != 1
        assert after.link.inertia.tensor == pytest.approx(factor * before.link.inertia.tensor, rel=1e-14)
        assert 0 < abs(after.link.mass / before.link.mass - 1) <= 0.1
        assert after.damping != before.damping
    (first, second), spring = other.joints[0].actuator.spring, robot.joints[0].actuator.spring[0]
    assert len({first.k, second.k, spring.k}) == len({first.k_c, second.k_c, spring.k_c}) == 3
    assert first.max_deflection == spring.max_deflection
    assert other.joints[1].actuator.stiffness != robot.joints[1].actuator.stiffness


def test_every_declared_variable_is_in_the_history():
    past = simulate(vsa_3r(), short_motion(3), sensors=Sensors()).history
    has = vsa_3r().has_variable
    assert list(past.arrays()) == [name for name, each in SIMULATION_VARIABLES.items() if has(each)]


def test_the_report_is_plain_json():
    report = simulate(vsa_3r(), short_motion(3)).report
    content = json.loads(json.dumps(report.as_json(), allow_nan=False))
    assert content["format"] == "vsacli-simulation-report/2"
    assert content["controller"] == "feedforward"
    assert content["joints"][0]["q_error"].keys() == {"peak", "time", "final"}
    assert content["ending"] is None
    lines = str(report).splitlines()
    assert lines[0].startswith("OK  vsa-3r, short: feedforward, 0.8 s; ")
    assert lines[2].split("  ")[0] == "joint"
