"""Conversion of a URDF to a robot, with a report on parts left out and changed.

The steps: read the file, choose the joints that move, place Denavit-Hartenberg frames, move inertias into
them, size placeholder actuators, and compare the forward kinematics of robot and URDF.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InvalidRecordError, Problem
from vsacli.base.texts import as_name, counted, joined, listed, one_line
from vsacli.documents.source import Problems
from vsacli.documents.tree import NULLS, quoted
from vsacli.robot.joint import (
    FRAME_0,
    UNBOUNDED,
    DenavitHartenberg,
    Inertia,
    Joint,
    Limits,
    Link,
    Pose,
    Tool,
)
from vsacli.robot.model import Robot
from vsacli.robot.urdf.dh import (
    SNAP_ANGLE,
    Frames,
    KinematicResidual,
    Snap,
    dh_frames,
    kinematic_residual,
    tidy,
    tidy_angle,
)
from vsacli.robot.urdf.link_tree import POSITION_LIMITS, RigidBody, UrdfJoint, inverse_pose, roll_pitch_yaw
from vsacli.robot.urdf.moving_tree import (
    STANDARD_GRAVITY,
    HeldJoint,
    Hold,
    MovingJoint,
    MovingTree,
    moving_tree,
)
from vsacli.robot.urdf.placeholders import JointLoad, Placeholders, largest_joint_loads
from vsacli.robot.urdf.reader import read_urdf
from vsacli.robot.urdf.srdf import ends_of_group

EXACT_RESIDUAL = 1e-9
"""Residual, m and rad, up to which kinematics are reported as the same."""

SMALLEST_RESIDUAL = 1e-12
"""Smallest residual reported, m and rad; smaller ones differ between machines."""

MOST_ENDS = 12
"""Most links that a note names as other possible tools."""

_HEADER = ("joint", "a/m", "alpha/rad", "d/m", "theta/rad", "mass/kg", "links")


@dataclass(frozen=True)
class Conversion:
    """A robot made from a URDF, with details of the conversion.

    Attributes:
        file: path of the URDF as given.
        tree: moving joints of the URDF; `tree.joints` correspond to `robot.joints` in order.
        robot: converted robot.
        placeholders: requested actuators.
        loads: largest load of each joint, to which its actuator was sized.
        snaps: axes that were made parallel.
        residual: deviation of the robot's tools from the URDF's tips.
        file_warnings: words of the file that are ignored, and implausible orientations, by line.
        devices: device whose actuator a joint has instead of a placeholder, by name of the joint.
    """

    file: str
    tree: MovingTree
    robot: Robot
    placeholders: Placeholders
    loads: tuple[JointLoad, ...]
    snaps: tuple[Snap, ...]
    residual: KinematicResidual
    file_warnings: tuple[Problem, ...] = ()
    devices: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return the Denavit-Hartenberg table, its accuracy, warnings, and notes."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        robot, tips = self.robot, ", ".join(tip.link for tip in self.tree.tips)
        yield f"{robot.name}: {counted(len(robot.joints), 'joint')} from {self.tree.base} to {tips}"
        yield from _align_dh_table(self._rows())
        yield f"total mass of the moving links: {sum(joint.link.mass for joint in robot.joints):.6g} kg"
        yield self._describe_residual()
        yield from (f"warning: {warning}" for warning in self.warnings())
        yield from self.notes()

    def _rows(self) -> Iterator[tuple[str, ...]]:
        is_tree = self.tree.shape == "tree"
        yield (_HEADER[0], *(["on"] if is_tree else []), *_HEADER[1:])
        for joint, origin in zip(self.robot.joints, self.tree.joints, strict=True):
            row = (joint.dh.a, joint.dh.alpha, joint.dh.d, joint.dh.theta, joint.link.mass)
            further = len(origin.links) - 1
            carried = origin.links[0].name + (f" + {further}" if further else "")
            carrying = self.robot.joints[origin.parent].name if origin.parent >= 0 else "base"
            seat = [carrying if joint.mount is None else f"{carrying}, mounted"] if is_tree else []
            yield (joint.name, *seat, *(f"{number:.6g}" for number in row), carried)

    def _describe_residual(self) -> str:
        verdict = "the same as" if max(self.residual) <= EXACT_RESIDUAL else "not quite"
        position, orientation = (max(error, SMALLEST_RESIDUAL) for error in self.residual)
        ends = "tip" if len(self.tree.tips) == 1 else "tools"
        errors = f"{position:.1e} m and {orientation:.1e} rad"
        return f"forward kinematics: {verdict} the URDF's, the {ends} within {errors}"

    def warnings(self) -> Iterator[str]:
        """Yield sentences about implausible values, and parts of the file that are ignored."""
        yield from map(str, self.file_warnings)
        for joint in self.tree.immobile:
            reason = "a robot file has no such joint, so that what it carries does not move with it"
            yield f"{joint.name} is {joint.type}, and held at zero: {reason}"
        yield from (warning for held in self.tree.held for warning in held.warnings())
        yield from self.robot.warnings

    def notes(self) -> Iterator[str]:
        """Yield sentences on parts left out or changed."""
        outside = f"outside the {self.tree.shape}"
        yield from _describe_held_joints("below the base", self.tree.held_below)
        yield from _describe_held_joints(f"{outside}, their links lumped", self.tree.held_beside)
        if followers := [
            f"{each.name} (follows {each.mimic.leader})" for each in self.tree.followers if each.mimic
        ]:
            yield f"{outside}, following it without mass, so without torque: {', '.join(followers)}"
        for tip in self.tree.tips:
            if tip.beyond:
                others = listed(tip.beyond, MOST_ENDS)
                another = "for another, name all tools by --tip"
                yield f"several links end beyond {tip.link}, where the tool is: {others}; {another}"
        for snap in self.snaps:
            yield f"axis of {snap.joint} made parallel to the one before it, {snap.angle:.2g} rad off"
        yield from self._of_motors()
        left_out: dict[str, list[str]] = (
            {"actuators of devices, with their damping": list(map(" ".join, self.devices.items()))}
            if self.devices
            else {}
        )
        for joint, phrase, value in self._left_out():
            left_out.setdefault(phrase, []).append(f"{joint.name} {value}".rstrip())
        yield from (f"{phrase}: {', '.join(values)}" for phrase, values in left_out.items())

    def _left_out(self) -> Iterator[tuple[UrdfJoint, str, str]]:
        """Yield properties of moving joints that are not taken over, and position limits of held ones."""
        for joint in (*(joint.urdf for joint in self.tree.joints), *self.tree.followers):
            yield from ((joint, *entry) for entry in dict.fromkeys(joint.left_out))
        for joint in (held.urdf for held in self.tree.held):
            yield from ((joint, *entry) for entry in joint.left_out if entry[0].startswith(POSITION_LIMITS))
        yield from ((joint, "damping left out", "") for joint in self.tree.followers if joint.damping)

    def _of_motors(self) -> Iterator[str]:
        """Yield notes on effort limits and gears, which apply to a single motor."""
        for count, taken in ((1, "taken over"), (2, "not taken over, since two motors share a joint")):
            joints = [
                origin.urdf
                for origin, joint in zip(self.tree.joints, self.robot.joints, strict=True)
                if joint.actuator.motor_count == count
            ]
            motor_data = {
                "effort limits (joint side)": [joint.name for joint in joints if joint.limit.effort],
                "gear reductions": [
                    f"{joint.name} {joint.gear_ratio:g}" for joint in joints if joint.gear_ratio
                ],
            }
            for quantity, names in motor_data.items():
                if names:
                    yield f"{quantity} {taken}: {', '.join(names)}"


def _describe_held_joints(place: str, joints: Sequence[HeldJoint]) -> Iterator[str]:
    at_zero = [joint.urdf.name for joint in joints if joint.position == 0]
    elsewhere = [str(joint) for joint in joints if joint.position != 0]
    if at_zero:
        yield f"held at zero {place}: {', '.join(at_zero)}"
    if elsewhere:
        yield f"held {place}: {', '.join(elsewhere)}"


def _align_dh_table(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Yield the lines of a table with aligned columns, numbers right-aligned."""
    table = list(rows)
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for first, *numbers, last in table:
        cells = [f"{cell:>{width}}" for cell, width in zip(numbers, widths[1:-1], strict=True)]
        yield "  ".join([f"{first:<{widths[0]}}", *cells, last])


