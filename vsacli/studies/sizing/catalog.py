"""Motors: their constants on their own side of the gear, and catalogs of them, CSV files with a row for each.

With the ratio n, a motor that moves by theta on the joint side turns by n theta. On its shaft it exerts

    tau = n (J theta'' + D theta') + friction + load/n

where load is the torque of the springs and a damper against it on the joint side. This is (73)-(74) divided
by n: neither motion nor load depend on the motor. So its torque is a sum of seven signals of the motion, with
coefficients of motor and gear. The efficiency of a gear makes a driven load larger, and a braked one smaller.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from vsacli.actuators.friction import NO_FRICTION, sign_of_motion
from vsacli.actuators.motor import JointMotor
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import (
    NON_NEGATIVE,
    POSITIVE,
    Check,
    Name,
    number,
    value,
)
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.record_table import RecordTable, read_records

LIMITS = ("torque", "continuous_torque", "velocity", "voltage")
"""Limits of a motor: peak and rms torque (both also by current), speed and voltage."""


class Shaft(NamedTuple):
    """Constants of a motor, or of several, (motors,), in SI units; missing limits are infinite.

    Attributes:
        inertia: inertia of the rotor.
        damping: viscous damping.
        backward, forward: dry friction while the joint side moves in that direction.
        offset: constant part of the friction torque.
        max_torque: limit of the peak torque, from torque and current.
        continuous_torque: limit of the rms torque, from torque and current.
        max_velocity: limit of the shaft's speed.
        max_voltage: limit of the voltage of the windings.
        torque_constant: torque over current; NaN if unknown.
        resistance: resistance of the windings; NaN if unknown.
        efficiency: efficiency of the gear.
    """

    inertia: Any
    damping: Any
    backward: Any
    forward: Any
    offset: Any
    max_torque: Any
    continuous_torque: Any
    max_velocity: Any
    max_voltage: Any
    torque_constant: Any
    resistance: Any
    efficiency: Any

    @classmethod
    def of(cls, shafts: Iterable[Self]) -> Self:
        """Stack the constants of several motors."""
        return cls(*(np.array(column, dtype=float) for column in zip(*shafts, strict=True)))

    @classmethod
    def of_joint_motor(cls, motor: JointMotor) -> Self:
        """Return the shaft of a robot's own motor, on the joint side if its gear is unknown."""
        ratio = abs(motor.gear_ratio or 1.0)
        friction = motor.friction or NO_FRICTION
        torque_constant = math.nan if motor.torque_constant is None else abs(motor.torque_constant) / ratio
        by_current = math.inf if motor.max_current is None else motor.max_current * torque_constant
        return cls(
            inertia=motor.inertia / ratio**2,
            damping=motor.damping / ratio**2,
            backward=friction.coulomb[0] / ratio,
            forward=friction.coulomb[1] / ratio,
            offset=friction.offset / ratio,
            max_torque=min(motor.max_torque / ratio, by_current),
            continuous_torque=math.inf,
            max_velocity=motor.max_velocity * ratio,
            max_voltage=math.inf if motor.max_voltage is None else motor.max_voltage,
            torque_constant=torque_constant,
            resistance=math.nan if motor.resistance is None else motor.resistance,
            efficiency=1.0,
        )

    @property
    def bounds(self) -> dict[str, Any]:
        """Limits by name."""
        bounds = (self.max_torque, self.continuous_torque, self.max_velocity, self.max_voltage)
        return dict(zip(LIMITS, bounds, strict=True))

    @property
    def limited(self) -> tuple[str, ...]:
        """Names of the finite limits, for one motor."""
        return tuple(name for name, bound in self.bounds.items() if math.isfinite(bound))

    @property
    def stall_torque(self) -> float:
        """Largest torque at rest, limited by torque, current and voltage."""
        by_voltage = self.max_voltage / self.volts_per_torque if self.volts_per_torque else math.inf
        return float(min(self.max_torque, by_voltage))

    @property
    def volts_per_torque(self) -> Any:
        """Resistance over torque constant, V/(N m); 0 without a voltage limit."""
        return np.where(np.isfinite(self.max_voltage), self.resistance / self.torque_constant, 0.0)

    @property
    def volts_per_speed(self) -> Any:
        """Torque constant, V s/rad; 0 without a voltage limit."""
        return np.where(np.isfinite(self.max_voltage), self.torque_constant, 0.0)

    @property
    def heat_per_torque(self) -> Any:
        """Copper loss over the square of the torque, W/(N m)^2; NaN if unknown."""
        return self.resistance / self.torque_constant**2

    @property
    def inertial(self) -> FloatArray:
        """Coefficients of the seven signals in the part proportional to the ratio, (motors, 7)."""
        return self._coefficients(self.inertia, self.damping, 0, 0, 0, 0, 0)

    @property
    def frictional(self) -> FloatArray:
        """Coefficients of the part independent of the ratio, (motors, 7)."""
        return self._coefficients(0, 0, -self.backward, self.forward, self.offset, 0, 0)

    @property
    def loaded(self) -> FloatArray:
        """Coefficients of the part inversely proportional to the ratio, (motors, 7)."""
        return self._coefficients(0, 0, 0, 0, 0, 1 / self.efficiency, self.efficiency)

    def _coefficients(self, *columns: Any) -> FloatArray:
        return np.stack(np.broadcast_arrays(np.zeros_like(self.inertia), *columns)[1:], axis=-1)

    def coefficients(self, ratio: FloatArray) -> FloatArray:
        """Return the coefficients of the torque on the shaft, (motors, 7), for ratios (motors,)."""
        ratio_column = np.asarray(ratio)[..., None]
        return ratio_column * self.inertial + self.frictional + self.loaded / ratio_column


