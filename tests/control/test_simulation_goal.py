"""Where a simulated robot ends: how far off it may be, and the report on runs that end off target."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from samples.robots import vsa_3r
from samples.simulated import short_motion
from samples.single_joint import LINK_INERTIA, rigid_joint, step_of

from vsacli import Gains, GoalTolerance, InitialError, InputError, simulate
from vsacli.control.simulation.simulation_report import SimulationReport
from vsacli.control.simulation.simulation_summary import Summary

MOTOR_INERTIA = 2.0


def drifted(size, excess, joint_type="revolute"):
    """Feedforward of a model whose inertia is too large by a share: q goes too far by the same share."""
    inertia = MOTOR_INERTIA + excess * (MOTOR_INERTIA + LINK_INERTIA)
    model = rigid_joint(inertia, joint_type)
    return simulate(rigid_joint(MOTOR_INERTIA, joint_type), step_of(size), model=model)


@pytest.mark.parametrize("size", [1.5, -1.5])
@pytest.mark.parametrize(
    ("excess", "verdict"),
    [(0.0105, "ok"), (0.0108, "off_target")],  # 1 % of 1.5 rad and 1e-3 rad are 1.0667 % of 1.5 rad
)
def test_a_drift_in_closed_form_strays_beyond_the_tolerance(size, excess, verdict):
    report = drifted(size, excess).report
    axis = report.joints[0]
    assert axis.q.final == pytest.approx(excess * size, rel=1e-7)  # tolerances of the integration
    assert axis.tolerance == pytest.approx(0.016, rel=1e-12)
    assert report.verdict == verdict
    assert ("exceeds the goal tolerance" in str(report)) == (verdict == "off_target")


def test_the_headline_has_the_largest_error_on_the_way():
    """A constant error of the start decays to nothing; its size is known all the same."""
    gains = Gains.from_poles([-20] * 2)
    error = InitialError(0.05)
    report = simulate(rigid_joint(2.0), step_of(1.0), gains=gains, initial_error=error).report
    assert report.verdict == "ok"
    headline = str(report).splitlines()[0]
    assert (
        headline
        == "OK  single, step: feedback-linearization, 1 s; largest q error 0.05 rad (axis, t = 0.000 s)"
    )
    largest = json.loads(json.dumps(report.as_json()))["largest_error"]
    assert largest == {"joint": "axis", "value": pytest.approx(0.05, rel=1e-12), "unit": "rad", "time": 0.0}


@pytest.mark.parametrize(
    ("amplitude", "frequency", "share"),
    [(0.02, 22.5, 67), (0.009, 22.5, None), (0.02, 0.5, None)],
    ids=["oscillating", "within", "off target"],
)
def test_an_oscillation_that_ends_on_target_by_chance_is_a_warning(amplitude, frequency, share):
    """A sine of twice the tolerance exceeds it two thirds of the time, and is zero at the end."""
    past = simulate(rigid_joint(2.0), step_of(1.0)).history
    error = amplitude * np.sin(2 * np.pi * frequency * (1 - past.time)) + (frequency < 1) * amplitude
    past = past.replaced(q_error=error[:, None])
    summary = Summary(rigid_joint(2.0), GoalTolerance(0.0, 0.01), (0.0, 1.0))
    summary.add(past)
    found = list(summary.unsettled_warnings(summary.joints()))
    if share is None:
        assert found == []
    else:
        (warning,) = found
        assert warning.startswith("axis: q error exceeds the goal tolerance of 0.01 rad in ")
        stated = int(warning.split(" % of the last tenth")[0].split()[-1])
        assert stated == pytest.approx(share, abs=5)


def test_a_joint_that_is_the_worst_only_by_its_tolerance_is_named_so():
    error = InitialError([0.01, 0, 0.005])
    gains = Gains.from_poles([-60] * 4, [-60] * 2)
    report = simulate(vsa_3r(), short_motion(3), gains=gains, initial_error=error).report
    pairs = zip(report.joints, (1.0, 1.0, 1e-3), strict=True)
    joints = tuple(dataclasses.replace(joint, tolerance=tolerance) for joint, tolerance in pairs)
    again = dataclasses.replace(report, joints=joints)
    assert "largest q error relative to its tolerance 0.005 rad (elbow" in str(again)
    assert "note: no motor has max_torque, so that its torque is unlimited" in str(again)


def test_a_prismatic_joint_strays_in_meters():
    report = drifted(0.3, 0.05, "prismatic").report
    assert report.verdict == "off_target"
    assert "axis: final q error 0.015 m exceeds the goal tolerance of 0.004 m" in str(report)
    assert "largest q error 0.015 m (axis, t = 1.000 s)" in str(report)


def test_joints_that_end_off_target_are_counted_and_named_worst_first():
    goal = GoalTolerance(share=0.0, absolute=1e-4)
    error = InitialError([0.001, 0, 0.01])
    report = simulate(vsa_3r(), short_motion(3), initial_error=error, goal_tolerance=goal).report
    missed = [joint for joint in report.joints if abs(joint.q.final) > joint.tolerance]
    missed.sort(key=lambda joint: abs(joint.q.final), reverse=True)
    headline, *lines = str(report).splitlines()
    assert headline.endswith(f"; {len(missed)} of 3 joints off target")
    found = [line for line in lines if "exceeds the goal tolerance of 0.0001 rad" in line]
    assert lines[: len(found)] == found
    assert [line.partition(":")[0] for line in found] == [joint.name for joint in missed]


@pytest.mark.parametrize(("error", "verdict"), [(0.9e-3, "ok"), (1.1e-3, "off_target")])
def test_a_joint_that_is_to_hold_still_may_be_a_milliradian_off(error, verdict):
    """No force acts on it: it stays where it starts."""
    report = simulate(rigid_joint(2.0), step_of(0.0), initial_error=InitialError(error)).report
    assert report.joints[0].q.final == pytest.approx(error, rel=1e-9)
    assert report.joints[0].tolerance == pytest.approx(1e-3, rel=1e-8)  # rounding of the command
    assert report.verdict == verdict


@pytest.mark.slow
def test_an_error_of_exactly_the_tolerance_has_arrived():
    error = InitialError([0, 0, 0.01])
    joints = simulate(vsa_3r(), short_motion(3), initial_error=error).report.joints
    size = max(abs(joint.q.final) for joint in joints)
    for tolerance, verdict in ((size, "ok"), (math.nextafter(size, 0), "off_target")):
        goal = GoalTolerance(share=0.0, absolute=tolerance)
        report = simulate(vsa_3r(), short_motion(3), initial_error=error, goal_tolerance=goal).report
        assert report.verdict == verdict


def test_straying_of_an_exact_run_is_blamed_on_the_integration():
    blame = "so the run ends off target by errors of the integration"
    tight = GoalTolerance(share=0.0, absolute=1e-15)
    assert blame in "".join(simulate(vsa_3r(), short_motion(3), goal_tolerance=tight).report.warnings)
    off = simulate(vsa_3r(), short_motion(3), goal_tolerance=tight, initial_error=InitialError(0.01)).report
    assert off.verdict == "off_target"
    assert not off.warnings


def test_a_stiffness_that_does_not_arrive_is_a_warning():
    slow = Gains.from_poles([-20] * 4, [-1] * 2)
    error = InitialError(0, [0, 30, 0])
    report = simulate(vsa_3r(), short_motion(3), gains=slow, initial_error=error).report
    assert report.verdict == "ok"
    left = 30 * (1 + 0.8) * math.exp(-0.8)  # of a double pole at -1/s, started without a rate
    assert report.joints[1].stiffness.final == pytest.approx(left, rel=1e-6)
    assert report.warnings == (
        f"shoulder: final stiffness error {left:.3g} N m/rad (commanded: 1300 N m/rad)",
    )


@pytest.mark.parametrize(
    ("written", "share", "absolute"),
    [
        ("1%", 0.01, 1e-3),
        (" 2.5 % ", 0.025, 1e-3),
        ("0%", 0.0, 1e-3),
        ("0.02", 0.0, 0.02),
        ("1e-3", 0.0, 1e-3),
    ],
)
def test_a_tolerance_as_typed(written, share, absolute):
    assert GoalTolerance.from_text(written) == GoalTolerance(share, absolute)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("wide", "expected a number in rad .m. such as 0.01, or a share .* found 'wide'"),
        ("%", "expected a number"),
        ("1 deg", "expected a number"),
        ("0", "the goal tolerance must be positive and finite, not 0$"),
        ("-1", "the goal tolerance must be positive and finite, not -1$"),
        ("-1%", "the goal tolerance must be from 0 % to 100 % of a joint's range, not -1%"),
        ("nan", "the goal tolerance must be positive and finite, not nan"),
        ("inf", "the goal tolerance must be positive and finite, not inf"),
        ("120%", "from 0 % to 100 % of a joint's range, not 120%"),
    ],
)
def test_a_tolerance_that_makes_no_sense_is_refused(written, message):
    with pytest.raises(InputError, match=message):
        GoalTolerance.from_text(written)


def test_reports_written_before_there_was_a_tolerance_can_be_read():
    content = simulate(rigid_joint(2.0), step_of(1.0)).report.as_json()
    del content["largest_error"], content["joints"][0]["tolerance"]
    old = SimulationReport.from_json(content)
    assert old.largest_error is None
    assert np.isnan(old.joints[0].tolerance)
    assert str(old).splitlines()[0].split() == ["OK", "single,", "step:", "feedforward,", "1", "s"]
