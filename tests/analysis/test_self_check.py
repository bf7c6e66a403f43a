"""The self-check passes on sound results of every kind, and fails on wrong ones."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.drives import motion
from samples.long_chains import random_chain
from samples.marks import slow, slow_but
from samples.moves import move
from samples.robots import random_robot, vsa_3r
from samples.spoiled import scaled, spoil_drive, spoil_torque

from vsacli import Report, Robot, Trajectory, inverse_dynamics, load_robot, load_trajectory
from vsacli.analysis.run_dynamics import RunDynamics
from vsacli.analysis.self_check import LADDER_BOUND, ROUNDING_GAIN, ladder
from vsacli.compute.engine import NUMPY, Engine
from vsacli.compute.engine.engines import Kernel
from vsacli.dynamics.variants import Variants

ROOT = Path(__file__).parents[2]
EXAMPLES = {
    "3R": ("vsa_3r", "rest_to_rest"),
    "3R soft": ("vsa_3r", "rest_to_rest_soft"),
    "3R stiff": ("vsa_3r", "rest_to_rest_stiff"),
    "7R": ("lwr_7r_vsa", "lwr_7r"),
    "R-P": ("rp_2", "rp_2"),
}
examples = pytest.mark.parametrize("example", EXAMPLES)
arms = pytest.mark.parametrize("example", slow_but(["3R", "7R", "R-P"], EXAMPLES))
"""The same, of which each arm is quick once."""

EPS = np.finfo(float).eps

ROUNDING = 1e-9
"""Sound results lie ten times below the bound; closed forms do so a thousand times and more."""

SOFT_AND_STIFF = {"stiffness": (850.0,) * 3, "end_stiffness": (1275.0,) * 3}


def load(example: str) -> tuple[Robot, Trajectory]:
    robot, trajectory = EXAMPLES[example]
    loaded = load_robot(ROOT / "robots" / f"{robot}.yaml")
    return loaded, load_trajectory(ROOT / "trajectories" / f"{trajectory}.yaml", loaded)


def assert_sound(report: Report) -> None:
    assert report.self_check.spring_residual <= 1e-14
    assert report.self_check.ladder <= ROUNDING
    assert report.self_check.passed


# Sound results


@examples
def test_examples_pass(example: str):
    report = inverse_dynamics(*load(example)).report
    assert report.verdict == "ok"
    # 1e-12 to 3e-12 is seen.
    assert report.self_check.ladder <= 2e-11
    assert_sound(report)


@pytest.mark.parametrize("duration", [0.54, 0.6, 1, 60, 3600])
def test_fast_and_slow_motions_pass(duration: float):
    report = inverse_dynamics(vsa_3r(), motion(duration=duration, rate=100 / duration)).report
    assert report.verdict == "ok"
    assert_sound(report)


def test_one_joint_turning_evenly_passes():
    # No torque changes: the derivatives are rounding, which must not be measured against itself.
    time = np.linspace(0, 0.8, 9)
    still = np.zeros_like(time)
    trajectory = Trajectory.from_samples(time, np.stack((time, still, still), axis=1), np.full((9, 3), 900.0))
    assert_sound(inverse_dynamics(vsa_3r(), trajectory).report)


def test_very_short_motion_passes():
    stiff = {"stiffness": (2e5,) * 3, "end_stiffness": (2.1e5,) * 3}
    report = inverse_dynamics(vsa_3r(), motion(duration=0.05, rate=1000, **stiff)).report
    assert report.verdict == "ok"
    assert_sound(report)


@pytest.mark.parametrize("duration", [0.02, 0.05, 0.1, 0.3, 0.5])
def test_motion_far_too_fast_is_infeasible_but_sound(duration: float):
    """It leaves the corridor within a thousandth of its duration."""
    report = inverse_dynamics(vsa_3r(), motion(duration=duration, rate=1000, **SOFT_AND_STIFF)).report
    assert_sound(report)
    assert report.verdict == ("infeasible" if duration < 0.5 else "ok")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 21, 74, 237, 321])
def test_hardly_feasible_motions_pass(seed: int):
    """Some probes fall next to a fold, which the joint passes in a moment; these seeds were looked for."""
    rng = np.random.default_rng(seed)
    duration = round(10 ** rng.uniform(-2, -0.5), 4)
    start, end = rng.uniform(-2, 2, (2, 3)).round(2)
    stiffness = [2000.0] * 3, [9000.0] * 3
    trajectory = move(duration, 20 / duration, (start, end), degrees=(9, 5), stiffness=stiffness)
    assert_sound(inverse_dynamics(random_robot("RPR", seed), trajectory).report)


@pytest.mark.parametrize("duration", [0.05, 1, 600])
def test_standing_still_passes(duration: float):
    hold = move(duration, 20 / duration, ([0.3, 0.2, 0.1],) * 2, stiffness=([850.0] * 3,) * 2)
    assert_sound(inverse_dynamics(vsa_3r(), hold).report)


@pytest.mark.parametrize("least_margin", [1e-3, 1e-5, 1e-8])
def test_motion_close_to_a_fold_passes(least_margin: float):
    lower = inverse_dynamics(vsa_3r(), motion(duration=4)).stiffness_min.max()
    stiffness = (float(lower / (1 - least_margin)),) * 3
    report = inverse_dynamics(vsa_3r(), motion(duration=4, stiffness=stiffness)).report
    assert sum(joint.samples["near_singular"] for joint in report.joints) > 0
    assert_sound(report)


@pytest.mark.parametrize("rate", [100, 1000])
def test_recorded_motion_passes(rate: int):
    time = np.arange(5 * rate + 1) / rate
    q = 0.4 * np.sin(time[:, None] * [1.0, 1.3, 1.7] + [0, 1, 2])
    stiffness = 1000 + 50 * np.sin(0.7 * time[:, None] * [1.0, 1.3, 1.7])
    report = inverse_dynamics(vsa_3r(), Trajectory.from_samples(time, q, stiffness)).report
    assert report.verdict == "ok"
    assert_sound(report)


def fast_recording(**options: Any) -> Trajectory:
    """Ten seconds at 10 kHz, interpolated: a knot each 0.1 ms."""
    time = np.arange(100001) / 10000
    q = 0.4 * np.sin(time[:, None] * [1.0, 1.3, 1.7] + [0, 1, 2])
    return Trajectory.from_samples(time, q, np.full_like(q, 1000.0), fit="interpolate", **options)


@pytest.fixture
def few_times_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute as few times together as for long chains."""
    monkeypatch.setattr("vsacli.analysis.self_check.usual_block", lambda _joints: 200)


