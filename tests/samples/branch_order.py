"""Files of the same tree with its branches in different orders, and reports compared joint by joint."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from samples.trees import TreeMotion, finger, hand, reordered, tree_run, tree_text
from vsacli import Robot

_PLACE = re.compile(r"\w+/(\w+\.yaml)(:\d+: )?")
"""A file in the folder of one order, and a line of it."""

WITHOUT_MEANING = frozenset(
    {"self_check", "evaluations", "q_error", "largest_error", "stiffness_error", "line"}
)
"""Keys of lines, of residuals, which are rounding, and of how the integrator got there."""


class TreeFiles(NamedTuple):
    """A robot file and a trajectory file."""

    robot: Path
    motion: Path


def write_orders(
    seed: int, joints: int, share: float = 0.95, folder: Path = Path()
) -> tuple[TreeFiles, TreeFiles]:
    """Files of a random tree and its motion, and of the same ones in another order of the branches.

    Its joints have a `share` of a stiffness that most of them attain.
    """
    robot, motion = _tree(seed, joints, share)
    first = _write("first", robot, motion, folder)
    return first, _write("second", reordered(robot, seed), motion, folder)


def write_branches(seed: int, joints: int, share: float = 0.95, folder: Path = Path()) -> Iterator[TreeFiles]:
    """Files of each subtree of the same random tree that stands on the base, alone."""
    robot, motion = _tree(seed, joints, share)
    for number, subtree in enumerate(robot.subtrees):
        yield _write(f"branch_{number}", finger(robot, subtree[0]), motion, folder)


def write_hand(soft: str, folder: Path = Path()) -> TreeFiles:
    """Files of five equal fingers on the base, of which one joint has less stiffness than its springs."""
    robot = hand(5, 2, palm=False)
    stiffness = {**dict.fromkeys(robot.joint_names, np.full(2, 5e3)), soft: np.full(2, 500.0)}
    q = dict.fromkeys(robot.joint_names, np.array([0.0, 0.3]))
    return _write("hand", robot, TreeMotion(q, stiffness, {}, {}), folder)


def _tree(seed: int, joints: int, share: float) -> tuple[Robot, TreeMotion]:
    """A random tree, and its motion with a share of its stiffness."""
    robot, motion = tree_run(seed, joints)
    stiffness = {name: share * values for name, values in motion.stiffness.items()}
    return robot, motion._replace(stiffness=stiffness)


def _write(name: str, robot: Robot, motion: TreeMotion, folder: Path) -> TreeFiles:
    """Write a robot, and its motion with values by joint and wrenches by tool."""
    (folder / name).mkdir()
    files = TreeFiles(folder / name / "robot.yaml", folder / name / "motion.yaml")
    files.robot.write_text(tree_text(robot))
    document: dict[str, Any] = {
        "format": "vsacli-trajectory/1",
        "name": "reach",
        "duration": 1.0,
        "rate": 40,
        "position": _polynomial(9, {joint: motion.q[joint] for joint in robot.joint_names}),
    }
    stiffness = {joint: motion.stiffness[joint] for joint in robot.joint_names}
    if commanded := {joint: ends for joint, ends in stiffness.items() if np.isfinite(ends).all()}:
        document["stiffness"] = _polynomial(5, commanded)
    if pushed := [tool for tool in robot.tool_names if motion.frames.get(tool)]:
        document["wrenches"] = {
            tool: _polynomial(5, motion.wrenches[tool]) | {"frame": motion.frames[tool]} for tool in pushed
        }
    files.motion.write_text(json.dumps(document))
    return files


def _polynomial(degree: int, ends: np.ndarray | dict[str, np.ndarray]) -> dict[str, Any]:
    """A polynomial between the ends of each joint, by name, or component."""
    names = ("start", "end")
    if isinstance(ends, dict):
        values = [{joint: float(pair[end]) for joint, pair in ends.items()} for end in range(2)]
    else:
        values = ends.T.tolist()
    return {"type": "polynomial", "degree": degree, **dict(zip(names, values, strict=True))}


SAME = 1e-9
"""Of numbers, or of 1: sums in another order agree to 1e-12; three digits are left to what cancels."""


def differences(one: Any, other: Any, where: str = "") -> Iterator[str]:
    """Yield where two JSON reports differ, whatever the order of their lists."""
    match one, other:
        case dict(), dict():
            for key in sorted({*one, *other} - WITHOUT_MEANING):
                if key in one and key in other:
                    yield from differences(one[key], other[key], f"{where}.{key}")
                else:
                    yield f"{where}.{key} is there once"
        case list(), list() if len(one) == len(other):
            for number, (here, there) in enumerate(zip(_sorted(one), _sorted(other), strict=True)):
                yield from differences(here, there, f"{where}.{number}")
        case float() | int(), float() | int():
            if not math.isclose(one, other, rel_tol=SAME, abs_tol=SAME):
                yield f"{where}: {one} and {other}"
        case _:
            if _PLACE.sub(r"\1", str(one)) != _PLACE.sub(r"\1", str(other)):
                yield f"{where}: {one} and {other}"


def _sorted(entries: list[Any]) -> list[Any]:
    """Entries with texts sorted by them; others as they are."""
    return sorted(entries, key=lambda entry: sorted(_PLACE.sub(r"\1", text) for text in _texts(entry)))


def _texts(content: Any) -> Iterator[str]:
    match content:
        case str():
            yield content
        case dict():
            yield from (text for entry in content.values() for text in _texts(entry))
        case list():
            yield from (text for entry in content for text in _texts(entry))
