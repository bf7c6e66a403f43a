"""Random trees: branches, seats, several tools, wrenches on them, and every kind of actuator."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from samples.marks import slow_but
from samples.mechanisms import DEVICES
from samples.random_arms import random_drive
from samples.robot_files import fields, tables
from samples.robots import ODD_GRAVITY, random_actuator, random_joint
from samples.springs import SPRINGS
from samples.term_mutations import mutated_run
from samples.wrenches import SCALES
from vsacli import (
    Antagonistic,
    Joint,
    Motor,
    Pose,
    Robot,
    Tool,
    Trajectory,
    Wrench,
    inverse_dynamics,
    load_robot,
)
from vsacli.actuators.actuator import Actuator
from vsacli.base import file_formats
from vsacli.base.signals import POSITION, STIFFNESS, WRENCH, Signal
from vsacli.base.wrench import WrenchFrame, frames_by_tool
from vsacli.dynamics.inverse import adapt_trajectory
from vsacli.robot.joint import FRAME_0
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.profile import WrenchProfile
from vsacli.trajectory.times import UniformTimes

MOST_TOOLS = 3
_LOSSY = [joint for run in ("pair", "serial", "spring") for joint in mutated_run(run)[0].joints]
"""Joints with friction, a damper, windings, gears, coupled springs or rotors."""

SMALL = (11, 38, 49)
"""Seeds of trees of at most 8 joints, for quick tests."""


def random_tree(seed: int, joints: int | None = None) -> Robot:
    """A tree of 4 to 20 joints with up to three tools, on a tilted base."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 21)) if joints is None else joints
    members: list[Joint] = []
    for number in range(count):
        joint = random_joint(rng, f"joint_{number}", str(rng.choice(["R", "R", "R", "P"])))
        parent = _random_parent(rng, members)
        mount = random_pose(rng) if rng.random() < 0.5 else None
        members.append(_random_drive(rng, replace(joint, parent=parent, mount=mount)))
    robot = Robot(name=f"tree-{seed}", gravity=ODD_GRAVITY, base=random_pose(rng), joints=tuple(members))
    return replace(robot, tools=_random_tools(rng, robot))


def tree_cases(count: int, joints: int | None = None) -> list[Any]:
    """Seeds and numbers of joints, None for any: a small tree of two fingers, and slow cases of all sizes.

    With a number of joints, every tenth slow case but the first has so many. Without, five at equal distances
    of fifty have every kind of actuator, joint and seat, and one to three tools.
    """
    quick = (0, 4)
    drawn = ((seed, joints if seed and seed % 10 == 0 else None) for seed in range(count))
    return slow_but([quick], [quick, *drawn])


def without_resistance(robot: Robot) -> Robot:
    """The robot without friction and dampers between the links, which references of the links leave out."""
    joints = tuple(replace(joint, friction=None, damper=None) for joint in robot.joints)
    return replace(robot, joints=joints)


def _random_parent(rng: np.random.Generator, before: list[Joint]) -> str | None:
    """The joint before, by its name or by default, as often as any other."""
    if not before or rng.random() < 0.2:
        return FRAME_0
    if rng.random() < 0.6:
        return None if rng.random() < 0.7 else before[-1].name
    return str(rng.choice([joint.name for joint in before]))


def random_pose(rng: np.random.Generator) -> Pose:
    """Any pose, one turned by right angles, or one on an axis."""
    x, y, z = (rng.uniform(-0.5, 0.5, 3) * (rng.random(3) < 0.8)).tolist()
    right = (math.pi / 2 * rng.integers(-1, 3, 3)).tolist()
    roll, pitch, yaw = right if rng.random() < 0.5 else rng.uniform(-3, 3, 3).tolist()
    return Pose(xyz=(x, y, z), rpy=(roll, pitch, yaw))


def _random_tools(rng: np.random.Generator, robot: Robot) -> tuple[Tool, ...]:
    """One to three, at tips as often as anywhere else; two may be on one link."""
    tools = []
    for number in range(int(rng.integers(1, MOST_TOOLS + 1))):
        tip = bool(rng.random() < 0.5)
        link = int(rng.choice(robot.tips)) if tip else int(rng.integers(len(robot.joints)))
        pose = random_pose(rng)
        joint = robot.joints[link].name
        tools.append(Tool(name=f"tool_{number}", joint=joint, xyz=pose.xyz, rpy=pose.rpy))
    return tuple(tools)


