"""Random tasks that robots cannot do, as files."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from samples.command_line import REPOSITORY
from vsacli import load_robot, load_trajectory

Values = dict[str, Any]

ROBOTS = ("vsa_3r", "vsa_3r", "rp_2", "mixed_3r", "measured_1r", "tendon_1r", "planar_2r")
"""Shipped robots, the first of them with other springs."""

SPRINGS: list[Any] = [
    None,
    [{"type": "cubic", "k": 400, "k_c": 2000}, {"type": "cubic", "k": 380, "k_c": 2600}],  # iterated
    [{"type": "sinh", "k": 80, "a": 5}, {"type": "cubic", "k": 400, "k_c": 2000}],
    [{"type": "cubic", "k": 500, "k_c": 9000}, {"type": "cubic", "k": 280, "k_c": 300}],
    [{"type": "four_bar", "k": 900, "ratio": 2.2}, {"type": "cubic", "k": 400, "k_c": 2000}],
]
"""Springs of the 3R arm: its own, or unlike ones on both sides, for which (14) has to be iterated."""


_SLOPES = {"sinh": 5.0, "four_bar": 0.36}
"""Stiffness at the least load, relative to k."""


def random_task(rng: np.random.Generator, folder: Path) -> tuple[Path, Path]:
    """Write robot.yaml and task.yaml, perhaps with task.csv, of a task that may be infeasible."""
    name = str(rng.choice(ROBOTS))
    robot = yaml.safe_load((REPOSITORY / "robots" / f"{name}.yaml").read_text())
    (folder / "measured_spring.csv").write_text((REPOSITORY / "robots/measured_spring.csv").read_text())
    springs = SPRINGS[rng.integers(len(SPRINGS))] if name == "vsa_3r" else None
    for joint in robot["joints"]:
        if springs is not None:
            joint["actuator"]["spring"] = copy.deepcopy(springs)
    _limit(rng, robot)
    robot_path = _written(folder / "robot.yaml", robot)
    task_path = _written(folder / "task.yaml", _trajectory(rng, robot))
    if rng.random() < 0.25:
        task_path = _recorded(robot_path, task_path)
    return robot_path, task_path


def _limit(rng: np.random.Generator, robot: Values) -> None:
    """Limits of the motors, of the stiffness, or of the position, at one joint."""
    joint = robot["joints"][rng.integers(len(robot["joints"]))]
    motor = joint["actuator"]["motor"]
    kind = rng.choice(["", "torque", "velocity", "stiffness", "position", "speed"])
    if kind == "torque":
        motor["max_torque"] = float(rng.uniform(20, 120) / motor.get("gear_ratio", 1) * _size(robot))
    elif kind == "stiffness" and (about := _stiffness(robot, joint)):
        joint.setdefault("limits", {})["stiffness"] = [about * 0.8, about * 1.15]
    elif kind == "velocity":
        motor["max_velocity"] = float(rng.uniform(0.8, 4))
    elif kind == "speed":
        joint.setdefault("limits", {})["velocity"] = float(rng.uniform(0.5, 3))
    elif kind == "position":
        joint.setdefault("limits", {})["position"] = [-0.3, 0.3]


def _size(robot: Values) -> float:
    """How strong the motors are, relative to those of the 3R arm."""
    return {"planar-2r": 10.0, "measured-1r": 0.1, "tendon-1r": 0.1}.get(robot["name"], 1.0)


def _trajectory(rng: np.random.Generator, robot: Values) -> Values:
    joints = robot["joints"]
    duration = float(np.round(math.exp(rng.uniform(math.log(0.25), math.log(2.5))), 3))
    reach = [0.25 if joint["type"] == "prismatic" else 1.0 for joint in joints]
    start = [float(r * rng.uniform(0, 0.3)) for r in reach]
    end = [s + float(r * rng.uniform(-0.2, 1.0)) for s, r in zip(start, reach, strict=True)]
    softness = rng.uniform(0.88, 1.15)
    stiffness = [_stiffness(robot, joint) for joint in joints]
    first = [None if value is None else float(value * softness) for value in stiffness]
    last = [None if value is None else float(value * rng.uniform(0.95, 1.2)) for value in first]
    task: Values = {
        "format": "vsacli-trajectory/1",
        "name": "task",
        "duration": duration,
        "rate": 200 / duration,
        "position": {"type": "polynomial", "degree": 7, "start": start, "end": end},
        "stiffness": {"type": "polynomial", "degree": 5, "start": first, "end": last},
    }
    if rng.random() < 0.3:
        push = [float(each) for each in rng.uniform(-8, 8, 3)] + [0.0, 0.0, 0.0]
        task["wrench"] = {"type": "polynomial", "frame": "base", "degree": 3, "start": [0.0] * 6, "end": push}
    return task


def _stiffness(robot: Values, joint: Values) -> float | None:
    """About what the joint is commanded; None if it takes none."""
    if joint["actuator"]["type"] != "antagonistic":
        return None
    by_robot = {"measured-1r": 60.0, "tendon-1r": 40.0}
    if robot["name"] in by_robot:
        return by_robot[robot["name"]]
    spring = joint["actuator"]["spring"]
    sides = spring if isinstance(spring, list) else [spring, spring]
    return 1.05 * sum(float(side["k"]) * _SLOPES.get(side["type"], 1.0) for side in sides)


def _written(path: Path, content: Values) -> Path:
    path.write_text(json.dumps(content, indent=1))
    return path


def _recorded(robot_path: Path, task_path: Path) -> Path:
    """The task as a table of samples without derivatives."""
    robot = load_robot(robot_path)
    trajectory = load_trajectory(task_path, robot)
    motion = trajectory.block(0, trajectory.samples)
    columns = {"time": motion.time}
    for index, joint in enumerate(robot.joints):
        columns[f"{joint.name}.q"] = motion.q[:, index]
        if "stiffness" in joint.actuator.commanded:
            columns[f"{joint.name}.stiffness"] = motion.commanded["stiffness"][:, index]
    table, rows = task_path.with_suffix(".csv"), np.stack(list(columns.values()), axis=1)
    np.savetxt(table, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    content = json.loads(task_path.read_text())
    kept = {key: content[key] for key in ("format", "name", "wrench") if key in content}
    recorded = {"type": "csv", "file": table.name}
    return _written(task_path, {**kept, "position": recorded, "stiffness": recorded})
