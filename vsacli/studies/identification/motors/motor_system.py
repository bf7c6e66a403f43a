"""The system of equations of one joint's motors, with what its numbers may be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.studies.identification.estimation.equations import Equations, with_noise
from vsacli.studies.identification.motors.motor_equations import motor_equations
from vsacli.studies.identification.motors.unknowns import SPRINGS, admissible, group_of, unknowns
from vsacli.studies.identification.records.signals import Signals


class MotorSystem:
    """Equations of the motors of a joint with springs; see `SystemOfEquations`.

    Args:
        robot: the robot, as its file has it.
        index: of the joint.
        sought: numbers of its actuator that are to be found.
    """

    def __init__(self, robot: Robot, index: int, sought: Sequence[Parameter]) -> None:
        self._robot, self._index, self._sought = robot, index, tuple(sought)
        self.title = robot.joints[index].name
        self.names = tuple(map(str, sought))
        self.units = tuple(each.unit for each in sought)
        self.sums = ("",) * len(self.names)
        self.before = np.array([each.value for each in sought])

    def equations(self, values: FloatArray, signals: Signals) -> Equations:
        """Those of a record at some values of the numbers, (numbers,)."""
        made = partial(motor_equations, self._robot, self._index, self._sought, values)
        return with_noise(made, signals)

    def admissible(self, number: int, value: float) -> float | None:
        """The value itself if the robot file may hold it, else zero if it may hold that; None if neither."""
        return admissible(self._robot, self.names[number], value)

    def without(self, fixed: dict[int, float]) -> MotorSystem:
        """The same with some numbers at given values, which are no longer looked for."""
        robot = self._robot.replace({self.names[number]: value for number, value in fixed.items()})
        return MotorSystem(robot, self._index, [e for n, e in enumerate(self._sought) if n not in fixed])


def motor_systems(
    robot: Robot,
    joints: Sequence[int],
    fit: Sequence[str],
    records: Sequence[Signals],
) -> Iterator[MotorSystem]:
    """Of the joints with springs, those of which anything is to be found.

    Numbers of springs that change no torque at all, since they but bound where these work, are passed over.

    Args:
        robot: the robot.
        joints: indices of those that were recorded.
        fit: words and patterns, see `unknowns`.
        records: of its motion.
    """
    for index in joints:
        sought = unknowns(robot, index, fit) if robot.joints[index].actuator.sprung else ()
        if not sought:
            continue
        values = np.array([each.value for each in sought])
        slopes = [motor_equations(robot, index, sought, values, each).slopes for each in records]
        acts = np.any(np.concatenate(slopes) != 0, axis=0)
        left = [each for each, does in zip(sought, acts, strict=True) if does or group_of(each) != SPRINGS]
        if left:
            yield MotorSystem(robot, index, left)
