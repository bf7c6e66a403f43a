"""Sensors in simulations: noise, the steps of encoders, and that a controller knows what is recorded."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.plants import elastic, rigid, with_actuators
from samples.robots import vsa_3r
from samples.simulated import short_motion

from vsacli import FeedbackLinearization, Gains, InputError, Limits, Sensors, State, load_trajectory, simulate
from vsacli.files.examples import examples

GAINS = Gains.from_poles([-12] * 4, [-12] * 2)


def test_noise_is_normal_white_and_as_large_as_said():
    past = simulate(vsa_3r(), short_motion(3, rate=1000), sensors=Sensors(2e-5, 0.5, seed=4)).history
    for name, deviation in (("q", 2e-5), ("theta", 2e-5), ("tau_motor", 0.5)):
        noise = getattr(past, f"{name}_measured") - getattr(past, name)
        noise = noise.reshape(len(past.time), -1) / deviation
        samples = len(noise)
        # five standard deviations of the estimates from so many samples
        assert np.abs(noise.mean(axis=0)).max() < 5 / np.sqrt(samples)
        assert np.abs(noise.std(axis=0) - 1).max() < 5 / np.sqrt(2 * samples)
        both = np.concatenate((noise[1:], noise[:-1]), axis=1)
        others = np.corrcoef(both.T) - np.eye(both.shape[1])
        columns = noise.shape[1]
        repeated = others[:columns, :columns], others[columns:, columns:]
        lagged = others[:columns, columns:]
        assert max(np.abs(part).max() for part in (*repeated, lagged)) < 5 / np.sqrt(samples)


def test_a_seed_repeats_the_readings_and_another_does_not():
    first, again, other = (
        simulate(vsa_3r(), short_motion(3), sensors=Sensors(1e-4, seed=seed)).history.q_measured
        for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.isclose(first, other, rtol=0, atol=1e-9).any()


def test_encoders_round_to_their_steps_on_either_side_of_the_gear():
    robot = vsa_3r()
    base = robot.joints[0]
    motors = (replace(base.actuator.motor[0], gear_ratio=-100.0, side="shaft"), base.actuator.motor[1])
    base = replace(base, actuator=replace(base.actuator, motor=motors))
    robot = replace(robot, joints=(base, *robot.joints[1:]))
    past = simulate(robot, short_motion(3), sensors=Sensors(encoder_bits=12)).history
    step = 2 * np.pi / 4096
    steps = np.array([[step / 100, step], [step, step], [step, step]])
    for read, true, size in (
        (past.q_measured, past.q, step),
        (past.theta_measured, past.theta, steps),
    ):
        whole = read / size
        assert np.abs(whole - np.round(whole)).max() < 1e-9  # rounding of some 1e5 steps
        assert np.abs(read - true).max() <= np.max(size) / 2 * (1 + 1e-9)
        assert (np.abs(read - true) <= size / 2 * (1 + 1e-9)).all()
        assert np.abs(read - true).max() > 0.4 * np.max(size)  # they do round
    assert np.array_equal(past.tau_motor_measured, past.tau_motor)


def test_an_encoder_of_a_slide_divides_its_range():
    (example,) = examples(["rp_2"])
    robot, slide = example.robot, example.robot.joints[1]
    trajectory = load_trajectory(example.trajectories[0].path, robot)
    lower, upper = -0.25, 0.75
    limited = replace(slide, limits=replace(slide.limits, position=(lower, upper)))
    past = simulate(
        replace(robot, joints=(robot.joints[0], limited)), trajectory, sensors=Sensors(encoder_bits=8)
    ).history
    whole = past.q_measured[:, 1] * 256
    assert np.abs(whole - np.round(whole)).max() < 1e-9
    endless = replace(robot, joints=(robot.joints[0], replace(slide, limits=Limits())))
    with pytest.raises(InputError, match=r"slide: the resolution of its encoder.*limits\.position"):
        simulate(endless, trajectory, sensors=Sensors(encoder_bits=8))


def test_joints_without_springs_have_an_encoder_at_the_motor_too():
    robot = with_actuators(vsa_3r(), {1: elastic(), 2: rigid()})
    past = simulate(robot, short_motion(3), sensors=Sensors(1e-3)).history
    assert np.isnan(past.theta_measured[:, 1:, 1]).all()  # there is no second motor
    assert np.isfinite(past.theta_measured[:, :, 0]).all()
    same = past.theta_measured[:, 2, 0] == past.q_measured[:, 2]
    assert not same.any()


@pytest.mark.slow
def test_perfect_sensors_change_nothing():
    conditions = {"gains": GAINS, "feedback": "positions"}
    plain = simulate(vsa_3r(), short_motion(3), **conditions).history
    read = simulate(vsa_3r(), short_motion(3), **conditions, sensors=Sensors()).history
    assert np.array_equal(plain.tau_motor_cmd, read.tau_motor_cmd)
    assert np.array_equal(read.q_measured, plain.q)
    assert plain.q_measured is None


@pytest.mark.slow
def test_a_controller_that_measures_positions_knows_what_is_recorded():
    """Its torques follow from the recorded positions alone, by the filter and the law."""
    sensors = Sensors(1e-4, encoder_bits=16, seed=2)
    motion = short_motion(3)
    past = simulate(vsa_3r(), motion, gains=GAINS, feedback="positions", sensors=sensors).history
    control = FeedbackLinearization(vsa_3r(), GAINS)
    q, theta = past.q_measured, past.theta_measured
    dq, dtheta = past.dq[0], past.dtheta[0]  # known at the start: the robot rests
    keep = np.exp(-0.2 * np.pi)
    for sample in range(1, 20):
        step = past.time[sample] - past.time[sample - 1]
        dq = keep * dq + (1 - keep) * (q[sample] - q[sample - 1]) / step
        dtheta = keep * dtheta + (1 - keep) * (theta[sample] - theta[sample - 1]) / step
        state = State(q=q[sample], dq=dq, theta=theta[sample], dtheta=dtheta)
        expected = control(state, motion.at(past.time[sample]))
        # rounding: the largest terms of the law, gains times inertias, cancel to six digits
        assert past.tau_motor_cmd[sample] == pytest.approx(expected, rel=1e-9, abs=1e-7)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"position": -1e-5}, r"noise must be from 0 to 1e\+30, not -1e-05"),
        ({"torque": np.nan}, "noise must be .* not nan"),
        ({"torque": 1e300}, r"noise must be .* not 1e\+300"),
        ({"encoder_bits": 0}, "1 to 48 bits, not 0"),
        ({"encoder_bits": 64}, "1 to 48 bits, not 64"),
        ({"seed": -1}, "seed must be"),
    ],
)
def test_sensors_that_cannot_be_are_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        Sensors(**wrong)


@pytest.mark.slow
def test_a_recording_from_the_desk_is_as_far_off_as_its_noise(vsacli, tmp_path):
    arm, motion = REPOSITORY / "robots/planar_2r.yaml", REPOSITORY / "trajectories/planar_2r.yaml"
    assert vsacli("invdyn", arm, motion, "-o", tmp_path / "plan.h5").code == 0
    run = vsacli("simulate", arm, motion, "--sensor-noise", "1e-4,0.5", "-o", tmp_path / "lab.h5")
    assert run.code == 0
    printed = vsacli("export", tmp_path / "lab.h5", "--variables", "q_measured,tau_motor_measured").out
    (tmp_path / "lab.csv").write_text(printed.replace("_measured", ""))
    compared = vsacli("compare", tmp_path / "plan.h5", tmp_path / "lab.csv")
    rms = {
        words[0]: float(words[3])
        for line in compared.out.split("\n\n")[1].splitlines()[2:]
        if len(words := re.split(r"\s{3,}", line)) > 3
    }
    # of a normal noise, whose rms over some 10^3 samples is within a few per cent of its deviation
    assert rms["shoulder.q"] == pytest.approx(1e-4, rel=0.1)
    assert rms["elbow.tau_motor_2"] == pytest.approx(0.5, rel=0.1)
    assert vsacli("simulate", arm, motion, "-o", tmp_path / "plain.h5").code == 0
    refused = vsacli("export", tmp_path / "plain.h5", "--variables", "q_measured")
    assert "holds no q_measured" in refused.err
    assert vsacli("simulate", arm, motion, "--sensor-noise", "1,2,3", "-o", tmp_path / "x.h5").code == 2
