"""URDF files that cannot be used: exit code 2 and a sentence with the line, whatever the file holds."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from samples.urdf import INERTIAL, joint, link, robot, serial

from vsacli import InputError, Placeholders, import_urdf
from vsacli.robot.joint import UNBOUNDED

BOMB = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>\n<robot name="&b;"/>'
EXTERNAL = '<!DOCTYPE robot SYSTEM "file:///etc/passwd">\n<robot name="x"/>'
ARM = serial("RR")
CIRCLE = robot(link("a"), link("b"), joint("ab", "a", "b"), joint("ba", "b", "a"))
STRAY_CIRCLE = robot(link("root"), link("a"), link("b"), joint("ab", "a", "b"), joint("ba", "b", "a"))
LOOP = robot(
    link("a"), link("b"), link("c"), joint("ab", "a", "b"), joint("ac", "a", "c"), joint("bc", "b", "c")
)

# Each case: the text, and the lines the user gets, as "line number: part of the message".
FILES = {
    "entity bomb": (BOMB, ["1: document type declarations and entities are not read"]),
    "external entity": (EXTERNAL, ["1: document type declarations and entities are not read"]),
    "undeclared entity": ('<robot name="&evil;"/>', ["1: not valid XML at column 1: undefined entity"]),
    "not closed": ("<robot>\n<link>", ["2: not valid XML at column 7: no element found"]),
    "binary": ("\0\1\2\3", ["1: not valid XML at column 1: not well-formed (invalid token)"]),
    "text": ("hello", ["1: not valid XML at column 1: syntax error"]),
    "YAML": ("format: vsacli-robot/1", [": is a robot, but URDF must be a URDF file"]),
    "other XML": ("<mujoco/>", ["1: expected a URDF, which begins with <robot>, found <mujoco>"]),
    "xacro": (
        '<robot>\n<xacro:arm name="x"/></robot>',
        ["2: <xacro:arm> belongs to a xacro file; expand it first: "],
    ),
    "nameless": (robot(link("a")).replace(' name="sample"', ""), ["1: robot: there is no attribute name"]),
    "no links": ('<robot name="x"/>', ["1: the file describes no links"]),
    "deep": ("<robot>" * 101 + "</robot>" * 101, ["1: nested more than 100 levels deep"]),
    "many": ("<robot>" + "<link/>\n" * 100_001 + "</robot>", ["100000: more than 100,000 elements"]),
    "many links": (serial("R" * 1000), ["1002: more than 1,000 links"]),
    "circle": (CIRCLE, ["1: must form one tree, which has one root, but every link has a parent"]),
    "circle beside the root": (STRAY_CIRCLE, ["3: the link 'a' is its own ancestor"]),
    "own parent": (robot(link("a"), joint("j", "a", "a")), ["1: every link has a parent"]),
    "loop": (LOOP, ["7: the link 'c' is the child of the joints 'ac' and 'bc'; closed loops are not read"]),
    "two roots": (robot(link("a"), link("b")), ["1: 'a', 'b' have no parent"]),
    "no joints": (robot(link("a")), [": no joint moves below 'a'"]),
}

# Each case: what is put in place of what in a good file, and the lines the user gets.
EDITS = {
    "missing link": (('<child link="l2"/>', '<child link="l3"/>'), ["6: joint 'j2': there is no link 'l3'"]),
    "duplicate link": (
        ('link name="l1"', 'link name="l0"'),
        ["3: the link 'l0' stands on line 2 already", "5: ", "6: "],
    ),
    "duplicate joint": (
        ('joint name="j2"', 'joint name="j1"'),
        ["6: the joint 'j1' stands on line 5 already"],
    ),
    "nameless link": (
        ('link name="l2"', "link"),
        ["4: link: there is no attribute name", "6: there is no link 'l2'"],
    ),
    "line break in a name": (
        ('link name="l0"', 'link name="l&#10;0"'),
        ["2: name: 'l\\n0' holds what cannot be printed", "5: joint 'j1': there is no link 'l0'"],
    ),
    "no parent": (('<parent link="l1"/>', ""), ["6: joint: there is no <parent> in it"]),
    "two parents": (('<parent link="l1"/>', '<parent link="l1"/>' * 2), ["6: joint: a second <parent>"]),
    "type": (
        ('name="j2" type="revolute"', 'name="j2" type="revolut"'),
        ["6: unknown word 'revolut'; did you mean 'revolute'?"],
    ),
    "zero axis": (
        ('<axis xyz="0 0 1"/></joint>\n</', '<axis xyz="0 0 0"/></joint>\n</'),
        ["6: axis: [0.0, 0.0, 0.0] has no direction"],
    ),
    "tiny axis": (
        ('<axis xyz="0 0 1"/></joint>\n</', '<axis xyz="0 0 1e-300"/></joint>\n</'),
        ["6: axis: [0.0, 0.0, 1e-300] has no direction"],
    ),
    "two numbers": (
        ('xyz="0.1 0 0.2"', 'xyz="0.1 0"'),
        ["2: xyz: expected 3 numbers, found 2", "3: ", "4: "],
    ),
    "NaN": (
        ('mass value="2"', 'mass value="nan"'),
        ["2: value: expected a number of at most 1e+09, found 'nan'", "3: ", "4: "],
    ),
    "infinity": (
        ('ixx="0.03"', 'ixx="inf"'),
        ["2: ixx: expected a number of at most 1e+09, found 'inf'", "3: ", "4: "],
    ),
    "1e308": (
        ('xyz="0.1 0 0.2"', 'xyz="1e308 0 0"'),
        ["2: xyz: expected a number of at most 1e+09, found '1e308'", "3: ", "4: "],
    ),
    "underscore": (('mass value="2"', 'mass value="2_0"'), ["2: found '2_0'", "3: ", "4: "]),
    "expression": (('mass value="2"', 'mass value="${m}"'), ["2: belongs to a xacro file"]),
    "negative mass": (
        ('mass value="2"', 'mass value="-2"'),
        ["2: mass: must be zero or positive, not -2", "3: ", "4: "],
    ),
    "no mass": (('<mass value="2"/>', ""), ["3: inertial of 'l1': there is no <mass> in it", "4: "]),
    "no moment": ((' iyz="0"', ""), ["2: inertia: there is no attribute iyz", "3: ", "4: "]),
    "impossible inertia": (
        ('ixx="0.03"', 'ixx="-0.03"'),
        ["3: inertia of 'l1': the tensor has the negative eigenvalue -0.03", "4: "],
    ),
    "NaN limit": (
        ("</joint>\n</", '<limit lower="nan"/></joint>\n</'),
        ["6: lower: expected a number, found 'nan'"],
    ),
    "negative damping": (
        ("</joint>\n</", '<dynamics damping="-1"/></joint>\n</'),
        ["6: dynamics: must be zero or positive, not -1"],
    ),
    "planar": (
        ('name="j2" type="revolute"', 'name="j2" type="planar"'),
        ["6: joint 'j2' is planar; a chain has"],
    ),
    "mimic": (("</joint>\n</", '<mimic joint="j1"/></joint>\n</'), ["6: joint 'j2' follows 'j1' (<mimic>)"]),
}


def refused(done, lines):
    assert (done.code, done.out) == (2, "")
    printed = done.err.splitlines()
    assert len(printed) == len(lines), done.err
    for found, expected in zip(printed, lines, strict=True):
        number, part = expected.split(": ", 1)
        assert found.startswith(f"arm.urdf:{number}: " if number else "arm.urdf: ")
        assert part in found


@pytest.mark.parametrize(("text", "lines"), FILES.values(), ids=FILES)
def test_a_file_that_is_no_urdf(vsacli, tmp_path, text, lines):
    (tmp_path / "arm.urdf").write_text(text)
    refused(vsacli("import-urdf", "arm.urdf"), lines)
    assert [path.name for path in tmp_path.iterdir()] == ["arm.urdf"]


@pytest.mark.parametrize(("change", "lines"), EDITS.values(), ids=EDITS)
def test_a_mistake_is_named_with_its_line(vsacli, tmp_path, change, lines):
    assert change[0] in ARM
    (tmp_path / "arm.urdf").write_text(ARM.replace(*change))
    refused(vsacli("import-urdf", "arm.urdf"), lines)
    assert [path.name for path in tmp_path.iterdir()] == ["arm.urdf"]


def test_the_unchanged_file_is_accepted(vsacli, tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    assert vsacli("import-urdf", "arm.urdf").code == 0


def test_a_huge_file_is_refused_without_being_read(vsacli, tmp_path):
    with (tmp_path / "arm.urdf").open("wb") as file:
        file.truncate(10_000_001)
    refused(vsacli("import-urdf", "arm.urdf"), [": the file has 10,000,001 bytes, more than the 10,000,000"])


def test_what_is_not_utf8(vsacli, tmp_path):
    (tmp_path / "arm.urdf").write_bytes(b'<?xml version="1.0" encoding="latin-1"?>\n<robot name="\xe9"/>')
    refused(vsacli("import-urdf", "arm.urdf"), ["2: byte 0xe9 is not valid UTF-8"])


@pytest.mark.parametrize(
    ("limit", "position", "velocity", "torque"),
    [
        ('lower="-1" upper="2" velocity="3" effort="4"', (-1, 2), (-3, 3), 4),
        ('lower="0" upper="0" velocity="0" effort="0"', UNBOUNDED, UNBOUNDED, math.inf),
        ('lower="-inf" upper="inf" velocity="inf" effort="inf"', UNBOUNDED, UNBOUNDED, math.inf),
        ('lower="-1e16" upper="1e16" velocity="-3" effort="-4"', UNBOUNDED, UNBOUNDED, math.inf),
        ('lower="0" upper="1e16"', (0, 1e9), UNBOUNDED, math.inf),
    ],
)
def test_limits_that_bound_nothing_are_none(tmp_path, limit, position, velocity, torque):
    (tmp_path / "arm.urdf").write_text(ARM.replace("</joint>", f"<limit {limit}/></joint>"))
    joint = import_urdf(tmp_path / "arm.urdf", placeholders=Placeholders("rigid")).robot.joints[0]
    assert (joint.limits.position, joint.limits.velocity) == (position, velocity)
    assert joint.actuator.motor.max_torque == torque


def test_a_continuous_joint_has_no_position_limits(tmp_path):
    limited = serial("C").replace("</joint>", '<limit lower="-1" upper="1"/></joint>')
    (tmp_path / "arm.urdf").write_text(limited)
    assert import_urdf(tmp_path / "arm.urdf").robot.joints[0].limits.position == UNBOUNDED


PARTS = st.sampled_from(
    [
        INERTIAL,
        link("l0"),
        joint("j1", "l0", "l1"),
        '"',
        "<",
        ">",
        "</joint>",
        "&amp;",
        "0 0",
        "1e999",
        "type=",
    ]
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(0, len(ARM)), length=st.integers(0, 80), part=PARTS)
def test_a_damaged_file_is_refused_or_converted(tmp_path, cut, length, part):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM[:cut] + part + ARM[cut + length :])
    problems = []
    try:
        import_urdf(path)
    except InputError as error:
        problems = [str(problem) for problem in error.problems]
    assert all(re.match(rf"{re.escape(str(path))}:", problem) for problem in problems)
