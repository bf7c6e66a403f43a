"""A motor and its gear: as declared in a robot file, on the joint side, and the current in the windings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsacli.actuators.friction import Friction
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import (
    NON_NEGATIVE,
    NON_ZERO,
    POSITIVE,
    POSITIVE_OR_INFINITE,
    Record,
    check_fields,
    number,
    value,
)

_SIDE = "joint side of the gear unless gear_ratio is given"

NEEDED = {
    "torque_constant": ("gear_ratio",),
    "resistance": ("torque_constant",),
    "max_current": ("torque_constant",),
    "max_voltage": ("torque_constant", "resistance"),
}
"""Keys required together with a constant of the windings, which is one of the motor's shaft."""

_UNKNOWN = {
    "torque_constant": "the torque on the motor's shaft",
    "resistance": "the current",
    "max_current": "the current",
    "max_voltage": "the voltage",
}
"""Quantities unknown without these keys."""


@dataclass(frozen=True)
class JointMotor:
    """A motor on the joint side of its gear; at a prismatic joint in m and N."""

    inertia: float = number(units.MOTOR_INERTIA, "inertia of the drive, joint side of the gear")
    damping: float = number(units.DAMPING, "viscous damping, joint side of the gear")
    max_torque: float = number(units.TORQUE, "largest |torque|, joint side of the gear")
    max_velocity: float = number(units.VELOCITY, "largest |velocity|, joint side of the gear")
    gear_ratio: float | None = number(
        units.GEAR_RATIO,
        "ratio of the motion of the motor shaft to the motion on the joint side",
        default=None,
    )
    friction: Friction | None = value(Record(Friction), "dry friction, joint side of the gear", default=None)
    torque_constant: float | None = number(
        units.JOINT_TORQUE_CONSTANT,
        "ratio of the torque on the joint side of the gear to the current",
        default=None,
    )
    resistance: float | None = number(units.RESISTANCE, "resistance of the windings", default=None)
    max_current: float | None = number(units.CURRENT, "largest |current|", default=None)
    max_voltage: float | None = number(units.VOLTAGE, "largest |voltage|", default=None)


