"""Sizes and weight of a robot, with which plausibility rules compare the numbers of its file."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.motor import Motor
from vsacli.base.arrays import FloatArray
from vsacli.documents.plausibility import Measured
from vsacli.documents.record_values import NumberAtPath, NumberPath, PathIndex
from vsacli.robot.joint import Joint, Link, Pose, Tool

WEIGHT_PER_MASS = 9.81
"""Gravity, m/s^2; loads are compared with the weight on earth, also of robots in space."""

SPHERE = 0.4
"""Moment of inertia of a solid sphere, over mass times radius squared."""


class UnloadedStiffnessRange(NamedTuple):
    """Attainable stiffness of a joint without load, N m/rad (N/m)."""

    lower: float
    upper: float


def unloaded_stiffness_range(joint: Joint) -> UnloadedStiffnessRange | None:
    """Return the attainable range of a joint without load; None if its stiffness is not commanded."""
    if "stiffness" not in joint.actuator.commanded:
        return None
    solution = joint.actuator.solve(np.zeros(1), np.ones(1), np.zeros(1))
    return UnloadedStiffnessRange(float(solution.lower[0]), float(solution.upper[0]))


@dataclass(frozen=True)
class CheckedRobot:
    """A robot with the data that plausibility rules need; of one with several joints on its base, a subtree.

    Attributes:
        joints: joints, each after the one that carries it.
        parents: index of the joint whose link carries each joint; -1 for frame 0.
        base: pose of DH frame 0 in the base frame.
        gravity: gravity acceleration in the base frame, m/s^2.
        numbers: all numbers of the file that concern it.
        placeholder: whether springs and motors are placeholders.
        numbers_in_robot: index of each joint in the whole robot.
        tools: index of the joint that carries each tool, by the index of the tool in the whole robot.
        end_effectors: these tools.
    """

    joints: tuple[Joint, ...]
    parents: tuple[int, ...]
    base: Pose
    gravity: tuple[float, float, float]
    numbers: tuple[NumberAtPath, ...]
    placeholder: bool
    numbers_in_robot: tuple[int, ...]
    tools: Mapping[int, int]
    end_effectors: tuple[Tool, ...]

    def subtree(self, joints: tuple[int, ...]) -> CheckedRobot:
        """Return the data of some joints, which are renumbered; numbers of the whole robot stay with them."""
        place = {-1: -1, **{number: index for index, number in enumerate(joints)}}
        tools = {tool: place[joint] for tool, joint in self.tools.items() if joint in place}
        inside = []
        for number in self.numbers:
            match number.path:
                case ("joints", PathIndex(joint, name), *inner):
                    if joint in place:
                        path = ("joints", PathIndex(place[joint], name), *inner)
                        inside.append(number._replace(path=path))
                case ("tools", PathIndex(tool), *_) if tool not in tools:
                    pass
                case _:
                    inside.append(number)
        return replace(
            self,
            joints=tuple(self.joints[joint] for joint in joints),
            parents=tuple(place[self.parents[joint]] for joint in joints),
            numbers=tuple(inside),
            numbers_in_robot=joints,
            tools=tools,
            end_effectors=tuple(
                effector
                for tool, effector in zip(self.tools, self.end_effectors, strict=True)
                if tool in tools
            ),
        )

    @property
    def tool_joints(self) -> tuple[int, ...]:
        """Index of the joint whose link carries each of `end_effectors`."""
        return tuple(self.tools.values())

    @cached_property
    def sizes(self) -> BodySizes:
        """Body sizes of the robot."""
        return BodySizes(self.joints, self.parents)

    @property
    def distance_from_base_frame(self) -> float:
        """Largest distance of the first joint from the origin of the base frame, m."""
        mount = self.joints[0].mount or Pose()
        return math.hypot(*self.base.xyz) + math.hypot(*mount.xyz)

    @cached_property
    def unloaded_ranges(self) -> tuple[UnloadedStiffnessRange | None, ...]:
        """Attainable stiffness of each joint at rest; None if it has no commanded stiffness."""
        return tuple(map(unloaded_stiffness_range, self.joints))

    @property
    def joints_with_drives(self) -> Iterator[tuple[int, Joint]]:
        """Joints with their indices; none if springs and motors are placeholders."""
        return enumerate(() if self.placeholder else self.joints)

    def of_unit(self, unit: str) -> Iterator[Measured]:
        """Yield the numbers with a unit, each with its magnitude as size."""
        for path, value in self._numbers_by_unit.get(unit, ()):
            yield Measured(path, value, unit, abs(value))

    @cached_property
    def _numbers_by_unit(self) -> Mapping[str, Sequence[tuple[NumberPath, float]]]:
        numbers: defaultdict[str, list[tuple[NumberPath, float]]] = defaultdict(list)
        for path, quantity, value, _ in self.numbers:
            numbers[quantity.unit(self._variant(path))].append((path, value))
        return numbers

    def _variant(self, path: NumberPath) -> str:
        """Return the joint type on which the unit of a number depends."""
        if path[0] != "joints" or not isinstance(path[1], PathIndex):
            return "revolute"
        return self.joints[path[1].number].type


def joint_path(number: int, joint: Joint, *steps: str | PathIndex) -> NumberPath:
    """Return the path of a part of a joint."""
    return ("joints", PathIndex(number, joint.name), *steps)


def motors_in_file(joint: Joint) -> Iterator[tuple[NumberPath, Motor]]:
    """Return the motors of a joint as written in the file, each with its path from the joint."""
    return records_in_file(("actuator", "motor"), getattr(joint.actuator, "motor", ()))


def records_in_file(path: NumberPath, content: Any) -> Iterator[tuple[NumberPath, Any]]:
    """Yield a record, or each record of a pair, with its path; a record for both sides is yielded once."""
    sides = content if isinstance(content, tuple) else (content,)
    if len({id(side) for side in sides}) == 1:
        yield path, sides[0]
    else:
        yield from (((*path, PathIndex(number)), side) for number, side in enumerate(sides))


class BodySizes:
    """Sizes of a robot, each an upper bound over its configurations with prismatic joints at zero.

    Attributes:
        gyrations: radius of gyration of each link about its center of mass, m; 0 without mass or inertia.
        reach: reach of the stretched robot, m, to the end of its rows or its farthest center of mass; mounts
            count as lengths, but on the base, from where the reach is measured.
        levers: distance from each joint to the farthest point of its branches of the stretched robot, m.
        mass: mass of all links, kg.
        inertias: inertia of each link alone about its joint, kg m^2; for a prismatic joint the mass, kg.
        moved_inertias: inertia of all links that a joint of the stretched robot moves, kg m^2; for a
            prismatic joint their mass, kg.
        loads: largest torque of the weight at each joint of the stretched robot, N m (N).
        load_bounds: the weight that each joint moves times the radius of gyration about it, N m (N); at least
            its load, and not zero if the center of mass is on the axis.
    """

    def __init__(self, joints: Sequence[Joint], parents: Sequence[int]) -> None:
        masses = np.array([joint.link.mass for joint in joints], dtype=np.float64)
        lengths = np.array([math.hypot(joint.dh.a, joint.dh.d) for joint in joints])
        mounts = [math.hypot(*(joint.mount or Pose()).xyz) for joint in joints]
        before = np.zeros(len(joints))
        for joint, parent in enumerate(parents):
            if parent >= 0:
                before[joint] = before[parent] + lengths[parent] + mounts[joint]
        coms = np.array([_com_distance(joint) for joint in joints])
        extents = before + coms
        self.gyrations = np.array([_radius_of_gyration(joint.link) for joint in joints])
        farthest = np.maximum(extents, before + lengths)
        self.reach = float(np.max(farthest))
        self.levers = _largest_along_branches(farthest, parents) - before
        mass, moment = _sums_from_tips(masses, parents), _sums_from_tips(masses * extents, parents)
        self.mass = float(mass[0])
        revolute = np.array([joint.is_revolute for joint in joints])
        self.inertias = masses * np.where(revolute, coms**2 + self.gyrations**2, 1.0)
        turned = (
            _sums_from_tips(masses * (extents**2 + self.gyrations**2), parents)
            - 2 * before * moment
            + before**2 * mass
        )
        self.moved_inertias = np.where(revolute, turned, mass)
        self.loads = WEIGHT_PER_MASS * np.where(revolute, moment - before * mass, mass)
        self.load_bounds = WEIGHT_PER_MASS * np.sqrt(mass * self.moved_inertias)

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


def _sums_from_tips(values: FloatArray, parents: Sequence[int]) -> FloatArray:
    """Return the sum over each joint and those it carries."""
    return _from_tips(np.add, values, parents)


def _largest_along_branches(values: FloatArray, parents: Sequence[int]) -> FloatArray:
    """Return the largest value of each joint, those that carry it, and those it carries."""
    largest = _from_tips(np.maximum, values, parents)
    carriers = values.copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            carriers[joint] = max(carriers[joint], carriers[parent])
    return np.maximum(largest, carriers)


def _from_tips(combine: Callable[[Any, Any], Any], values: FloatArray, parents: Sequence[int]) -> FloatArray:
    """Return the values of each joint combined with those of the joints it carries."""
    combined = values.copy()
    for joint in reversed(range(len(parents))):
        if parents[joint] >= 0:
            combined[parents[joint]] = combine(combined[parents[joint]], combined[joint])
    return combined


def _com_distance(joint: Joint) -> float:
    """Return the distance of the center of mass, Tz(d) Tx(a) Rx(alpha) com, from frame i-1, m."""
    x, y, z = joint.link.com
    c, s = math.cos(joint.dh.alpha), math.sin(joint.dh.alpha)
    return math.hypot(joint.dh.a + x, c * y - s * z, joint.dh.d + s * y + c * z)


def _sum_of_moments(link: Link) -> float:
    """Return the trace of the inertia tensor, kg m^2: twice the integral of r^2 dm, for any axes."""
    return link.inertia.xx + link.inertia.yy + link.inertia.zz


def _radius_of_gyration(link: Link) -> float:
    return math.sqrt(max(_sum_of_moments(link), 0.0) / 2 / link.mass) if link.mass else 0.0


def density_of_sphere(link: Link) -> float:
    """Return the density, kg/m^3, of the solid sphere with mass and sum of moments of a link.

    It is NaN if mass or moments are zero. A real body is at least as dense somewhere, since the sphere has
    the smallest moments for its volume.
    """
    moments = _sum_of_moments(link)
    if not (link.mass > 0 and moments > 0):
        return math.nan
    radius = math.sqrt(moments / 3 / SPHERE / link.mass)
    return link.mass / (4 / 3 * math.pi * radius * radius * radius)


def ratio_or_nan(value: float, reference: float) -> float:
    """Return a value over a reference; NaN unless the reference is positive."""
    return value / reference if reference > 0 else math.nan
