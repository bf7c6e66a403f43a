"""Robots with branches, and a motion of all their joints."""

from __future__ import annotations

import dataclasses

import numpy as np

from samples.robots import ODD_GRAVITY, random_joint
from vsacli.base.signals import POSITION, STIFFNESS, WRENCH
from vsacli.base.wrench import WrenchFrame
from vsacli.robot.joint import FRAME_0, Pose, Tool
from vsacli.robot.model import Robot
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.profile import WrenchProfile
from vsacli.trajectory.times import UniformTimes
from vsacli.trajectory.trajectory import Trajectory


def random_pose(rng: np.random.Generator) -> Pose:
    """A frame up to half a meter away, turned about all axes."""
    (x, y, z), (roll, pitch, yaw) = rng.uniform(-0.5, 0.5, 3).tolist(), rng.uniform(-3, 3, 3).tolist()
    return Pose(xyz=(x, y, z), rpy=(roll, pitch, yaw))


def random_tree(types: str, seed: int) -> Robot:
    """A tree of joints such as "RPRR", each on any earlier link or the base, mostly mounted; three tools."""
    rng = np.random.default_rng(seed)
    names = [f"joint_{number}" for number in range(1, 1 + len(types))]
    joints = []
    for number, (name, letter) in enumerate(zip(names, types, strict=True)):
        joint = random_joint(rng, name, letter)
        parent = str(rng.choice([FRAME_0, *names[:number]]))
        mount = random_pose(rng) if rng.random() < 0.7 else None
        joints.append(dataclasses.replace(joint, parent=parent, mount=mount))
    tools = []
    for name, carrier in zip(("left", "middle", "right"), rng.choice(names, 3), strict=True):
        pose = random_pose(rng)
        tools.append(Tool(name=name, joint=str(carrier), xyz=pose.xyz, rpy=pose.rpy))
    return Robot(
        name=f"tree-{types}-{seed}",
        gravity=ODD_GRAVITY,
        base=random_pose(rng),
        joints=tuple(joints),
        tools=tuple(tools),
    )


def hand(fingers: int, joints_each: int = 4, seed: int = 2) -> Robot:
    """A wrist that carries equal fingers of up to four joints at various mounts, each with a tool."""
    rng = np.random.default_rng(seed)
    names = ("wrist", "spread", "bend", "curl", "tip")[: 1 + joints_each]
    wrist, *finger = (random_joint(rng, name, "R") for name in names)
    joints, tools = [wrist], []
    for number in range(fingers):
        first, *others = (dataclasses.replace(each, name=f"{each.name}_{number}") for each in finger)
        joints += [dataclasses.replace(first, parent="wrist", mount=random_pose(rng)), *others]
        tools.append(Tool(name=f"tool_{number}", joint=joints[-1].name, xyz=(0.1, 0, 0)))
    return Robot(name=f"hand-{fingers}", joints=tuple(joints), tools=tuple(tools))


def rest_to_rest(
    stiffness: list[tuple[float, float]],
    duration: float,
    rate: float,
    wrench: tuple[float, ...] = (),
    frame: WrenchFrame = (),
) -> Trajectory:
    """A motion of joints by half a radian or meter in turn; stiffness from one to another, NaN if none.

    Wrenches on the tools, six components each, rise from zero.
    """
    span, count = (0.0, duration), len(stiffness)
    start = tuple(np.linspace(0.2, -0.3, count).tolist())
    end = tuple(position + (-1) ** index / 2 for index, position in enumerate(start))
    (start_stiffness, end_stiffness) = zip(*stiffness, strict=True)
    position = RestToRest(signal=POSITION, span=span, degree=11, start=start, end=end)
    commanded = RestToRest(
        signal=STIFFNESS, span=span, degree=7, start=tuple(start_stiffness), end=tuple(end_stiffness)
    )
    rising = RestToRest(signal=WRENCH, span=span, degree=7, start=(0.0,) * len(wrench), end=wrench)
    exerted = WrenchProfile(rising, frame) if wrench else None
    times = UniformTimes(duration, rate)
    return Trajectory(times, position, {STIFFNESS.key: commanded}, wrench=exerted, name="move")