NEGLIGIBLE_INERTIA = 1e-15
"""Inertia, over mass times the arm's size squared, that counts as a rounded zero of the file."""


def import_urdf(
    path: str | os.PathLike[str],
    base: str | None = None,
    tip: str | Sequence[str] | None = None,
    placeholders: Placeholders | None = None,
    snap: float = SNAP_ANGLE,
    hold: Hold | None = None,
    srdf: str | os.PathLike[str] | None = None,
    group: str | None = None,
) -> Conversion:
    """Convert a URDF file to a robot: all joints below a link, or those between it and one or more tips.

    Args:
        path: path of the URDF file.
        base: name of the fixed link; the root by default.
        tip: name of the end effector's link, or several names; by default the end of each branch.
        placeholders: actuators, which a URDF does not describe; by default sized to their loads.
        snap: angle, rad; axes closer to parallel are made parallel if their common normal is far away.
        hold: positions of joints that are held, by name, in rad (m) or as "30 deg". Without `tip`, all other
            joints move that have a drive; else joints outside the path to a tip are held at zero by default.
        srdf: path of an SRDF file, a group of which gives base and tips if these are not given.
        group: name of the group; the only one by default.

    Raises:
        InputError: the file is not a URDF, has no such joints, or joints cannot be held as requested.
    """
    file, chosen = os.fspath(path), placeholders or Placeholders()
    urdf = read_urdf(path)
    tips = (tip,) if isinstance(tip, str) else tuple(tip or ())
    if srdf is not None:
        ends = ends_of_group(srdf, group, urdf)
        base, tips = base or ends.base, tips or ends.tips
    tree = moving_tree(urdf, base, tips, hold)
    frames = dh_frames(tree.joints, tree.tips, snap)
    mounts = _mounts(tree.joints, frames)
    links = _convert_links(file, tree.joints, frames)
    loads = largest_joint_loads(tree.joints, frames.rows, mounts, links)
    actuators = [
        ACTUATORS[chosen.actuator].placeholder(chosen.constants(joint, load))
        for joint, load in zip(tree.joints, loads, strict=True)
    ]
    robot = _assemble_robot(file, tree, frames, mounts, links, actuators)
    residual = kinematic_residual(tree, robot)
    return Conversion(file, tree, robot, chosen, tuple(loads), frames.snaps, residual, urdf.warnings)


