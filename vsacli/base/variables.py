"""The variables of a result, each declared once: dimensions, unit, long name, equation.

The declaration feeds the pipeline, the HDF5 attributes, the CSV headers, the plots and the documentation.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from vsacli.base import units
from vsacli.base.arrays import AnyArray, FlagArray, FloatArray, of_joint
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, Problem
from vsacli.base.units import Quantity
from vsacli.base.wrench import wrench_columns

MOTORS = (1, 2)
VARIABLE_STIFFNESS = ("antagonistic",)
COMPLIANT = (*VARIABLE_STIFFNESS, "elastic")
EVERY_ACTUATOR = (*COMPLIANT, "rigid")


class Variable(NamedTuple):
    """What is declared of a result variable.

    Attributes:
        name: as in the file and in Python.
        dims: dimensions after `time`: (), ("joint",), ("joint", "motor") or ("wrench_axis",).
        quantity: unit at revolute and prismatic joints, or of moments and forces.
        long_name: a few words.
        equation: number in Buondonno & De Luca (2016), or where the value comes from.
        actuators: the types of actuator whose joints have it; at the others it is NaN.
        geared: the power of a motor's gear ratio by which the value is larger on the motor's shaft.
    """

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str
    equation: str
    actuators: tuple[str, ...] = EVERY_ACTUATOR
    geared: int = 0


def _variable(
    dims: tuple[str, ...],
    quantity: Quantity,
    long_name: str,
    equation: str,
    default: Any = dataclasses.MISSING,
    actuators: tuple[str, ...] = EVERY_ACTUATOR,
    geared: int = 0,
) -> Any:
    metadata = {
        "dims": dims,
        "quantity": quantity,
        "long_name": long_name,
        "equation": equation,
        "actuators": actuators,
        "geared": geared,
    }
    return dataclasses.field(default=default, kw_only=True, metadata=metadata)


def _of_joint(
    quantity: Quantity, long_name: str, equation: str, actuators: tuple[str, ...] = EVERY_ACTUATOR
) -> Any:
    return _variable(("joint",), quantity, long_name, equation, actuators=actuators)


def _of_motor(
    quantity: Quantity, long_name: str, equation: str, default: Any = dataclasses.MISSING, geared: int = 0
) -> Any:
    return _variable(("joint", "motor"), quantity, long_name, equation, default, geared=geared)


def _of_wrench(quantity: Quantity, long_name: str) -> Any:
    return _variable(("wrench_axis",), quantity, long_name, "given", default=None)


@dataclass(frozen=True, eq=False)
class Block:
    """Every variable over a block of consecutive steps; shapes (samples, joints) or (samples, joints, 2).

    A value that cannot be computed is NaN, and `flags` says why; one that the joint's actuator does not have
    is NaN throughout. The wrench, (samples, 6), is None if the trajectory has none, and `motor_energy`, which
    sums over the steps before, until the block has its place in a run.
    """

    time: FloatArray = _variable((), units.TIME, "time", "given")

    q: FloatArray = _of_joint(units.POSITION, "commanded joint position", "given")
    dq: FloatArray = _of_joint(units.VELOCITY, "commanded joint velocity", "given")
    ddq: FloatArray = _of_joint(units.JOINT_ACCELERATION, "commanded joint acceleration", "given")
    d3q: FloatArray = _of_joint(units.JERK, "commanded joint jerk", "given")
    d4q: FloatArray = _of_joint(units.SNAP, "commanded joint snap", "given")

    stiffness: FloatArray = _of_joint(units.STIFFNESS, "commanded joint stiffness", "given", COMPLIANT)
    dstiffness: FloatArray = _of_joint(
        units.STIFFNESS_RATE, "rate of the commanded stiffness", "given", COMPLIANT
    )
    ddstiffness: FloatArray = _of_joint(
        units.STIFFNESS_ACCELERATION, "second derivative of the commanded stiffness", "given", COMPLIANT
    )

    wrench: FloatArray | None = _of_wrench(units.WRENCH, "wrench exerted on the end effector")
    dwrench: FloatArray | None = _of_wrench(units.WRENCH_RATE, "rate of the wrench")
    ddwrench: FloatArray | None = _of_wrench(units.WRENCH_ACCELERATION, "second derivative of the wrench")

    tau_e: FloatArray = _of_joint(units.TORQUE, "total elastic torque", "(58)")
    dtau_e: FloatArray = _of_joint(units.TORQUE_RATE, "rate of the elastic torque", "(59)")
    ddtau_e: FloatArray = _of_joint(
        units.TORQUE_ACCELERATION, "second derivative of the elastic torque", "(60)"
    )

    phi: FloatArray = _of_motor(units.POSITION, "deflection theta - q of each transmission", "(61)")
    dphi: FloatArray = _of_motor(units.VELOCITY, "deflection rate", "(68)")
    theta: FloatArray = _of_motor(units.POSITION, "motor position, joint side of the gear", "(69)", geared=1)
    dtheta: FloatArray = _of_motor(units.VELOCITY, "motor velocity, joint side of the gear", "(69)", geared=1)
    ddtheta: FloatArray = _of_motor(
        units.JOINT_ACCELERATION, "motor acceleration, joint side of the gear", "(72)", geared=1
    )
    tau_spring: FloatArray = _of_motor(units.TORQUE, "torque of each transmission", "(62)")
    tau_motor: FloatArray = _of_motor(
        units.TORQUE, "motor torque, joint side of the gear", "(73)-(74)", geared=-1
    )

    elastic_energy: FloatArray = _of_joint(
        units.ENERGY, "energy in the springs of the joint", "integral of (62)"
    )
    motor_power: FloatArray = _of_motor(units.POWER, "mechanical power of the motor", "tau_motor * dtheta")
    motor_energy: FloatArray | None = _of_motor(
        units.ENERGY,
        "mechanical work of the motor since the first step",
        "integral of motor_power",
        default=None,
    )

    det_A: FloatArray = _of_joint(  # noqa: N815  (the published name)
        units.DECOUPLING, "determinant of the decoupling block of the joint", "(67)", VARIABLE_STIFFNESS
    )
    stiffness_lower: FloatArray = _of_joint(
        units.STIFFNESS,
        "smallest stiffness reachable at this elastic torque on the joint's branch",
        "(14)",
        VARIABLE_STIFFNESS,
    )
    stiffness_upper: FloatArray = _of_joint(
        units.STIFFNESS,
        "largest stiffness reachable at this elastic torque on the joint's branch",
        "(14)",
        VARIABLE_STIFFNESS,
    )
    flags: FlagArray = _of_joint(
        units.DIMENSIONLESS, "what is wrong with this step of the joint", "margins of (14)"
    )

    def of_joint(self, index: int) -> dict[str, AnyArray]:
        """The variables of one joint by name, (samples,), those of its motors (2, samples)."""
        joints = (name for name, variable in VARIABLES.items() if "joint" in variable.dims)
        there = {name: array for name in joints if (array := getattr(self, name)) is not None}
        return of_joint(there, index)

    def arrays(self) -> dict[str, AnyArray]:
        """The variables there are, by name."""
        return {name: array for name in VARIABLES if (array := getattr(self, name)) is not None}


VARIABLES: dict[str, Variable] = {
    field.name: Variable(field.name, **field.metadata) for field in dataclasses.fields(Block)
}
"""Every variable by name, `time` first."""


def select_variables(
    names: Iterable[str], declared: Mapping[str, Variable] = VARIABLES
) -> tuple[Variable, ...]:
    """The variables of these names, in declared order, `time` left out.

    Raises:
        InputError: for each name that is no variable, the nearest one that is.
    """
    wanted = set(names)
    unknown = sorted(wanted - set(declared))
    if unknown:
        raise InputError(
            Problem("", 0, f"no variable is called {name!r}{did_you_mean(name, declared)}")
            for name in unknown
        )
    return tuple(variable for name, variable in declared.items() if name in wanted and variable.dims)


def existing(variable: Variable, actuators: Iterable[str]) -> list[list[bool]]:
    """Which columns of a variable of joints exist, for each joint with one of these types of actuator."""
    motors = MOTORS if "motor" in variable.dims else MOTORS[:1]
    return [
        [
            actuator in variable.actuators and (motor == MOTORS[0] or actuator in VARIABLE_STIFFNESS)
            for motor in motors
        ]
        for actuator in actuators
    ]


def column_names(variable: Variable, joint_names: Iterable[str]) -> list[str]:
    """CSV headers of a variable, in the order of its flattened values, e.g. `elbow.tau_motor_1`."""
    if "wrench_axis" in variable.dims:
        return wrench_columns(variable.name)
    endings = [f"_{motor}" for motor in MOTORS] if "motor" in variable.dims else [""]
    return [f"{joint}.{variable.name}{ending}" for joint in joint_names for ending in endings]
