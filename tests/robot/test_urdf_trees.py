"""URDF files with branches: which joints move, where their rows begin, and which links become tools."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from oracles.urdf_pinocchio import UrdfOracle
from samples.marks import slow
from samples.urdf import INERTIAL, joint, link, random_tree, robot, write
from samples.urdf_deviations import deviations

from vsacli import InputError, Pose, import_urdf, link_torques, load_robot, mass_matrix
from vsacli.robot.urdf import converted_robot_text

RIGHT_ANGLE = "1.5707963267948966"
LIMIT = '<limit lower="-2" upper="2" velocity="3" effort="40"/>'
STROKE = '<limit lower="-0.2" upper="0.5" velocity="1" effort="1"/>'
ROUNDING = 1e-12
"""Relative, of torques and poses: numbers of the file that are short but for 1e-11 occur in no test here."""


def arm(side: str, y: float) -> list[str]:
    """An arm of two revolute joints and a prismatic one on the torso, with a tip link without mass."""
    rpy = f"{math.copysign(1, -y)}"
    names = (f"{side}_upper", f"{side}_fore", f"{side}_palm")
    return [
        *map(link, names),
        link(f"{side}_tcp", ""),
        joint(f"{side}.shoulder", "torso", names[0], xyz=f"0 {y} 0.4", rpy=f"{rpy} 0 0", rest=LIMIT),
        joint(f"{side}.elbow", names[0], names[1], rpy=f"0 {RIGHT_ANGLE} 0", rest=LIMIT),
        joint(f"{side}.wrist", names[1], names[2], "P", xyz="0.25 0 0", rest=STROKE),
        joint(f"{side}_weld", names[2], f"{side}_tcp", "F", xyz="0 0 0.1"),
    ]


LEFT, RIGHT = arm("left", 0.2), arm("right", -0.2)
WAIST = [link("stand"), link("torso"), joint("waist", "stand", "torso", rest=LIMIT)]
TORSO = robot(*WAIST, *LEFT, *RIGHT)


@pytest.fixture
def urdf(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda text: write(tmp_path / "body.urdf", text).name


def compare_with_pinocchio(conversion, held=None, bound=ROUNDING):
    """Compare tool poses and torques at random states."""
    assert max(deviations(conversion, UrdfOracle(conversion.file), 5, held or {})) < bound


def test_all_joints_move_and_each_branch_ends_with_a_tool(urdf):
    conversion = import_urdf(urdf(TORSO))
    body = conversion.robot
    assert body.joint_names == (
        *("waist", "left_shoulder", "left_elbow", "left_wrist"),
        *("right_shoulder", "right_elbow", "right_wrist"),
    )
    assert [moving.parent for moving in body.joints] == [None, None, None, None, "waist", None, None]
    assert [moving.mount is not None for moving in body.joints] == [False] * 4 + [True, False, False]
    assert [(tool.name, tool.joint) for tool in body.tools] == [
        ("left_tcp", "left_wrist"),
        ("right_tcp", "right_wrist"),
    ]
    assert (body.tool, conversion.snaps) == (Pose(), ())
    compare_with_pinocchio(conversion)


def test_the_file_and_the_report_of_a_tree(vsacli, urdf, tmp_path):
    urdf(TORSO)
    done = vsacli("import-urdf", "body.urdf")
    conversion = import_urdf("body.urdf")
    text = (tmp_path / "body.yaml").read_text()
    assert load_robot(tmp_path / "body.yaml") == conversion.robot
    assert text == converted_robot_text(conversion)
    lines = done.out.splitlines()
    assert lines[0] == "sample: 7 joints from stand to left_tcp, right_tcp"
    assert lines[6].split()[:3] == ["right_shoulder", "waist,", "mounted"]
    assert lines[7].split()[:2] == ["right_elbow", "right_shoulder"]
    exact = "the same as the URDF's, the tools within 1.0e-12 m and 1.0e-12 rad"
    assert f"forward kinematics: {exact}" in lines
    assert 'description: "converted from body.urdf, from link stand to links left_tcp and right_tcp"' in text
    assert "    parent: waist\n    mount: {xyz: [" in text
    assert "# where its row begins in the DH frame of waist; m, rad" in text
    assert re.search(r"\ntools: .*\n  left_tcp: {joint: left_wrist, xyz: \[.*\n  right_tcp: {", text)


def test_branches_on_the_base(urdf):
    text = TORSO.replace('parent link="torso"', 'parent link="stand"')
    conversion = import_urdf(urdf(text))
    assert [moving.parent for moving in conversion.robot.joints if moving.parent] == ["frame 0", "frame 0"]
    assert "    parent: null\n" in converted_robot_text(conversion)
    compare_with_pinocchio(conversion)


def test_coincident_axes_need_no_mount(urdf):
    text = robot(
        *map(link, "abcd"),
        joint("stem", "a", "b"),
        joint("one", "b", "c", rpy="1 0 0"),
        joint("two", "b", "d", rpy="1 0 0"),
    )
    body = import_urdf(urdf(text)).robot
    assert [moving.parent for moving in body.joints] == [None, None, "stem"]
    assert [moving.mount for moving in body.joints] == [None, None, None]


def test_a_branch_gives_what_it_gives_alone(urdf):
    """All but where it is mounted: rows, links, placeholders, limits."""
    base = [link("torso")]
    both = import_urdf(urdf(robot(*base, *RIGHT, *LEFT))).robot
    for side, parts in (("left", LEFT), ("right", RIGHT)):
        alone = import_urdf(urdf(robot(*base, *parts))).robot
        branch = [moving for moving in both.joints if moving.name.startswith(side)]
        for moving, other in zip(branch, alone.joints, strict=True):
            assert (moving.dh, moving.link, moving.limits) == (other.dh, other.link, other.limits)
            assert moving.actuator == other.actuator


PARENTS = [(0, 1, 1), (0, 0, 2, 2, 0), (0, 1, 1, 3, 1, 5), (0, 1, 2, 2, 4, 2, 0, 7)]
TREES = [("RRR", 0), ("RPRPR", 1), ("RPRRCR", 2), ("CRPRRPRR", 3)]
QUICK = (("RRR", 0, 0), ("RPRPR", 1, 1), ("RPRRCR", 2, 0))
CASES = [(letters, shape, seed) for letters, shape in TREES for seed in range(6)]


def shuffled(text: str, seed: int) -> str:
    """The file with its elements in another order, which is another order of siblings."""
    first, *elements, last = text.splitlines()
    return "\n".join([first, *np.random.default_rng(seed).permutation(elements), last])


def by_name(names, values):
    return {name: values[..., index] for index, name in enumerate(names)}


@pytest.mark.cases(8)  # two of each tree
@pytest.mark.parametrize(("letters", "shape", "seed"), [c if c in QUICK else slow(*c) for c in CASES])
def test_random_trees_in_any_order(urdf, letters, shape, seed):
    limits = STROKE.replace("-0.2", "-1")
    text = random_tree(letters, PARENTS[shape], seed).replace("</joint>", f"{limits}</joint>")
    conversion = import_urdf(urdf(text))
    compare_with_pinocchio(conversion, bound=1e-10)  # as of random chains
    body, names = conversion.robot, conversion.robot.joint_names
    other = import_urdf(urdf(shuffled(text, seed + 10)))
    order = [names.index(name) for name in other.robot.joint_names]
    assert sorted(order) == list(range(len(names)))
    assert set(other.robot.tool_names) == set(body.tool_names)
    assert set(other.warnings()) == set(conversion.warnings())
    for index, moving in zip(order, other.robot.joints, strict=True):
        assert (moving.actuator, moving.limits) == (body.joints[index].actuator, body.joints[index].limits)
        same = body.joints[index]
        assert moving.link.mass == pytest.approx(same.link.mass, rel=1e-14)
        if body.parents.count(index) < 2:  # the frames of other links are those of a sibling
            numbers = [(*vars(each.dh).values(), *each.link.com) for each in (moving, same)]
            assert numbers[0] == pytest.approx(numbers[1], rel=1e-9, abs=1e-9)
    q, dq, ddq = np.random.default_rng(seed).uniform(-2, 2, (3, 3, len(names)))
    torques = link_torques(body, q, dq, ddq)[0]
    again = link_torques(other.robot, q[:, order], dq[:, order], ddq[:, order])[0]
    np.testing.assert_allclose(again, torques[:, order], rtol=0, atol=1e-10 * np.abs(torques).max())


@pytest.mark.cases(8)  # two of each tree
@pytest.mark.parametrize(("letters", "shape", "seed"), [c if c in QUICK else slow(*c) for c in CASES])
def test_no_pose_loads_a_joint_of_a_tree_more_than_it_is_sized_for(urdf, letters, shape, seed):
    text = random_tree(letters, PARENTS[shape], seed).replace("</joint>", f"{STROKE}</joint>")
    conversion = import_urdf(urdf(text))
    rng = np.random.default_rng(seed)
    kinds = [moving.type for moving in conversion.robot.joints]
    low, high = np.array([(-0.2, 0.5) if kind == "prismatic" else (-np.pi, np.pi) for kind in kinds]).T
    q = rng.uniform(low, high, (100, len(kinds)))
    directions = rng.normal(size=(4, 3))
    directions *= 9.81 / np.linalg.norm(directions, axis=1, keepdims=True)
    bodies = [conversion.robot.replace("gravity", along) for along in directions.tolist()]
    torques = np.array([link_torques(body, q)[0] for body in bodies])
    inertias = np.diagonal(mass_matrix(conversion.robot, q), axis1=1, axis2=2)
    bounds = np.array([(load.torque, load.inertia) for load in conversion.loads]).T * (1 + 1e-13)  # rounding
    assert np.all(abs(torques).max(axis=(0, 1)) <= bounds[0])
    assert np.all(inertias.max(axis=0) <= bounds[1])


@pytest.mark.parametrize("tilt", [1e-5, 1e-2])
def test_a_joint_with_a_far_common_normal_is_mounted_as_it_is(urdf, tilt):
    """Its sibling takes the row; alone it would be snapped, or have a row kilometers long."""
    text = robot(
        *map(link, "abcd"),
        joint("stem", "a", "b", rest=LIMIT),
        joint("far", "b", "c", xyz="0.4 0.3 0", rpy=f"{tilt} 0 0", rest=LIMIT),
        joint("near", "b", "d", xyz="0 0.3 0", rpy="1 0 0", rest=LIMIT),
    )
    conversion = import_urdf(urdf(text))
    stem, far, near = conversion.robot.joints
    assert conversion.snaps == ()
    assert (near.parent, near.mount) == ("stem", None)
    assert max(map(abs, far.mount.xyz)) < 1
    assert max(abs(row) for moving in (stem, far, near) for row in (moving.dh.a, moving.dh.d)) < 1
    compare_with_pinocchio(conversion)
    alone = import_urdf(urdf(text.replace('"near" type="revolute"', '"near" type="fixed"')))
    assert [snap.joint for snap in alone.snaps] == (["far"] if tilt < 1e-4 else [])


def test_only_far_joints_are_all_mounted(urdf):
    text = robot(
        *map(link, "abcd"),
        joint("stem", "a", "b", rest=LIMIT),
        joint("one", "b", "c", xyz="0 0.4 0", rpy="1e-6 0 0", rest=LIMIT),
        joint("two", "b", "d", xyz="0 -0.4 0", rpy="-1e-6 0 0", rest=LIMIT),
    )
    conversion = import_urdf(urdf(text))
    assert [moving.mount is not None for moving in conversion.robot.joints] == [False, True, True]
    compare_with_pinocchio(conversion)


def test_several_tips_take_the_joints_before_them(vsacli, urdf, tmp_path):
    head = [link("head"), joint("nod", "torso", "head", rpy="0 1 0", rest=LIMIT)]
    urdf(robot(*WAIST, *head, *LEFT, *RIGHT))
    done = vsacli("import-urdf", "body.urdf", "--tip", "right_fore", "--tip", "left_tcp")
    body = load_robot(tmp_path / "body.yaml")
    assert body.joint_names[1:4] == ("left_shoulder", "left_elbow", "left_wrist")
    assert body.joint_names[4:] == ("right_shoulder", "right_elbow")
    assert body.tool_names == ("right_fore", "left_tcp")
    assert "held at zero outside the tree, their links lumped: nod, right.wrist" in done.out
    compare_with_pinocchio(import_urdf("body.urdf", tip=["right_fore", "left_tcp"]))


def test_tips_may_be_on_one_link_or_on_the_way_to_another(urdf):
    conversion = import_urdf(urdf(TORSO), tip=["left_palm", "left_tcp", "torso", "left_tcp"])
    assert conversion.robot.tool_names == ("left_palm", "left_tcp", "torso")
    assert [tool.joint for tool in conversion.robot.tools] == ["left_wrist", "left_wrist", "waist"]
    assert all(moving.parent is None for moving in conversion.robot.joints)
    compare_with_pinocchio(conversion)


@pytest.mark.parametrize(
    ("tips", "problem"),
    [
        (["left_tcp", "right_tpc"], "--tip: there is no link 'right_tpc'; did you mean 'right_tcp'?"),
        (["left_tcp", "stand"], "--base and --tip are the same link, 'stand'; choose a base nearer to the"),
    ],
)
def test_tips_that_cannot_be(vsacli, urdf, tips, problem):
    urdf(TORSO)
    done = vsacli("import-urdf", "body.urdf", *(word for tip in tips for word in ("--tip", tip)))
    assert (done.code, problem in done.err) == (2, True)


def test_a_held_joint_stands_within_the_tree(urdf):
    conversion = import_urdf(urdf(TORSO), hold={"left.elbow": "30 deg"})
    assert "left_elbow" not in conversion.robot.joint_names
    assert "left_wrist" in conversion.robot.joint_names
    assert "held outside the tree, their links lumped: left.elbow at 0.523599 rad" in conversion.notes()
    compare_with_pinocchio(conversion, {"left.elbow": math.pi / 6})


def test_a_single_branch_is_the_chain_of_its_tip(urdf):
    path = urdf(robot(*WAIST, *LEFT))
    assert converted_robot_text(import_urdf(path)) == converted_robot_text(import_urdf(path, tip="left_tcp"))


def finger(name: str, inertial: str, rest: str = "") -> list[str]:
    return [link(name, inertial), joint(f"close_{name}", "left_palm", name, rpy="0.5 0 0", rest=rest + LIMIT)]


def test_fingers_without_mass_that_follow_a_joint_do_not_end_the_import(urdf):
    second = finger("second", "", '<mimic joint="close_first"/>')
    beyond = [link("pad", ""), joint("turn", "second", "pad", rest=LIMIT)]
    first = finger("first", INERTIAL)
    conversion = import_urdf(urdf(robot(*WAIST, *LEFT, *RIGHT, *first, *second, *beyond)))
    plain = import_urdf(urdf(robot(*WAIST, *LEFT, *RIGHT, *first)))
    assert conversion.robot.joints == plain.robot.joints
    followers = "outside the tree, following it without mass, so without torque: close_second (follows"
    assert any(note.startswith(followers) for note in conversion.notes())
    assert "held at zero outside the tree, their links lumped: turn" in conversion.notes()


def test_fingers_with_mass_that_follow_a_joint_can_be_held(urdf):
    fingers = [
        *finger("first", INERTIAL),
        *finger("second", INERTIAL, '<mimic joint="close_first"/>'),
    ]
    path = urdf(robot(*WAIST, *LEFT, *RIGHT, *fingers))
    with pytest.raises(InputError, match=r"joint 'close_second' follows 'close_first' \(<mimic>\)") as caught:
        import_urdf(path)
    alone, both = (
        re.search(f"{word} by --hold (\\w+)=0", str(caught.value))[1] for word in ("hold it", "or both")
    )
    neglected = import_urdf(path, hold={alone: 0})
    assert "close_first" in neglected.robot.joint_names
    assert any("its motion with that joint is neglected" in warning for warning in neglected.warnings())
    conversion = import_urdf(path, hold={both: 0.3})
    assert not {"close_first", "close_second"} & set(conversion.robot.joint_names)
    assert [held.position for held in conversion.tree.held] == [0.3, 0.3]
    compare_with_pinocchio(conversion, {both: 0.3})


def test_all_fingers_that_follow_a_joint_are_named_at_once(urdf):
    """Also those that follow a joint beyond another that follows one."""
    parts = [
        *finger("first", INERTIAL),
        *finger("second", INERTIAL, '<mimic joint="close_first"/>'),
        *(link(name) for name in ("third", "fourth")),
        joint("bend", "second", "third", rest=LIMIT),
        joint("follow", "third", "fourth", rest=f'<mimic joint="bend"/>{LIMIT}'),
    ]
    with pytest.raises(InputError) as caught:
        import_urdf(urdf(robot(*WAIST, *LEFT, *RIGHT, *parts)))
    named = re.findall(r"joint '(\w+)' follows '(\w+)' \(<mimic>\)", str(caught.value))
    assert named == [("close_second", "close_first"), ("follow", "bend")]


def test_a_floating_base_is_held_and_warned_of(urdf):
    base = [link("world", ""), joint("free", "world", "stand", "floating", xyz="0 0 0")]
    path = urdf(robot(*base, *WAIST, *LEFT, *RIGHT))
    conversion = import_urdf(path)
    assert next(conversion.warnings()).startswith(
        "free is floating, and held at zero: a robot file has no such"
    )
    assert conversion.robot.joints == import_urdf(urdf(TORSO)).robot.joints
    planar = TORSO.replace('name="left.elbow" type="revolute"', 'name="left.elbow" type="planar"')
    with pytest.raises(
        InputError, match=r"joint 'left.elbow' is planar; a tree has revolute, continuous and"
    ):
        import_urdf(urdf(planar))


def test_links_that_end_beside_each_other_leave_the_tool_before_them(urdf):
    camera = [link("camera", ""), joint("screw", "left_palm", "camera", "F")]
    conversion = import_urdf(urdf(robot(*WAIST, *LEFT, *camera, *RIGHT)))
    assert conversion.robot.tool_names == ("left_palm", "right_tcp")
    ends = "several links end beyond left_palm, where the tool is: left_tcp, camera"
    assert f"{ends}; for another, name all tools by --tip" in conversion.notes()


def test_a_joint_named_null_carries_a_branch(urdf, tmp_path):
    conversion = import_urdf(urdf(TORSO.replace('"waist"', '"null"').replace("left_tcp", "Null")))
    loaded = load_robot(write(tmp_path / "body.yaml", converted_robot_text(conversion)))
    assert (loaded.joints[4].parent, loaded.tool_names[0]) == ("_null", "_Null")


def test_names_of_tools_are_identifiers_that_differ(urdf):
    text = TORSO.replace("left_tcp", "arm.tcp").replace("right_tcp", "arm tcp")
    assert import_urdf(urdf(text)).robot.tool_names == ("arm_tcp", "arm_tcp_2")
