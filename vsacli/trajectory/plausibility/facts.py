"""What is known of a trajectory to judge its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.signals import POSITION
from vsacli.base.units import Quantity
from vsacli.documents.plausibility import Measured
from vsacli.documents.record_numbers import Entry, Number
from vsacli.robot.model import Robot
from vsacli.robot.plausibility.facts import BodySizes
from vsacli.robot.plausibility.spring_rules import Corridor, corridor
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.times import Times

INSTANTS = 1001
"""Times, evenly spread, at which the motion is looked at; sums of sinusoids are the fastest to change."""

PER_SECOND = "per second"


@dataclass(frozen=True)
class Facts:
    """What the rules know of a trajectory.

    Attributes:
        robot: that is to execute it.
        numbers: all of the file.
        times: the steps.
        motion: the position over time if it is given by a formula; recorded ones are looked at elsewhere.
    """

    robot: Robot
    numbers: Sequence[Number]
    times: Times
    motion: Profile | None

    @cached_property
    def sizes(self) -> BodySizes:
        """Of the robot."""
        return BodySizes(self.robot.joints)

    @cached_property
    def moved(self) -> FloatArray | None:
        """Position and its derivatives, (orders, joints, instants); None if they are recorded."""
        return None if self.motion is None else self.motion.at(np.linspace(*self.times.span, INSTANTS))

    @cached_property
    def corridors(self) -> list[Corridor | None]:
        """What stiffness each joint can have at rest; None if it takes none."""
        return [corridor(joint) for joint in self.robot.joints]

    @property
    def revolute(self) -> BoolArray:
        """Which joints are, (joints,)."""
        return np.array([joint.is_revolute for joint in self.robot.joints])

    @property
    def travels(self) -> FloatArray:
        """A common way of each joint, (joints,): 1 rad, or the reach of the robot, m."""
        return np.where(self.revolute, 1.0, self.sizes.extent or math.nan)

    @property
    def duration(self) -> float:
        """From the first step to the last, s."""
        first, last = self.times.span
        return last - first

    def of_joints(self, quantity: Quantity) -> Iterator[tuple[Measured, int]]:
        """The numbers that measure this, each with its joint and with its magnitude as size."""
        for path, measured, value, _ in self.numbers:
            if measured == quantity and isinstance(path[-1], Entry):
                joint = path[-1].number
                unit = quantity.unit(self.robot.joint_types[joint])
                yield Measured(path, value, unit, abs(value)), joint

    def paced(self, quantity: Quantity, sizes: FloatArray, **beside: str) -> Iterator[Measured]:
        """The number that the pace follows from, if it is a time or a frequency, with the largest size."""
        of_motion = [each for each in self.numbers if each.path[0] in ("duration", POSITION.key)]
        given = [each for each in of_motion if each.path[-1] == "frequency"]
        given = given or [each for each in of_motion if each.quantity == units.TIME]
        longest = max(given, key=lambda each: each.value, default=None)
        if longest is not None and longest.quantity == quantity:
            joint = int(np.argmax(sizes))
            names = {"joint": self.robot.joint_names[joint], **beside}
            unit = "s" if quantity == units.TIME else PER_SECOND
            yield Measured(longest.path, longest.value, unit, float(sizes[joint]), names)
