"""Figures of robots before any run: charts of actuators, the drawing of the arm."""

from __future__ import annotations

import dataclasses
import itertools
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from oracles import kinematics as oracle
from samples.command_line import REPOSITORY
from samples.figures import smallest_stiffness
from samples.marks import slow_but
from samples.robots import random_motion, random_robot
from samples.shipped import shipped_robot, shipped_run
from samples.torso import torso_text, written
from samples.trees import hand
from samples.wrenches import held

from vsacli import Robot, inverse_dynamics, load_robot
from vsacli.files.info.robot_info import static_load, static_loads
from vsacli.results.charts.arm_chart import ArmPoints, arm_chart, home_position
from vsacli.results.charts.look import STYLES, drawing_with
from vsacli.results.charts.robot_charts import LIMITS, ActuatorChart, StiffnessMap, actuator_charts
from vsacli.results.plots import actuators_figure, arm_figure, stiffness_figure

FILES = sorted((REPOSITORY / "robots").rglob("*.yaml"))
bundled = pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)


def charts(robot: Robot) -> list[ActuatorChart]:
    return actuator_charts(robot, static_loads(static_load(robot)).tolist())


@cache
def bundled_charts(file: Path) -> list[ActuatorChart]:
    return charts(load_robot(file))


def chart(name: str) -> ActuatorChart:
    """The chart of a robot with one distinct actuator."""
    (only,) = charts(shipped_robot(name))
    return only


def crossing(seen: StiffnessMap, words: str) -> float:
    """Stiffness without torque at which the clearance to a limit vanishes."""
    column = int(np.argmin(np.abs(seen.tau_e)))
    return float(np.interp(0.0, -seen.clearance[words][:, column], seen.levels[:, column]))


def test_minimum_stiffness_is_that_of_a_run() -> None:
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    result = inverse_dynamics(robot, trajectory)
    map_3r = chart("vsa_3r")
    for joint in range(3):
        tau_e, expected = result.tau_e[::50, joint], result.stiffness_min[::50, joint]
        np.testing.assert_allclose(map_3r.ends(tau_e)[0], expected, rtol=1e-12)
        drawn = np.interp(tau_e, map_3r.stiffness.tau_e, map_3r.stiffness.lower)
        np.testing.assert_allclose(drawn, expected, rtol=1e-3)  # the map is drawn by straight lines


def test_minimum_stiffness_of_cubic_springs_is_the_closed_form() -> None:
    seen = chart("vsa_3r").stiffness
    np.testing.assert_allclose(seen.lower, smallest_stiffness(seen.tau_e), rtol=1e-9)
    assert seen.lower_singular.all()
    assert np.isinf(seen.upper).all()


def test_limits_of_motors_and_springs_end_the_map() -> None:
    """Without torque both springs, k sinh(a phi), are tensed equally: the stiffness is 2 k a cosh(a phi)."""
    cubebot = charts(load_robot(device("vsa_cubebot")))[0].stiffness  # k = 0.05, a = 6.5
    at_torque = 2 * 6.5 * np.hypot(0.05, 4)
    assert crossing(cubebot, LIMITS["tau_motor"]) == pytest.approx(at_torque, rel=1e-3)
    assert at_torque < cubebot.top < 1.2 * at_torque
    assert cubebot.tau_e[-1] == pytest.approx(8, rel=0.1)  # both motors pull the same way
    qbmove = chart("qbmove_arm_gazebo")
    law = qbmove.actuator.spring[0]
    at_deflection = 2 * law.k * law.a * np.cosh(law.a * law.max_deflection)
    assert crossing(qbmove.stiffness, LIMITS["phi"]) == pytest.approx(at_deflection, rel=1e-3)


def device(name: str) -> Path:
    return REPOSITORY / "robots" / "devices" / f"{name}.yaml"


