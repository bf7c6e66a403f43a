"""Groups of an SRDF: between which links their chains lie."""

from __future__ import annotations

import pytest
from samples.urdf import joint, link, robot, write

from vsacli import InputError, import_urdf
from vsacli.robot.urdf.reader import read_urdf
from vsacli.robot.urdf.srdf import ends_of_group

URDF = robot(
    *(link(f"l{number}") for number in range(5)),
    link("tool"),
    link("finger"),
    joint("j1", "l0", "l1"),
    joint("j2", "l1", "l2"),
    joint("j3", "l2", "l3"),
    joint("j4", "l3", "l4"),
    joint("mount", "l4", "tool", "F"),
    joint("grip", "tool", "finger", "P"),
)

GROUPS = {
    "a chain": ('<chain base_link="l1" tip_link="tool"/>', ("l1", "tool"), "j2 j3 j4"),
    "joints": ('<joint name="j2"/><joint name="j3"/>', ("l1", "l3"), "j2 j3"),
    "joints with a fixed one": (
        '<joint name="j3"/><joint name="j4"/><joint name="mount"/>',
        ("l2", "tool"),
        "j3 j4",
    ),
    "links": ('<link name="l3"/><link name="l4"/><link name="tool"/>', ("l2", "tool"), "j3 j4"),
    "the root among links": ('<link name="l0"/><link name="l1"/>', ("l0", "l1"), "j1"),
    "groups": ('<group name="lower"/><group name="upper"/>', ("l0", "l4"), "j1 j2 j3 j4"),
    "a group and a joint": ('<group name="upper"/><joint name="j2"/>', ("l1", "l4"), "j2 j3 j4"),
}

OTHERS = (
    '<group name="lower"><joint name="j1"/><joint name="j2"/></group>'
    '<group name="upper"><chain base_link="l2" tip_link="l4"/></group>'
)


@pytest.fixture
def files(tmp_path):
    def make(group: str, others: str = OTHERS):
        text = f'<robot name="sample">\n<group name="arm">\n{group}\n</group>\n{others}\n</robot>'
        return write(tmp_path / "arm.urdf", URDF), write(tmp_path / "arm.srdf", text)

    return make


@pytest.mark.parametrize("name", GROUPS)
def test_ends_of_a_group(files, name):
    group, (base, tip), names = GROUPS[name]
    urdf, srdf = files(group)
    assert ends_of_group(srdf, "arm", read_urdf(urdf)) == (base, (tip,))
    conversion = import_urdf(urdf, srdf=srdf, group="arm")
    assert conversion.robot.joint_names == tuple(names.split())
    assert (conversion.tree.base, conversion.tree.tips[0].link) == (base, tip)


def test_the_only_group_needs_no_name(files):
    urdf, srdf = files('<joint name="j2"/>', others="")
    assert ends_of_group(srdf, None, read_urdf(urdf)) == ("l1", ("l2",))


