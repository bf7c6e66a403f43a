"""Random robots with two branches on a common trunk and a tool at each tip."""

from __future__ import annotations

import dataclasses

import numpy as np

from samples.robots import random_robot
from samples.wrenches import held
from vsacli.robot.joint import FRAME_0, Joint, Pose, Tool
from vsacli.robot.model import Robot


def random_branches(trunk: str, left: str, right: str, seed: int, *, tilted: bool = True) -> Robot:
    """A tree of joints R and P, by default on a tilted base; the right branch has a mount."""
    rng = np.random.default_rng(seed)
    robot = random_robot(trunk + left + right, seed)
    robot = held(robot) if tilted else robot
    parent = robot.joint_names[len(trunk) - 1] if trunk else FRAME_0
    begins = len(trunk) + len(left)
    mounted = dataclasses.replace(robot.joints[begins], parent=parent, mount=_pose(rng))
    joints = (*robot.joints[:begins], mounted, *robot.joints[begins + 1 :])
    return dataclasses.replace(
        robot,
        joints=joints,
        tool=Pose(),
        tools=(_tool(rng, "left", joints[begins - 1]), _tool(rng, "right", joints[-1])),
    )


def alone(robot: Robot, tool: str) -> Robot:
    """The chain of the joints that move a tool, without the other branches."""
    index = robot.end_effector(tool)
    path = robot.paths[robot.tool_joints[index]]
    joints = [dataclasses.replace(robot.joints[path[0]], parent=None)]
    joints += [dataclasses.replace(robot.joints[joint], parent=None) for joint in path[1:]]
    return dataclasses.replace(robot, joints=tuple(joints), tools=(robot.tools[index],))


def _tool(rng: np.random.Generator, name: str, joint: Joint) -> Tool:
    pose = _pose(rng)
    return Tool(name=name, joint=joint.name, xyz=pose.xyz, rpy=pose.rpy)


def _pose(rng: np.random.Generator) -> Pose:
    x, y, z, roll, pitch, yaw = rng.uniform(-0.4, 0.4, 6).tolist()
    return Pose(xyz=(x, y, z), rpy=(roll, pitch, yaw))
