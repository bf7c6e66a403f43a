"""A URDF file to a robot with standard Denavit-Hartenberg rows."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vsacli.actuators.actuator import Placeholders
from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InvalidRecordError
from vsacli.documents.source import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.joint import UNBOUNDED, DenavitHartenberg, Inertia, Joint, Limits, Link, Pose
from vsacli.robot.model import Robot
from vsacli.robot.urdf.dh import SNAP_ANGLE, Frames, Snap, dh_frames, tidy, tidy_angle
from vsacli.robot.urdf.held_joints import HeldJoint, Hold
from vsacli.robot.urdf.reader import read_urdf
from vsacli.robot.urdf.residual import Residual, kinematic_residual
from vsacli.robot.urdf.rigid_motion import Body, inverse, roll_pitch_yaw
from vsacli.robot.urdf.serial_chain import ChainJoint, SerialChain, serial_chain

STANDARD_GRAVITY = 9.81
"""m/s^2, along -z of the root link; a URDF does not give any."""

NEGLIGIBLE_INERTIA = 1e-15
"""Inertia, over mass times the arm's size squared, that is rounding of a zero in the file."""


@dataclass(frozen=True)
class Conversion:
    """A robot made from a URDF, and what was done to it.

    Attributes:
        file: path of the URDF as given.
        chain: the joints and links it was made from; `chain.joints` belong to `robot.joints` in turn.
        robot: the result.
        snaps: axes that were made parallel.
        residual: how far its tip strays from the chain's.
    """

    file: str
    chain: SerialChain
    robot: Robot
    snaps: tuple[Snap, ...]
    residual: Residual

    def warnings(self) -> Iterator[str]:
        """What may not be what was meant, one sentence each."""
        yield from (warning for held in self.chain.held for warning in held.warnings())
        yield from self.robot.warnings

    def notes(self) -> Iterator[str]:
        """What a user should know about what was left out or changed, one sentence each."""
        chain = self.chain
        yield from _held("below the base", chain.held_below)
        yield from _held("beside the chain, their links lumped", chain.held_beside)
        for snap in self.snaps:
            yield f"axis of {snap.joint} made parallel to the one before it, {snap.angle:.2g} rad off"
        friction = [joint.urdf.name for joint in chain.joints if joint.urdf.friction]
        if friction:
            yield f"dry friction left out: {', '.join(friction)}"


def _held(place: str, joints: Sequence[HeldJoint]) -> Iterator[str]:
    """Which joints stand at zero, and which elsewhere."""
    at_zero = [joint.urdf.name for joint in joints if joint.position == 0]
    elsewhere = [str(joint) for joint in joints if joint.position != 0]
    if at_zero:
        yield f"held at zero {place}: {', '.join(at_zero)}"
    if elsewhere:
        yield f"held {place}: {', '.join(elsewhere)}"


def import_urdf(
    path: str | os.PathLike[str],
    base: str | None = None,
    tip: str | None = None,
    placeholders: Placeholders | None = None,
    snap: float = SNAP_ANGLE,
    hold: Hold | None = None,
) -> Conversion:
    """A robot from a serial chain of a URDF file.

    Args:
        path: the URDF file.
        base: name of the link that stands still; the root by default.
        tip: name of the end effector's link; by default the only one that can be.
        placeholders: the actuators, of which a URDF says nothing.
        snap: angle in rad; axes closer to parallel are made parallel if their common normal is far away.
        hold: where joints beside the chain stand, by name, in rad (m) or as "30 deg"; others stand at zero.

    Raises:
        InputError: the file is no URDF, has no such chain, or its joints cannot be held like this.
    """
    chain = serial_chain(read_urdf(path), base, tip, hold)
    frames = dh_frames(chain.joints, chain.tip_pose, snap)
    robot = _robot(os.fspath(path), chain, frames, placeholders or Placeholders())
    return Conversion(os.fspath(path), chain, robot, frames.snaps, kinematic_residual(chain, robot))


