"""Files of the same tree with its branches in different orders, and reports compared joint by joint."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from samples.trees import finger, hand, reordered, tree_run, tree_text
from vsacli.robot.model import Robot

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
    robot, stiffness = _tree(seed, joints, share)
    first = _write("first", robot, stiffness, folder)
    return first, _write("second", reordered(robot, seed), stiffness, folder)


def write_branches(seed: int, joints: int, share: float = 0.95, folder: Path = Path()) -> Iterator[TreeFiles]:
    """Files of each subtree of the same random tree that stands on the base, alone."""
    robot, stiffness = _tree(seed, joints, share)
    for number, subtree in enumerate(robot.subtrees):
        yield _write(f"branch_{number}", finger(robot, subtree[0]), stiffness, folder)


def write_hand(soft: str, folder: Path = Path()) -> TreeFiles:
    """Files of five equal fingers on the base, of which one joint has less stiffness than its springs."""
    robot = hand(5, 2, palm=False)
    return _write("hand", robot, {**dict.fromkeys(robot.joint_names, 5e3), soft: 500.0}, folder)


def _tree(seed: int, joints: int, share: float) -> tuple[Robot, dict[str, float]]:
    """A random tree, and the stiffness of each joint that has one."""
    robot, motion = tree_run(seed, joints)
    lowest = {name: float(np.min(values)) for name, values in motion.stiffness.items()}
    return robot, {name: share * value for name, value in lowest.items() if math.isfinite(value)}


def _write(name: str, robot: Robot, stiffness: dict[str, float], folder: Path) -> TreeFiles:
    """Write a robot, and its motion from rest to rest, with values by joint."""
    (folder / name).mkdir()
    files = TreeFiles(folder / name / "robot.yaml", folder / name / "motion.yaml")
    files.robot.write_text(tree_text(robot))
    motion = {
        "format": "vsacli-trajectory/1",
        "name": "reach",
        "duration": 1.0,
        "rate": 40,
        "position": {
            "type": "polynomial",
            "degree": 7,
            "start": 0.0,
            "end": {j: _goal(j) for j in robot.joint_names},
        },
    }
    if commanded := {joint: stiffness[joint] for joint in robot.joint_names if joint in stiffness}:
        motion["stiffness"] = {"type": "constant", "value": commanded}
    files.motion.write_text(json.dumps(motion))
    return files


def _goal(joint: str) -> float:
    """A position that depends on the name of the joint alone, rad (m)."""
    return float(np.random.default_rng(list(joint.encode())).uniform(-0.5, 0.5))


def differences(one: Any, other: Any, where: str = "", scale: float = 1e-9) -> Iterator[str]:
    """Yield where two JSON reports differ, whatever the order of their lists."""
    match one, other:
        case dict(), dict():
            for key in sorted({*one, *other} - WITHOUT_MEANING):
                if key in one and key in other:
                    yield from differences(one[key], other[key], f"{where}.{key}", scale)
                else:
                    yield f"{where}.{key} is there once"
        case list(), list() if len(one) == len(other):
            for number, (here, there) in enumerate(zip(_sorted(one), _sorted(other), strict=True)):
                yield from differences(here, there, f"{where}.{number}", scale)
        case float() | int(), float() | int():
            if not math.isclose(one, other, rel_tol=1e-9, abs_tol=scale):
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