def shaft_signals(velocity: FloatArray, acceleration: FloatArray, load: FloatArray) -> FloatArray:
    """Return the seven signals of a demand, (7, samples), from joint-side values, each (samples,).

    They are acceleration, velocity, 1 while moving backward, 1 while moving forward, 1, the driven load, and
    the braked load. At rest a load counts as driven.
    """
    direction = sign_of_motion(velocity)
    driven = direction * load >= 0
    return np.stack(
        (
            acceleration,
            velocity,
            (direction < 0).astype(float),
            (direction > 0).astype(float),
            np.ones_like(load),
            np.where(driven, load, 0.0),
            np.where(driven, 0.0, load),
        )
    )


_TORQUE, _VELOCITY, _DAMPING = (
    units.constant(quantity.revolute) for quantity in (units.TORQUE, units.VELOCITY, units.DAMPING)
)
"""Units of a rotating shaft, also at prismatic joints."""
_EFFICIENCY_CHECK = Check(lambda value: 0 < value <= 1, "above 0 and at most 1")
_TORQUE_LIMITS = ("continuous_torque", "max_torque", "continuous_current", "max_current")
_REQUIRED_COLUMNS = {
    "resistance": ("torque_constant",),
    "continuous_current": ("torque_constant",),
    "max_current": ("torque_constant",),
    "max_voltage": ("torque_constant", "resistance"),
}
"""Columns that a column requires."""


