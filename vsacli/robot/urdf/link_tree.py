"""A URDF as records: links, and the joints that make a tree of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from vsacli.base.arrays import FloatArray
from vsacli.robot.urdf.rigid_motion import Body

ROTATING = ("revolute", "continuous")
MOVING = (*ROTATING, "prismatic")
"""Types of joints with one degree of freedom."""

TYPES = (*MOVING, "fixed", "floating", "planar")


@dataclass(frozen=True)
class UrdfLink:
    """A link; `body` is in its own frame, None if the file gives no inertial data."""

    name: str
    line: int
    body: Body | None


@dataclass(frozen=True)
class UrdfLimit:
    """Limits of a joint, None where the file gives none that bounds anything."""

    position: tuple[float, float] | None = None
    velocity: float | None = None
    effort: float | None = None


@dataclass(frozen=True)
class UrdfJoint:
    """A joint; at position zero its child has the pose `placement` in its parent."""

    name: str
    line: int
    type: str
    parent: str
    child: str
    placement: FloatArray
    axis: FloatArray
    limit: UrdfLimit
    damping: float
    friction: float
    mimics: str | None

    @property
    def is_fixed(self) -> bool:
        """Whether it joins its links rigidly."""
        return self.type == "fixed"


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
