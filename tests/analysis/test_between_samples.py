"""What lies between the steps, against SciPy's scalar minimizer and dense sampling."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from samples.marks import slow
from samples.robots import random_robot
from scipy.optimize import minimize_scalar

from vsacli import Flag, Limits, Motor, Report, Robot, Trajectory, inverse_dynamics, motor_torques
from vsacli.actuators.reach import margin
from vsacli.analysis.between_samples import SAMPLES_ONLY, SCAN_TIMES
from vsacli.analysis.run import Run
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.trajectory.curves import ConstantProfile
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.times import UniformTimes

DURATION = 6.0
CASES = [("R", 7.0), ("P", 103.0), *(slow(*case) for case in [("P", 7.0), ("R", 40.0), ("R", 103.0)])]
"""Joints and rates; at 7 and 40 Hz the run is scanned, at 103 Hz it is looked at around its steps."""

KNOWN = 1e-3
"""What is promised: a minimum to this share of it."""


def swinging(rate: float, joints: int = 1, stiffness: float = 1500.0, swing: float = 0.0) -> Trajectory:
    """Sums of sines whose extrema fall between the steps."""
    span = (0.0, DURATION)
    joint = np.arange(joints)
    sine = tuple(tuple((0.3 / order * np.cos(order * joint)).tolist()) for order in (1, 2, 3))
    cosine = tuple(tuple((0.3 / order * np.sin(1 + order + joint)).tolist()) for order in (1, 2, 3))
    position = Sinusoids(
        signal=POSITION, span=span, cycles=3.3, offset=(0.1,) * joints, sine=sine, cosine=cosine
    )
    of_stiffness = Sinusoids(
        signal=STIFFNESS,
        span=span,
        cycles=2.3,
        offset=(stiffness,) * joints,
        sine=((swing,) * joints,),
        cosine=((swing / 2,) * joints,),
    )
    return Trajectory(UniformTimes(DURATION, rate), position, {"stiffness": of_stiffness}, name="swinging")


def size(robot: Robot, trajectory: Trajectory, name: str, times: np.ndarray) -> np.ndarray:
    """Size of a variable of the only joint, of motors that of the larger one; (samples,)."""
    values: np.ndarray = np.abs(getattr(motor_torques(robot, trajectory.at(times)), name)[:, 0])
    return values if values.ndim == 1 else values.max(axis=1)


def largest(robot: Robot, trajectory: Trajectory, name: str) -> tuple[float, float]:
    """Largest size at the steps, and over all time: Brent's method about the largest of many."""
    steps = size(robot, trajectory, name, trajectory.times.block(0, trajectory.samples))
    times = np.linspace(0, DURATION, 4001)
    dense = size(robot, trajectory, name, times)
    near = int(np.clip(dense.argmax(), 1, len(times) - 2))
    found = minimize_scalar(
        lambda time: -float(size(robot, trajectory, name, np.array([time]))[0]),
        bounds=(times[near - 1], times[near + 1]),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float(steps.max()), max(-float(found.fun), float(dense.max()))


def limited(robot: Robot, **bounds: float) -> Robot:
    """The robot of one joint with bounds of the sizes of some of its variables."""
    (joint,) = robot.joints
    motor = Motor(
        inertia=0.4,
        damping=0.1,
        max_torque=bounds.get("tau_motor", math.inf),
        max_velocity=bounds.get("dtheta", math.inf),
    )
    spring, _ = joint.actuator.spring
    spring = dataclasses.replace(spring, max_deflection=bounds.get("phi", math.inf))
    actuator = dataclasses.replace(joint.actuator, motor=(motor, motor), spring=(spring, spring))
    names = {"q": "position", "dq": "velocity", "stiffness": "stiffness"}
    limits = {
        names[name]: (-bound if name != "stiffness" else 0.0, bound)
        for name, bound in bounds.items()
        if name in names
    }
    joint = dataclasses.replace(joint, actuator=actuator, limits=Limits(**limits))
    return dataclasses.replace(robot, joints=(joint,))


LIMITED = {
    "q": Flag.POSITION_LIMIT,
    "dq": Flag.VELOCITY_LIMIT,
    "stiffness": Flag.STIFFNESS_LIMIT,
    "phi": Flag.DEFLECTION_LIMIT,
    "dtheta": Flag.MOTOR_VELOCITY_LIMIT,
    "tau_motor": Flag.MOTOR_TORQUE_LIMIT,
}


@pytest.mark.parametrize(("letter", "rate"), CASES)
@pytest.mark.parametrize("name", LIMITED)
def test_limits_that_no_step_exceeds(name: str, letter: str, rate: float) -> None:
    free, trajectory = limited(random_robot(letter, seed=8)), swinging(rate, swing=100.0)
    at_steps, most = largest(free, trajectory, name)
    assert most > at_steps > 0
    bound = at_steps + 0.4 * (most - at_steps)
    robot, label = limited(free, **{name: bound}), LIMITED[name].label
    result = inverse_dynamics(robot, trajectory)
    (joint,) = result.report.joints
    assert result.report.verdict == "over_limit"
    assert joint.samples["over_limit"] >= 1
    found = joint.between[label]
    assert found == joint.worst[label]
    assert abs(found.bound) == bound
    assert abs(found.value) == pytest.approx(most, abs=KNOWN * (most - bound) + 1e-9 * bound)
    nearest = int(np.abs(result.time - found.time).argmin())
    assert result.flags[nearest, 0] & LIMITED[name]
    assert f"joint_1: {LIMITED[name].quantity}" in str(result.report)
    assert "between two samples" in str(result.report)


@pytest.mark.parametrize(("letter", "rate"), CASES)
@pytest.mark.parametrize(("promised", "flag"), [(0.01, Flag.NEAR_SINGULAR), (0.0, Flag.INFEASIBLE)])
def test_margins_that_are_smaller_than_at_any_step(
    promised: float, flag: Flag, letter: str, rate: float
) -> None:
    """Every step has a larger margin than was promised, and a time between has not."""
    if promised and rate > 100:
        pytest.skip("the difference is less than the thousandth to which a margin is known")
    robot = limited(random_robot(letter, seed=8))
    at_steps, everywhere = largest(robot, swinging(rate), "stiffness_min")
    stiffness = (at_steps + everywhere) / 2 / (1 - promised)
    trajectory, least = swinging(rate, stiffness=stiffness), 1 - everywhere / stiffness
    result = inverse_dynamics(robot, trajectory)
    (joint,) = result.report.joints
    assert joint.margin == pytest.approx(least, abs=KNOWN * abs(least) + 1e-9)
    between = joint.between["margin"]
    assert between.time == joint.margin_time == joint.worst[flag.label].time
    marked = result.flags[:, 0] & flag != 0
    assert marked[np.abs(result.time - between.time).argmin()]
    assert joint.samples[flag.label] == np.count_nonzero(marked)
    assert np.isfinite(result.tau_motor[marked]).all(), "the steps themselves are feasible"
    assert result.report.verdict == ("infeasible" if flag is Flag.INFEASIBLE else "ok")


def test_minima_that_are_known_are_not_mentioned() -> None:
    """At 20 kHz, the steps know each minimum to a thousandth."""
    robot = limited(random_robot("R", seed=8), q=0.75)
    result = inverse_dynamics(robot, swinging(20000.0, stiffness=1000.0))
    assert not result.report.joints[0].between
    assert "between" not in json.dumps(result.report.as_json())


def three_joints(rate: float = 103.0) -> tuple[Robot, Trajectory]:
    """Steps all of which are feasible, and stiffnesses below the corridor between them."""
    robot = random_robot("RRR", seed=3)
    trajectory = swinging(rate, joints=3)
    block = motor_torques(robot, trajectory.at(np.linspace(0, DURATION, 5 * int(DURATION * rate) + 1)))
    lower = block.stiffness_min
    at_steps, everywhere = lower[::5].max(axis=0), lower.max(axis=0)
    stiffness = np.where(everywhere > at_steps + 1e-3, (at_steps + everywhere) / 2, 2 * everywhere)
    constant = ConstantProfile(signal=STIFFNESS, span=(0.0, DURATION), value=tuple(stiffness.tolist()))
    return robot, Trajectory(trajectory.times, trajectory.position, {"stiffness": constant}, name="three")


@pytest.mark.cases(2)
@pytest.mark.slow
@pytest.mark.parametrize("block_samples", [1, 2, 7, 50])
def test_what_is_found_does_not_depend_on_the_blocks(block_samples: int) -> None:
    """Of a run so long that it is looked at around its steps."""
    robot, trajectory = three_joints()
    assert trajectory.samples > SCAN_TIMES
    whole = inverse_dynamics(robot, trajectory)
    run = Run(robot, trajectory, block_samples=block_samples)
    blocks = list(run)
    assert max(len(block.time) for block in blocks) == block_samples
    np.testing.assert_array_equal(np.concatenate([block.flags for block in blocks]), whole.flags)
    assert run.report().as_json() == whole.report.as_json()
    assert [joint.between for joint in run.report().joints] == [
        joint.between for joint in whole.report.joints
    ]


@pytest.mark.slow
def test_every_dip_below_the_corridor_is_found_and_its_nearest_step_marked() -> None:
    """The oracle looks at a hundred times from each step to the next."""
    robot, trajectory = three_joints()
    assert trajectory.samples > SCAN_TIMES
    dense = trajectory.at(np.linspace(0, DURATION, 100 * (trajectory.samples - 1) + 1))
    block = motor_torques(robot, dense)
    gap = margin(block.stiffness, block.stiffness_min, block.stiffness_max)
    result = inverse_dynamics(robot, trajectory)
    assert result.report.verdict == "infeasible"
    for index, joint in enumerate(result.report.joints):
        infeasible = np.flatnonzero(result.flags[:, index] & Flag.INFEASIBLE)
        outside = np.unique(np.round(np.flatnonzero(gap[:, index] < -1e-9) / 100))
        assert set(infeasible) <= set(outside), "no step is marked without a dip beside it"
        dips = np.split(outside, np.flatnonzero(np.diff(outside) > 1) + 1)
        assert all(set(dip) & set(infeasible) for dip in dips if dip.size), (
            "no dip without a step that is marked"
        )
        assert joint.margin == pytest.approx(gap[:, index].min(), rel=2 * KNOWN)
    stored = Report.from_json(json.loads(json.dumps(result.report.as_json())))
    assert str(stored) == str(result.report)


def test_a_run_that_stops_does_so_at_the_step_beside_a_dip() -> None:
    robot, trajectory = three_joints()
    whole = inverse_dynamics(robot, trajectory)
    first = int(np.any(whole.flags & Flag.INFEASIBLE != 0, axis=1).argmax())
    stopped = inverse_dynamics(robot, trajectory, stop_on_infeasible=True)
    assert len(stopped.time) == first + 1
    assert not stopped.report.complete
    assert stopped.report.verdict == "infeasible"
    np.testing.assert_array_equal(stopped.flags, whole.flags[: first + 1])
    worst = [joint.worst["infeasible"].time for joint in stopped.report.joints if joint.worst]
    assert worst
    step = trajectory.duration / (trajectory.samples - 1)
    assert max(worst) < whole.time[first] + step / 2


def test_a_spike_between_coarse_steps() -> None:
    """Steps at the zeros of a swing: its load shows at none of them."""
    robot = limited(random_robot("R", seed=8))
    span = (0.0, DURATION)
    position = Sinusoids(
        signal=POSITION, span=span, cycles=12.0, offset=(0.1,), sine=((0.3,),), cosine=((0.0,),)
    )
    times = UniformTimes(DURATION, 4.0)

    def zeros(stiffness: float) -> Trajectory:
        constant = ConstantProfile(signal=STIFFNESS, span=span, value=(stiffness,))
        return Trajectory(times, position, {"stiffness": constant}, name="zeros")

    at_steps, everywhere = largest(robot, zeros(1500.0), "stiffness_min")
    assert everywhere > 1.09 * at_steps
    stiffness = 1.05 * at_steps
    report = inverse_dynamics(robot, zeros(stiffness)).report
    assert report.verdict == "infeasible"
    assert report.joints[0].margin == pytest.approx(1 - everywhere / stiffness, rel=KNOWN)


@pytest.mark.slow
def test_where_some_derivatives_are_given_the_samples_are_all_there_is() -> None:
    robot, trajectory = three_joints()
    motion = trajectory.block(0, trajectory.samples)
    given = {name: getattr(motion, name) for name in ("dq", "ddq", "d3q")}
    stiffness = motion.commanded["stiffness"]
    recorded = Trajectory.from_samples(motion.time, motion.q, stiffness, **given)
    report = inverse_dynamics(robot, recorded).report
    assert report.verdict == "ok"
    assert SAMPLES_ONLY in report.notes
    assert not any(joint.between for joint in report.joints)
    splined = inverse_dynamics(robot, Trajectory.from_samples(motion.time, motion.q, stiffness)).report
    assert splined.verdict == "infeasible"
    assert SAMPLES_ONLY not in splined.notes
