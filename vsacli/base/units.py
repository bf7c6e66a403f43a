"""Units of joint quantities, which differ between revolute and prismatic joints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A joint quantity and its SI unit at a revolute and at a prismatic joint."""

    revolute: str
    prismatic: str

    def unit(self, joint_type: str) -> str:
        """Return the unit at a joint of type `revolute` or `prismatic`."""
        return self.revolute if joint_type == "revolute" else self.prismatic

    def of_component(self, index: int, joint_types: Sequence[str]) -> str:
        """Return the unit at a joint, or along an axis of a wrench."""
        return self.unit(joint_types[index])

    def of_axis(self, _column: int) -> str:
        """Return the unit of a column of a variable that is not one of joints."""
        return self.revolute

    def inside(self, variant: str | None) -> Quantity:
        """Return the quantity in a record with a unit variant of its own; None is that of the joint."""
        return self if variant is None else constant(self.unit(variant))

    def __str__(self) -> str:
        if self.revolute == self.prismatic:
            return self.revolute
        return f"{self.revolute} ({self.prismatic} if prismatic)"


class GearQuantity(Quantity):
    """A quantity that relates both sides of a gear; its unit is the joint's in any record."""

    def inside(self, _variant: str | None) -> Quantity:
        """Return the quantity itself."""
        return self


class WrenchQuantity(Quantity):
    """A wrench or a rate of it; its moments have the unit `revolute`, its forces the unit `prismatic`."""

    def unit(self, _joint_type: str) -> str:
        """Return both units, whatever the joint."""
        return str(self)

    def of_component(self, index: int, _joint_types: Sequence[str]) -> str:
        """See `Quantity.of_component`."""
        return self.of_axis(index)

    def of_axis(self, column: int) -> str:
        """Return the unit of a component: three forces, then three moments, of each tool in turn."""
        return self.prismatic if column % 6 < 3 else self.revolute

    @property
    def attributes(self) -> dict[str, str]:
        """Units in files, by attribute."""
        return {"units": "see wrench_axis", "units_force": self.prismatic, "units_moment": self.revolute}

    def __str__(self) -> str:
        return f"{self.prismatic} (forces), {self.revolute} (moments)"


class ComplianceQuantity(WrenchQuantity):
    """A compliance: translation and rotation, each per force and moment, in the order of its 36 entries."""

    def of_axis(self, column: int) -> str:
        """Return the unit of an entry, row by row."""
        row, axis = divmod(column % 36, 6)
        displacement, wrench = "m" if row < 3 else "rad", "N" if axis < 3 else "(N m)"
        return f"{displacement}/{wrench}"

    @property
    def attributes(self) -> dict[str, str]:
        """See `WrenchQuantity.attributes`."""
        entry_by_name = {
            "translation_force": 0,
            "translation_moment": 3,
            "rotation_force": 18,
            "rotation_moment": 21,
        }
        units = {f"units_{name}": self.of_axis(axis) for name, axis in entry_by_name.items()}
        return {"units": "see displacement_axis and wrench_axis", **units}

    def __str__(self) -> str:
        return "m/N and m/(N m) (translation), rad/N and rad/(N m) (rotation)"


def units_of(quantity: Quantity, joint_types: Iterable[str]) -> str:
    """Return the unit of a quantity; of both types of joints where there are both."""
    return in_header(map(quantity.unit, joint_types))


def in_header(units: Iterable[str]) -> str:
    """Return the units of a column for its header, each once."""
    return " | ".join(dict.fromkeys(units))


def time_text(time: float) -> str:
    """Return a time with its unit, to milliseconds, or to microseconds where it is no multiple of 1 ms."""
    return f"{time:.3f} s" if abs(time - round(time, 3)) < 5e-7 else f"{time:.6f} s"


def constant(unit: str) -> Quantity:
    """Return a quantity whose unit is the same at every joint."""
    return Quantity(unit, unit)


TIME = constant("s")
ANGLE = constant("rad")
LENGTH = constant("m")
MASS = constant("kg")
INERTIA = constant("kg m^2")
ACCELERATION = constant("m/s^2")
RATE = constant("1/s")
DIMENSIONLESS = constant("1")
ANY_SI_UNIT = constant("SI units")

POSITION = Quantity("rad", "m")
VELOCITY = Quantity("rad/s", "m/s")
JOINT_ACCELERATION = Quantity("rad/s^2", "m/s^2")
JERK = Quantity("rad/s^3", "m/s^3")
SNAP = Quantity("rad/s^4", "m/s^4")
TORQUE = Quantity("N m", "N")
TORQUE_RATE = Quantity("N m/s", "N/s")
TORQUE_ACCELERATION = Quantity("N m/s^2", "N/s^2")
WRENCH = WrenchQuantity("N m", "N")
WRENCH_RATE = WrenchQuantity("N m/s", "N/s")
WRENCH_ACCELERATION = WrenchQuantity("N m/s^2", "N/s^2")
LEAD = Quantity("m/rad", "1")
LINEAR_STIFFNESS = constant("N/m")
COMPLIANCE = ComplianceQuantity("rad/(N m)", "m/N")
STIFFNESS = Quantity("N m/rad", "N/m")
STIFFNESS_RATE = Quantity("N m/(rad s)", "N/(m s)")
STIFFNESS_ACCELERATION = Quantity("N m/(rad s^2)", "N/(m s^2)")
CUBIC_STIFFNESS = Quantity("N m/rad^3", "N/m^3")
INVERSE_POSITION = Quantity("1/rad", "1/m")
QUADRATIC_STIFFNESS = Quantity("N m/rad^2", "N/m^2")
FIFTH_STIFFNESS = Quantity("N m/rad^5", "N/m^5")
SEVENTH_STIFFNESS = Quantity("N m/rad^7", "N/m^7")
NINTH_STIFFNESS = Quantity("N m/rad^9", "N/m^9")
DAMPING = Quantity("N m s/rad", "N s/m")
DAMPING_RATE = Quantity("N m/rad", "N/m")
DAMPING_ACCELERATION = Quantity("N m/(rad s)", "N/(m s)")
MOTOR_INERTIA = Quantity("kg m^2", "kg")
GEAR_RATIO = GearQuantity("1", "rad/m")
ENERGY = constant("J")
POWER = constant("W")
CURRENT = constant("A")
VOLTAGE = constant("V")
RESISTANCE = constant("ohm")
TORQUE_CONSTANT = constant("N m/A")
JOINT_TORQUE_CONSTANT = Quantity("N m/A", "N/A")
DECOUPLING = Quantity("N^2 m^2/rad^3", "N^2/m^3")
