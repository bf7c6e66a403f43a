"""The variables of a result, each declared once: dimensions, unit, long name, equation.

The declaration feeds the pipeline, the HDF5 attributes, the CSV headers, the plots and the documentation.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from vsacli import units
from vsacli.arrays import FlagArray, FloatArray
from vsacli.errors import InputError
from vsacli.suggestions import did_you_mean
from vsacli.units import Quantity

MOTORS = (1, 2)


@dataclass(frozen=True)
class Variable:
    """What is declared of a result variable.

    Attributes:
        name: as in the file and in Python.
        dims: dimensions after `time`: () , ("joint",) or ("joint", "motor").
        quantity: unit at revolute and prismatic joints.
        long_name: a few words.
        equation: number in Buondonno & De Luca (2016), or where the value comes from.
    """

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str
    equation: str


def _variable(dims: tuple[str, ...], quantity: Quantity, long_name: str, equation: str) -> Any:
    return dataclasses.field(
        kw_only=True, metadata={"dims": dims, "quantity": quantity, "long_name": long_name, "equation": equation}
    )


def _of_joint(quantity: Quantity, long_name: str, equation: str) -> Any:
    return _variable(("joint",), quantity, long_name, equation)


def _of_motor(quantity: Quantity, long_name: str, equation: str) -> Any:
    return _variable(("joint", "motor"), quantity, long_name, equation)


@dataclass(frozen=True)
class Block:
    """Every variable over a block of consecutive steps; shapes (samples, joints) or (samples, joints, 2).

    A value that cannot be computed is NaN, and `flags` says why.
    """

    time: FloatArray = _variable((), units.TIME, "time", "given")

    q: FloatArray = _of_joint(units.POSITION, "commanded joint position", "given")
    dq: FloatArray = _of_joint(units.VELOCITY, "commanded joint velocity", "given")
    ddq: FloatArray = _of_joint(units.JOINT_ACCELERATION, "commanded joint acceleration", "given")
    d3q: FloatArray = _of_joint(units.JERK, "commanded joint jerk", "given")
    d4q: FloatArray = _of_joint(units.SNAP, "commanded joint snap", "given")

    stiffness: FloatArray = _of_joint(units.STIFFNESS, "commanded joint stiffness", "given")
    dstiffness: FloatArray = _of_joint(units.STIFFNESS_RATE, "rate of the commanded stiffness", "given")
    ddstiffness: FloatArray = _of_joint(
        units.STIFFNESS_ACCELERATION, "second derivative of the commanded stiffness", "given"
    )

    tau_e: FloatArray = _of_joint(units.TORQUE, "total elastic torque", "(58)")
    dtau_e: FloatArray = _of_joint(units.TORQUE_RATE, "rate of the elastic torque", "(59)")
    ddtau_e: FloatArray = _of_joint(units.TORQUE_ACCELERATION, "second derivative of the elastic torque", "(60)")

    phi: FloatArray = _of_motor(units.POSITION, "deflection theta - q of each transmission", "(61)")
    dphi: FloatArray = _of_motor(units.VELOCITY, "deflection rate", "(68)")
    theta: FloatArray = _of_motor(units.POSITION, "motor position, joint side of the gear", "(69)")
    dtheta: FloatArray = _of_motor(units.VELOCITY, "motor velocity, joint side of the gear", "(69)")
    ddtheta: FloatArray = _of_motor(units.JOINT_ACCELERATION, "motor acceleration, joint side of the gear", "(72)")
    tau_spring: FloatArray = _of_motor(units.TORQUE, "torque of each transmission", "(62)")
    tau_motor: FloatArray = _of_motor(units.TORQUE, "motor torque, joint side of the gear", "(73)-(74)")

    det_A: FloatArray = _of_joint(  # noqa: N815  (the published name)
        units.DECOUPLING, "determinant of the decoupling block of the joint", "(67)"
    )
    stiffness_lower: FloatArray = _of_joint(
        units.STIFFNESS, "smallest stiffness reachable at this elastic torque on the joint's branch", "(14)"
    )
    stiffness_upper: FloatArray = _of_joint(
        units.STIFFNESS, "largest stiffness reachable at this elastic torque on the joint's branch", "(14)"
    )
    flags: FlagArray = _of_joint(units.DIMENSIONLESS, "what is wrong with this step of the joint", "margins of (14)")


VARIABLES: dict[str, Variable] = {
    field.name: Variable(field.name, **field.metadata) for field in dataclasses.fields(Block)
}
"""Every variable by name, `time` first."""


def select_variables(names: Iterable[str]) -> tuple[Variable, ...]:
    """The variables of these names, in declared order, `time` left out.

    Raises:
        InputError: a name that is no variable, with the nearest one that is.
    """
    wanted = set(names)
    unknown = sorted(wanted - set(VARIABLES))
    if unknown:
        raise InputError.one(f"no variable is called {unknown[0]!r}{did_you_mean(unknown[0], VARIABLES)}")
    return tuple(variable for name, variable in VARIABLES.items() if name in wanted and variable.dims)


def column_names(variable: Variable, joint_names: Iterable[str]) -> list[str]:
    """CSV headers of a variable, in the order of its flattened values, e.g. `elbow.tau_motor_1`."""
    endings = [f"_{motor}" for motor in MOTORS] if "motor" in variable.dims else [""]
    return [f"{joint}.{variable.name}{ending}" for joint in joint_names for ending in endings]