def ladder_of(robot: Robot, trajectory: Trajectory, engine: Engine = NUMPY) -> tuple[float, float]:
    """Return the error of a run nearest to its bound, and that bound."""
    errors, bounds = ladder(RunDynamics(Variants.of_one(robot), [trajectory], engine=engine))
    return float(errors[0]), float(bounds[0])


@pytest.mark.slow
def test_how_many_times_are_computed_together_does_not_matter(request):
    """Those of long chains are computed some after the others."""
    whole = ladder_of(*load("7R"))
    request.getfixturevalue("few_times_together")
    assert ladder_of(*load("7R")) == whole


class Counted:
    """An engine that counts its calls; results of zero have no error, so that the first steps decide."""

    def __init__(self) -> None:
        self.calls = 0

    def run(self, kernel: Kernel, rows: Sequence[np.ndarray]) -> np.ndarray:
        self.calls += 1
        return np.zeros((kernel.outputs, len(rows[0])))


@pytest.mark.parametrize("joints", [160, slow(1000)])
def test_blocks_of_long_chains_do_not_grow_in_number(joints: int):
    """A block is as much work as the chain is long, and the shorter; in blocks the check must not grow."""
    robot = random_chain(joints)
    still = ([900.0] * joints,) * 2
    hold = move(1.0, 20.0, still, stiffness=still)
    counted = Counted()
    ladder_of(robot, hold, counted)
    assert counted.calls == 2  # 4 and 20 if there were as many times as for short ones


@pytest.mark.slow
@pytest.mark.usefixtures("few_times_together")
def test_memory_of_long_chains_is_that_of_the_times_computed_together():
    """All times at all scales, of eight derivatives, would take three times as much."""
    arm = load("7R")[0]
    joints = [
        replace(joint, name=f"joint_{number}") for number, joint in enumerate(islice(cycle(arm.joints), 40))
    ]
    chain = replace(arm, gravity=(0.0, 0.0, 0.0), joints=tuple(joints))
    trajectory = move(3.0, 300.0, ([0.0] * 40, [0.005] * 40), stiffness=([2200.0] * 40,) * 2)
    tracemalloc.start()
    try:
        ladder_of(chain, trajectory)
        assert tracemalloc.get_traced_memory()[1] < 16e6  # 10.4e6
    finally:
        tracemalloc.stop()


@pytest.mark.slow
def test_bound_follows_rounding_where_sampling_is_fast():
    trajectory = fast_recording()
    error, bound = ladder_of(vsa_3r(), trajectory)
    # Steps of a 48th of the knot spans' 1e-4 s; what rounding leaves is a tenth of the bound and less.
    assert bound == pytest.approx(ROUNDING_GAIN * EPS * 10 * 48 / 1e-4, rel=1e-6)
    assert LADDER_BOUND < bound < 1e-6
    assert error < bound / 10


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2], ids=["dtau_e", "ddtau_e"])
@pytest.mark.parametrize("defect", [1e-2, 1e-6])
def test_wrong_derivative_is_found_where_sampling_is_fast(order: int, defect: float, monkeypatch):
    spoil_torque(monkeypatch, order, scaled(1 + defect))
    error, bound = ladder_of(vsa_3r(), fast_recording())
    assert error == pytest.approx(defect, rel=0.05)
    assert error > bound


