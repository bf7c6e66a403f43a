"""A robot that is a tree, as a file: a torso with two arms; and runs of it with wrenches."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vsacli import Result, Robot, Trajectory, inverse_dynamics, load_robot, load_trajectory
from vsacli.base.signals import WRENCH
from vsacli.trajectory.curves import ConstantProfile
from vsacli.trajectory.profile import WrenchProfile

ACTUATOR = "{type: antagonistic, motor: {inertia: 0.01}, spring: {type: cubic, k: 400, k_c: 2000}}"
FRAMES = ("base", None, "end_effector")
"""Frames of the wrenches on the tools of the torso."""

SWING = """format: vsacli-trajectory/1
name: swing
duration: 1
rate: 40
position: {type: polynomial, degree: 7, start: 0.1, end: 0.5}
stiffness: {type: constant, value: 900}
"""


def joint_text(name: str, dh: str, begin: str = "") -> str:
    """An entry of `joints`; `begin` are its keys `parent` and `mount`."""
    link = "{mass: 1, com: [-0.02, 0, 0], inertia: {xx: 0.01, yy: 0.01, zz: 0.01}}"
    return (
        f"  - {{name: {name}, type: revolute, {begin}dh: {dh},\n"
        f"     link: {link},\n     actuator: {ACTUATOR}}}\n"
    )


def torso_text() -> str:
    """A waist with an arm of three joints left and right of it, and a neck on the base."""
    text = "format: vsacli-robot/1\nname: torso\njoints:\n" + joint_text("waist", "{a: 0, alpha: 0, d: 0.4}")
    for side, sign in (("left", 1), ("right", -1)):
        begin = f"parent: waist, mount: {{xyz: [0, {0.2 * sign}, 0], rpy: [{-90 * sign} deg, 0, 0]}}, "
        text += joint_text(f"{side}_shoulder", "{a: 0, alpha: 90 deg}", begin)
        text += joint_text(f"{side}_arm", "{a: 0.3, alpha: 0}") + joint_text(
            f"{side}_elbow", "{a: 0.25, alpha: 0}"
        )
    begin = "parent: null, mount: {xyz: [-0.2, 0, 0.1]}, "
    return (
        f"{text}{joint_text('pole', '{a: 0.1, alpha: 0, d: 0.3}', begin)}tools:\n"
        "  left_hand: {joint: left_elbow, xyz: [0, 0, 0.1]}\n  right_hand: {joint: right_elbow}\n"
        "  lamp: {joint: pole, rpy: [0.1, 0.2, 0.3]}\n"
    )


def written(folder: Path, text: str) -> Path:
    """The file of a robot."""
    path = folder / "tree.yaml"
    path.write_text(text)
    return path


def push(components: Sequence[float]) -> WrenchProfile:
    """Constant wrenches on the tools of the torso."""
    signal = WRENCH._replace(components=len(components))
    value = tuple(map(float, components))
    return WrenchProfile(ConstantProfile(signal=signal, span=(0.0, 1.0), value=value), FRAMES)


def torso(folder: Path) -> tuple[Robot, Trajectory]:
    """The torso with a swing, pushed at two of its tools."""
    robot = load_robot(written(folder, torso_text()))
    path = folder / "swing.yaml"
    path.write_text(SWING)
    components = np.arange(1.0, 19.0)
    components[6:12] = 0
    swing = load_trajectory(path, robot)
    swing.wrench = push(components)
    return robot, swing


def torso_result(folder: Path) -> Result:
    """The result of a run of the torso."""
    return inverse_dynamics(*torso(folder))