@pytest.mark.parametrize("file", slow_but(FILES[::4], FILES), ids=lambda file: file.stem)
def test_the_decoupling_matrix_is_singular_at_ends_of_the_attainable_range_alone(file: Path) -> None:
    for each in bundled_charts(file):
        if not each.commanded:
            continue
        seen = each.stiffness
        torques = np.broadcast_to(seen.tau_e, seen.levels.shape).ravel()
        inside = each.at_rest(torques, seen.levels.ravel()).det_A.reshape(seen.levels.shape)
        wide = seen.levels[-1] - seen.levels[0] > 1e-3 * seen.levels[-1]
        assert wide.any()
        signs = np.sign(inside[1:-1, wide])
        assert (signs == signs[0]).all()
        at_end, middle = (np.abs(inside[row])[wide] for row in (0, len(inside) // 2))
        singular = seen.lower_singular[wide] & (seen.lower[wide] > 0)
        assert (at_end[singular] < 0.05 * middle[singular]).all()


def test_equal_actuators_share_a_chart_and_rigid_ones_have_none() -> None:
    assert [each.title for each in charts(shipped_robot("ur5_6r"))] == [
        "shoulder_pan, shoulder_lift",
        "elbow",
        "wrist_1, wrist_2, wrist_3",
    ]
    mixed = charts(shipped_robot("mixed_3r"))
    assert [(each.title, each.kind) for each in mixed] == [
        ("shoulder", "elastic, linear"),
        ("elbow", "antagonistic, cubic"),
    ]
    assert mixed[1].limits == [810, 2000]


def test_joints_with_other_limits_of_the_same_springs_are_drawn_apart() -> None:
    robot = shipped_robot("vsa_3r")
    assert len(charts(robot)) == 1
    assert len(charts(robot.replace("joints.elbow.actuator.motor.*.max_torque", 50))) == 2
    assert len(charts(robot.replace("joints.elbow.actuator.spring.*.max_deflection", 0.3))) == 2


@pytest.mark.parametrize("name", ["maccepa_1r", "vsa_3r", "tendon_1r"])
def test_motors_that_hold_no_spring_leave_a_figure_beyond_limits(name: str) -> None:
    weak = charts(shipped_robot(name).replace("joints.*.actuator.motor.*.max_torque", 1e-9))
    assert not weak[0].stiffness.within_limits.any()
    for figure in (actuators_figure(weak, "weak"), stiffness_figure(weak, "weak")):
        figure.draw_without_rendering()


def test_torque_of_springs_ends_at_the_limit_of_deflection() -> None:
    (curve,) = charts(load_robot(device("vsa_cubebot")))[0].torques
    assert curve.label == "springs 1 and 2"
    assert (curve.deflection[0], curve.deflection[-1], curve.limit) == (-0.8, 0.8, 0.8)
    np.testing.assert_allclose(curve.torque, 0.05 * np.sinh(6.5 * curve.deflection), atol=1e-12)


def test_tendons_pull_and_springs_between_motors_are_named() -> None:
    pulling, other = chart("tendon_1r").torques
    assert pulling.deflection.min() == 0
    assert other.deflection.max() == 0
    np.testing.assert_allclose(other.torque, -pulling.torque[::-1], atol=1e-12)
    assert [each.label for each in chart("coupled_1r").torques] == [
        "springs 1 and 2",
        "spring between the motors",
    ]


def test_torque_of_a_mechanism_has_the_stiffness_of_each_setting() -> None:
    """AwAS: tau_e = k r^2 sin(2 phi) with the arm r = lead theta_2."""
    awas = chart("awas_1r")
    mechanism = awas.actuator.mechanism
    assert [curve.label for curve in awas.torques] == ["2", "4", "6", "8", "10"]
    for curve in awas.torques:
        arm = mechanism.lead * float(curve.label)
        there = np.isfinite(curve.torque)
        expected = mechanism.k * arm**2 * np.sin(2 * curve.deflection[there])
        np.testing.assert_allclose(curve.torque[there], expected, rtol=1e-4, atol=1e-9)
    assert np.nanmax(awas.stiffness.upper) == pytest.approx(2 * mechanism.k * mechanism.arm[1] ** 2)


@pytest.mark.parametrize("types", ["R", "PRRP", "RRRRRRR"])
def test_points_of_the_chain_agree_with_forward_kinematics(types: str) -> None:
    robot = held(random_robot(types, seed=3))
    q = random_motion(robot, 5, seed=1)[0]
    points = ArmPoints.of(robot, q)
    chain = np.concatenate((points.origins, points.tools), axis=1)
    for row, position in enumerate(q):
        poses = [
            oracle.tool_pose(Robot(name="part", base=robot.base, joints=robot.joints[:end]), position[:end])
            for end in range(1, len(types) + 1)
        ]
        poses = [oracle.transform(robot.base), *poses, oracle.tool_pose(robot, position)]
        np.testing.assert_allclose(chain[row], [pose.real[:3, 3] for pose in poses], atol=1e-12)
        np.testing.assert_allclose(points.axes[row], [pose.real[:3, 2] for pose in poses[:-2]], atol=1e-12)
        along = points.elbows[row] - points.seats[row]
        np.testing.assert_allclose(np.cross(along, points.axes[row]), 0, atol=1e-12)
        lengths = np.linalg.norm(points.origins[row, 1:] - points.elbows[row], axis=1)
        np.testing.assert_allclose(lengths, [abs(joint.dh.a) for joint in robot.joints], atol=1e-12)


@bundled
def test_joints_are_drawn_on_their_axes_and_apart(file: Path) -> None:
    arm = arm_chart(load_robot(file))
    along = arm.centers - arm.points.seats[0]
    np.testing.assert_allclose(np.cross(along, arm.points.axes[0]), 0, atol=1e-12)
    apart = np.linalg.norm(arm.centers[:, None] - arm.centers, axis=-1) + np.eye(len(arm.centers))
    assert apart.min() > 0.9 * arm.joint_length


def test_home_is_zero_or_the_middle_of_limits_that_hold_the_joint_on_one_side() -> None:
    panda, slide = shipped_robot("panda_7r"), shipped_robot("rp_2")
    assert [home_position(joint) for joint in panda.joints] == [0, 0, 0, (-3.0718 - 0.0698) / 2, 0, 0, 0]
    assert [home_position(joint) for joint in slide.joints] == [0, pytest.approx(0.15)]
    assert arm_chart(panda).title == "panda-7r: arm at q = 0, joint4 at the middle of the limits"
    assert arm_chart(shipped_robot("vsa_3r")).title == "vsa-3r: arm at q = 0"


@bundled
def test_views_have_gravity_downward_and_are_right_handed(file: Path) -> None:
    arm = arm_chart(load_robot(file))
    isometric, side, *top = arm.views
    assert isometric.project(arm.down)[1] == pytest.approx(-np.sqrt(2 / 3))
    np.testing.assert_allclose(side.project(arm.down), [0, -1], atol=1e-12)
    for view in top:
        np.testing.assert_allclose(view.toward, -arm.down, atol=1e-12)
    for view in arm.views:
        np.testing.assert_allclose(np.linalg.norm([view.right, view.up], axis=1), 1)
        assert view.right @ view.up == pytest.approx(0)


@pytest.mark.slow
def test_a_tree_is_drawn_with_every_branch_and_tool(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path, torso_text()))
    arm = arm_chart(robot)
    origins, seats, elbows, tools = (
        points[0].tolist()
        for points in (arm.points.origins, arm.points.seats, arm.points.elbows, arm.points.tools)
    )
    to_left_hand = [elbows[2], origins[3], elbows[3], origins[4], tools[0]]
    assert [line.tolist() for line in arm.lines[:2]] == [
        [[0, 0, 0], origins[0], elbows[0], origins[1], seats[1], elbows[1], origins[2], *to_left_hand],
        [origins[1], seats[4], elbows[4], origins[5], elbows[5], origins[6], elbows[6], origins[7], tools[1]],
    ]
    assert [len(line) for line in arm.lines] == [12, 9, 5]
    corners = np.concatenate(arm.lines)
    assert np.ptp(corners, axis=0).max() <= arm.size
    texts = [text.get_text() for text in arm_figure(arm).axes[0].texts]
    assert {*robot.joint_names, *robot.tool_names} <= set(texts)


@pytest.mark.slow
def test_all_joints_of_a_hand_are_named() -> None:
    robot = hand(5, 4)
    figure = arm_figure(arm_chart(robot))
    assert {*robot.joint_names, *robot.tool_names} <= {text.get_text() for text in figure.axes[0].texts}
    figure.draw_without_rendering()
    names = [text for text in figure.axes[0].texts if text.get_text() in robot.joint_names]
    boxes = sorted((text.get_window_extent() for text in names), key=lambda box: float(box.y0))
    assert all(below.y1 <= above.y0 + 1 for below, above in itertools.pairwise(boxes))


def test_a_flat_arm_needs_no_top_view() -> None:
    assert len(arm_chart(shipped_robot("planar_2r")).views) == 2
    assert len(arm_chart(shipped_robot("puma_560")).views) == 3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["vsa_3r", "planar_2r", "scara_4", "panda_7r"])
