"""Size and weight of a robot: the measures that single numbers of its file are compared with."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vsacli.actuators.motor import Motor
from vsacli.base.arrays import FloatArray
from vsacli.documents.plausibility import Measured
from vsacli.documents.record_values import Entry, Number, NumberPath
from vsacli.robot.joint import Joint, Link, Pose

WEIGHT_PER_MASS = 9.81
"""m/s^2. Loads are compared with the weight on earth, also of robots that work in space."""

SPHERE = 0.4
"""Moment of inertia of a solid sphere over mass times radius squared."""


@dataclass(frozen=True)
class CheckedRobot:
    """A robot as the rules of plausibility see it.

    Attributes:
        joints: from the base to the tip.
        base: as in the robot file.
        gravity: as in the robot file, m/s^2.
        numbers: all of the file.
        placeholder: whether springs and motors only stand in for others.
    """

    joints: tuple[Joint, ...]
    base: Pose
    gravity: tuple[float, float, float]
    numbers: tuple[Number, ...]
    placeholder: bool

    @cached_property
    def sizes(self) -> BodySizes:
        """Sizes of the robot."""
        return BodySizes(self.joints)

    @property
    def driven(self) -> Iterator[tuple[int, Joint]]:
        """The joints with their indices, unless springs and motors only stand in for others."""
        return enumerate(() if self.placeholder else self.joints)

    def of_unit(self, unit: str) -> Iterator[Measured]:
        """Yield the numbers in a unit, each with its magnitude as size."""
        for path, quantity, value, _ in self.numbers:
            if quantity.unit(self._variant(path)) == unit:
                yield Measured(path, value, unit, abs(value))

    def _variant(self, path: NumberPath) -> str:
        """Return the joint type on which a unit depends: revolute for a motor behind its gear."""
        if path[0] != "joints" or not isinstance(path[1], Entry):
            return "revolute"
        joint = self.joints[path[1].number]
        geared = any(motor.gear_ratio for at, motor in motors(joint) if at == path[2:-1])
        return "revolute" if geared else joint.type


def joint_path(number: int, joint: Joint, *steps: str | Entry) -> NumberPath:
    """Return the path to something of a joint."""
    return ("joints", Entry(number, joint.name), *steps)


def motors(joint: Joint) -> Iterator[tuple[NumberPath, Motor]]:
    """Return the motors of a joint as they are written, each with its path from the joint."""
    return written_once(("actuator", "motor"), getattr(joint.actuator, "motor", ()))


def written_once(path: NumberPath, content: Any) -> Iterator[tuple[NumberPath, Any]]:
    """One record or a pair of them, each with its path; if one serves both sides, that one."""
    sides = content if isinstance(content, tuple) else (content,)
    if len({id(side) for side in sides}) == 1:
        yield path, sides[0]
    else:
        yield from (((*path, Entry(number)), side) for number, side in enumerate(sides))


class BodySizes:
    """Sizes of a robot, each an upper bound over its configurations; prismatic joints count at zero.

    Attributes:
        gyrations: radius of gyration of each link about its centre of mass, m; 0 without mass or inertia.
        reach: of the stretched robot, m: to the end of its rows or its farthest centre of mass.
        levers: distance of what is farthest from each joint while the robot is stretched, m.
        mass: of all links, kg.
        inertias: of each link alone about its joint, kg m^2; of a prismatic joint the mass, kg.
        moved: of all that a joint moves while the robot is stretched, kg m^2; of a prismatic joint, kg.
        loads: what the weight can ask of each joint while the robot is stretched, N m (N).
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        masses = np.array([joint.link.mass for joint in joints], dtype=np.float64)
        lengths = np.array([math.hypot(joint.dh.a, joint.dh.d) for joint in joints])
        before = np.cumsum(lengths) - lengths
        coms = np.array([_com_distance(joint) for joint in joints])
        extents = before + coms
        self.gyrations = np.array([_gyration(joint.link) for joint in joints])
        self.reach = float(max(np.max(extents), np.sum(lengths)))
        self.levers = self.reach - before
        mass, moment = _from_tip(masses), _from_tip(masses * extents)
        self.mass = float(mass[0])
        revolute = np.array([joint.is_revolute for joint in joints])
        self.inertias = masses * np.where(revolute, coms**2 + self.gyrations**2, 1.0)
        turned = _from_tip(masses * (extents**2 + self.gyrations**2)) - 2 * before * moment + before**2 * mass
        self.moved = np.where(revolute, turned, mass)
        self.loads = WEIGHT_PER_MASS * np.where(revolute, moment - before * mass, mass)

    @property
    def extent(self) -> float:
        """Size of the robot, m: its reach, or the radius of a link that is larger."""
        return max(self.reach, float(np.max(self.gyrations)))

    @property
    def weight(self) -> float:
        """Weight of all links, N."""
        return WEIGHT_PER_MASS * self.mass

    def scale(self, joint: Joint) -> float:
        """Return the weight at the reach of the robot, N m; the weight, N, for a prismatic joint."""
        return self.weight * (self.extent if joint.is_revolute else 1.0)


def _from_tip(values: FloatArray) -> FloatArray:
    """Sums from each entry to the last."""
    sums: FloatArray = np.cumsum(values[::-1])[::-1]
    return sums


def _com_distance(joint: Joint) -> float:
    """Return the distance of the centre of mass from frame i-1, in which it is Tz(d) Tx(a) Rx(alpha) com."""
    x, y, z = joint.link.com
    c, s = math.cos(joint.dh.alpha), math.sin(joint.dh.alpha)
    return math.hypot(joint.dh.a + x, c * y - s * z, joint.dh.d + s * y + c * z)


def _sum_of_moments(link: Link) -> float:
    """Trace of the inertia tensor, kg m^2: twice the integral of r^2 dm, whatever the axes."""
    return link.inertia.xx + link.inertia.yy + link.inertia.zz


def _gyration(link: Link) -> float:
    return math.sqrt(max(_sum_of_moments(link), 0.0) / 2 / link.mass) if link.mass else 0.0


def density_of_sphere(link: Link) -> float:
    """Density of the solid sphere with the mass and the sum of moments of a link, kg/m^3; NaN if either is 0.

    A real body is at least as dense somewhere, since the sphere has the least moments for its volume.
    """
    moments = _sum_of_moments(link)
    if not (link.mass > 0 and moments > 0):
        return math.nan
    radius = math.sqrt(moments / 3 / SPHERE / link.mass)
    return link.mass / (4 / 3 * math.pi * radius * radius * radius)


def ratio(value: float, reference: float) -> float:
    """Return a value over another; NaN if there is nothing to hold it against."""
    return value / reference if reference > 0 else math.nan