@dataclass(frozen=True)
class CatalogMotor(DeclaredRecord):
    """A motor of a catalog, which may already have a gear."""

    name: str = value(Name(), "name of the motor, unique in the file")
    inertia: float = number(units.INERTIA, "inertia of the rotor", check=POSITIVE)
    continuous_torque: float | None = number(
        _TORQUE, "largest root mean square of the torque", check=POSITIVE, default=None
    )
    max_torque: float | None = number(_TORQUE, "largest |torque|", check=POSITIVE, default=None)
    max_velocity: float | None = number(_VELOCITY, "largest |speed|", check=POSITIVE, default=None)
    torque_constant: float | None = number(
        units.TORQUE_CONSTANT,
        "ratio of torque to current, and so of voltage to speed",
        check=POSITIVE,
        default=None,
    )
    resistance: float | None = number(
        units.RESISTANCE,
        "resistance of the windings; requires torque_constant",
        check=NON_NEGATIVE,
        default=None,
    )
    continuous_current: float | None = number(
        units.CURRENT,
        "largest root mean square of the current; requires torque_constant",
        check=POSITIVE,
        default=None,
    )
    max_current: float | None = number(
        units.CURRENT, "largest |current|; requires torque_constant", check=POSITIVE, default=None
    )
    max_voltage: float | None = number(
        units.VOLTAGE,
        "largest |voltage|; requires torque_constant and resistance",
        check=POSITIVE,
        default=None,
    )
    damping: float = number(_DAMPING, "viscous damping", check=NON_NEGATIVE, default=0.0)
    coulomb: float = number(_TORQUE, "dry friction against the motion", check=NON_NEGATIVE, default=0.0)
    gear_ratio: float | None = number(
        units.GEAR_RATIO,
        "gear ratio: turns of the motor per turn of the joint, or rad per m, if the motor has a "
        "gear; else gear ratios are chosen",
        check=POSITIVE,
        default=None,
    )
    gear_efficiency: float = number(
        units.DIMENSIONLESS,
        "efficiency of the gear, the same in both directions",
        check=_EFFICIENCY_CHECK,
        default=1.0,
    )
    mass: float | None = number(units.MASS, "mass of the motor with its gear", check=POSITIVE, default=None)

    def _problems(self) -> Iterator[FieldProblem]:
        yield from (*self._missing_columns(), *self._stall_problems())

    def _missing_columns(self) -> Iterator[FieldProblem]:
        """Yield the columns that others require."""
        for name, required_columns in _REQUIRED_COLUMNS.items():
            missing = [key for key in required_columns if getattr(self, key) is None]
            if getattr(self, name) is not None and missing:
                yield FieldProblem((name,), f"needs {' and '.join(missing)}, too")
        if all(getattr(self, name) is None for name in _TORQUE_LIMITS):
            columns = f"{', '.join(_TORQUE_LIMITS[:-1])} or {_TORQUE_LIMITS[-1]}"
            yield FieldProblem((), f"motor {self.name!r} has no torque limit; give {columns}")

    def _stall_problems(self) -> Iterator[FieldProblem]:
        """Yield a problem if the motor cannot overcome its friction, by torque or voltage."""
        if self.coulomb and not list(self._missing_columns()) and self.coulomb >= self.shaft.stall_torque:
            message = f"must be below the {self.shaft.stall_torque:.4g} N m that the motor can give at all"
            yield FieldProblem(("coulomb",), message)

    @property
    def shaft(self) -> Shaft:
        """Constants of the motor."""
        constant = math.nan if self.torque_constant is None else self.torque_constant
        return Shaft(
            inertia=self.inertia,
            damping=self.damping,
            backward=self.coulomb,
            forward=self.coulomb,
            offset=0.0,
            max_torque=_effective_torque_limit(self.max_torque, self.max_current, constant),
            continuous_torque=_effective_torque_limit(
                self.continuous_torque, self.continuous_current, constant
            ),
            max_velocity=_infinite_if_none(self.max_velocity),
            max_voltage=_infinite_if_none(self.max_voltage),
            torque_constant=constant,
            resistance=math.nan if self.resistance is None else self.resistance,
            efficiency=self.gear_efficiency,
        )


def read_catalog(path: str | os.PathLike[str]) -> RecordTable[CatalogMotor]:
    """Read the motors of a catalog.

    Raises:
        InputError: the file is wrong; with file and line of every problem.
    """
    return read_records(path, CatalogMotor, "name")


def _infinite_if_none(bound: float | None) -> float:
    return math.inf if bound is None else bound


def _effective_torque_limit(torque: float | None, current: float | None, constant: float) -> float:
    """Return the smaller of a torque limit and the torque at a current limit."""
    by_current = math.inf if current is None else current * constant
    return min(_infinite_if_none(torque), by_current)
