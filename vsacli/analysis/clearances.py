"""How far a robot stays from its bounds: margins of the stiffness, and distances to limits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.limit_check import LimitCheck, OfJoint
from vsacli.actuators.reach import margin, nearer_end
from vsacli.analysis.joint_report import Worst
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag
from vsacli.base.signals import STIFFNESS
from vsacli.base.variables import Block
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

REACH = Flag.INFEASIBLE | Flag.SLACK | Flag.SINGULAR | Flag.NEAR_SINGULAR | Flag.NOT_FINITE
"""Bits that concern a stiffness in its corridor."""

MARGIN = "margin"
"""What the clearance of a stiffness is called; that of a limit is called as its flag."""


class Bounded(NamedTuple):
    """A quantity that has bounds.

    Attributes:
        joint: whose it is.
        number: of the joint.
        limit: what bounds it; None is the stiffness in its corridor.
    """

    joint: Joint
    number: int
    limit: LimitCheck | None

    @property
    def bits(self) -> Flag:
        """The bits that say what is wrong with it."""
        return REACH if self.limit is None else self.limit.flag

    def clearance(self, of_joint: OfJoint) -> FloatArray:
        """Relative distance to the nearer bound, (samples,), negative beyond it.

        Where the springs cannot carry the torque at all it is -inf. A number of a motor that does not exist
        is near no limit: +inf.
        """
        if self.limit is not None:
            return np.fmin(self.limit.clearance(of_joint), np.inf)  # the one of both that is no NaN
        gap = margin(of_joint["stiffness"], of_joint["stiffness_lower"], of_joint["stiffness_upper"])
        return np.fmax(gap, -np.inf)

    def at(self, block: Block, step: int) -> Worst:
        """A step of a block as a report has it: the value, and the nearer bound."""
        of_joint, limit = block.of_joint(self.number), self.limit
        if limit is None:
            kind, motor, unit = MARGIN, None, units.STIFFNESS.unit(self.joint.type)
            values = of_joint["stiffness"]
            ends = of_joint["stiffness_lower"][step], of_joint["stiffness_upper"][step]
        else:
            kind, motor, unit = limit.flag.label, limit.motor, limit.unit(self.joint.type)
            values, ends = limit.values(of_joint), limit.range
        value = float(values[step])
        return Worst(kind, float(block.time[step]), value, nearer_end(value, *map(float, ends)), unit, motor)


def bounded_quantities(robot: Robot) -> list[Bounded]:
    """Everything of a robot that has bounds."""
    return [
        Bounded(joint, index, limit)
        for index, joint in enumerate(robot.joints)
        for limit in (*([None] if STIFFNESS.key in joint.actuator.commanded else []), *limit_checks(joint))
    ]


def clearances(quantities: list[Bounded], block: Block) -> FloatArray:
    """Clearances of all quantities, (quantities, samples)."""
    of_joints = {number: block.of_joint(number) for number in {quantity.number for quantity in quantities}}
    rows = [quantity.clearance(of_joints[quantity.number]) for quantity in quantities]
    return np.array(rows).reshape(-1, len(block.time))
