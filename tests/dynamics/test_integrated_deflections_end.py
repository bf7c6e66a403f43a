"""Where the deflections of the first step cannot be followed any further, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest
from samples.deflections import (
    ARM,
    COARSE,
    DRIFT,
    MOTOR_VARIABLES,
    dipping,
    integrated,
    motion,
    softened,
    softening,
)
from samples.drives import Stopped, joint_with, springs, with_joint

from vsacli import Flag, Result, inverse_dynamics
from vsacli.base.flags import SINGULAR_MARGIN, has_flag
from vsacli.dynamics.integrated_deflections import (
    REASONS,
    SINGULAR,
    STALLED,
    UNATTAINABLE,
    DeflectionEquation,
    integrate_deflections,
)


@pytest.fixture(scope="module")
def touching() -> Result:
    return integrated(ARM, dipping(800.0))


def test_touching_the_singular_set_ends_the_way(touching: Result):
    base, shoulder = touching.report.drifts
    # The margin is 60 (t - 1.3)^2 / 800, which the smallest that counts as regular equals at:
    end = 1.3 - np.sqrt(SINGULAR_MARGIN * 800 / 60)
    assert base.stop is not None
    assert base.stop.time == pytest.approx(end, abs=1e-9)  # a margin of 1e-9 is good to 1e-13
    assert base.stop.reason == REASONS[SINGULAR]
    assert shoulder.stop is None


def test_steps_after_the_end_are_infeasible(touching: Result):
    lost = touching.time >= 1.2999
    assert 50 < lost.sum() < 100
    np.testing.assert_array_equal(has_flag(touching.flags[:, 0], Flag.INFEASIBLE), lost)
    for name in MOTOR_VARIABLES:
        undefined = np.isnan(getattr(touching, name)[:, 0]).reshape(len(lost), -1)
        np.testing.assert_array_equal(undefined, np.broadcast_to(lost[:, None], undefined.shape))
    assert np.isfinite(touching.tau_e).all()


@pytest.mark.slow
def test_way_holds_no_number_at_its_very_end():
    deflections = softened()
    _, stop = deflections.stops
    assert stop is not None
    ends = deflections.at(np.array([np.nextafter(stop.time, 0), stop.time]))
    np.testing.assert_array_equal(np.isnan(ends[1]), [[False, True]] * 2)
    assert np.isfinite(ends[0]).all()


def test_other_joint_goes_on(touching: Result):
    root = inverse_dynamics(ARM, dipping(800.0))
    np.testing.assert_allclose(touching.phi[:, 1:], root.phi[:, 1:], rtol=0, atol=DRIFT)
    assert not has_flag(touching.flags[:, 1:], Flag.INFEASIBLE).any()


def test_report_says_when_and_why(touching: Result):
    text = str(touching.report)
    assert (
        "base: deflections cannot be integrated beyond t = 1.299885 s: "
        "its decoupling matrix becomes singular (infeasible: 71 samples)"
    ) in text.splitlines()
    assert touching.report.verdict == "infeasible"
    assert touching.report.joints[0].samples["infeasible"] == 71


def test_stiffness_inside_the_corridor_is_not_called_out_of_reach(touching: Result):
    base = touching.report.joints[0]
    assert base.worst.keys() == {"singular", "near_singular"}
    assert not base.other_branch
    assert "at this load" not in str(touching.report)


def test_crossing_the_fold_ends_where_the_corridor_does():
    crossing = inverse_dynamics(ARM, softening(), deflection_solver=softened())
    unreachable = has_flag(inverse_dynamics(ARM, softening()).flags[:, 1], Flag.INFEASIBLE)
    first = int(unreachable.argmax())
    stop = crossing.report.drifts[1].stop
    assert stop is not None
    assert crossing.time[first - 1] < stop.time <= crossing.time[first]
    assert stop.reason == REASONS[SINGULAR]
    assert "infeasible" in crossing.report.joints[1].worst


def test_end_of_a_spring_is_not_singular():
    robot = with_joint(ARM, 1, joint_with(springs(Stopped(k=400, k_c=2000), Stopped(k=400, k_c=2000))))
    base, shoulder = integrate_deflections(
        robot, motion(start=(850.0, 840.0), end=(850.0, 1000.0)), COARSE
    ).stops
    assert base is None
    assert shoulder is not None
    assert shoulder.reason == REASONS[UNATTAINABLE]


def test_another_sign_of_the_determinant_is_beyond_the_singular_set():
    task, joints, time = DeflectionEquation(ARM, motion()), (0, 1), np.linspace(0, 2, 5)
    roots = task.roots(joints, time)
    assert not task.stop_reasons(joints, time, roots).any()
    assert (task.stop_reasons(joints, time, roots[:, ::-1]) == SINGULAR).all()


@pytest.mark.slow
def test_integration_that_stalls_ends_at_the_joint_to_blame(monkeypatch):
    trajectory = softening()
    expected = softened().stops[1]
    monkeypatch.setattr(
        DeflectionEquation,
        "stop_reasons",
        lambda _task, joints, time, _phi: np.zeros((len(joints), time.size), int),
    )
    base, shoulder = integrate_deflections(ARM, trajectory, COARSE).stops
    assert base is None
    assert expected is not None
    assert shoulder is not None
    assert shoulder.reason == REASONS[STALLED]
    assert shoulder.time == pytest.approx(
        expected.time, abs=1e-6
    )  # the fold follows a margin of 1e-9 closely


def test_start_out_of_reach_is_not_followed():
    result = integrated(ARM, motion(start=(850.0, 790.0), end=(850.0, 850.0)), COARSE)
    shoulder = result.report.drifts[1]
    assert shoulder.stop is not None
    assert (shoulder.stop.time, shoulder.stop.reason) == (0.0, REASONS[UNATTAINABLE])
    assert np.isnan(result.phi[:, 1]).all()
    assert np.isfinite(result.phi[:, 0]).all()
    assert shoulder.as_json()["stopped"] == {"time": 0.0, "reason": REASONS[UNATTAINABLE]}
    assert "shoulder none (no sample integrated)" in str(result.report)


def test_robot_that_nobody_can_follow_ends_at_once():
    deflections = integrate_deflections(ARM, motion(start=(790.0, 790.0)))
    assert np.isnan(deflections.at(np.linspace(0, 2, 5))).all()


def test_run_that_stops_at_infeasible_steps_stops_at_the_end_of_the_way():
    trajectory = dipping(800.0)
    result = inverse_dynamics(
        ARM,
        trajectory,
        deflection_solver=integrate_deflections(ARM, trajectory, COARSE),
        stop_on_infeasible=True,
    )
    assert result.time[-1] == 1.3
    assert not result.report.complete