def _robot(path: str, chain: SerialChain, frames: Frames, placeholders: Placeholders) -> Robot:
    names = identifiers([joint.urdf.name for joint in chain.joints])
    links = _links(path, chain.joints, frames)
    joints = (
        _joint(name, joint, row, link, placeholders)
        for name, joint, row, link in zip(names, chain.joints, frames.rows, links, strict=True)
    )
    x, y, z = (-STANDARD_GRAVITY * tidy(chain.up, 1.0) + 0.0).tolist()
    return Robot(
        name=chain.robot_name,
        description=_description(path, chain),
        placeholder=True,
        gravity=(x, y, z),
        base=_pose(frames.base, frames.scale),
        tool=_pose(frames.tool, frames.scale),
        joints=tuple(joints),
    )


def _description(path: str, chain: SerialChain) -> str:
    """Where the robot comes from; that joints do not stand at zero can be seen nowhere else in it."""
    held = [f", {each}" for each in chain.held if each.position != 0]
    origin = f"converted from {os.path.basename(path)}, from link {chain.base} to link {chain.tip}"
    return f"{origin}{''.join(held)}"


def _joint(
    name: str, joint: ChainJoint, dh: DenavitHartenberg, link: Link, placeholders: Placeholders
) -> Joint:
    limit = joint.urdf.limit
    speed = limit.velocity
    return Joint(
        name=name,
        type="revolute" if joint.is_revolute else "prismatic",
        dh=dh,
        link=link,
        damping=joint.urdf.damping,
        actuator=ACTUATORS[placeholders.actuator].placeholder(placeholders, limit.effort),
        limits=Limits(
            position=limit.position or UNBOUNDED,
            velocity=UNBOUNDED if speed is None else (-speed, speed),
        ),
    )


def _links(path: str, joints: Sequence[ChainJoint], frames: Frames) -> list[Link]:
    """What each joint carries, in its Denavit-Hartenberg frame.

    Raises:
        InputError: no body has such an inertia.
    """
    problems, links = Problems(path), []
    for joint, pose in zip(joints, frames.poses, strict=True):
        try:
            links.append(_link(joint.body.moved(inverse(pose)), frames.scale))
        except InvalidRecordError as error:
            own, *others = joint.links
            whole = f"{quoted(own.name)}{' with the links it carries' if others else ''}"
            for problem in error.fields:
                problems.add(own.line, f"inertia of {whole}: {problem}")
    problems.check()
    return links


def _link(body: Body, scale: float) -> Link:
    largest = float(abs(body.inertia).max())
    inertia = (
        tidy(body.inertia, largest)
        if largest > NEGLIGIBLE_INERTIA * body.mass * scale**2
        else np.zeros((3, 3))
    )
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    x, y, z = tidy(body.com, scale).tolist()
    mass = tidy(np.array(body.mass), body.mass).item()
    return Link(mass=mass, com=(x, y, z), inertia=Inertia(xx=xx, yy=yy, zz=zz, xy=xy, xz=xz, yz=yz))


def _pose(pose: FloatArray, scale: float) -> Pose:
    x, y, z = tidy(pose[:3, 3], scale).tolist()
    roll, pitch, yaw = (tidy_angle(angle) for angle in roll_pitch_yaw(pose[:3, :3]))
    return Pose(xyz=(x, y, z), rpy=(roll, pitch, yaw))


def identifiers(names: Sequence[str]) -> list[str]:
    """The names with only letters, digits, `_` and `-`, beginning with a letter or `_`, and all different."""
    chosen: list[str] = []
    for name in names:
        word = re.sub(r"[^A-Za-z0-9_-]", "_", name)
        word = word if re.match(r"[A-Za-z_]", word) else f"_{word}"
        taken = (f"{word}_{number}" for number in itertools.count(2))
        chosen.append(word if word not in chosen else next(other for other in taken if other not in chosen))
    return chosen
