"""From a serial chain of a URDF to a robot with standard Denavit-Hartenberg rows."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Sequence

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InvalidRecordError
from vsacli.base.texts import as_name, one_line
from vsacli.documents.source import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.joint import UNBOUNDED, DenavitHartenberg, Inertia, Joint, Limits, Link, Pose
from vsacli.robot.model import Robot
from vsacli.robot.urdf.conversion import Conversion
from vsacli.robot.urdf.dh import SNAP_ANGLE, Frames, dh_frames, tidy, tidy_angle
from vsacli.robot.urdf.held_joints import Hold
from vsacli.robot.urdf.placeholders import Placeholders, joint_loads
from vsacli.robot.urdf.reader import read_urdf
from vsacli.robot.urdf.residual import kinematic_residual
from vsacli.robot.urdf.rigid_motion import Body, inverse, roll_pitch_yaw
from vsacli.robot.urdf.serial_chain import STANDARD_GRAVITY, ChainJoint, SerialChain, serial_chain
from vsacli.robot.urdf.srdf import ends_of_group

NEGLIGIBLE_INERTIA = 1e-15
"""Inertia, over mass times the arm's size squared, that is rounding of a zero in the file."""


def import_urdf(
    path: str | os.PathLike[str],
    base: str | None = None,
    tip: str | None = None,
    placeholders: Placeholders | None = None,
    snap: float = SNAP_ANGLE,
    hold: Hold | None = None,
    srdf: str | os.PathLike[str] | None = None,
    group: str | None = None,
) -> Conversion:
    """A robot from a serial chain of a URDF file.

    Args:
        path: the URDF file.
        base: name of the link that stands still; the root by default.
        tip: name of the end effector's link; by default the only one that can be.
        placeholders: the actuators, of which a URDF says nothing; by default sized to what they carry.
        snap: angle in rad; axes closer to parallel are made parallel if their common normal is far away.
        hold: where joints beside the chain stand, by name, in rad (m) or as "30 deg"; others stand at zero.
        srdf: an SRDF file, of which a group says base and tip, if these are not given.
        group: name of the group; the only one by default.

    Raises:
        InputError: the file is no URDF, has no such chain, or its joints cannot be held like this.
    """
    file, chosen = os.fspath(path), placeholders or Placeholders()
    urdf = read_urdf(path)
    if srdf is not None:
        ends = ends_of_group(srdf, group, urdf)
        base, tip = base or ends.base, tip or ends.tip
    chain = serial_chain(urdf, base, tip, hold)
    frames = dh_frames(chain.joints, chain.tip_pose, snap)
    links = _links(file, chain.joints, frames)
    loads = joint_loads(chain.joints, frames.rows, links)
    actuators = [
        ACTUATORS[chosen.actuator].placeholder(chosen.constants(joint, load))
        for joint, load in zip(chain.joints, loads, strict=True)
    ]
    robot = _robot(file, chain, frames, links, actuators)
    residual = kinematic_residual(chain, robot)
    return Conversion(file, chain, robot, chosen, tuple(loads), frames.snaps, residual)


def _robot(
    path: str, chain: SerialChain, frames: Frames, links: Sequence[Link], actuators: Sequence[Actuator]
) -> Robot:
    names = identifiers([joint.urdf.name for joint in chain.joints])
    parts = zip(names, chain.joints, frames.rows, links, actuators, strict=True)
    x, y, z = (-STANDARD_GRAVITY * tidy(chain.up, 1.0) + 0.0).tolist()
    return Robot(
        name=as_name(chain.robot_name),
        description=_description(path, chain),
        placeholder=True,
        gravity=(x, y, z),
        base=_pose(frames.base, frames.scale),
        tool=_pose(frames.tool, frames.scale),
        joints=tuple(_joint(*part) for part in parts),
    )


def _description(path: str, chain: SerialChain) -> str:
    """Where the robot comes from, and which joints stand elsewhere than at zero without following others."""
    held = [f", {each}" for each in chain.held if each.position != 0 and not each.follows]
    origin = f"converted from {one_line(os.path.basename(path))}, from link {chain.base} to link {chain.tip}"
    return f"{origin}{''.join(held)}"


def _joint(name: str, joint: ChainJoint, dh: DenavitHartenberg, link: Link, actuator: Actuator) -> Joint:
    limit = joint.urdf.limit
    speed = limit.velocity
    return Joint(
        name=name,
        type="revolute" if joint.is_revolute else "prismatic",
        dh=dh,
        link=link,
        damping=joint.urdf.damping,
        actuator=actuator,
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