@pytest.mark.slow
def test_stamps_since_1970_pass():
    time = np.arange(1001) / 1000
    q = 0.4 * np.sin(time[:, None] * [1.0, 1.3, 1.7] + [0, 1, 2])
    stiffness = np.full_like(q, 1000.0)
    report = inverse_dynamics(vsa_3r(), Trajectory.from_samples(1.7e9 + time, q, stiffness)).report
    assert report.verdict == "ok"
    assert_sound(report)


# Wrong results


@arms
@pytest.mark.parametrize("order", [1, 2], ids=["dtau_e", "ddtau_e"])
@pytest.mark.parametrize("defect", [slow(1e-2), 1e-6])
def test_wrong_derivative_of_the_torque_fails(example: str, order: int, defect: float, monkeypatch):
    spoil_torque(monkeypatch, order, scaled(1 + defect))
    report = inverse_dynamics(*load(example)).report
    assert report.verdict == "self_check_failed"
    # It is measured against its peak, which need not be met by a probe.
    assert report.self_check.ladder == pytest.approx(defect, rel=0.05)


@pytest.mark.parametrize("joint", range(3))
@pytest.mark.parametrize("order", [1, 2], ids=["dtau_e", "ddtau_e"])
def test_a_single_wrong_joint_fails(joint: int, order: int, monkeypatch):
    spoil_torque(monkeypatch, order, lambda torque: torque * np.where(np.arange(3) == joint, 1 + 1e-6, 1))
    assert not inverse_dynamics(*load("3R")).report.self_check.passed


def test_torque_wrong_for_a_moment_fails(monkeypatch):
    """A defect of a fiftieth of the values, such as a wrong branch would make."""

    def spoil(torque: np.ndarray) -> np.ndarray:
        return torque * np.where(torque > np.quantile(torque, 0.98), 1.01, 1)

    spoil_torque(monkeypatch, 2, spoil)
    assert not inverse_dynamics(*load("3R")).report.self_check.passed


@arms
@pytest.mark.parametrize("name", ["phi", "dphi", "theta", "dtheta", "ddtheta"])
def test_wrong_motion_of_the_motors_fails(example: str, name: str, monkeypatch):
    spoil_drive(monkeypatch, name, scaled(1 + 1e-6))
    assert not inverse_dynamics(*load(example)).report.self_check.passed


@pytest.mark.parametrize("motor", [0, 1])
@pytest.mark.parametrize("name", ["phi", "dphi", "dtheta", "ddtheta"])
def test_a_single_wrong_motor_fails(name: str, motor: int, monkeypatch):
    factors = np.where(np.arange(2) == motor, 1 + 1e-6, 1)[:, None]
    spoil_drive(monkeypatch, name, lambda values: values * factors, joint_name="elbow")
    assert not inverse_dynamics(*load("3R")).report.self_check.passed


def test_deflections_off_by_a_constant_fail(monkeypatch):
    """No difference over time shows it; the springs do."""
    spoil_drive(monkeypatch, "phi", lambda phi: phi + 1e-9)
    check = inverse_dynamics(*load("3R")).report.self_check
    assert check.ladder <= ROUNDING
    assert check.spring_residual > 1e-11
    assert not check.passed


def test_wrong_torque_of_recorded_motion_fails(monkeypatch):
    spoil_torque(monkeypatch, 2, scaled(1.01))
    time = np.arange(501) / 100
    q = 0.4 * np.sin(time[:, None] + [0, 1, 2])
    trajectory = Trajectory.from_samples(time, q, np.full((501, 3), 1000.0))
    assert not inverse_dynamics(vsa_3r(), trajectory).report.self_check.passed


@pytest.mark.parametrize("name", ["phi", "dphi", "ddtheta"])
def test_missing_numbers_of_regular_steps_fail(name: str, monkeypatch):
    spoil_drive(monkeypatch, name, scaled(math.nan), joint_name="shoulder")
    assert not inverse_dynamics(*load("3R")).report.self_check.passed


def test_a_single_missing_deflection_fails(monkeypatch):
    robot, trajectory = load("3R")

    def spoil(phi: np.ndarray) -> np.ndarray:
        lost = (np.arange(phi.shape[1]) == 2000) & (phi.shape[1] == trajectory.samples)
        return np.where(lost, math.nan, phi)

    spoil_drive(monkeypatch, "phi", spoil, joint_name="base")
    check = inverse_dynamics(robot, trajectory).report.self_check
    assert math.isnan(check.spring_residual)
    assert check.ladder <= ROUNDING
    assert not check.passed


def test_missing_derivative_of_the_torque_fails(monkeypatch):
    spoil_torque(monkeypatch, 2, scaled(math.nan))
    assert inverse_dynamics(*load("3R")).report.verdict == "self_check_failed"
