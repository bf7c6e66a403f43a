"""What flows in the windings of direct current motors, and what that takes: current, voltage, heat."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.actuators.motor import JointMotor
from vsacli.base.arrays import FloatArray

ELECTRICAL = ("current", "voltage", "copper_loss")
"""The variables of it."""


class Windings(NamedTuple):
    """Constants of several motors; arrays that spread with those of their torques.

    Attributes:
        torque_constant: torque on the joint's side of the gear over current, and so voltage over velocity
            there; negative if the gear turns the motor against the joint. NaN where it is not known.
        resistance: of the windings, NaN where it is not known.
    """

    torque_constant: FloatArray
    resistance: FloatArray

    @classmethod
    def of(cls, motors: Sequence[JointMotor | None]) -> Windings | None:
        """One entry each, on the last axis; None if there is no torque constant."""
        rows = [[getattr(motor, name, None) for name in cls._fields] for motor in motors]
        if all(constant is None for constant, _ in rows):
            return None
        known = [[math.nan if value is None else value for value in row] for row in rows]
        return cls(*map(np.stack, zip(*known, strict=True)))

    def with_axis_behind(self) -> Windings:
        """The same with a further axis, for samples, behind those there are."""
        return Windings(*(values[..., None] for values in self))

    def variables(self, torque: FloatArray, velocity: FloatArray) -> dict[str, FloatArray]:
        """The variables `ELECTRICAL` by name, A, V, W.

        Args:
            torque: of the motors, N m (N), joint side of the gear.
            velocity: of the motors, rad/s (m/s), joint side of the gear.
        """
        current = torque / self.torque_constant
        return {
            "current": current,
            "voltage": self.resistance * current + self.torque_constant * velocity,
            "copper_loss": self.resistance * current * current,
        }