def _random_drive(rng: np.random.Generator, joint: Joint) -> Joint:
    """The joint with any kind of actuator that fits it; some with friction and dampers between the links."""
    kind = rng.choice(["pair", "law", "rigid", "elastic", "serial", "losses"])
    if kind == "losses":
        like = _LOSSY[rng.integers(len(_LOSSY))]
        drive = {"actuator": like.actuator, "friction": like.friction, "damper": like.damper}
    else:
        drive = {"actuator": _random_actuator(rng, str(kind))}
    if drive["actuator"].unfit_for(joint.type):
        return joint
    return replace(joint, **drive)


def _random_actuator(rng: np.random.Generator, kind: str) -> Actuator:
    """An actuator that needs no file of its own."""
    if kind == "pair":
        return random_actuator(rng)
    if kind == "serial":
        devices = [device.actuator for device in DEVICES.values() if not any(tables(device.mechanism))]
        return devices[rng.integers(len(devices))]
    if kind == "law":
        pairs = [(one, two) for (one, _), (two, _) in SPRINGS.values() if not any(tables(one))]
        motor = Motor(inertia=0.1, damping=0.02)
        return Antagonistic(motor=(motor, motor), spring=pairs[rng.integers(len(pairs))])
    return random_drive(kind, rng)


def random_wrenches(robot: Robot, samples: int, seed: int) -> Wrench:
    """Unrelated random components on each tool, in either frame; on some nothing, but never on all."""
    rng = np.random.default_rng(seed)
    frames = [rng.choice(["end_effector", "base"]) for _ in robot.end_effectors]
    idle = rng.random(len(frames)) < 0.25
    idle[rng.integers(len(frames))] = False
    components = 6 * len(frames)
    acting = np.repeat(~idle, 6)
    arrays = (acting * rng.uniform(-scale, scale, (samples, components)) for scale in SCALES)
    by_tool = tuple(None if rests else str(frame) for frame, rests in zip(frames, idle, strict=True))
    frame: WrenchFrame = by_tool if len(by_tool) > 1 else str(by_tool[0])
    return Wrench(*arrays, frame=frame)


def hand(fingers: int, joints: int, *, palm: bool = True) -> Robot:
    """Equal fingers with a tool each, on seats of a palm that turns, or of the base."""
    rng = np.random.default_rng(1)
    members = [random_joint(rng, "palm", "R")] if palm else []
    phalanges = [random_joint(rng, f"joint_{number}", "R") for number in range(joints)]
    tools = []
    for number in range(fingers):
        x, y, z, roll, pitch, yaw = rng.uniform(-0.5, 0.5, 6).tolist()
        seat = {"parent": "palm" if palm else FRAME_0, "mount": Pose(xyz=(x, y, z), rpy=(roll, pitch, yaw))}
        for place, joint in enumerate(phalanges):
            name = f"finger_{number}_{joint.name}"
            members.append(replace(joint, name=name, **({} if place else seat)))
        tools.append(Tool(name=f"tip_{number}", joint=members[-1].name, xyz=(0.0, 0.1, 0.2)))
    name = f"hand-{fingers}x{joints}"
    return Robot(name=name, gravity=ODD_GRAVITY, joints=tuple(members), tools=tuple(tools))


def reordered(robot: Robot, seed: int) -> Robot:
    """The same tree with its branches in another order, each joint after the one that carries it.

    There is no other order of a chain.
    """
    rng, joints, parents = np.random.default_rng(seed), robot.joints, robot.parents
    order = list(range(len(joints)))
    while order == sorted(order) and len(robot.tips) > 1:
        order = _random_order(rng, parents)
    names = {-1: FRAME_0, **dict(enumerate(robot.joint_names))}
    members = (replace(joints[index], parent=names[parents[index]]) for index in order)
    return replace(robot, joints=tuple(members))


def _random_order(rng: np.random.Generator, parents: Sequence[int]) -> list[int]:
    order = list[int]()
    ready = [joint for joint, parent in enumerate(parents) if parent < 0]
    while ready:
        order.append(ready.pop(rng.integers(len(ready))))
        ready += [joint for joint, parent in enumerate(parents) if parent == order[-1]]
    return order


