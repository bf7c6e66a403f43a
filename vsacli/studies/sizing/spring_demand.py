"""What trajectories ask of each spring of a robot."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from vsacli.base.json_records import Published, named
from vsacli.base.variables import Block
from vsacli.robot.model import Robot
from vsacli.studies.sizing.peak import Peak


@dataclass(frozen=True)
class SpringDemand(Published):
    """What a spring must bear.

    Attributes:
        joint, joint_type: whose it is.
        spring: which of its springs.
        energy: largest energy in it, J.
        torque: largest |torque|, N m (N).
        deflection: largest |deflection|, rad (m).
        max_deflection: what the robot file admits; infinite if it says nothing.
    """

    joint: str
    joint_type: str
    spring: str
    energy: Peak
    torque: Peak
    deflection: Peak
    max_deflection: float

    shape: ClassVar = named("joint", "spring", "energy", "torque", "deflection", "max_deflection", "share")

    @property
    def share(self) -> float:
        """Of the deflection that is admissible; NaN if nothing is said of that."""
        return self.deflection.value / self.max_deflection if math.isfinite(self.max_deflection) else math.nan


class SpringPeaks:
    """Keeps what springs bear at most; `add` blocks in order."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._found: dict[tuple[str, str], SpringDemand] = {}

    def add(self, block: Block, trajectory: str) -> None:
        """Merge a block of a trajectory."""
        for index, joint in enumerate(self._robot.joints):
            for load in joint.actuator.spring_loads(block.of_joint(index)):
                energy, torque, deflection = (
                    Peak.of(values, block.time, trajectory)
                    for values in (load.energy, load.torque, load.deflection)
                )
                new = SpringDemand(
                    joint.name, joint.type, load.name, energy, torque, deflection, load.max_deflection
                )
                key = joint.name, load.name
                self._found[key] = _larger(self._found.get(key, new), new)

    def report(self) -> tuple[SpringDemand, ...]:
        """What was found of each spring."""
        return tuple(self._found.values())


def _larger(one: SpringDemand, other: SpringDemand) -> SpringDemand:
    """The larger of the peaks of both."""
    return replace(
        one,
        energy=one.energy.or_larger(other.energy),
        torque=one.torque.or_larger(other.torque),
        deflection=one.deflection.or_larger(other.deflection),
    )