def test_an_arm_fills_a_column_of_a_paper(name: str) -> None:
    """Boxes around links and joints take a seventh of it or more, at about one scale in all views."""
    with drawing_with(STYLES["paper"]):
        figure = arm_figure(arm_chart(shipped_robot(name)))
    figure.draw_without_rendering()
    area = 0.0
    for axes in figure.axes:
        solids = [path.vertices for each in axes.collections for path in each.get_paths()]
        links = [line.get_xydata() for line in axes.get_lines() if line.get_zorder() >= 2]
        area += np.prod(np.ptp(axes.transData.transform(np.concatenate([*solids, *links])), axis=0))
    assert area > 0.14 * figure.bbox.width * figure.bbox.height
    scales = [float(axes.transData.get_matrix()[0, 0]) for axes in figure.axes]
    np.testing.assert_allclose(scales, np.mean(scales), rtol=0.2)  # labels of axes take some of it


def test_ticks_count_along_the_axes_of_the_base_frame_on_a_ceiling() -> None:
    robot = dataclasses.replace(shipped_robot("puma_560"), gravity=(0.0, 0.0, 9.81))
    side = arm_chart(robot).views[1]
    assert side.flipped == (False, True)
    figure = arm_figure(arm_chart(robot))
    assert figure.axes[1].yaxis.get_major_formatter()(-0.25, 0) == "0.25"


@pytest.mark.cases(3)
@pytest.mark.slow
@bundled
def test_every_bundled_robot_is_drawn(file: Path) -> None:
    robot = load_robot(file)
    arm = arm_figure(arm_chart(robot))
    texts = {text.get_text() for text in arm.axes[0].texts}
    assert texts >= {*robot.joint_names, "g"}
    solids = sum(isinstance(each, PolyCollection) for each in arm.axes[0].collections)
    motors = sum(joint.actuator.motor_count for joint in robot.joints)
    assert solids == 3 * (1 + len(robot.joints) + motors)
    actuators = bundled_charts(file)
    for figure in (actuators_figure(actuators, "r"), stiffness_figure(actuators, "r")):
        assert len(figure.axes) == len(actuators)
        figure.draw_without_rendering()
    arm.draw_without_rendering()
