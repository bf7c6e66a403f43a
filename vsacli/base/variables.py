"""The variables of a result, each declared once: dimensions, unit, long name, equation.

The declaration feeds the pipeline, the HDF5 attributes, the CSV headers, the plots and the documentation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, ClassVar, NamedTuple, Self

from vsacli.base import units
from vsacli.base.arrays import AnyArray, of_joint
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, Problem
from vsacli.base.renamed import now_called
from vsacli.base.signals import COMMANDED, DAMPING, POSITION, STIFFNESS, WRENCH, Signal
from vsacli.base.units import Quantity
from vsacli.base.wrench import wrench_columns

MOTORS = (1, 2)
SPRINGS = "springs"
"""Requirement of variables that only joints with springs have, commanded signals apart."""

MOTOR_CONSTANTS = ("torque_constant", "resistance")
"""Constants of a motor that it must have to have a variable."""

LOSSES = "friction"
"""Requirement of the variables of losses: friction or damping anywhere in the robot."""

OF_ANY_ROBOT = (None, SPRINGS, STIFFNESS.key)
"""Requirements of variables that every result has, NaN where a joint does not meet them. Variables with other
requirements are left out of a result if no joint of the robot meets them."""


class Variable(NamedTuple):
    """A result variable as declared.

    Attributes:
        name: as in the file and in Python.
        dims: dimensions after `time`: (), ("joint",), ("joint", "motor") or ("wrench_axis",).
        quantity: unit at revolute and prismatic joints, or of moments and forces.
        long_name: a few words.
        equation: number in Buondonno & De Luca (2016), or where the value comes from.
        requires: condition on the joint, `SPRINGS`, a commanded signal by key, one of
            `MOTOR_CONSTANTS`; else it is NaN. `LOSSES` all joints have if any has friction.
        geared: the power of a motor's gear ratio by which the value is larger on the motor's shaft.
    """

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str
    equation: str
    requires: str | None = None
    geared: int = 0


def _of_signal(signal: Signal, dim: str, requires: str | None = None) -> Iterator[Variable]:
    for name, quantity, long_name in zip(signal.names, signal.quantities, signal.long_names, strict=True):
        yield Variable(name, (dim,), quantity, long_name, "given", requires)


def _given() -> Iterator[Variable]:
    yield Variable("time", (), units.TIME, "time", "given")
    yield from _of_signal(POSITION, "joint")
    for signal in COMMANDED.values():
        # springs whose stiffness is not commanded have one of their own
        yield from _of_signal(signal, "joint", SPRINGS if signal is STIFFNESS else signal.key)
    yield from _of_signal(WRENCH, "wrench_axis")


_JOINT, _MOTOR = ("joint",), ("joint", "motor")

_COMPUTED = (
    Variable("tau_e", _JOINT, units.TORQUE, "total elastic torque", "(58)"),
    Variable("dtau_e", _JOINT, units.TORQUE_RATE, "rate of the elastic torque", "(59)"),
    Variable("ddtau_e", _JOINT, units.TORQUE_ACCELERATION, "second derivative of the elastic torque", "(60)"),
    Variable("phi", _MOTOR, units.POSITION, "deflection theta - q of each transmission", "(61)"),
    Variable("dphi", _MOTOR, units.VELOCITY, "deflection rate", "(68)"),
    Variable("theta", _MOTOR, units.POSITION, "motor position, joint side of the gear", "(69)", geared=1),
    Variable("dtheta", _MOTOR, units.VELOCITY, "motor velocity, joint side of the gear", "(69)", geared=1),
    Variable(
        "ddtheta",
        _MOTOR,
        units.JOINT_ACCELERATION,
        "motor acceleration, joint side of the gear",
        "(72)",
        geared=1,
    ),
    Variable("tau_transmission", _MOTOR, units.TORQUE, "flexible torque of each transmission", "(62)"),
    Variable(
        "tau_motor", _MOTOR, units.TORQUE, "motor torque, joint side of the gear", "(73)-(74)", geared=-1
    ),
    Variable(
        "tau_damper",
        _JOINT,
        units.TORQUE,
        "torque of the joint's damper, part of tau_e",
        "damping * velocity of the damper",
        DAMPING.key,
    ),
    Variable(
        "elastic_energy", _JOINT, units.ENERGY, "energy in the springs of the joint", "integral of (62)"
    ),
    Variable("motor_power", _MOTOR, units.POWER, "mechanical power of the motor", "tau_motor * dtheta"),
    Variable(
        "motor_energy",
        _MOTOR,
        units.ENERGY,
        "mechanical work of the motor since the first step",
        "integral of motor_power",
    ),
    Variable(
        "dissipated_power",
        _JOINT,
        units.POWER,
        "power that friction and damping of the joint and its motors take",
        "friction times velocity",
        LOSSES,
    ),
    Variable(
        "current",
        _MOTOR,
        units.CURRENT,
        "current of the motor",
        "tau_motor/(gear_ratio * torque_constant)",
        "torque_constant",
    ),
    Variable(
        "voltage",
        _MOTOR,
        units.VOLTAGE,
        "voltage of the motor",
        "resistance * current + torque_constant * gear_ratio * dtheta",
        "resistance",
    ),
    Variable(
        "copper_loss",
        _MOTOR,
        units.POWER,
        "heat in the windings of the motor",
        "resistance * current^2",
        "resistance",
    ),
    Variable(
        "det_A",
        _JOINT,
        units.DECOUPLING,
        "determinant of the decoupling block of the joint",
        "(67)",
        STIFFNESS.key,
    ),
    Variable(
        "stiffness_min",
        _JOINT,
        units.STIFFNESS,
        "minimum attainable stiffness at this elastic torque on the joint's branch",
        "(14)",
        STIFFNESS.key,
    ),
    Variable(
        "stiffness_max",
        _JOINT,
        units.STIFFNESS,
        "maximum attainable stiffness at this elastic torque on the joint's branch",
        "(14)",
        STIFFNESS.key,
    ),
    Variable(
        "flags",
        _JOINT,
        units.DIMENSIONLESS,
        "what is wrong with this step of the joint",
        "margins of (14)",
    ),
)


UNCERTAIN = (
    *(name for signal in (POSITION, *COMMANDED.values(), WRENCH) for name in signal.names),
    *("tau_e", "dtau_e", "ddtau_e", "phi", "theta", "dtheta", "tau_motor"),
)
"""The variables that have a standard deviation if a signal was recorded."""


def deviation(name: str) -> str:
    """Name under which the standard deviation of a variable is stored."""
    return f"{name}_std"


def _deviations(declared: Iterable[Variable]) -> Iterator[Variable]:
    for variable in declared:
        if variable.name in UNCERTAIN:
            words = variable.long_name.replace("commanded ", "")
            source = "covariance of the fit" if variable.equation == "given" else "first order"
            yield variable._replace(
                name=deviation(variable.name),
                long_name=f"standard deviation of the {words}",
                equation=source,
            )


VARIABLES: dict[str, Variable] = {
    variable.name: variable for variable in (*_given(), *_COMPUTED, *_deviations((*_given(), *_COMPUTED)))
}
"""Every variable by name, `time` first."""


class Block:
    """Variables over a block of consecutive steps, each an attribute of the shape (samples, joints[, 2]).

    A value that cannot be computed is NaN, and `flags` says why; one that the joint's actuator does not have
    is NaN throughout. Variables missing from a block are None: the wrench, (samples, 6), if the trajectory
    has none; `motor_energy`, which sums over the samples before, and the standard deviations until the block
    has its place in a run; standard deviations without a recorded signal behind them.

    Attributes:
        declared: the variables that it may have, by name.
    """

    declared: ClassVar[Mapping[str, Variable]] = VARIABLES

    def __init__(self, **arrays: AnyArray) -> None:
        unknown = arrays.keys() - self.declared.keys()
        if unknown:
            raise TypeError(f"no variable is called {', '.join(sorted(unknown))}")
        vars(self).update(arrays)

    def __getattr__(self, name: str) -> Any:
        if name in self.declared:
            return None
        hint = now_called(name, self.declared)
        raise AttributeError(f"{type(self).__name__!r} has no variable {name!r}{hint}")

    def of_joint(self, index: int) -> dict[str, AnyArray]:
        """Return the variables of one joint by name, (samples,), those of its motors (2, samples)."""
        joints = {name: array for name, array in vars(self).items() if "joint" in self.declared[name].dims}
        return of_joint(joints, index)

    def arrays(self) -> dict[str, AnyArray]:
        """Return the variables there are, by name."""
        return {name: vars(self)[name] for name in self.declared if name in vars(self)}

    def taken(self, steps: slice | AnyArray) -> Self:
        """Return some of its steps."""
        return type(self)(**{name: array[steps] for name, array in self.arrays().items()})

    def replaced(self, **arrays: AnyArray) -> Self:
        """Return the same with some variables that are other or further ones."""
        return type(self)(**{**self.arrays(), **arrays})


def select_variables(
    names: Iterable[str], declared: Mapping[str, Variable] = VARIABLES
) -> tuple[Variable, ...]:
    """Return the variables of these names, in declared order, `time` left out.

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


def column_names(variable: Variable, joint_names: Iterable[str]) -> list[str]:
    """CSV headers of a variable, in the order of its flattened values, e.g. `elbow.tau_motor_1`."""
    if "wrench_axis" in variable.dims:
        return wrench_columns(variable.name)
    endings = [f"_{motor}" for motor in MOTORS] if "motor" in variable.dims else [""]
    return [f"{joint}.{variable.name}{ending}" for joint in joint_names for ending in endings]
