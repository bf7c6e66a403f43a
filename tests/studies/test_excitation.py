"""Excitations: within all limits, from rest to rest, well conditioned; as files they are what was planned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples.excitations import shorten_searches
from samples.shipped import shipped_robot, shipped_run

from vsacli import (
    Excitation,
    InputError,
    Limits,
    Robot,
    excitation_text,
    inverse_dynamics,
    load_trajectory,
    plan_excitation,
)
from vsacli.studies.identification.excitation import ImpossibleError
from vsacli.studies.identification.excitation.family import MARGIN

BETWEEN = 0.01
"""Relative excess over a margin of what lies between the times at which it is kept; see
`family.SAMPLES_PER_PERIOD`."""


@pytest.fixture(autouse=True, scope="module")
def _short_searches() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        shorten_searches(patch, steps=30)
        yield


@pytest.fixture(name="planned", scope="module")
def _planned(_short_searches: None) -> Excitation:
    """Of an arm with limits of position, velocity and stiffness."""
    return plan_excitation(shipped_robot("rp_2"), duration=5)


@pytest.mark.slow
def test_it_keeps_a_margin_from_every_limit_between_steps_as_well(planned: Excitation) -> None:
    assert planned.report.verdict == "ok"
    time = np.linspace(0, 5, 3501)  # no multiple of the steps
    motion = planned.trajectory.at(time)
    stiffness = motion.commanded["stiffness"]
    for index, joint in enumerate(planned.robot.joints):
        for values, (low, high) in (
            (motion.q, joint.limits.position),
            (motion.dq, joint.limits.velocity),
            (stiffness, joint.limits.stiffness),
        ):
            kept = (MARGIN - BETWEEN) * max(abs(low), abs(high))
            assert values[:, index].min() > low + kept
            assert values[:, index].max() < high - kept


@pytest.mark.slow
def test_limits_of_motors_make_it_smaller() -> None:
    robot = shipped_robot("scara_4")
    found = plan_excitation(robot, duration=5)
    run = inverse_dynamics(robot, found.trajectory)
    assert run.report.verdict == "ok"
    for index, joint in enumerate(robot.joints):
        for number, motor in enumerate(joint.actuator.motors):
            for values, bound in (
                (run.tau_motor, motor.max_torque),
                (run.dtheta, motor.max_velocity),
            ):
                assert np.abs(values[:, index, number]).max() < (1 - MARGIN + BETWEEN) * bound


@pytest.mark.slow
def test_joints_and_motors_begin_and_end_at_rest(planned: Excitation) -> None:
    run = inverse_dynamics(planned.robot, planned.trajectory)
    for rate in (run.dq, run.ddq, run.d3q, run.d4q, run.dstiffness, run.ddstiffness):
        peak = np.abs(rate).max(axis=0)
        assert np.abs(rate[[0, -1]] / peak).max() < 1e-9  # rounding of four derivatives of a ramp
    for rate in (run.dtheta, run.ddtheta):
        assert np.abs(rate[[0, -1]]).max() < 1e-9 * np.abs(rate).max()


def test_its_json_names_what_it_says(planned: Excitation) -> None:
    found = planned.as_json()
    first = found["planned"]["numbers"][0]
    assert first["path"] == "joints.arm.actuator.motor.inertia"
    assert first["value"] == 2.5
    assert 0 < first["standard_error"] < 0.025
    assert set(found) >= {"format", "seed", "noise", "structural", "active", "assumptions", "report"}


def test_the_file_is_what_was_planned(planned: Excitation, tmp_path: Path) -> None:
    file = tmp_path / "excitation.yaml"
    file.write_text(excitation_text(planned), encoding="utf-8")
    read = load_trajectory(file, planned.robot)
    time = np.linspace(0, 5, 50)
    one, other = read.at(time), planned.trajectory.at(time)
    for name, values in one.variables().items():
        assert np.array_equal(values, other.variables()[name], equal_nan=True), name
    assert read.name == "rp-2-excitation"
    assert not read.warnings


@pytest.mark.slow
def test_the_same_seed_finds_the_same(planned: Excitation) -> None:
    again = plan_excitation(planned.robot, duration=5)
    assert excitation_text(again) == excitation_text(planned)
    other = plan_excitation(planned.robot, duration=5, seed=1)
    assert excitation_text(other) != excitation_text(planned)


def scaled_condition(columns: list[np.ndarray]) -> float:
    """By singular values."""
    matrix = np.stack([column.ravel() / np.linalg.norm(column) for column in columns], axis=1)
    singular = np.linalg.svd(matrix, compute_uv=False)
    return float(singular[0] / singular[-1])


def test_its_conditions_are_those_of_the_formula_of_the_motors(planned: Excitation) -> None:
    """tau_motor = B theta'' + D theta' + F_c sign(theta') + F_o + k phi + k_c phi^3 at every step."""
    run = inverse_dynamics(planned.robot, planned.trajectory)
    moving = np.where(np.abs(run.dtheta) > 1e-10, np.sign(run.dtheta), 0.0)
    for index, name in enumerate(planned.robot.joint_names):
        rows = [run.ddtheta, run.dtheta, moving, np.ones_like(moving), run.phi, run.phi**3]
        condition = scaled_condition([row[:, index] for row in rows])
        ours = planned.planned.conditions[name]
        assert ours == pytest.approx(condition, rel=0.02)  # of fewer steps, where signs weigh differently


@pytest.mark.slow
def test_beside_the_users_own_motion_it_says_how_much_more_it_tells() -> None:
    """At constant stiffness k and k_c are hardly told apart."""
    robot, own = shipped_run("vsa_3r", "vsa_3r_excitation")
    found = plan_excitation(robot, own, duration=10)
    assert found.own is not None
    assert found.own.conditions["base"] > 1000
    assert found.condition < 30
    ours, theirs = (
        {each.path: each.standard_error for each in of.numbers} for of in (found.planned, found.own)
    )
    assert ours["joints.base.actuator.spring.k"] < 1  # N m/rad
    assert np.isnan(theirs["joints.base.actuator.spring.k"])
    assert "motion given" in str(found)


@pytest.mark.slow
def test_what_a_robot_has_no_limit_of_is_said_with_what_was_assumed() -> None:
    found = plan_excitation(shipped_robot("measured_1r"), duration=10)
    assert found.assumptions == (
        "no limits.position (0.785 rad either way from zero assumed): elbow",
        "no limits.velocity (1 rad/s assumed): elbow",
        "no limits.stiffness (at most 2 times the least assumed where springs set no end): elbow",
        "no max_torque of motors (none assumed): elbow",
    )
    motion = found.trajectory.at(np.linspace(0, 10, 999))
    assert np.abs(motion.q).max() < np.pi / 4
    assert np.abs(motion.dq).max() < 1


@pytest.mark.slow
def test_a_robot_that_cannot_do_anything_is_told_why() -> None:
    robot = shipped_robot("coupled_1r")
    (joint,) = robot.joints
    weak = replace(joint, limits=Limits(position=(1.0, 1.2), stiffness=(1, 2)))
    with pytest.raises(ImpossibleError, match="elbow has no stiffness that carries"):
        plan_excitation(Robot(name="weak", gravity=robot.gravity, joints=(weak,)), duration=10)


@pytest.mark.parametrize("noise", [(1e308, None), (2e-5, 1e308), (-1.0, None), (0.0, float("nan"))])
def test_a_noise_out_of_range_is_refused(noise: tuple[float, float | None]) -> None:
    """Squares of such numbers are infinite, and no spectrum has a noise or a motion then."""
    with pytest.raises(InputError, match=r"the sensor noise must be from 0 to 1e\+30, not"):
        plan_excitation(shipped_robot("rp_2"), duration=5, noise=noise)


def test_a_duration_too_short_is_refused() -> None:
    with pytest.raises(InputError, match="the duration must be from 5 to 3600 s, not 1 s"):
        plan_excitation(shipped_robot("rp_2"), duration=1)
