"""A catalog of motors: a CSV file with data sheet values, on the motor's own shaft."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass

from vsacli.base import units
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
from vsacli.studies.sizing.shaft import Shaft

_TORQUE, _VELOCITY, _DAMPING = (
    units.constant(quantity.revolute) for quantity in (units.TORQUE, units.VELOCITY, units.DAMPING)
)
"""Units of a rotating shaft, also at prismatic joints."""
_SHARE = Check(lambda value: 0 < value <= 1, "above 0 and at most 1")
_BEARING = ("continuous_torque", "max_torque", "continuous_current", "max_current")
_NEEDED = {
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
        check=_SHARE,
        default=1.0,
    )
    mass: float | None = number(units.MASS, "mass of the motor with its gear", check=POSITIVE, default=None)

    def _problems(self) -> Iterator[FieldProblem]:
        yield from (*self._missing(), *self._stuck())

    def _missing(self) -> Iterator[FieldProblem]:
        """Yield the columns that others require."""
        for name, needed in _NEEDED.items():
            missing = [key for key in needed if getattr(self, key) is None]
            if getattr(self, name) is not None and missing:
                yield FieldProblem((name,), f"needs {' and '.join(missing)}, too")
        if all(getattr(self, name) is None for name in _BEARING):
            columns = f"{', '.join(_BEARING[:-1])} or {_BEARING[-1]}"
            yield FieldProblem((), f"motor {self.name!r} has no torque limit; give {columns}")

    def _stuck(self) -> Iterator[FieldProblem]:
        """Yield a problem if the motor cannot overcome its friction, by torque or voltage."""
        if self.coulomb and not list(self._missing()) and self.coulomb >= self.shaft.stall_torque:
            reason = f"must be below the {self.shaft.stall_torque:.4g} N m that the motor can give at all"
            yield FieldProblem(("coulomb",), reason)

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
            max_torque=_smallest(self.max_torque, self.max_current, constant),
            continuous_torque=_smallest(self.continuous_torque, self.continuous_current, constant),
            max_velocity=_or_infinite(self.max_velocity),
            max_voltage=_or_infinite(self.max_voltage),
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


def _or_infinite(bound: float | None) -> float:
    return math.inf if bound is None else bound


def _smallest(torque: float | None, current: float | None, constant: float) -> float:
    """Return the smaller of a torque limit and the torque at a current limit."""
    by_current = math.inf if current is None else current * constant
    return min(_or_infinite(torque), by_current)
