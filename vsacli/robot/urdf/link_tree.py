"""A URDF as records: links, and the joints that make a tree of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.units import POSITION, Quantity
from vsacli.robot.urdf.rigid_motion import Body, cross_matrix

ROTATING = ("revolute", "continuous")
MOVING = (*ROTATING, "prismatic")
"""Types of joints with one degree of freedom."""

TYPES = (*MOVING, "fixed", "floating", "planar")

LARGEST_NUMBER = 1e9
"""Numbers beyond are no length, mass or inertia of a robot, and products of them would overflow."""


@dataclass(frozen=True)
class UrdfLink:
    """A link; `body` is in its own frame, None if the file gives no inertial data.

    `flaw` is the line of inertial data that are not whole and what is missing, which matters if a joint
    carries the link.
    """

    name: str
    line: int
    body: Body | None
    flaw: tuple[int, str] | None = None


@dataclass(frozen=True)
class UrdfLimit:
    """Limits of a joint, None where the file gives none that bounds anything."""

    position: tuple[float, float] | None = None
    velocity: float | None = None
    effort: float | None = None


@dataclass(frozen=True)
class Mimic:
    """How a joint follows another: to `multiplier` times the position of joint `leader`, plus `offset`."""

    leader: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class UrdfJoint:
    """A joint; at position zero its child has the pose `placement` in its parent.

    `gear_ratio` is the motion of its only motor over its own, None if that is 1 or not known; `left_out` is
    what the file says of it that has no place in a robot file, a few words each.
    """

    name: str
    line: int
    type: str
    parent: str
    child: str
    placement: FloatArray
    axis: FloatArray
    limit: UrdfLimit
    damping: float
    mimic: Mimic | None
    gear_ratio: float | None
    left_out: tuple[str, ...]

    @property
    def is_fixed(self) -> bool:
        """Whether it joins its links rigidly."""
        return self.type == "fixed"

    @property
    def is_revolute(self) -> bool:
        """Whether it turns."""
        return self.type in ROTATING

    def unit(self, quantity: Quantity = POSITION) -> str:
        """Unit of a quantity of it."""
        return quantity.unit("revolute" if self.is_revolute else "prismatic")

    def motions(self, positions: FloatArray) -> FloatArray:
        """How its child moves at positions (samples,), (samples, 4, 4); by Rodrigues' formula if it turns."""
        poses = np.tile(np.eye(4), (len(positions), 1, 1))
        if not self.is_revolute:
            poses[:, :3, 3] = np.outer(positions, self.axis)
            return poses
        cross = cross_matrix(self.axis)
        angle = positions[:, None, None]
        poses[:, :3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
        return poses


@dataclass(frozen=True)
class Urdf:
    """A robot as a tree of links.

    Attributes:
        file: its path as given.
        name: of the robot.
        links: by name.
        joints: by name.
        root: the link without a parent.
    """

    file: str
    name: str
    links: Mapping[str, UrdfLink]
    joints: Mapping[str, UrdfJoint]
    root: str

    def above(self, link: str) -> list[UrdfJoint]:
        """The joints between the root and a link, from the root."""
        parents = {joint.child: joint for joint in self.joints.values()}
        path = []
        while link in parents:
            path.append(parents[link])
            link = parents[link].parent
        return path[::-1]

    def followed(self, joint: UrdfJoint) -> Mimic:
        """The joint that a joint follows in the end, itself if it follows none that there is."""
        mimic = Mimic(joint.name)
        while (further := self.joints[mimic.leader].mimic) is not None and further.leader in self.joints:
            multiplier, offset = mimic.multiplier, mimic.offset
            mimic = Mimic(
                further.leader, multiplier * further.multiplier, multiplier * further.offset + offset
            )
        return mimic


def below(link: str, joints: Iterable[UrdfJoint]) -> Iterator[UrdfJoint]:
    """Joints that hang below a link, parents before children."""
    children: dict[str, list[UrdfJoint]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint)
    waiting = [link]
    while waiting:
        for joint in children.get(waiting.pop(), ()):
            yield joint
            waiting.append(joint.child)
