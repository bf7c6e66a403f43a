"""Which part of a URDF becomes the robot: ends of the chain, lumped links, side branches."""

from __future__ import annotations

import re

import numpy as np
import pytest
from samples.urdf import joint, link, robot, write

from vsacli import InputError, import_urdf

NO_INERTIA = '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
TREE = robot(
    link("world"),
    link("torso"),
    link("arm"),
    link("hand"),
    link("left"),
    link("right"),
    link("head"),
    joint("lift", "world", "torso", "P"),
    joint("shoulder", "torso", "arm", "R", rpy="1 0 0"),
    joint("wrist", "arm", "hand", "R", rpy="0 1 0"),
    joint("open_left", "hand", "left", "P", rpy="0 0 1"),
    joint("open_right", "hand", "right", "P", rest='<mimic joint="open_left"/>'),
    joint("nod", "torso", "head", "R", rpy="0 1 0"),
)


@pytest.fixture
def urdf(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda text: write(tmp_path / "arm.urdf", text).name


def names(conversion):
    return [[carried.name for carried in each.links] for each in conversion.tree.joints]


def names_of(held):
    return [each.urdf.name for each in held]


def point(xyz: str, mass: float) -> str:
    return f'<inertial><origin xyz="{xyz}"/><mass value="{mass}"/>{NO_INERTIA}</inertial>'


def test_fixed_links_and_held_branches_are_lumped(urdf):
    conversion = import_urdf(urdf(TREE), tip="hand")
    assert names(conversion) == [["torso", "head"], ["arm"], ["hand", "left", "right"]]
    assert names_of(conversion.tree.held_beside) == ["open_left", "open_right", "nod"]
    assert any("held at zero outside the chain" in note and "nod" in note for note in conversion.notes())


def test_joints_below_the_base_are_held(urdf):
    conversion = import_urdf(urdf(TREE), base="torso", tip="hand")
    assert names(conversion) == [["arm"], ["hand", "left", "right"]]
    assert names_of(conversion.tree.held_below) == ["lift"]
    assert "held at zero below the base: lift" in conversion.notes()


def test_two_points_make_a_dumbbell(urdf):
    text = robot(
        link("base"),
        link("rod", point("1 0 0", 3)),
        link("end", point("0 0 0", 1)),
        joint("turn", "base", "rod", xyz="0 0 0"),
        joint("weld", "rod", "end", "F", xyz="-1 0 0"),
    )
    (only,) = import_urdf(urdf(text), tip="rod").robot.joints
    assert only.link.mass == 4
    assert only.link.com == (0.5, 0, 0)
    # Reduced mass 3/4 kg at the distance of 2 m.
    assert np.diag(only.link.inertia.tensor).tolist() == [0, 3, 3]


def test_a_welded_body_keeps_its_orientation(urdf):
    moments = '<inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="2.5"/>'
    turned = f'<inertial><mass value="1"/>{moments}</inertial>'
    text = robot(
        link("base"),
        link("rod", ""),
        link("end", turned),
        joint("turn", "base", "rod"),
        joint("weld", "rod", "end", "F", rpy="1.5707963267948966 0 0"),
    )
    (only,) = import_urdf(urdf(text), tip="rod").robot.joints
    assert np.diag(only.link.inertia.tensor).tolist() == [1, 2.5, 2]


def test_gravity_follows_the_base(urdf):
    text = robot(
        link("floor"), link("wall"), link("arm"),
        joint("hang", "floor", "wall", "F", rpy="1.5707963267948966 0 0"), joint("turn", "wall", "arm"),
    )  # fmt: skip
    assert import_urdf(urdf(text)).robot.gravity == (0, 0, -9.81)
    assert import_urdf(urdf(text), base="wall").robot.gravity == (0, -9.81, 0)


def test_the_only_end_is_the_tip(urdf):
    text = robot(
        link("a"), link("b"), link("c"), link("tool"), link("screw"),
        joint("j1", "a", "b"), joint("j2", "b", "c", rpy="1 0 0"), joint("weld", "c", "tool", "F"),
        joint("bolt", "b", "screw", "F"),
    )  # fmt: skip
    assert import_urdf(urdf(text)).tree.tips[0].link == "tool"


@pytest.mark.parametrize(
    ("base", "tip", "problem"),
    [
        (None, None, "13: joint 'open_right' follows 'open_left' (<mimic>), so it has no drive of its own; "
         "hold it by --hold open_right=0, which neglects its motion, or both by --hold open_left=0"),
        (None, "hnd", "--tip: there is no link 'hnd'; did you mean 'hand'?"),
        ("torzo", "hand", "--base: there is no link 'torzo'; did you mean 'torso'?"),
        ("head", "hand", "the link 'hand' does not hang below 'head'"),
        ("hand", "torso", "the link 'torso' does not hang below 'hand'"),
        ("hand", "hand", "--base and --tip are the same link, 'hand'; choose a base nearer to the root"),
        ("head", None, "no joint moves below 'head'"),
        (None, "right", "13: joint 'open_right' follows 'open_left' (<mimic>)"),
        (None, "left", "13: joint 'open_right' outside the chain follows 'open_left' on it (<mimic>)"),
    ],
)  # fmt: skip
def test_a_chain_that_cannot_be(urdf, base, tip, problem):
    separator = "" if problem[0].isdigit() else " "
    with pytest.raises(InputError, match=f"^arm.urdf:{separator}{re.escape(problem)}"):
        import_urdf(urdf(TREE), base, tip)


def test_a_floating_base_may_be_held(urdf):
    text = TREE.replace('name="lift" type="prismatic"', 'name="lift" type="floating"')
    assert names_of(import_urdf(urdf(text), base="torso", tip="hand").tree.held_below) == ["lift"]
    with pytest.raises(InputError, match=r"^arm.urdf:9: joint 'lift' is floating; a chain has revolute"):
        import_urdf(urdf(text), tip="hand")


def test_names_become_identifiers_that_differ(urdf):
    text = robot(
        link("a"), link("b"), link("c"), link("d"),
        joint("arm.1", "a", "b"), joint("arm 1", "b", "c"), joint("7: é", "c", "d"),
    )  # fmt: skip
    assert import_urdf(urdf(text)).robot.joint_names == ("arm_1", "arm_1_2", "_7___")
