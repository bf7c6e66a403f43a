"""What comes of a robot with a joint of each kind: report, files, figures, advice."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from samples.command_line import Outcome
from samples.figures import Result, rest_to_rest
from samples.fixes import written
from samples.plants import elastic, rigid, with_actuators
from samples.robots import vsa_3r
from samples.spoiled import scaled, spoil_drive

from vsacli import Limits, Robot, Trajectory, fixes, inverse_dynamics, load_robot, load_trajectory
from vsacli.dynamics.integrated_deflections import integrate_deflections
from vsacli.results.charts.figures import feasibility
from vsacli.results.charts.stored import StoredCharts
from vsacli.results.plots import compare_files, draw_sheet, plot_stored
from vsacli.studies.search.fix_report import NotPossible, StiffnessOffset, StiffnessProfile

ROOT = Path(__file__).parents[2]
ROBOT, TRAJECTORY = ROOT / "robots" / "mixed_3r.yaml", ROOT / "trajectories" / "mixed_3r.yaml"
JOINTS = {"rigid": "base", "elastic": "shoulder", "antagonistic": "elbow"}
KINDS = tuple(JOINTS)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(ROBOT)


def task(robot: Robot, folder: Path, *changes: tuple[str, str]) -> Trajectory:
    """The example at 100 steps a second."""
    text = TRAJECTORY.read_text()
    for old, new in (("rate: 1000 ", "rate: 100 "), *changes):
        assert old in text
        text = text.replace(old, new)
    (folder / "move.yaml").write_text(text)
    return load_trajectory(folder / "move.yaml", robot)


@pytest.fixture
def motion(robot: Robot, tmp_path: Path) -> Trajectory:
    return task(robot, tmp_path)


# Report


def test_what_a_joint_does_not_have_is_null_in_json(robot: Robot, motion: Trajectory) -> None:
    base, shoulder, elbow = inverse_dynamics(robot, motion).report.as_json()["joints"]
    assert [joint["actuator"] for joint in (base, shoulder, elbow)] == list(KINDS)
    for joint in (base, shoulder):
        assert joint["margin"] == {"min": None, "time": None, "attainable": [None, None]}
        assert (joint["peak"]["tau_motor"][1], joint["start"]["theta"][1]) == (None, None)
        assert not any(joint["samples"].values())
    assert base["stiffness"] == {"min": None, "max": None}
    assert base["start"]["torque_discontinuity"] == [None, None]
    assert shoulder["stiffness"] == {"min": 1000.0, "max": 1000.0}
    assert None not in (*elbow["peak"]["tau_motor"], *elbow["start"]["theta"], elbow["margin"]["min"])
    assert shoulder["peak"]["tau_motor"][0] > 30


def test_the_table_has_a_dash_for_it(vsacli: Callable[..., Outcome]) -> None:
    outcome = vsacli("check-feasibility", ROBOT, TRAJECTORY)
    assert outcome.code == 0
    _, table, values = outcome.out.split("\n\n")
    _, units, base, shoulder, elbow = table.splitlines()
    assert units.split() == ["N", "m", "N", "m", "N", "m/rad", "N", "m/rad", "%"]
    assert base.split() == ["base", "0.945", "5.66", "-", "-", "-"]
    assert shoulder.split() == ["shoulder", "32.7", "34.9", "1000", "-", "-"]
    assert elbow.split()[2:5] == ["98.9", "/", "91.6"]
    start, jump, end, energy, effort, check = values.splitlines()
    expected = "base +0 rad, shoulder +0.03245 rad, elbow +0.07276 -0.05513 rad"
    assert start == f"initial motor positions: {expected}"
    assert jump.endswith("(elbow)")
    assert end.startswith("final motor positions: base +1.571 rad, shoulder ")
    assert energy.startswith("energy: motors deliver ")
    assert effort.endswith("(elbow); its load requires 3.69 N m")
    assert check.startswith("self-check passed")


def test_a_limit_of_an_elastic_joint_is_reported(robot: Robot, motion: Trajectory) -> None:
    joints = [replace(joint, limits=Limits(velocity=(-0.1, 0.1))) for joint in robot.joints]
    report = inverse_dynamics(replace(robot, joints=tuple(joints)), motion).report
    assert report.verdict == "over_limit"
    assert all(joint.samples["over_limit"] for joint in report.joints)


# Self-check


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["ddtheta", "dtheta"])
def test_a_wrong_derivative_of_any_kind_fails(
    robot: Robot, motion: Trajectory, kind: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    spoil_drive(monkeypatch, name, scaled(1 + 1e-6), JOINTS[kind])
    check = inverse_dynamics(robot, motion).report.self_check
    assert not check.passed
    # Of the peak, which no probe need meet; power has the velocity twice, in kinetic energy and in losses.
    assert 0.9e-6 < check.ladder < 2.1e-6


def test_a_wrong_deflection_of_an_elastic_joint_fails(
    robot: Robot, motion: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    spoil_drive(monkeypatch, "phi", scaled(1 + 1e-9), JOINTS["elastic"])
    check = inverse_dynamics(robot, motion).report.self_check
    assert check.spring_residual == pytest.approx(1e-9, rel=1e-3)
    assert not check.passed


def test_missing_numbers_fail(robot: Robot, motion: Trajectory, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("theta", "dtheta", "ddtheta"):
        spoil_drive(monkeypatch, name, scaled(np.nan), JOINTS["rigid"])
    assert not inverse_dynamics(robot, motion).report.self_check.passed


# Files


@pytest.fixture
def stored(vsacli: Callable[..., Outcome], robot: Robot, tmp_path: Path) -> Path:
    task(robot, tmp_path)
    assert vsacli("invdyn", ROBOT, "move.yaml", "-q", "-o", "result.h5").code == 0
    return tmp_path / "result.h5"


def exported(vsacli: Callable[..., Outcome], *names: str) -> list[list[str]]:
    outcome = vsacli("export", "result.h5", "--variables", ",".join(names), "--rate", "1")
    assert outcome.code == 0, outcome.err
    return list(csv.reader(io.StringIO(outcome.out)))


@pytest.mark.usefixtures("stored")
def test_columns_that_a_joint_does_not_have_are_not_exported(vsacli: Callable[..., Outcome]) -> None:
    header, *rows = exported(vsacli, "stiffness", "tau_motor", "stiffness_min", "flags")
    assert header == [
        "time",
        *("shoulder.stiffness", "elbow.stiffness"),
        *("base.tau_motor_1", "shoulder.tau_motor_1", "elbow.tau_motor_1", "elbow.tau_motor_2"),
        "elbow.stiffness_min",
        *("base.flags", "shoulder.flags", "elbow.flags"),
    ]
    assert len(rows) == 5
    assert all(cell for row in rows for cell in row)


def test_exported_motion_and_stiffness_are_a_trajectory_again(
    vsacli: Callable[..., Outcome], robot: Robot, stored: Path
) -> None:
    names = ["q", "dq", "ddq", "d3q", "d4q", "stiffness", "dstiffness", "ddstiffness"]
    assert vsacli("export", stored, "--variables", ",".join(names), "-o", "again.csv").code == 0
    again = inverse_dynamics(robot, load_trajectory("again.csv", robot))
    with h5py.File(stored) as file:
        np.testing.assert_array_equal(again.tau_motor, file["tau_motor"][...])
        np.testing.assert_array_equal(again.stiffness, file["stiffness"][...])


def test_the_robot_is_stored_with_one_motor_or_two(stored: Path) -> None:
    with h5py.File(stored) as file:
        joints = file["inputs/robot/joints"]
        assert joints["actuator_type"].asstr()[...].tolist() == list(KINDS)
        expected = [[6.4, np.nan], [6.1, np.nan], [1.98, 1.98]]
        np.testing.assert_array_equal(joints["actuator_motor_inertia"][...], expected)
        np.testing.assert_array_equal(joints["actuator_stiffness"][...], [np.nan, 1000.0, np.nan])
        np.testing.assert_array_equal(joints["actuator_spring_k"][:2], np.nan)
        assert joints["actuator_spring_type"].asstr()[...].tolist() == [
            ["", ""],
            ["", ""],
            ["cubic", "cubic"],
        ]
        assert [scale.values()[0].name for scale in joints["actuator_motor_inertia"].dims] == [
            "/joint",
            "/motor",
        ]


@pytest.mark.slow
def test_a_robot_with_one_motor_a_joint_is_stored_without_the_second(
    vsacli: Callable[..., Outcome], tmp_path: Path
) -> None:
    lines = [
        "format: vsacli-robot/1\nname: one\njoints:\n",
        "  - name: only\n    type: revolute\n    dh: {a: 1, alpha: 0}\n",
        "    link: {mass: 1, com: [0, 0, 0], inertia: {xx: 1, yy: 1, zz: 1}}\n",
        "    actuator: {type: rigid, motor: {inertia: 2}}\n",
    ]
    (tmp_path / "one.yaml").write_text("".join(lines))
    (tmp_path / "go.yaml").write_text(
        "format: vsacli-trajectory/1\nname: go\nduration: 1\n"
        "position: {type: polynomial, degree: 3, start: 0, end: 1}\n"
    )
    assert vsacli("invdyn", "one.yaml", "go.yaml", "-q", "-o", "one.h5", "--plot", "figures").code == 0
    with h5py.File(tmp_path / "one.h5") as file:
        np.testing.assert_array_equal(file["inputs/robot/joints/actuator_motor_inertia"][...], [2.0])
        assert np.isnan(file["tau_motor"][:, 0, 1]).all()
        assert np.isnan(file["stiffness"][...]).all()
    refused = vsacli("check-feasibility", "one.yaml", "go.yaml", "--plot", "figures")
    assert (refused.code, refused.err) == (2, "there is no stiffness to plot: all joints are rigid\n")


# Figures


def drawn(**options: object) -> Result:
    result = rest_to_rest(101, actuators=KINDS, **options)
    for name, joints in (("stiffness", [0]), ("stiffness_min", [0, 1]), ("stiffness_max", [0, 1])):
        result.read(name)[:, joints] = np.nan
    result.read("tau_motor")[:, :2, 1] = np.nan
    return result


def titles(axes: object) -> list[str]:
    return [each.get_title(loc="left") for each in axes]


def compared_panels(*results: Any) -> list[Any]:
    """Those without differences, which alone have a label."""
    return [axes for axes in compare_files(results)["compare"].axes if axes.get_ylabel()]


def test_no_stiffness_panel_for_a_rigid_joint_and_no_corridor_for_an_elastic_one() -> None:
    for figure, first in (
        (plot_stored(drawn())["motion"], 1),
        (draw_sheet(feasibility(StoredCharts([drawn()]))), 0),
    ):
        shoulder, elbow = figure.axes[first:]
        assert titles([shoulder, elbow]) == ["shoulder", "elbow"]
        assert (len(shoulder.collections), len(elbow.collections)) == (0, 1)
        assert [text.get_text() for text in figure.legends[0].get_texts()][-1] == "attainable"


def test_motor_two_is_drawn_where_it_exists() -> None:
    first, second = plot_stored(drawn())["motor-torque"].axes
    assert (len(first.lines), len(second.lines)) == (3, 1)


@pytest.mark.slow
def test_panels_without_a_motor_are_not_there() -> None:
    result = drawn(types="RRP")  # the antagonistic joint is the prismatic one
    figure = plot_stored(result)["motor-torque"]
    assert [len(axes.lines) for axes in figure.axes] == [2, 1, 1]
    result.actuators = ("elastic", "elastic", "rigid")
    assert [len(axes.lines) for axes in plot_stored(result)["motor-torque"].axes] == [2, 1]


def test_a_rigid_robot_has_a_figure_of_its_motion() -> None:
    result = drawn()
    result.actuators = ("rigid",) * 3
    [position] = plot_stored(result)["motion"].axes
    assert len(position.lines) == 3


@pytest.mark.slow
def test_a_comparison_shows_the_motors_that_any_of_the_results_has() -> None:
    antagonistic = rest_to_rest(101, trajectory="two motors")
    one_each = drawn(trajectory="one")
    one_each.actuators = ("rigid",) * 3
    assert len(compared_panels(one_each, antagonistic)) == 6
    mixed = drawn(trajectory="mixed")
    expected = ["base, motor 1", "shoulder, motor 1", "elbow, motor 1", "elbow, motor 2"]
    assert titles(compared_panels(one_each, mixed)) == expected
    expected = [f"{joint}, motor 1" for joint in ("base", "shoulder", "elbow")]
    assert titles(compared_panels(one_each, one_each)) == expected


# Deflections by integration, and advice


@pytest.mark.slow
def test_only_antagonistic_joints_are_followed(robot: Robot, motion: Trajectory) -> None:
    deflections = integrate_deflections(robot, motion)
    assert deflections.stops == (None, None, None)
    result = inverse_dynamics(robot, motion, deflection_solver=deflections)
    assert [drift.joint for drift in result.report.drifts] == ["elbow"]
    assert result.report.drifts[0].largest < 1e-10  # the tolerance of the integration is 1e-12 a step
    solved = inverse_dynamics(robot, motion)
    np.testing.assert_array_equal(result.tau_motor[:, :2], solved.tau_motor[:, :2])


@pytest.mark.slow
def test_a_stop_is_told_of_the_joint_that_stops(
    vsacli: Callable[..., Outcome], robot: Robot, tmp_path: Path
) -> None:
    task(robot, tmp_path, ("end: {elbow: 1275}", "end: {elbow: 790}"))
    outcome = vsacli("check-feasibility", ROBOT, "move.yaml", "--deflection-solver", "ode")
    assert outcome.code == 3
    assert "elbow: deflections cannot be integrated beyond t = " in outcome.out


def test_nothing_is_followed_where_no_joint_is_antagonistic(motion: Trajectory) -> None:
    robot = with_actuators(vsa_3r(), {0: rigid(), 1: elastic(), 2: elastic()})
    deflections = integrate_deflections(robot, motion)
    assert np.isnan(deflections.at(np.array([0.5]))).all()
    assert inverse_dynamics(robot, motion, deflection_solver=deflections).report.drifts == ()


@pytest.mark.slow
def test_the_profile_of_a_fix_is_of_the_antagonistic_joint_alone(robot: Robot, tmp_path: Path) -> None:
    soft = task(robot, tmp_path, ("end: {elbow: 1275}", "end: {elbow: 790}"))
    found = fixes(robot, soft)
    assert isinstance(found.stiffness_offset, StiffnessOffset)
    assert [offset.joint for offset in found.stiffness_offset.offsets] == ["elbow"]
    assert isinstance(found.stiffness_profile, StiffnessProfile)
    (fix,) = [each for each in found.fixes if each.stiffness_profile]
    path, table = written(fix, tmp_path / "fixed.yaml")
    assert table.read_text().splitlines()[0] == "time,elbow.stiffness,elbow.dstiffness,elbow.ddstiffness"
    again = load_trajectory(path, robot)
    assert again.warnings == ()
    assert inverse_dynamics(robot, again).report.verdict == "ok"


def test_no_stiffness_fixes_an_elastic_joint(robot: Robot, motion: Trajectory) -> None:
    base, shoulder, elbow = robot.joints
    weak = replace(shoulder.actuator, motor=replace(shoulder.actuator.motor, max_torque=10.0))
    weaker = replace(robot, joints=(base, replace(shoulder, actuator=weak), elbow))
    found = fixes(weaker, motion)
    assert isinstance(found.stiffness_offset, NotPossible)
    assert found.stiffness_offset == found.stiffness_profile
    assert found.causes[0].text.endswith("no slower motion helps, and it has no stiffness to choose")
    json.dumps(found.as_json())
