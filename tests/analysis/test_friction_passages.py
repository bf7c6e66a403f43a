"""Friction between links that changes its sign between two steps: what motors do meanwhile is told."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from samples.fixes import pendulum

from vsacli import Friction, Robot, Trajectory, inverse_dynamics, motor_torques
from vsacli.analysis.run import Run
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.trajectory.curves import ConstantProfile
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.times import UniformTimes

TOLD = re.compile(r"from t = ([\d.]+) s on: motor torques reach (\S+) N m there, (\S+) at the samples")


def rubbing(width: float) -> Robot:
    robot = pendulum()
    (joint,) = robot.joints
    friction = Friction(coulomb=(2.0, 2.0), width=width)
    return dataclasses.replace(robot, joints=(dataclasses.replace(joint, friction=friction),))


def swing(rate: float) -> Trajectory:
    """It turns back four times, never at a step."""
    times = UniformTimes(2.0, rate)
    sines = Sinusoids(
        signal=POSITION, span=times.span, cycles=2.0, offset=(0.1,), sine=((0.3,),), cosine=((0.05,),)
    )
    firm = ConstantProfile(signal=STIFFNESS, span=times.span, value=(1500.0,))
    return Trajectory(times, sines, {"stiffness": firm}, name="swing")


@pytest.mark.parametrize("width", [3e-3, 1e-4, 1e-6])
def test_peaks_between_the_steps_are_those_of_a_dense_scan(width: float) -> None:
    robot, trajectory = rubbing(width), swing(500.0)
    report = inverse_dynamics(robot, trajectory).report
    (note,) = [note for note in report.notes if "friction between the links" in note]
    found = TOLD.search(note)
    assert found is not None, note
    first, between, at_steps = map(float, found.groups())
    steps = trajectory.block(0, trajectory.samples)
    turns = np.flatnonzero(np.diff(np.sign(steps.dq[:, 0])))
    assert 0 <= steps.time[turns[0]] - first <= 1 / 500  # one step earlier it may be within reach
    # each turn, a hundred times as fine as the friction changes its sign
    peaks = [
        np.abs(motor_torques(robot, trajectory.at(time)).tau_motor).max()
        for turn in turns
        for time in [_around(trajectory, steps.time[turn], width)]
    ]
    assert between == pytest.approx(max(peaks), rel=0.02)  # 25 levels, 3 digits
    assert at_steps == pytest.approx(np.abs(motor_torques(robot, steps).tau_motor).max(), rel=1e-2)


def _around(trajectory: Trajectory, time: float, width: float) -> np.ndarray:
    for _ in range(8):  # to where it turns, by Newton's method
        here = trajectory.at(np.array([time]))
        time -= float(here.dq[0, 0] / here.ddq[0, 0])
    long = 4 * width / abs(float(here.ddq[0, 0]))
    return np.linspace(time - long, time + long, 801)


def test_nothing_is_told_where_the_steps_show_it() -> None:
    for robot, rate in ((rubbing(0.1), 500.0), (rubbing(3e-3), 20_000.0), (pendulum(), 500.0)):
        report = inverse_dynamics(robot, swing(rate)).report
        assert not [note for note in report.notes if "friction" in note]


def test_blocks_do_not_matter() -> None:
    notes = []
    for samples in (37, 5000):
        run = Run(rubbing(1e-5), swing(500.0), block_samples=samples)
        list(run)
        notes.append(run.report().notes)
    assert notes[0] == notes[1]
    assert len(notes[0]) == 1


def test_where_nothing_is_known_between_the_steps_it_is_said() -> None:
    motion = swing(500.0).block(0, 1001)
    given = {name: motion.of_joints[name] for name in ("dq", "ddq", "d3q")}
    trajectory = Trajectory.from_samples(
        motion.time, motion.q, motion.commanded["stiffness"], **given, name="given"
    )
    notes = inverse_dynamics(rubbing(1e-5), trajectory).report.notes
    assert any("what the motors do meanwhile is not known" in note for note in notes)