def _mounts(joints: Sequence[MovingJoint], frames: Frames) -> list[Pose | None]:
    """Return where each row begins in the frame of the link that carries the joint; None if at it."""
    carrying = [frames.base if joint.parent < 0 else frames.poses[joint.parent] for joint in joints]
    seats = zip(carrying, frames.seats, strict=True)
    poses = [_tidy_pose(inverse_pose(frame) @ seat, frames.scale) for frame, seat in seats]
    return [None if pose == Pose() else pose for pose in poses]


def _assemble_robot(
    path: str,
    tree: MovingTree,
    frames: Frames,
    mounts: Sequence[Pose | None],
    links: Sequence[Link],
    actuators: Sequence[Actuator],
) -> Robot:
    names = identifiers([joint.urdf.name for joint in tree.joints])
    x, y, z = (-STANDARD_GRAVITY * tidy(tree.up, 1.0) + 0.0).tolist()
    tool, *others = tools = _convert_tips(tree, frames, names)
    return Robot(
        name=as_name(tree.robot_name),
        description=_describe_origin(path, tree),
        placeholder=True,
        gravity=(x, y, z),
        base=_tidy_pose(frames.base, frames.scale),
        tool=Pose() if others else Pose(xyz=tool.xyz, rpy=tool.rpy),
        joints=tuple(
            _convert_joint(number, names, *parts)
            for number, parts in enumerate(
                zip(tree.joints, mounts, frames.rows, links, actuators, strict=True)
            )
        ),
        tools=tuple(tools) if others else (),
    )