@dataclass(frozen=True)
class Motor:
    """A motor as declared: on the joint side of its gear, or, with a gear ratio, on its own shaft."""

    inertia: float = number(units.MOTOR_INERTIA, f"inertia of the drive, {_SIDE}", check=POSITIVE)
    damping: float = number(units.DAMPING, f"viscous damping, {_SIDE}", check=NON_NEGATIVE, default=0.0)
    max_torque: float = number(
        units.TORQUE,
        f"largest |torque|, {_SIDE}; flagged beyond",
        check=POSITIVE_OR_INFINITE,
        default=math.inf,
    )
    max_velocity: float = number(
        units.VELOCITY,
        f"largest |velocity|, {_SIDE}; flagged beyond",
        check=POSITIVE_OR_INFINITE,
        default=math.inf,
    )
    gear_ratio: float | None = number(
        units.GEAR_RATIO,
        "turns of the motor per turn of the joint, negative if it turns in the opposite direction; "
        "if given, the other values are those of the motor shaft, as in datasheets, in kg m^2, N m "
        "s/rad, N m, rad/s at every joint",
        check=NON_ZERO,
        default=None,
    )
    friction: Friction | None = value(Record(Friction), f"dry friction, {_SIDE}", default=None)
    torque_constant: float | None = number(
        units.TORQUE_CONSTANT,
        "ratio of torque to current, and so of voltage to velocity, on the motor shaft; requires "
        "gear_ratio, 1 for a direct drive",
        check=POSITIVE,
        default=None,
    )
    resistance: float | None = number(
        units.RESISTANCE,
        "resistance of the windings; requires torque_constant",
        check=NON_NEGATIVE,
        default=None,
    )
    max_current: float | None = number(
        units.CURRENT,
        "largest |current|; larger ones are flagged; requires torque_constant",
        check=POSITIVE_OR_INFINITE,
        default=None,
    )
    max_voltage: float | None = number(
        units.VOLTAGE,
        "largest |voltage|; larger ones are flagged; requires torque_constant and resistance",
        check=POSITIVE_OR_INFINITE,
        default=None,
    )

    unit_variant_with = ("gear_ratio", "revolute")

    def __post_init__(self) -> None:
        problems = []
        inertia = self.at_joint.inertia
        if self.gear_ratio and POSITIVE.problem(inertia) and not POSITIVE.problem(self.inertia):
            reason = f"makes the inertia on the joint side {inertia:g}, too far from anything built"
            problems.append(FieldProblem(("gear_ratio",), reason))
        check_fields(self, *problems, *self._missing())

    def _missing(self) -> Iterator[FieldProblem]:
        """Yield the keys missing for constants of the windings."""
        for name, needed in NEEDED.items():
            missing = [key for key in needed if getattr(self, key) is None]
            if getattr(self, name) is not None and missing:
                direct = " (1 for a direct drive)" if "gear_ratio" in missing else ""
                reason = f"needs {' and '.join(missing)}{direct}, without which {_UNKNOWN[name]} is not known"
                yield FieldProblem((name,), reason)

    @staticmethod
    def example(joint_type: str) -> dict[str, float]:
        """Return plausible values of the fields, for a new robot file."""
        revolute = joint_type == "revolute"
        return {"inertia": 0.5, "damping": 0.01} if revolute else {"inertia": 10, "damping": 0.1}

    @cached_property
    def at_joint(self) -> JointMotor:
        """Motor on the joint side: inertia and damping times the ratio squared, torques times the ratio."""
        signed = self.gear_ratio or 1.0
        ratio = abs(signed)
        return JointMotor(
            inertia=self.inertia * ratio * ratio,
            damping=self.damping * ratio * ratio,
            max_torque=self.max_torque * ratio,
            max_velocity=self.max_velocity / ratio,
            gear_ratio=self.gear_ratio,
            friction=self.friction and self.friction.geared(signed),
            torque_constant=None if self.torque_constant is None else signed * self.torque_constant,
            resistance=self.resistance,
            max_current=self.max_current,
            max_voltage=self.max_voltage,
        )


ELECTRICAL = ("current", "voltage", "copper_loss")
"""Result variables of the windings."""


class Windings(NamedTuple):
    """Constants of several motors' windings; arrays that broadcast with their torques.

    Attributes:
        torque_constant: Torque on the joint side of the gear over current, and so voltage over velocity
            there; negative if the gear reverses the motion. NaN where unknown.
        resistance: Resistance of the windings, NaN where unknown.
    """

    torque_constant: FloatArray
    resistance: FloatArray

    @classmethod
    def of(cls, motors: Sequence[JointMotor | None]) -> Windings | None:
        """Return the constants, one entry per motor on the last axis; None if no torque constant is given."""
        rows = [[getattr(motor, name, None) for name in cls._fields] for motor in motors]
        if all(constant is None for constant, _ in rows):
            return None
        known = [[math.nan if value is None else value for value in row] for row in rows]
        return cls(*map(np.stack, zip(*known, strict=True)))

    def with_axis_behind(self) -> Windings:
        """Return the constants with a further last axis, for samples."""
        return Windings(*(values[..., None] for values in self))

    def variables(self, torque: FloatArray, velocity: FloatArray) -> dict[str, FloatArray]:
        """Return the variables `ELECTRICAL` by name, A, V, W.

        Args:
            torque: Torques of the motors, N m (N), joint side of the gear.
            velocity: Velocities of the motors, rad/s (m/s), joint side of the gear.
        """
        current = torque / self.torque_constant
        return {
            "current": current,
            "voltage": self.resistance * current + self.torque_constant * velocity,
            "copper_loss": self.resistance * current * current,
        }
