"""Robot files of trees: parents, mounts and tools, and messages where they are wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator
from samples.command_line import Outcome
from samples.marks import slow_but
from samples.trees import SMALL, random_tree, tree_text

from vsacli import load_robot

HEAD = "format: vsacli-robot/1\nname: torso\n"
TOOLS = "tools:\n  hand: {joint: left, xyz: [0, 0, 0.1]}\n  other: {joint: right}\n"
MOVE = (
    "format: vsacli-trajectory/1\nname: move\nduration: 1\nrate: 20\n"
    "position: {type: polynomial, degree: 9, start: 0, end: 0.1}\n"
)
WAIST, LEFT, RIGHT = "", "parent: waist", "parent: waist, mount: {xyz: [0, 0, 0.1]}"

Run = Callable[..., Outcome]


def torso(tools: str = TOOLS, waist: str = WAIST, left: str = LEFT, right: str = RIGHT) -> str:
    """A waist that carries two joints; each of them in a line of its own, from line 4 on without tools."""
    rest = (
        "type: revolute, dh: {a: 0.3, alpha: 0}, "
        "link: {mass: 1, com: [0, 0, 0], inertia: {xx: 0.01, yy: 0.01, zz: 0.01}}, "
        "actuator: {type: rigid, motor: {inertia: 0.1}}"
    )
    joints = {"waist": waist, "left": left, "right": right}
    rows = (f"  - {{name: {name}, {more + ', ' if more else ''}{rest}}}\n" for name, more in joints.items())
    return HEAD + tools + "joints:\n" + "".join(rows)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            torso("", left="parent: wasit"),
            "5: joints.parent: no earlier joint is called 'wasit' (null stands for the base); did you mean "
            "'waist'?",
        ),
        (
            torso("", waist="parent: base"),
            "4: joints.parent: no earlier joint is called 'base' (null stands for the base)",
        ),
        (
            torso("", waist="parent: right"),
            "4: joints.parent: 'right' comes later in the file; list joints after the one that carries them "
            "(a cycle has no such order)",
        ),
        (
            torso("", left="parent: left"),
            "5: joints.parent: a joint is not mounted on its own link; name an earlier joint, or null for "
            "the base",
        ),
        (torso("", left="parent: [waist]"), "5: parent: expected a text, found a list of 1 value"),
        (torso("", left="mount: [0, 0, 1]"), "5: mount: expected a mapping, found a list of 3 values"),
        (
            torso("tools:\n  hand: {joint: lft}\n"),
            "4: tools.hand.joint: no joint is called 'lft'; did you mean 'left'?",
        ),
        (
            torso("tools:\n  hand: {xyz: [0, 0, 1]}\n"),
            "4: tools.hand: missing key 'joint' (joint whose link carries the tool)",
        ),
        (torso("tool: {xyz: [0, 0, 0.1]}\n" + TOOLS), "3: tool: give `tool` or `tools`, not both"),
        (
            torso("tool: {xyz: [0, 0, 0.1]}\n"),
            "3: tool: which of the tips left, right carries it? Give `tools: {NAME: {joint: right, xyz: "
            "[...]}}` instead",
        ),
        (
            torso("tools: {}\n"),
            "3: tools: expected a mapping with at least one name, found an empty mapping",
        ),
        (
            torso("tools: [{joint: left}]\n"),
            "3: tools: expected a mapping with at least one name, found a list of 1 value",
        ),
        (
            torso("tools:\n  hand: left\n"),
            "4: tools.hand: expected a mapping with the key joint, found 'left'",
        ),
        (
            torso("tools:\n  hand: {name: hand, joint: left}\n"),
            "4: tools.hand: leave out 'name'; the key 'hand' is the name",
        ),
        (
            torso("tools:\n  my hand: {joint: left}\n"),
            "4: name: must be made of letters, digits, _ and -, beginning with a letter or _, not 'my hand'",
        ),
        (
            torso("tools:\n  hand: {joint: left}\n  hand: {joint: right}\n"),
            "5: duplicate key 'hand'; it is already on line 4",
        ),
    ],
)
def test_a_mistake_is_named_with_its_line(text: str, message: str, own_folder: Path, vsacli: Run) -> None:
    (own_folder / "torso.yaml").write_text(text)
    outcome = vsacli("validate", "torso.yaml")
    assert outcome.code == 2
    assert outcome.out.splitlines() == [f"torso.yaml:{message}"]


def test_branches_may_begin_at_the_base(own_folder: Path) -> None:
    (own_folder / "torso.yaml").write_text(torso(right="parent: null"))
    robot = load_robot("torso.yaml")
    assert robot.parents == (-1, 0, -1)
    assert robot.tips == (1, 2)
    assert robot.tool_names == ("hand", "other")


@pytest.mark.parametrize(
    ("change", "changed"),
    [
        ("joints.right.mount.xyz.2=0.2", lambda robot: robot.joints[2].mount.xyz == (0, 0, 0.2)),
        ("joints.left.mount={xyz: [0, 1, 0]}", lambda robot: robot.joints[1].mount.xyz == (0, 1, 0)),
        ("joints.right.parent=left", lambda robot: robot.parents == (-1, 0, 1)),
        ("joints.right.parent=null", lambda robot: robot.parents == (-1, 0, -1)),
        ("tools.hand.xyz.2=0.3", lambda robot: robot.tools[0].xyz == (0, 0, 0.3)),
        ("tools.*.joint=waist", lambda robot: robot.tool_joints == (0, 0)),
        ("tools={only: {joint: left}}", lambda robot: robot.tool_names == ("only",)),
    ],
)
def test_changes_by_path(change: str, changed: Callable[..., bool], own_folder: Path) -> None:
    (own_folder / "torso.yaml").write_text(torso())
    path, _, value = change.partition("=")
    assert changed(load_robot("torso.yaml", {path: yaml.safe_load(value)}))
    assert changed(load_robot("torso.yaml").replace(path, yaml.safe_load(value)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("tools.hnd.xyz.2=0.3", "tools has no 'hnd'; did you mean 'hand'?"),
        (
            "joints.left.mount.xyz.2=0.2",
            "there is nothing at joints.left.mount; replace it as a whole",
        ),
        (
            "joints.left.parent=right",
            "joints.1.parent: 'right' comes later in the file; list joints after the one that carries them "
            "(a cycle has no such order)",
        ),
        ("tools.hand.joint=rihgt", "no joint is called 'rihgt'; did you mean 'right'?"),
    ],
)
def test_wrong_changes_are_refused(change: str, message: str, own_folder: Path, vsacli: Run) -> None:
    (own_folder / "torso.yaml").write_text(torso())
    (own_folder / "move.yaml").write_text(MOVE)
    outcome = vsacli("check-feasibility", "torso.yaml", "move.yaml", "--set", change)
    assert outcome.code == 2
    assert outcome.err.splitlines() == [f"--set {change}: {message}"]


@pytest.mark.cases(5)
@pytest.mark.parametrize("seed", slow_but(SMALL[:1], range(30)))
def test_the_schema_accepts_what_the_reader_does(seed: int, vsacli: Run) -> None:
    schema = Draft202012Validator(json.loads(vsacli("schema", "robot").out))
    schema.validate(yaml.safe_load(tree_text(random_tree(seed))))


@pytest.mark.parametrize(
    "text",
    [
        torso("tools: {}\n"),
        torso("tools: [{joint: left}]\n"),
        torso("tools:\n  hand: {xyz: [0, 0, 1]}\n"),
        torso("tools:\n  hand: {name: hand, joint: left}\n"),
        torso("tools:\n  my hand: {joint: left}\n"),
        torso(left="parent: [waist]"),
        torso(left="mount: [0, 0, 1]"),
    ],
)
def test_the_schema_refuses_what_the_reader_does(text: str, vsacli: Run) -> None:
    schema = Draft202012Validator(json.loads(vsacli("schema", "robot").out))
    assert schema.is_valid(yaml.safe_load(torso()))
    assert not schema.is_valid(yaml.safe_load(text))
