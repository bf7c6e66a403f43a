"""Paths into files: what they lead to in plain data, and another value there in a declared record."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

import pytest
from samples.command_line import REPOSITORY

from vsacli import Antagonistic, InputError, Robot, laws, load_robot
from vsacli.base.signals import POSITION
from vsacli.documents.paths import find, replace
from vsacli.trajectory.curves.closed_form import Use
from vsacli.trajectory.curves.via_points import Via

ROBOT = load_robot(REPOSITORY / "robots" / "vsa_3r.yaml")
CONTENT = {
    "joints": [{"name": "a", "x": 1.5}, {"name": "b", "x": None}],
    "n": "text",
    "row": [[1, 2], [3, 4]],
}


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("joints.1.x", None),
        ("joints.a.x", 1.5),
        ("joints.0.x", 1.5),
        ("joints.*.name", ["a", "b"]),
        ("row.*.1", [2, 4]),
        ("row.*.*", [[1, 2], [3, 4]]),
        ("n", "text"),
    ],
)
def test_find(path: str, found: Any) -> None:
    assert find(CONTENT, path) == found


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("joint", "there is no 'joint'; did you mean 'joints'?"),
        ("joints.2", "joints has no '2'; valid: a, b or 0 to 1"),
        ("joints.0.y", "joints.0 has no 'y'; valid: name, x"),
        ("joints.*.nam", "joints.0 has no 'nam'; did you mean 'name'?"),
        ("n.0", "n has no '0'; it is a single value"),
        ("n.*", "n has no '*'; it is a single value"),
        ("*", "there is no '*'; valid: joints, n, row"),
        ("", "there is no ''; valid: joints, n, row"),
    ],
)
def test_a_path_that_leads_nowhere(path: str, message: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        find(CONTENT, path)


def springs(robot: Robot, joint: int = 2) -> tuple[Any, Any]:
    actuator = robot.joints[joint].actuator
    assert isinstance(actuator, Antagonistic)
    return actuator.spring


def with_springs(first: laws.Cubic, second: laws.Cubic) -> Robot:
    *others, elbow = ROBOT.joints
    elbow = dataclasses.replace(elbow, actuator=dataclasses.replace(elbow.actuator, spring=(first, second)))
    return dataclasses.replace(ROBOT, joints=(*others, elbow))


@pytest.mark.parametrize("path", ["joints.elbow.actuator.spring.k", "joints.2.actuator.spring.*.k"])
def test_sides_that_are_the_same_change_together_and_stay_one(path: str) -> None:
    first, second = springs(replace(ROBOT, path, 500))
    assert first is second
    assert first == dataclasses.replace(springs(ROBOT)[0], k=500)
    assert springs(ROBOT)[0].k != 500


def test_one_side() -> None:
    first, second = springs(replace(ROBOT, "joints.elbow.actuator.spring.1.k", 500))
    assert (first, second.k) == (springs(ROBOT)[0], 500)


DIFFERENT = (laws.Cubic(k=400, k_c=2000), laws.Cubic(k=300, k_c=2000))
LIMITED = (laws.Cubic(k=400, k_c=2000), laws.Cubic(k=400, k_c=2000, max_deflection=0.5))


@pytest.mark.parametrize("sides", [DIFFERENT, LIMITED], ids=["constant", "limit"])
def test_sides_that_differ_change_only_if_it_is_said_which(sides: tuple[laws.Cubic, laws.Cubic]) -> None:
    robot = with_springs(*sides)
    both = replace(robot, "joints.elbow.actuator.spring.*.k", 500)
    assert [spring.k for spring in springs(both)] == [500, 500]
    assert [spring.max_deflection for spring in springs(both)] == [spring.max_deflection for spring in sides]
    message = (
        "joints.elbow.actuator.spring: its two sides differ; say which by 0, 1 or *, as in "
        "joints.elbow.actuator.spring.0.k"
    )
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        replace(robot, "joints.elbow.actuator.spring.k", 500)


@pytest.mark.parametrize(
    ("path", "value", "content"),
    [
        ("name", "other", "other"),
        ("name", "on", "on"),
        ("gravity", [0, 0, "-9.81/2"], (0, 0, -4.905)),
        ("gravity.2", -1.62, (0, 0, -1.62)),
        ("gravity.*", 0, (0, 0, 0)),
        ("base", {"xyz": [0, 0, 1]}, dataclasses.replace(ROBOT.base, xyz=(0, 0, 1))),
        ("base.rpy.0", "90 deg", dataclasses.replace(ROBOT.base, rpy=(math.pi / 2, 0, 0))),
    ],
)
def test_values_are_what_a_file_could_hold(path: str, value: Any, content: Any) -> None:
    changed = replace(ROBOT, path, value)
    attribute = path.partition(".")[0]
    assert getattr(changed, attribute) == content
    assert changed == dataclasses.replace(ROBOT, **{attribute: content})
    assert changed.sources == ROBOT.sources


def test_all_joints() -> None:
    changed = replace(ROBOT, "joints.*.limits.position", "90 deg")
    assert [joint.limits.position for joint in changed.joints] == [(-math.pi / 2, math.pi / 2)] * 3
    changed = replace(changed, "joints.shoulder.limits.position.1", 3)
    assert changed.joints[1].limits.position == (-math.pi / 2, 3)


def test_units_follow_the_joint_and_the_gear() -> None:
    robot = load_robot(REPOSITORY / "robots" / "rp_2.yaml")
    names = {joint.type: joint.name for joint in robot.joints}
    assert replace(robot, f"joints.{names['revolute']}.limits.position.1", "90 deg")
    message = f"joints.{names['prismatic']}.limits.position.1: '90 deg' is an angle; expected a number in m"
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        replace(robot, f"joints.{names['prismatic']}.limits.position.1", "90 deg")


def test_a_variant_is_replaced_as_a_whole() -> None:
    changed = replace(ROBOT, "joints.elbow.actuator.spring", {"type": "cubic", "k": 100, "k_c": 200})
    assert springs(changed) == (laws.Cubic(k=100, k_c=200),) * 2


MOVE = Via.record(Use(POSITION))(degree=9, points=((0.0, 0.0), (1.0, 1.0), (2.0, 0.0)), times=(0.0, 1.0, 2.0))
MEMBERS = {"left": "revolute", "right": "prismatic"}


def test_values_per_joint() -> None:
    assert replace(MOVE, "points.1.left", "180 deg", MEMBERS).points == ((0, 0), (math.pi, 1), (2, 0))
    assert replace(MOVE, "points.*.right", 3, MEMBERS).points == ((0, 3), (1, 3), (2, 3))
    assert replace(MOVE, "points.0", {"left": 7, "right": 8}, MEMBERS).points[0] == (7, 8)
    assert replace(MOVE, "times.2", 4).times == (0, 1, 4)
    with pytest.raises(InputError, match=r"^points\.1\.right: '180 deg' is an angle; expected a number in m"):
        replace(MOVE, "points.1.right", "180 deg", MEMBERS)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("joint", 1, "there is no 'joint'; did you mean 'joints'?"),
        ("joints.elbw.damping", 1, "joints has no 'elbw'; did you mean 'elbow'?"),
        ("joints.3", 1, "joints has no '3'; valid: base, shoulder, elbow or 0 to 2"),
        ("joints.elbow.link.mas", 1, "joints.elbow.link has no 'mas'; did you mean 'mass'?"),
        ("joints.elbow.link.mass.0", 1, "joints.elbow.link.mass has no '0'; it is a single value"),
        ("gravity.z", 1, "gravity has no 'z'; valid: 0 to 2"),
        (
            "joints.elbow.actuator.spring.kc",
            1,
            "joints.elbow.actuator.spring has no 'kc'; did you mean 'k_c'?",
        ),
        (
            "joints.elbow.actuator.type",
            "rigid",
            "joints.elbow.actuator.type: the type cannot be changed alone, since each type has other keys; "
            "give the whole mapping, 'joints.elbow.actuator={type: rigid, ...}'",
        ),
        ("joints.elbow.link.mass", -1, "joints.elbow.link.mass: must be zero or positive, not -1 kg"),
        ("joints.elbow.link.mass", "x", "joints.elbow.link.mass: expected a number in kg, found 'x'"),
        ("joints.elbow.link.mass", None, "joints.elbow.link.mass: expected a number in kg, found nothing"),
        ("joints.elbow.link.mass", True, "joints.elbow.link.mass: expected a number in kg, found 'true'"),
        ("joints.elbow.link.mass", math.inf, "joints.elbow.link.mass: expected a number in kg, found 'inf'"),
        ("joints.elbow.link", 1, "joints.elbow.link is a mapping; set one of its keys: mass, com, inertia"),
        ("joints.elbow.name", "a b", "joints.elbow.name: must be made of letters"),
        ("joints.elbow.name", "base", "joints.2.name: 'base' is already used by entry 0; choose another one"),
        ("joints.0.actuator.branch", "up", "joints.base.actuator.branch: unknown word 'up'; valid: positive"),
        (
            "joints.0.actuator.spring",
            {"type": "cubic", "k": 1, "kc": 2},
            "joints.base.actuator.spring: unknown key 'kc'; did you mean 'k_c'?",
        ),
        (
            "joints.0.actuator.spring.*.k_c",
            0,
            "joints.base.actuator.spring.k_c: must be positive, not 0 N m/rad^3",
        ),
        (
            "joints.0.limits.position",
            [1, -1],
            "joints.base.limits.position: the lower limit 1 rad exceeds the upper limit -1 rad; swap them",
        ),
        ("joints.*.link.inertia.xy", 9, "joints.base.link.inertia: the tensor has the negative eigenvalue"),
    ],
)
def test_what_cannot_be_replaced(path: str, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        replace(ROBOT, path, value)


def test_nothing_is_found_in_what_is_not_there() -> None:
    with pytest.raises(InputError, match=r"^there is nothing at times; replace it as a whole$"):
        replace(dataclasses.replace(MOVE, times=None), "times.1", 1)


def test_every_problem_of_a_value_is_told() -> None:
    with pytest.raises(
        InputError, match=r"(?s)^joints\.base\.link: com: expected.*joints\.base\.link: mass: must"
    ):
        replace(ROBOT, "joints.0.link", {"mass": -1, "com": [1, 2], "inertia": {"xx": 1, "yy": 1, "zz": 1}})


def test_an_entry_by_name_takes_its_name_from_the_path() -> None:
    """Also a further entry, and the first of a key that is absent."""
    hand = load_robot(REPOSITORY / "robots" / "hand_3x2r.yaml")
    moved = replace(hand, "tools.index_tip", {"joint": "index_knuckle"})
    assert [(tool.name, tool.joint) for tool in moved.tools[:2]] == [
        ("index_tip", "index_knuckle"),
        ("middle_tip", "middle_middle"),
    ]
    assert replace(hand, "tools.0", {"joint": "index_knuckle"}) == moved
    further = replace(hand, "tools.knuckle", {"joint": "index_knuckle"})
    assert (further.tools[:-1], further.tool_names[-1]) == (hand.tools, "knuckle")
    assert replace(ROBOT, "tools.tip", {"joint": ROBOT.joint_names[-1]}).tool_names == ("tip",)
    with pytest.raises(InputError, match=re.escape("tools has no 'idex_tip'; did you mean 'index_tip'?")):
        replace(hand, "tools.idex_tip", 5)
    with pytest.raises(InputError, match=re.escape("tools.tip.joint: no joint is called 'x'")):
        replace(hand, "tools.tip", {"joint": "x"})
