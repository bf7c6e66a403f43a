"""What a combination of changes is, what it costs, and in which form the stiffness changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.admissible_stiffness import checked_range
from vsacli.studies.remedies.motions import Load
from vsacli.studies.remedies.stiffness_offset import smallest_offset


class Cost(Protocol):
    """How large changes are; the cost of all together is the root of the sum of the squares."""

    def of_factor(self, factor: float) -> float:
        """Of a slow-down: 0 for a factor of 1, and growing with it."""

    def of_stiffness(self, asked: FloatArray, change: FloatArray) -> float:
        """Of what is added to the stiffness of a joint, (samples,): 0 if that is nothing."""


class _RelativeChange:
    """What is changed, relative to what was asked for.

    One part is the factor less 1, the others the root mean square of each joint's change over that of its
    stiffness: a motion that takes 10 % longer counts as much as a joint that is 10 % stiffer throughout.
    """

    def of_factor(self, factor: float) -> float:
        """How much longer the motion takes, relative to its duration."""
        return factor - 1

    def of_stiffness(self, asked: FloatArray, change: FloatArray) -> float:
        """How much stiffer or softer the joint becomes, relative to its stiffness."""
        return math.sqrt(float(np.mean(change**2) / np.mean(asked**2)))


RELATIVE_CHANGE: Cost = _RelativeChange()

Form = Callable[[Acceptance, Joint, Load], FloatArray]
"""What to add to the stiffness of a joint so that its load is accepted, (samples,), or an ImpossibleError."""


def constant_change(acceptance: Acceptance, joint: Joint, load: Load) -> FloatArray:
    """The smallest that is the same at every sample."""
    return np.full(len(load.time), smallest_offset(acceptance, joint, load))


def least_change(acceptance: Acceptance, joint: Joint, load: Load) -> FloatArray:
    """The smallest at each sample by itself, whatever the motors may do: no smooth profile has a smaller."""
    low, high = checked_range(acceptance, joint, load)
    if np.any(low > high):
        raise ImpossibleError(f"corridor and limits leave {joint.name} no stiffness")
    asked = load.command.commanded["stiffness"]
    change: FloatArray = np.clip(0.0, low - asked, high - asked)
    return change


@dataclass(frozen=True, eq=False)
class Combination:
    """Changes that together mend a motion.

    Attributes:
        factor: of the slow-down, at least 1.
        changes: what to add to the stiffness, (samples,), by index of the joint; joints that are fine are
            left out.
        preloads: what becomes of the preload, by index of the joint, where it is to be the other one.
        size: by the cost that was asked for.
    """

    factor: float
    changes: Mapping[int, FloatArray]
    preloads: Mapping[int, str]
    size: float

    @property
    def constants(self) -> dict[int, float]:
        """The changes of stiffness by index of the joint, if they are constant."""
        return {index: float(change[0]) for index, change in self.changes.items()}

    def robot(self, robot: Robot) -> Robot:
        """The robot with the preloads of the combination."""
        return robot.replace(
            {preload_path(robot, index): preload for index, preload in self.preloads.items()}
        )


AS_IT_IS = Combination(1.0, {}, {}, 0.0)


def preload_path(robot: Robot, index: int) -> str:
    """The path to the preload of a joint in the file of its robot."""
    return f"joints.{index}.actuator.{robot.joints[index].actuator.preload_field}"
