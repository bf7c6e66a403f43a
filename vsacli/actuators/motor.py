"""A motor and its gear: as declared in a robot file, on the joint side, and the current in the windings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

from vsacli.actuators.friction import NO_FRICTION, Friction
from vsacli.base import units
from vsacli.base.arrays import FloatArray, stack_constants
from vsacli.base.errors import FieldProblem
from vsacli.base.units import Quantity, constant
from vsacli.documents.fields import (
    NON_NEGATIVE,
    NON_ZERO,
    POSITIVE,
    POSITIVE_OR_INFINITE,
    RecordOf,
    choice,
    number,
    value,
)
from vsacli.documents.record_checks import DeclaredRecord, fault_of_number

JOINT, SHAFT = "joint", "shaft"
"""Sides of a gear."""

_SIDE_TEXT = "joint side of the gear unless side is shaft"

_REFLECTED = {
    "inertia": units.MOTOR_INERTIA,
    "damping": units.DAMPING,
    "max_torque": units.TORQUE,
    "max_velocity": units.VELOCITY,
    "friction.coulomb": units.TORQUE,
    "friction.offset": units.TORQUE,
    "friction.width": units.VELOCITY,
}
"""Quantities of the values that are given on either side of the gear."""

REQUIRED_WITH = {
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
    friction: Friction | None = value(
        RecordOf(Friction), "dry friction, joint side of the gear", default=None
    )
    torque_constant: float | None = number(
        units.JOINT_TORQUE_CONSTANT,
        "ratio of the torque on the joint side of the gear to the current",
        default=None,
    )
    resistance: float | None = number(units.RESISTANCE, "resistance of the windings", default=None)
    max_current: float | None = number(units.CURRENT, "largest |current|", default=None)
    max_voltage: float | None = number(units.VOLTAGE, "largest |voltage|", default=None)


@dataclass(frozen=True)
class Motor(DeclaredRecord):
    """A motor as declared: on the joint side of its gear, or with `side: shaft` on its own shaft."""

    inertia: float = number(units.MOTOR_INERTIA, f"inertia of the drive, {_SIDE_TEXT}", check=POSITIVE)
    damping: float = number(units.DAMPING, f"viscous damping, {_SIDE_TEXT}", check=NON_NEGATIVE, default=0.0)
    max_torque: float = number(
        units.TORQUE,
        f"largest |torque|, {_SIDE_TEXT}; flagged beyond",
        check=POSITIVE_OR_INFINITE,
        default=math.inf,
    )
    max_velocity: float = number(
        units.VELOCITY,
        f"largest |velocity|, {_SIDE_TEXT}; flagged beyond",
        check=POSITIVE_OR_INFINITE,
        default=math.inf,
    )
    gear_ratio: float | None = number(
        units.GEAR_RATIO,
        "turns of the motor per turn of the joint, negative if it turns in the opposite direction; a ratio "
        "other than 1 requires side",
        check=NON_ZERO,
        default=None,
    )
    side: str | None = choice(
        (JOINT, SHAFT),
        "side of the gear to which inertia, damping, max_torque, max_velocity and friction refer; required "
        "with a gear_ratio other than 1; values of the shaft, as in data sheets, are in kg m^2, N m s/rad, "
        "N m, rad/s at any joint",
        default=None,
    )
    friction: Friction | None = value(RecordOf(Friction), f"dry friction, {_SIDE_TEXT}", default=None)
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

    unit_variant = "side"
    unit_variants = MappingProxyType({SHAFT: "revolute"})
    required_unless = MappingProxyType({"side": ("gear_ratio", 1)})

    def _problems(self) -> Iterator[FieldProblem]:
        yield from (*self._gear_problems(), *self._missing_keys())

    def _gear_problems(self) -> Iterator[FieldProblem]:
        ratio = self.gear_ratio
        if ratio is None:
            return
        if self.side is None and ratio != 1:
            yield self._missing_side_problem(ratio)
            return
        inertia = self.at_joint.inertia
        if fault_of_number(inertia, POSITIVE):
            reason = f"makes the inertia on the joint side {inertia:g}, too far from anything built"
            yield FieldProblem(("gear_ratio",), reason)

    def _missing_side_problem(self, ratio: float) -> FieldProblem:
        """Return the problem of a motor with a gear but no side, with both meanings of its values."""
        values, on_joint_side, on_shaft_side = map(
            _constant_texts, (vars(self), self._reflected_values(ratio), self._reflected_values(1 / ratio))
        )
        meanings: list[str] = []
        quantities: list[Quantity] = []
        for (name, quantity, text), (*_, joint_text), (*_, shaft_text) in zip(
            values, on_joint_side, on_shaft_side, strict=True
        ):
            rotary_unit = constant(quantity.revolute)
            if not meanings:  # says once which number is where
                meaning_of_first = f"{text} {{}} at the shaft = {joint_text} {{}} at the joint"
                meanings.append(
                    f"{name} {meaning_of_first}, or {text} {{}} at the joint = {shaft_text} {{}} at the shaft"
                )
                quantities += (rotary_unit, quantity, quantity, rotary_unit)
            else:
                meanings.append(f"{name} {text} {{}} = {joint_text} {{}}, or = {shaft_text} {{}}")
                quantities += (rotary_unit, quantity, rotary_unit)
        reason = "; ".join((f"{ratio:g} needs side: {SHAFT} or {JOINT}", *meanings))
        return FieldProblem(("gear_ratio",), reason, quantities=tuple(quantities))

    def _missing_keys(self) -> Iterator[FieldProblem]:
        """Yield the keys missing for constants of the windings."""
        for name, required_keys in REQUIRED_WITH.items():
            missing = [key for key in required_keys if getattr(self, key) is None]
            if getattr(self, name) is not None and missing:
                hint = " (1 for a direct drive)" if "gear_ratio" in missing else ""
                reason = f"needs {' and '.join(missing)}{hint}, without which {_UNKNOWN[name]} is not known"
                yield FieldProblem((name,), reason)

    @staticmethod
    def example(joint_type: str) -> dict[str, float]:
        """Return plausible values of the fields, for a new robot file."""
        revolute = joint_type == "revolute"
        return {"inertia": 0.5, "damping": 0.01} if revolute else {"inertia": 10, "damping": 0.1}

    @property
    def _gear_ratio_or_one(self) -> float:
        """Gear ratio; 1 without a gear."""
        return 1.0 if self.gear_ratio is None else self.gear_ratio

    @property
    def ratio_of_side(self) -> float:
        """Motion of the declared side over that on the joint side: 1 or the gear ratio."""
        return 1.0 if self.side == JOINT else self._gear_ratio_or_one

    @cached_property
    def at_joint(self) -> JointMotor:
        """Motor on the joint side: inertia and damping times the ratio squared, torques times the ratio."""
        ratio = self._gear_ratio_or_one
        return JointMotor(
            **self._reflected_values(self.ratio_of_side),
            gear_ratio=self.gear_ratio,
            torque_constant=None if self.torque_constant is None else ratio * self.torque_constant,
            resistance=self.resistance,
            max_current=self.max_current,
            max_voltage=self.max_voltage,
        )

    def _reflected_values(self, signed_ratio: float) -> dict[str, Any]:
        """Return the values beyond a gear whose declared side moves `signed_ratio` times as far."""
        ratio = abs(signed_ratio)
        return {
            "inertia": self.inertia * ratio * ratio,
            "damping": self.damping * ratio * ratio,
            "max_torque": self.max_torque * ratio,
            "max_velocity": self.max_velocity / ratio,
            "friction": self.friction and self.friction.geared(signed_ratio),
        }


def _constant_texts(values: Mapping[str, Any]) -> Iterator[tuple[str, Quantity, str]]:
    """Yield name, quantity and text of the values of `_REFLECTED` that are neither zero nor infinite."""
    friction = values["friction"] or NO_FRICTION
    for name, quantity in _REFLECTED.items():
        field = name.removeprefix("friction.")
        numbers = values[name] if field == name else getattr(friction, field)
        distinct_numbers = dict.fromkeys(numbers if isinstance(numbers, tuple) else (numbers,))
        if any(0 < abs(number) < math.inf for number in distinct_numbers):
            texts = [f"{number:.4g}" for number in distinct_numbers]
            yield name, quantity, texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"


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
        constants = cls.over_samples(motors)
        return constants and cls(*(values[:, 0] for values in constants))

    @classmethod
    def over_samples(cls, motors: Sequence[JointMotor | None]) -> Windings | None:
        """Return the constants, one entry per motor on the first axis, before one of samples; see `of`."""
        rows = [[getattr(motor, name, None) for name in cls._fields] for motor in motors]
        if all(constant is None for constant, _ in rows):
            return None
        filled_rows = [[math.nan if value is None else value for value in row] for row in rows]
        return cls(*map(stack_constants, zip(*filled_rows, strict=True)))

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