def finger(robot: Robot, root: int) -> Robot:
    """The part of a robot that joint `root`, on the base, moves: a robot of its own."""
    moved = [index for index, path in enumerate(robot.paths) if path[0] == root]
    parents = [robot.parents[index] for index in moved]
    joints = [
        replace(robot.joints[index], parent=robot.joints[parent].name if parent >= 0 else FRAME_0)
        for index, parent in zip(moved, parents, strict=True)
    ]
    names = [joint.name for joint in joints]
    tools = tuple(tool for tool in robot.tools if tool.joint in names)
    return replace(robot, joints=tuple(joints), tools=tools)


def tree_text(robot: Robot, convention: str = "standard") -> str:
    """The robot file of these numbers, whose rows and link frames are meant in a convention."""
    content: dict[str, Any] = {"format": file_formats.ROBOT, "convention": convention, **fields(robot)}
    joints = content.pop("joints")
    head = [f"{key}: {json.dumps(value)}" for key, value in content.items()]
    return "\n".join([*head, "joints:", *(f"  - {json.dumps(joint)}" for joint in joints)]) + "\n"


class TreeMotion(NamedTuple):
    """First and last position and stiffness by joint, and wrench by tool, of a tree or more.

    Between them everything moves along polynomials, for a second.
    """

    q: dict[str, np.ndarray]
    stiffness: dict[str, np.ndarray]
    wrenches: dict[str, np.ndarray]
    frames: dict[str, str | None]

    def trajectory(self, robot: Robot) -> Trajectory:
        """The trajectory of a robot with some of these joints and tools; its dampers are at their least."""
        position = _polynomial(POSITION, 9, [self.q[name] for name in robot.joint_names])
        stiffness = _polynomial(STIFFNESS, 5, [self.stiffness[name] for name in robot.joint_names])
        frames, wrench = tuple(self.frames.get(name) for name in robot.tool_names), None
        if any(frames):
            course = _polynomial(
                WRENCH, 5, [each for name in robot.tool_names for each in self.wrenches[name]]
            )
            wrench = WrenchProfile(course, frames if len(frames) > 1 else str(frames[0]))
        declared = Trajectory(
            UniformTimes(1, 40), position, {"stiffness": stiffness}, wrench=wrench, name="polynomials"
        )
        return adapt_trajectory(robot, declared)


def _polynomial(signal: Signal, degree: int, ends: Sequence[np.ndarray]) -> RestToRest:
    start, end = (tuple(each) for each in np.array(ends).T.tolist())
    return RestToRest(signal=signal, span=(0, 1), degree=degree, start=start, end=end)


def read_tree(robot: Robot, folder: Path, convention: str = "standard") -> Robot:
    """The robot as the file `tree_text` is read."""
    path = folder / f"{robot.name}_{convention}.yaml"
    path.write_text(tree_text(robot, convention))
    return load_robot(path)


def tree_run(seed: int, joints: int | None = None) -> tuple[Robot, TreeMotion]:
    """A tree of light links, and a motion under small wrenches, too soft for some of its joints."""
    robot = random_tree(seed, joints)
    light = [replace(joint, link=replace(joint.link, mass=0.05 * joint.link.mass)) for joint in robot.joints]
    robot = replace(robot, joints=tuple(light))
    trial = _motion(robot, np.full(len(light), 1e9), seed).trajectory(robot)
    least = np.fmax.reduce(inverse_dynamics(robot, trial).stiffness_min, axis=0)
    factor = np.random.default_rng(seed).uniform(0.7, 3, len(least))
    return robot, _motion(robot, np.where(least > 0, least, 300) * factor, seed)


def _motion(robot: Robot, stiffness: np.ndarray, seed: int) -> TreeMotion:
    rng, joints = np.random.default_rng(seed), robot.joint_names
    commanded = ["stiffness" in joint.commanded for joint in robot.joints]
    levels = np.where(commanded, stiffness, math.nan)
    wrench = random_wrenches(robot, 2, seed)
    by_tool = np.split(0.02 * wrench.wrench.T, len(robot.tool_names))
    return TreeMotion(
        dict(zip(joints, rng.uniform(-0.3, 0.3, (len(joints), 2)), strict=True)),
        dict(zip(joints, levels[:, None] * rng.uniform(1, 1.1, (len(joints), 2)), strict=True)),
        dict(zip(robot.tool_names, by_tool, strict=True)),
        dict(zip(robot.tool_names, frames_by_tool(wrench.frame), strict=True)),
    )
