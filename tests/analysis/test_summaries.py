"""What a run reports: counts, first times, worst steps, peaks and the verdict, whatever the blocks."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from samples.drives import Stopped, lower_by_branch, motion, springs, with_branch, with_joint
from samples.robots import vsa_3r
from samples.shipped import shipped_robot

from vsacli import Antagonistic, Flag, Limits, Motor, Report, Robot, Trajectory, inverse_dynamics, laws
from vsacli.actuators.reach import margin
from vsacli.analysis.run import Run
from vsacli.base.flags import LIMITS
from vsacli.compute.engine.engines import SAMPLES_PER_PASS
from vsacli.dynamics.inverse import usual_block

MOTOR_VARIABLES = ("phi", "dphi", "theta", "dtheta", "ddtheta", "tau_transmission", "tau_motor", "det_A")


def troubled() -> tuple[Robot, Trajectory]:
    """Joint 1 touches the end of its corridor, 2 breaks limits, 3 leaves the corridor."""
    motor = Motor(inertia=3.05, damping=1e-4, max_torque=25, max_velocity=0.5)
    spring = laws.Cubic(k=400, k_c=2000, max_deflection=0.08)
    shoulder = dataclasses.replace(
        vsa_3r().joints[1],
        actuator=Antagonistic(motor=(motor, motor), spring=(spring, spring)),
        limits=Limits(position=(-0.1, 0.7), velocity=(-1, 0.4), stiffness=(0, 900)),
    )
    robot = with_joint(vsa_3r(), 1, shoulder)
    return robot, motion(stiffness=(850, 850, 830), end_stiffness=(800, 1000, 790))


def report_by_blocks(robot: Robot, trajectory: Trajectory, block_samples: int) -> Report:
    run = Run(robot, trajectory, block_samples=block_samples)
    for _ in run:
        pass
    return run.report()


@pytest.mark.slow
def test_results_do_not_depend_on_the_blocks():
    robot, trajectory = troubled()
    whole = inverse_dynamics(robot, trajectory)
    for block_samples in (1, 7, 100, 201):
        run = Run(robot, trajectory, block_samples=block_samples)
        blocks = list(run)
        assert max(len(block.time) for block in blocks) == block_samples
        for name in ("time", "q", "tau_e", "ddtau_e", *MOTOR_VARIABLES, "stiffness_min", "flags"):
            joined = np.concatenate([getattr(block, name) for block in blocks])
            np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
        assert run.report().as_json() == whole.report.as_json()


def test_a_long_chain_is_taken_in_shorter_blocks():
    assert usual_block(7) == usual_block(12) == SAMPLES_PER_PASS
    assert 11 * SAMPLES_PER_PASS < 1000 * usual_block(1000) <= 12 * SAMPLES_PER_PASS
    assert usual_block(10**9) == 1


def test_report_counts_and_dates_each_trouble():
    robot, trajectory = troubled()
    result = inverse_dynamics(robot, trajectory)
    kinds = {"infeasible": Flag.INFEASIBLE, "singular": Flag.SINGULAR, "over_limit": LIMITS}
    for index, joint in enumerate(result.report.joints):
        for kind, bits in kinds.items():
            hit = (result.flags[:, index] & bits) != 0
            assert joint.samples[kind] == hit.sum()
            assert joint.first_time.get(kind) == (result.time[hit.argmax()] if hit.any() else None)
    base, shoulder, elbow = result.report.joints
    assert (base.samples["singular"], base.samples["infeasible"]) == (1, 0)
    assert shoulder.samples["over_limit"] > 0
    assert elbow.samples["infeasible"] > 0


def test_report_names_the_worst_step_and_what_it_allows():
    result = inverse_dynamics(*troubled())
    elbow = result.report.joints[2]
    gap = margin(result.stiffness, result.stiffness_min, result.stiffness_max)[:, 2]
    step = gap.argmin()
    assert (elbow.margin, elbow.margin_time) == (gap[step], result.time[step])
    assert elbow.attainable == (result.stiffness_min[step, 2], math.inf)
    worst = elbow.worst["infeasible"]
    assert (worst.time, worst.value, worst.bound) == (
        result.time[step],
        result.stiffness[step, 2],
        result.stiffness_min[step, 2],
    )
    assert worst.unit == "N m/rad"


@pytest.mark.parametrize(
    ("label", "variable", "limit"),
    [
        ("position_limit", "q", 0.7),
        ("velocity_limit", "dq", 0.4),
        ("stiffness_limit", "stiffness", 900),
        ("deflection_limit", "phi", 0.08),
        ("motor_velocity_limit", "dtheta", 0.5),
        ("motor_torque_limit", "tau_motor", 25),
    ],
)
def test_report_names_the_worst_excess_of_each_limit(label: str, variable: str, limit: float):
    result = inverse_dynamics(*troubled())
    shoulder = result.report.joints[1]
    values = getattr(result, variable)[:, 1].reshape(len(result.time), -1)
    worst = shoulder.worst[label]
    step, motor = np.unravel_index(np.nanargmax(np.abs(values)), values.shape)
    assert (worst.value, worst.time) == (values[step, motor], result.time[step])
    assert abs(worst.bound) == limit
    assert worst.bound * worst.value > 0
    assert worst.motor == (None if values.shape[1] == 1 else motor + 1)
    over = np.any(np.abs(values) > limit, axis=1)
    assert shoulder.first_time[label] == result.time[over.argmax()]


def test_first_time_over_a_limit_is_that_of_either_motor():
    """Motor 2 is over its limit before motor 1 is."""
    result = inverse_dynamics(vsa_3r(), motion())
    speed = np.abs(result.dtheta[:, 0])
    step = int(np.argmax(speed[:, 0] > speed[:, 1] + 1e-6))
    bounds = speed[step, 0] * np.array([1.2, 0.8])
    first, second = (Motor(inertia=3.2, damping=1e-4, max_velocity=float(bound)) for bound in bounds)
    joint = vsa_3r().joints[0]
    actuator = dataclasses.replace(joint.actuator, motor=(first, second))
    robot = with_joint(vsa_3r(), 0, dataclasses.replace(joint, actuator=actuator))
    report = inverse_dynamics(robot, motion()).report.joints[0]
    over = speed > bounds
    assert over[:, 1].argmax() < over[:, 0].argmax()
    assert report.first_time["motor_velocity_limit"] == result.time[over[:, 1].argmax()]
    assert report.first_time["over_limit"] == report.first_time["motor_velocity_limit"]


def test_peaks_skip_steps_without_torque():
    result = inverse_dynamics(*troubled())
    for index, joint in enumerate(result.report.joints):
        assert joint.peak_tau_e == np.abs(result.tau_e[:, index]).max()
        assert joint.peak_tau_motor == tuple(np.nanmax(np.abs(result.tau_motor[:, index]), axis=0))


def test_start_tells_where_the_motors_wait_and_how_their_torque_jumps():
    result = inverse_dynamics(vsa_3r(), motion(stiffness=(850.0,) * 3, end_stiffness=(1275.0,) * 3))
    base = result.report.joints[0]
    assert base.start_theta == tuple(result.theta[0, 0])
    # At rest only the inertia B theta'' is missing from the torque that holds the spring.
    np.testing.assert_allclose(base.torque_discontinuity, 3.2 * np.abs(result.ddtheta[0, 0]), rtol=1e-12)


def test_ends_tell_where_the_motors_are_and_how_fast():
    whole = motion(stiffness=(850.0,) * 3, end_stiffness=(1275.0,) * 3)
    result = inverse_dynamics(vsa_3r(), whole)
    for index, joint in enumerate(result.report.joints):
        assert joint.end_theta == tuple(result.theta[-1, index])
        assert joint.start_dtheta == joint.end_dtheta == (0.0, 0.0)
        assert joint.peak_dtheta == tuple(np.abs(result.dtheta[:, index]).max(axis=0))


def test_end_of_a_run_that_stopped_early_is_unknown():
    robot, whole = troubled()
    for joint in inverse_dynamics(robot, whole, stop_on_infeasible=True).report.joints:
        assert np.isnan(joint.end_theta).all()
        assert np.isnan(joint.end_dtheta).all()


def test_report_names_the_other_branch_if_it_does_for_every_step():
    """Springs a hundred times too soft for the elbow, so that its load is beyond where the branches part."""
    weak = dataclasses.replace(
        vsa_3r().joints[2], actuator=springs(laws.Cubic(k=4, k_c=20), laws.Cubic(k=4.4, k_c=20))
    )
    tau_e = inverse_dynamics(vsa_3r(), motion()).tau_e[:, 2]
    lower = lower_by_branch(weak, tau_e)
    low, high = sorted(lower, key=lambda branch: lower[branch].max())
    stiffness = float(lower[low].max() + lower[high].max()) / 2
    for branch, asked, infeasible, other in [
        (high, stiffness, True, True),
        (low, stiffness, False, False),
        (high, 0.999 * float(lower[low].max()), True, False),
    ]:
        robot = with_joint(vsa_3r(), 2, with_branch(weak, branch))
        report = inverse_dynamics(robot, motion(stiffness=(850.0, 850.0, asked))).report.joints[2]
        assert (report.samples["infeasible"] > 0) == infeasible
        assert report.other_branch == other


def test_stop_on_infeasible_ends_with_the_first_infeasible_step():
    robot, trajectory = troubled()
    whole = inverse_dynamics(robot, trajectory)
    first = int(((whole.flags & Flag.INFEASIBLE) != 0).any(axis=1).argmax())
    assert 0 < first < len(whole.time) - 1
    for block_samples in (7, 8192):
        run = Run(robot, trajectory, stop_on_infeasible=True, block_samples=block_samples)
        flags = np.concatenate([block.flags for block in run])
        np.testing.assert_array_equal(flags, whole.flags[: first + 1])
        report = run.report()
        assert (report.samples, report.complete, report.verdict) == (first + 1, False, "infeasible")
        assert report.joints[2].samples["infeasible"] == 1


def test_stop_on_infeasible_changes_nothing_where_all_is_feasible():
    stopped = inverse_dynamics(vsa_3r(), motion(), stop_on_infeasible=True)
    assert stopped.report.complete
    np.testing.assert_array_equal(stopped.tau_motor, inverse_dynamics(vsa_3r(), motion()).tau_motor)


def test_springs_that_cannot_carry_the_load_leave_no_margin():
    """At the shoulder, whose springs end at 30 N m each and which must hold 68 N m stretched out."""
    weak = Stopped(k=400, k_c=2000)
    shoulder = dataclasses.replace(vsa_3r().joints[1], actuator=springs(weak, weak))
    heavy = dataclasses.replace(with_joint(vsa_3r(), 1, shoulder), gravity=(0, 0, -20.5))
    result = inverse_dynamics(heavy, motion(duration=20))
    carried = np.abs(result.tau_e[:, 1]) <= 60
    assert 0 < carried.sum() < len(carried)
    np.testing.assert_array_equal(np.isfinite(result.stiffness_min[:, 1]), carried)
    report = result.report.joints[1]
    assert report.samples["infeasible"] >= (~carried).sum()
    assert math.isnan(report.margin)
    assert math.isnan(report.worst["infeasible"].bound)
    assert report.worst["infeasible"].time == report.margin_time == result.time[(~carried).argmax()]
    plain = json.loads(json.dumps(result.report.as_json(), allow_nan=False))
    assert plain["joints"][1]["margin"]["min"] is None
    assert plain["joints"][1]["worst"]["infeasible"]["bound"] is None


def test_worst_excess_may_be_below_a_range():
    elbow = dataclasses.replace(vsa_3r().joints[2], limits=Limits(position=(-0.5, 1), stiffness=(860, 2000)))
    worst = inverse_dynamics(with_joint(vsa_3r(), 2, elbow), motion()).report.joints[2].worst
    assert (worst["position_limit"].value, worst["position_limit"].bound) == (-math.pi / 3, -0.5)
    assert (worst["stiffness_limit"].value, worst["stiffness_limit"].bound) == (850, 860)


def test_json_holds_plain_finite_values():
    for robot, trajectory in (troubled(), (vsa_3r(), motion())):
        report = inverse_dynamics(robot, trajectory).report.as_json()
        plain = json.loads(json.dumps(report, allow_nan=False))
        assert plain == report
        assert plain["joints"][0]["margin"]["attainable"][1] is None


def verdict_of(report: Report, **samples: int) -> str:
    joints = (dataclasses.replace(report.joints[0], samples=samples), *report.joints[1:])
    return dataclasses.replace(report, joints=joints).verdict


def test_worst_verdict_wins():
    report = inverse_dynamics(vsa_3r(), motion()).report
    assert report.verdict == "ok"
    assert verdict_of(report, near_singular=5, slack=2, over_limit=0, singular=0, infeasible=0) == "ok"
    assert verdict_of(report, over_limit=1) == "over_limit"
    assert verdict_of(report, over_limit=1, singular=1) == "singular"
    assert verdict_of(report, over_limit=1, singular=1, infeasible=1) == "infeasible"
    failed = dataclasses.replace(report.self_check, ladder=1.0)
    assert verdict_of(dataclasses.replace(report, self_check=failed), infeasible=1) == "self_check_failed"
    assert not dataclasses.replace(report.self_check, ladder=math.nan).passed
    assert not dataclasses.replace(report.self_check, spring_residual=math.nan).passed


def test_what_is_not_finite_counts_as_infeasible_and_is_named():
    """Speeds of 1e80 rad/s, whose fourth powers overflow in the second derivative of tau_e."""
    robot, time = shipped_robot("mixed_3r"), np.linspace(0, 1, 9)
    q = np.zeros((9, 3))
    dq = np.where(time > 0.3, 1e80, 0.0)[:, None] * [1, 1, 1]
    trajectory = Trajectory.from_samples(time, q, q + 900, dq=dq, ddq=q, d3q=q, d4q=q)
    with np.errstate(all="ignore"):
        result = inverse_dynamics(robot, trajectory)
    flags = dict(zip(robot.joint_names, result.flags.T, strict=True))
    kinds = {joint.actuator_type: joint.name for joint in robot.joints}
    both = Flag.NOT_FINITE | Flag.INFEASIBLE
    assert np.array_equal(flags[kinds["elastic"]] & both, np.where(time > 0.3, both, 0))
    assert np.array_equal(flags[kinds["antagonistic"]] & both, np.where(time > 0.3, Flag.INFEASIBLE, 0)), (
        "its springs cannot carry 1e160 N m at that stiffness: that is why there are no numbers"
    )
    of_elastic = result.report.joints[robot.joint_names.index(kinds["elastic"])]
    assert of_elastic.samples["infeasible"] == 6
    assert of_elastic.first_time["not_finite"] == of_elastic.worst["not_finite"].time == 0.375
    assert f"{kinds['elastic']}: a motor variable is not finite at t = 0.375 s" in str(result.report)
    stored = Report.from_json(json.loads(json.dumps(result.report.as_json())))
    assert str(stored) == str(result.report)