def _convert_tips(tree: MovingTree, frames: Frames, joint_names: Sequence[str]) -> list[Tool]:
    names = identifiers([tip.link for tip in tree.tips])
    poses = [_tidy_pose(pose, frames.scale) for pose in frames.tools]
    return [
        Tool(name=name, joint=joint_names[tip.joint], xyz=pose.xyz, rpy=pose.rpy)
        for name, tip, pose in zip(names, tree.tips, poses, strict=True)
    ]


def _describe_origin(path: str, tree: MovingTree) -> str:
    """Return a description of the robot's origin, with joints held elsewhere than at zero."""
    held = [f", {each}" for each in tree.held if each.position != 0 and not each.follows]
    tips = [tip.link for tip in tree.tips]
    ends = f"{'link' if len(tips) == 1 else 'links'} {joined(tips)}"
    origin = f"converted from {one_line(os.path.basename(path))}, from link {tree.base} to {ends}"
    return f"{origin}{''.join(held)}"


def _convert_joint(
    number: int,
    names: Sequence[str],
    joint: MovingJoint,
    mount: Pose | None,
    dh: DenavitHartenberg,
    link: Link,
    actuator: Actuator,
) -> Joint:
    limit = joint.urdf.limit
    speed = limit.velocity
    carrying = names[joint.parent] if joint.parent >= 0 else FRAME_0
    return Joint(
        name=names[number],
        type="revolute" if joint.is_revolute else "prismatic",
        parent=None if joint.parent == number - 1 else carrying,
        mount=mount,
        dh=dh,
        link=link,
        damping=joint.urdf.damping,
        actuator=actuator,
        limits=Limits(
            position=limit.position or UNBOUNDED,
            velocity=UNBOUNDED if speed is None else (-speed, speed),
        ),
    )


def _convert_links(path: str, joints: Sequence[MovingJoint], frames: Frames) -> list[Link]:
    """Return the links that each joint moves, in its Denavit-Hartenberg frame.

    Raises:
        InputError: an inertia is physically impossible.
    """
    problems, links = Problems(path), []
    for joint, pose in zip(joints, frames.poses, strict=True):
        try:
            links.append(_convert_link(joint.body.in_outer_frame(inverse_pose(pose)), frames.scale))
        except InvalidRecordError as error:
            first, *carried = joint.links
            whole = f"{quoted(first.name)}{' with the links it carries' if carried else ''}"
            for problem in error.fields:
                problems.add(first.line, f"inertia of {whole}: {problem}")
    problems.check()
    return links


def _convert_link(body: RigidBody, scale: float) -> Link:
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


def _tidy_pose(pose: FloatArray, scale: float) -> Pose:
    x, y, z = tidy(pose[:3, 3], scale).tolist()
    roll, pitch, yaw = (tidy_angle(angle) for angle in roll_pitch_yaw(pose[:3, :3]))
    return Pose(xyz=(x, y, z), rpy=(roll, pitch, yaw))


def identifiers(names: Sequence[str]) -> list[str]:
    """Return distinct names of letters, digits, `_` and `-`, with a letter or `_` first; none is null."""
    chosen: list[str] = []
    for name in names:
        word = re.sub(r"[^A-Za-z0-9_-]", "_", name)
        word = word if re.match(r"[A-Za-z_]", word) and word.lower() not in NULLS else f"_{word}"
        taken = (f"{word}_{number}" for number in itertools.count(2))
        chosen.append(word if word not in chosen else next(other for other in taken if other not in chosen))
    return chosen