REFUSED = {
    "several": (
        None,
        '<joint name="j2"/>',
        "1: choose one of its groups with --group: 'arm', 'lower', 'up",
    ),
    "unknown": ("amr", '<joint name="j2"/>', "1: there is no group 'amr'; did you mean 'arm'?"),
    "no joint": ("arm", '<joint name="j7"/>', "3: .*arm.urdf has no joint 'j7'"),
    "no link": ("arm", '<link name="l7"/>', "3: .*arm.urdf has no link 'l7'"),
    "no chain": ("arm", '<chain base_link="l3" tip_link="l1"/>', "3: the link 'l1' does not hang below 'l3'"),
    "no base": ("arm", '<chain tip_link="l1"/>', "3: .*arm.urdf has no link ''"),
    "empty": ("arm", "", "2: no joint moves in the group 'arm'"),
    "fixed": ("arm", '<joint name="mount"/>', "2: no joint moves in the group 'arm'"),
    "gap": (
        "arm",
        '<joint name="j1"/><joint name="j3"/>',
        "2: the group 'arm' leaves out 'j2' within its ch",
    ),
    "itself": ("arm", '<group name="arm"/>', "2: the group 'arm' contains itself"),
    "inner": ("arm", '<group name="leg"/>', "3: there is no group 'leg'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_groups_that_are_no_chain(files, case):
    name, group, sentence = REFUSED[case]
    urdf, srdf = files(group)
    with pytest.raises(InputError, match=f"arm.srdf:{sentence}"):
        ends_of_group(srdf, name, read_urdf(urdf))


BODY = robot(
    *map(link, ("floor", "torso", "neck", "head", "left", "left_hand", "right", "right_hand", "wheel")),
    joint("lift", "floor", "torso", "P"),
    joint("nod", "torso", "head"),
    joint("raise_left", "torso", "left", xyz="0 0.2 0"),
    joint("bend_left", "left", "left_hand", rpy="1 0 0"),
    joint("weld", "torso", "neck", "F"),
    joint("raise_right", "neck", "right", xyz="0 -0.2 0"),
    joint("bend_right", "right", "right_hand", rpy="-1 0 0"),
    joint("roll", "floor", "wheel"),
)
LEFT = '<group name="left"><chain base_link="torso" tip_link="left_hand"/></group>'
RIGHT = '<group name="right"><joint name="raise_right"/><joint name="bend_right"/></group>'
BOTH = '<group name="left"/><group name="right"/>'
TREES = {
    "groups": (BOTH, "torso", ["left_hand", "right_hand"]),
    "groups in another order": (
        '<group name="right"/><group name="left"/>',
        "torso",
        ["right_hand", "left_hand"],
    ),
    "with the joint that carries both": (f'<joint name="lift"/>{BOTH}', "floor", ["left_hand", "right_hand"]),
    "chains one after the other": (
        '<chain base_link="torso" tip_link="left_hand"/><chain base_link="floor" tip_link="torso"/>',
        "floor",
        ["left_hand"],
    ),
    "chains that share a base link": (
        '<chain base_link="floor" tip_link="left_hand"/><chain base_link="floor" tip_link="right_hand"/>',
        "floor",
        ["left_hand", "right_hand"],
    ),
    "a base link before a fixed joint": (
        '<chain base_link="torso" tip_link="right"/>',
        "torso",
        ["right"],
    ),
    "joints": ('<joint name="nod"/><joint name="raise_left"/>', "torso", ["head", "left"]),
}


@pytest.mark.parametrize("name", TREES)
def test_a_group_may_be_a_tree(tmp_path, name):
    group, base, tips = TREES[name]
    urdf = write(tmp_path / "body.urdf", BODY)
    text = f'<robot name="x"><group name="both">{group}</group>{LEFT}{RIGHT}</robot>'
    conversion = import_urdf(urdf, srdf=write(tmp_path / "body.srdf", text), group="both")
    assert (conversion.tree.base, [tip.link for tip in conversion.tree.tips]) == (base, tips)
    expected = tips if len(tips) > 1 else ["end_effector"]
    assert conversion.robot.tool_names == tuple(expected)
    assert "roll" not in conversion.robot.joint_names


def test_a_tree_has_no_gaps(tmp_path):
    urdf = write(tmp_path / "body.urdf", BODY)
    joints = '<joint name="roll"/><joint name="bend_left"/>'
    srdf = write(tmp_path / "body.srdf", f'<robot name="x"><group name="both">{joints}</group></robot>')
    sentence = "the group 'both' leaves out 'lift', 'raise_left' within its tree"
    with pytest.raises(InputError, match=sentence):
        import_urdf(urdf, srdf=srdf)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (URDF, "expected an SRDF"),
        ("<robot/>", "there is no <group>"),
        ("<srdf/>", "expected an SRDF"),
        ("a: 1", "arm.srdf: is a YAML file, expected an SRDF"),
    ],
)
def test_what_is_no_srdf(tmp_path, text, sentence):
    urdf, srdf = write(tmp_path / "arm.urdf", URDF), write(tmp_path / "arm.srdf", text)
    with pytest.raises(InputError, match=sentence):
        import_urdf(urdf, srdf=srdf)


def test_the_command_takes_a_group(vsacli, files):
    files('<chain base_link="l1" tip_link="tool"/>')
    done = vsacli("import-urdf", "arm.urdf", "--srdf", "arm.srdf", "--group", "arm", "-o", "arm.yaml")
    assert done.code == 0
    assert "3 joints from l1 to tool" in done.out
    refused = vsacli("import-urdf", "arm.urdf", "--group", "arm", "-o", "other.yaml")
    assert (refused.code, "--group needs --srdf FILE" in refused.err) == (2, True)
    refused = vsacli("import-urdf", "arm.urdf", "--srdf", "arm.srdf", "--tip", "tool", "-o", "other.yaml")
    assert (refused.code, "leave out --base and --tip" in refused.err) == (2, True)


@pytest.mark.parametrize(
    ("urdf", "sentence"),
    [
        (
            URDF.replace('value="2"', 'value="${mass}"', 1),
            "2: '${mass}' belongs to a xacro file; expand it first",
        ),
        (URDF.replace("<inertial>", "<inertial><xacro:mass/>", 1), "2: <xacro:mass> belongs to a xacro file"),
    ],
)
def test_xacro_that_was_not_expanded(tmp_path, urdf, sentence):
    path = write(tmp_path / "arm.urdf", urdf)
    with pytest.raises(InputError) as caught:
        import_urdf(path)
    assert f"arm.urdf:{sentence}" in str(caught.value)
    assert str(caught.value).endswith("arm.urdf > arm_expanded.urdf")


def test_what_xacro_has_expanded_is_read(tmp_path):
    expanded = URDF.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    mesh = '<visual><geometry><mesh filename="package://arm/$(arg hand).stl"/></geometry></visual>'
    expanded = expanded.replace("<inertial>", f"{mesh}<inertial>", 1)
    assert import_urdf(write(tmp_path / "arm.urdf", expanded), tip="tool").robot.joint_names[0] == "j1"
