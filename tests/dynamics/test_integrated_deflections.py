"""Deflections that follow the first root by integration, against the root at each step."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.drives import Stopped, joint_with, springs, with_joint
from samples.drives import motion as arm_motion
from samples.marks import slow
from samples.robots import vsa_3r

from vsacli import Trajectory, inverse_dynamics, load_robot, load_trajectory
from vsacli.actuators.elastic import Elastic
from vsacli.actuators.laws.cubic import Cubic
from vsacli.actuators.laws.exponential import Exponential
from vsacli.actuators.motor import Motor
from vsacli.actuators.reach import TOUCHING
from vsacli.analysis.result import Result
from vsacli.analysis.run import Run
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag, has
from vsacli.dynamics.integrated_deflections import integrate_deflections
from vsacli.dynamics.integrated_deflections.task import REASONS, SINGULAR, STALLED, UNREACHABLE, Task
from vsacli.robot.model import Robot

ARM = dataclasses.replace(vsa_3r(), joints=vsa_3r().joints[:2])
"""Base and shoulder: the base carries nothing while the arm is still, the shoulder the weight of its link."""

TINY = 1e-11
"""Drift, rad or m: each of about 40 integration steps may err by 1e-12 of deflections of about 0.1."""

TORQUE_AGREEMENT = 1e-9
"""Of the peak motor torque: a drift of 1e-11, which A^-1 magnifies up to a hundredfold at a margin of 3 %."""

COARSE = 1e-8
"""Tolerance where only the course of things matters, to save time."""

MOTOR_VARIABLES = ("phi", "dphi", "theta", "dtheta", "ddtheta", "tau_spring", "tau_motor", "det_A")


def example(robot: str, trajectory: str) -> tuple[Robot, Trajectory]:
    loaded = load_robot(REPOSITORY / "robots" / f"{robot}.yaml")
    return loaded, load_trajectory(REPOSITORY / "trajectories" / f"{trajectory}.yaml", loaded)


def motion(
    start: tuple[float, float] = (850.0, 850.0), end: tuple[float, float] | None = None, rate: float = 100
) -> Trajectory:
    """Rest to rest of base and shoulder, in 2 s."""
    whole = arm_motion((*start, 1.0), (*(end or start), 1.0), rate=rate)
    position, stiffness = (
        dataclasses.replace(profile, start=profile.start[:2], end=profile.end[:2])
        for profile in (whole.position, whole.stiffness)
    )
    return Trajectory(whole.times, position, stiffness, name="rest-to-rest")


def unlike(preload: str) -> tuple[Robot, Trajectory]:
    """The arm with a shoulder whose springs differ."""
    actuator = springs(Cubic(k=400, k_c=2000), Cubic(k=360, k_c=6000), preload)
    return with_joint(ARM, 1, joint_with(actuator)), motion(end=(1275.0, 1275.0))


def tendons() -> tuple[Robot, Trajectory]:
    """The arm with a shoulder that two exponential tendons drive."""
    tendon = Exponential(c=2.0, a=12.0)
    return with_joint(ARM, 1, joint_with(springs(tendon, tendon))), motion(end=(1275.0, 1275.0))


def recorded(samples: int, noise: float = 0.0) -> Trajectory:
    """A motion of 2 s as samples of positions and stiffness, rough if noise is added."""
    time = np.linspace(0, 2, samples)
    smooth = motion(end=(1275.0, 1275.0)).at(time)
    rough = noise * np.random.default_rng(5).standard_normal(smooth.q.shape)
    return Trajectory.from_samples(time, smooth.q + rough, smooth.stiffness, fit="interpolate")


def followed(robot: Robot, trajectory: Trajectory, tolerance: float = 1e-12) -> Result:
    return inverse_dynamics(
        robot, trajectory, deflections=integrate_deflections(robot, trajectory, tolerance)
    )


def drifts(result: Result) -> list[float]:
    return [drift.largest for drift in result.report.drifts]


@dataclass(frozen=True)
class Dip:
    """Stiffness of two joints, of which the first dips to a floor at 1.3 s and rises again."""

    floor: float
    bend: float = 60.0
    bottom: float = 1.3
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    components: int = 2

    @property
    def breakpoints(self) -> FloatArray:
        return np.array([0.0, 2.0])

    def at(self, time: FloatArray) -> FloatArray:
        away = time - self.bottom
        dip = [self.floor + self.bend * away**2, 2 * self.bend * away, np.full_like(time, 2 * self.bend)]
        steady = [np.full_like(time, 1000.0), np.zeros_like(time), np.zeros_like(time)]
        return np.stack([np.stack([first, other]) for first, other in zip(dip, steady, strict=True)])

    def samples(self, _start: int, _stop: int, time: FloatArray, /) -> FloatArray:
        return self.at(time)

    def summary(self) -> None:
        return None

    def stretched(self, factor: float) -> Dip:
        raise AssertionError(f"nobody stretches this by {factor}")


def dipping(floor: float) -> Trajectory:
    """The arm keeps still; joint 1, which carries nothing, reaches 2K = 800 N m/rad and up."""
    plain = motion()
    still = dataclasses.replace(plain.position, end=plain.position.start)
    return Trajectory(plain.times, still, Dip(floor), name="dip")


def softening() -> Trajectory:
    """The shoulder becomes softer than its load allows, the base stiffer."""
    return motion(end=(1275.0, 790.0))


@pytest.fixture(scope="module")
def touching() -> Result:
    return followed(ARM, dipping(800.0))


@pytest.fixture(scope="module")
def crossing() -> Result:
    return followed(ARM, softening(), COARSE)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(lambda: example("vsa_3r", "rest_to_rest"), id="3R", marks=pytest.mark.slow),
        pytest.param(lambda: example("vsa_3r", "rest_to_rest_soft"), id="3R soft", marks=pytest.mark.slow),
        pytest.param(lambda: example("rp_2", "rp_2"), id="R-P"),
        pytest.param(lambda: unlike("positive"), id="sides differ"),
        pytest.param(lambda: unlike("negative"), id="preload negative", marks=pytest.mark.slow),
        pytest.param(tendons, id="tendons"),
    ],
)
def test_integration_stays_at_the_root(case):
    robot, trajectory = case()
    root, result = inverse_dynamics(robot, trajectory), followed(robot, trajectory)
    assert max(drifts(result)) == np.abs(result.phi - root.phi).max() < TINY
    for name in MOTOR_VARIABLES:
        expected = getattr(root, name)
        assert np.abs(getattr(result, name) - expected).max() < TORQUE_AGREEMENT * np.abs(expected).max()
    np.testing.assert_array_equal(result.flags, root.flags)
    assert result.report.verdict == "ok"


def test_corridor_is_that_of_the_root(crossing: Result):
    root = inverse_dynamics(ARM, softening())
    for name in ("stiffness_lower", "stiffness_upper", "tau_e"):
        np.testing.assert_array_equal(getattr(crossing, name), getattr(root, name))


def test_first_step_is_the_root_itself():
    trajectory = motion()
    start = integrate_deflections(ARM, trajectory).at(np.zeros(1))
    np.testing.assert_array_equal(start[..., 0], inverse_dynamics(ARM, trajectory).phi[0])


def test_result_does_not_depend_on_the_blocks():
    trajectory = softening()
    deflections = integrate_deflections(ARM, trajectory, COARSE)
    at_once, by_seven = (
        Run(ARM, trajectory, deflections=deflections, block_samples=samples) for samples in (201, 7)
    )
    (whole,), pieces = list(at_once), list(by_seven)
    assert at_once.report().as_json() == by_seven.report().as_json()
    for name in MOTOR_VARIABLES:
        joined = np.concatenate([getattr(piece, name) for piece in pieces])
        np.testing.assert_array_equal(joined, getattr(whole, name))


def test_cost_does_not_grow_with_the_samples(monkeypatch):
    calls = []
    rates = Task.rates
    monkeypatch.setattr(Task, "rates", lambda *arguments: calls.append(0) or rates(*arguments))
    counts = []
    for rate in (100, 10_000):
        calls.clear()
        integrate_deflections(ARM, motion(rate=rate), COARSE)
        counts.append(len(calls))
    assert 0 < counts[0] == counts[1]


def test_recording_is_followed_from_breakpoint_to_breakpoint():
    trajectory = recorded(21, noise=1e-3)
    result = followed(ARM, trajectory)
    assert np.isfinite(result.phi).all()
    assert max(drifts(result)) < TINY


@pytest.mark.slow
def test_long_recording_drifts_a_little(monkeypatch):
    monkeypatch.setattr("vsacli.dynamics.integrated_deflections.integration.MOST_PIECES", 20)
    smooth, rough = (followed(ARM, recorded(101, noise)) for noise in (0.0, 1e-5))
    # A tolerance of 1e-6 of 0.1 rad a step; and steps of 0.1 s, in which a smooth motion changes little.
    assert TINY < max(drifts(smooth)) < 1e-9
    assert smooth.report.verdict == "ok"
    # What the spline does with the noise inside a step is seen by some of the 12 stages only.
    assert max(drifts(rough)) > 1e-9


def test_touching_the_singular_set_ends_the_way(touching: Result):
    base, shoulder = touching.report.drifts
    # The margin is 60 (t - 1.3)^2 / 800, which the smallest that counts as regular equals at:
    end = 1.3 - np.sqrt(TOUCHING * 800 / 60)
    assert base.stop is not None
    assert base.stop.time == pytest.approx(end, abs=1e-9)  # a margin of 1e-9 is good to 1e-13
    assert base.stop.reason == REASONS[SINGULAR]
    assert shoulder.stop is None


def test_steps_after_the_end_are_infeasible(touching: Result):
    lost = touching.time >= 1.2999
    assert 50 < lost.sum() < 100
    np.testing.assert_array_equal(has(touching.flags[:, 0], Flag.INFEASIBLE), lost)
    for name in MOTOR_VARIABLES:
        undefined = np.isnan(getattr(touching, name)[:, 0]).reshape(len(lost), -1)
        np.testing.assert_array_equal(undefined, np.broadcast_to(lost[:, None], undefined.shape))
    assert np.isfinite(touching.tau_e).all()


def test_way_holds_no_number_at_its_very_end():
    deflections = integrate_deflections(ARM, softening(), COARSE)
    _, stop = deflections.stops
    assert stop is not None
    ends = deflections.at(np.array([np.nextafter(stop.time, 0), stop.time]))
    np.testing.assert_array_equal(np.isnan(ends[1]), [[False, True]] * 2)
    assert np.isfinite(ends[0]).all()


def test_other_joint_goes_on(touching: Result):
    root = inverse_dynamics(ARM, dipping(800.0))
    np.testing.assert_allclose(touching.phi[:, 1:], root.phi[:, 1:], rtol=0, atol=TINY)
    assert not has(touching.flags[:, 1:], Flag.INFEASIBLE).any()


def test_report_says_when_and_why(touching: Result):
    text = str(touching.report)
    assert (
        "base: its deflections cannot be followed beyond t = 1.299885 s: "
        "its decoupling matrix becomes singular (infeasible: 71 steps)"
    ) in text.splitlines()
    assert touching.report.verdict == "infeasible"
    assert touching.report.joints[0].steps["infeasible"] == 71


def test_stiffness_inside_the_corridor_is_not_called_out_of_reach(touching: Result):
    base = touching.report.joints[0]
    assert base.worst.keys() == {"singular", "near_singular"}
    assert not base.other_preload
    assert "its load allows" not in str(touching.report)


@pytest.mark.parametrize("floor", [800.0 * (1 + 2e-9), slow(800.0 + 1e-4)])
def test_passing_closely_by_goes_on(floor: float):
    trajectory = dipping(floor)
    result = followed(ARM, trajectory)
    assert result.report.drifts[0].stop is None
    # Near the fold an error of the integration grows like 1/sqrt(margin), to 3e4 times at a margin of 1e-9.
    assert drifts(result)[0] < 3e4 * TINY
    assert (result.phi[:, 0, 0] > result.phi[:, 0, 1]).all()


def test_crossing_the_fold_ends_where_the_corridor_does(crossing: Result):
    unreachable = has(inverse_dynamics(ARM, softening()).flags[:, 1], Flag.INFEASIBLE)
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
    assert shoulder.reason == REASONS[UNREACHABLE]


def test_another_sign_of_the_determinant_is_beyond_the_singular_set():
    task, joints, time = Task(ARM, motion()), (0, 1), np.linspace(0, 2, 5)
    roots = task.roots(joints, time)
    assert not task.hindrances(joints, time, roots).any()
    assert (task.hindrances(joints, time, roots[:, ::-1]) == SINGULAR).all()


@pytest.mark.slow
def test_integration_that_stalls_ends_at_the_joint_to_blame(monkeypatch):
    trajectory = softening()
    expected = integrate_deflections(ARM, trajectory, COARSE).stops[1]
    monkeypatch.setattr(
        Task, "hindrances", lambda _task, joints, time, _phi: np.zeros((len(joints), time.size), int)
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
    result = followed(ARM, motion(start=(850.0, 790.0), end=(850.0, 850.0)), COARSE)
    shoulder = result.report.drifts[1]
    assert shoulder.stop is not None
    assert (shoulder.stop.time, shoulder.stop.reason) == (0.0, REASONS[UNREACHABLE])
    assert np.isnan(result.phi[:, 1]).all()
    assert np.isfinite(result.phi[:, 0]).all()
    assert shoulder.as_json()["stopped"] == {"time": 0.0, "reason": REASONS[UNREACHABLE]}
    assert "shoulder none (no step followed)" in str(result.report)


def test_robot_that_nobody_can_follow_ends_at_once():
    deflections = integrate_deflections(ARM, motion(start=(790.0, 790.0)))
    assert np.isnan(deflections.at(np.linspace(0, 2, 5))).all()


def test_run_that_stops_at_infeasible_steps_stops_at_the_end_of_the_way():
    trajectory = dipping(800.0)
    result = inverse_dynamics(
        ARM, trajectory, deflections=integrate_deflections(ARM, trajectory, COARSE), stop_on_infeasible=True
    )
    assert result.time[-1] == 1.3
    assert not result.report.complete


def test_loose_integration_drifts_and_says_so():
    loose = followed(ARM, motion(), tolerance=1e-3)
    largest = max(drifts(loose))
    # Each step may err by 1e-3 of 0.1 rad.
    assert 1e-7 < largest < 1e-3
    base, _ = loose.report.drifts
    when = float(np.abs(loose.phi - inverse_dynamics(ARM, motion()).phi)[:, 0].max(axis=1).argmax()) / 100
    assert base.time == pytest.approx(when)
    assert f"drift of the integration: base {base.largest:.1e} rad at {base.time:.3f} s, shoulder" in str(
        loose.report
    )


def test_drift_beyond_its_bound_fails_the_self_check():
    loose = followed(ARM, motion(), tolerance=1e-3)
    assert loose.report.self_check.spring_residual > 1e-6
    assert loose.report.self_check.ladder < 1e-8
    assert loose.report.verdict == "self_check_failed"
    assert "(bound 1e-06); do not use these torques" in str(loose.report)


def test_report_as_json():
    report = followed(ARM, motion(), COARSE).report
    entry = report.as_json()["deflections"]
    assert entry["method"] == "integrate"
    assert [joint["joint"] for joint in entry["joints"]] == ["base", "shoulder"]
    for joint, drift in zip(entry["joints"], report.drifts, strict=True):
        assert (joint["drift"], joint["time"]) == (drift.largest, drift.time)
        assert (joint["unit"], joint["stopped"]) == ("rad", None)


def test_only_antagonistic_joints_are_followed():
    elastic = Elastic(motor=Motor(inertia=3), stiffness=900)
    robot = with_joint(ARM, 0, dataclasses.replace(ARM.joints[0], actuator=elastic))
    root, result = inverse_dynamics(robot, motion()), followed(robot, motion(), COARSE)
    assert [drift.joint for drift in result.report.drifts] == ["shoulder"]
    np.testing.assert_array_equal(result.phi[:, 0], root.phi[:, 0])
    assert np.isfinite(result.phi[:, 1]).all()


def test_drift_of_a_sliding_joint_is_in_metres():
    robot, trajectory = example("rp_2", "rp_2")
    assert [drift.unit for drift in followed(robot, trajectory, COARSE).report.drifts] == ["rad", "m"]


def test_report_of_the_root_names_its_method():
    report = inverse_dynamics(ARM, motion()).report
    assert report.as_json()["deflections"] == {"method": "root"}
    assert "drift" not in str(report)
