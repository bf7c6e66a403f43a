"""The variables of a result, each declared once: dimensions, unit, long name, equation.

The declarations feed the pipeline, the HDF5 attributes, the CSV headers, the plots and the documentation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias

from vsacli.base import units
from vsacli.base.arrays import AnyArray, of_joint
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, Problem
from vsacli.base.signals import COMMANDED, DAMPING, POSITION, STIFFNESS, WRENCH, Signal
from vsacli.base.units import Quantity
from vsacli.base.wrench import DISPLACEMENT_AXES, WRENCH_AXES, wrench_columns

MOTORS = (1, 2)
_WRENCH_DIMS = ("wrench_axis",)
"""Dimensions of the wrench on one tool."""

SPRINGS = "springs"
"""Requirement of variables, other than commanded signals, that only joints with springs have."""

MOTOR_CONSTANTS = ("torque_constant", "resistance")
"""Motor constants that variables may require."""

LOSSES = "friction"
"""Requirement of the variables of losses: dry friction or a damper at any joint; viscous damping does not
count."""

TIP_COMPLIANCE = "tip_compliance"
"""Name of the variable with the compliance of each tool."""

TOOL_FLAGS = "tool_flags"
"""Name of the variable with the flags of each tool."""

TOOLS = "tools"
"""Requirement of variables of tools."""

MIN_STIFFNESS = "min_stiffness"
"""Requirement of variables of tools of which one has this limit, or whose compliance was asked for."""

OF_ANY_ROBOT = (None, SPRINGS, STIFFNESS.key)
"""Requirements of variables that every result has, NaN at joints that do not meet them. A result omits
variables with other requirements if no joint of the robot meets these."""


class Variable(NamedTuple):
    """Declaration of a result variable.

    Attributes:
        name: name in files and in Python.
        dims: dimensions after `time`: (), ("joint",), ("joint", "motor"), ("wrench_axis",), ("tool",) or
            ("tool", "displacement_axis", "wrench_axis"); see `variables_by_tool` for robots with several
            tools.
        quantity: units at revolute and prismatic joints, or of moments and forces.
        long_name: short description.
        equation: number in Buondonno & De Luca (2016), or source of the value.
        requires: condition on a joint: `SPRINGS`, a commanded signal by key, or one of `MOTOR_CONSTANTS`;
            values of other joints are NaN. All joints meet `LOSSES` if any has friction. For variables of
            tools, `TOOLS` or `MIN_STIFFNESS`.
        geared: exponent e: value on the motor shaft = value * gear_ratio**e (1 for position, -1 for torque).
    """

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str
    equation: str
    requires: str | None = None
    geared: int = 0


def _signal_variables(signal: Signal, dim: str, requires: str | None = None) -> Iterator[Variable]:
    for name, quantity, long_name in zip(signal.names, signal.quantities, signal.long_names, strict=True):
        yield Variable(name, (dim,), quantity, long_name, "given", requires)


def _given_variables() -> Iterator[Variable]:
    yield Variable("time", (), units.TIME, "time", "given")
    yield from _signal_variables(POSITION, "joint")
    for signal in COMMANDED.values():
        # joints with springs have a stiffness even if it is not commanded
        yield from _signal_variables(signal, "joint", SPRINGS if signal is STIFFNESS else signal.key)
    yield from _signal_variables(WRENCH, *_WRENCH_DIMS)


_JOINT_DIMS, _MOTOR_DIMS = ("joint",), ("joint", "motor")

_COMPUTED_VARIABLES = (
    Variable("tau_e", _JOINT_DIMS, units.TORQUE, "total elastic torque", "(58)"),
    Variable("dtau_e", _JOINT_DIMS, units.TORQUE_RATE, "rate of the elastic torque", "(59)"),
    Variable(
        "ddtau_e", _JOINT_DIMS, units.TORQUE_ACCELERATION, "second derivative of the elastic torque", "(60)"
    ),
    Variable("phi", _MOTOR_DIMS, units.POSITION, "deflection theta - q of each transmission", "(61)"),
    Variable("dphi", _MOTOR_DIMS, units.VELOCITY, "deflection rate", "(68)"),
    Variable(
        "theta", _MOTOR_DIMS, units.POSITION, "motor position, joint side of the gear", "(69)", geared=1
    ),
    Variable(
        "dtheta", _MOTOR_DIMS, units.VELOCITY, "motor velocity, joint side of the gear", "(69)", geared=1
    ),
    Variable(
        "ddtheta",
        _MOTOR_DIMS,
        units.JOINT_ACCELERATION,
        "motor acceleration, joint side of the gear",
        "(72)",
        geared=1,
    ),
    Variable("tau_transmission", _MOTOR_DIMS, units.TORQUE, "flexible torque of each transmission", "(62)"),
    Variable(
        "tau_motor", _MOTOR_DIMS, units.TORQUE, "motor torque, joint side of the gear", "(73)-(74)", geared=-1
    ),
    Variable(
        "tau_damper",
        _JOINT_DIMS,
        units.TORQUE,
        "torque of the joint's damper, part of tau_e",
        "damping * velocity of the damper",
        DAMPING.key,
    ),
    Variable(
        "elastic_energy",
        _JOINT_DIMS,
        units.ENERGY,
        "elastic energy of the springs of the joint",
        "integral of (62)",
    ),
    Variable("motor_power", _MOTOR_DIMS, units.POWER, "mechanical power of the motor", "tau_motor * dtheta"),
    Variable(
        "motor_energy",
        _MOTOR_DIMS,
        units.ENERGY,
        "mechanical work of the motor since the first sample",
        "integral of motor_power",
    ),
    Variable(
        "dissipated_power",
        _JOINT_DIMS,
        units.POWER,
        "power dissipated by friction and damping of the joint and its motors",
        "friction times velocity",
        LOSSES,
    ),
    Variable(
        "current",
        _MOTOR_DIMS,
        units.CURRENT,
        "current of the motor",
        "tau_motor/(gear_ratio * torque_constant)",
        "torque_constant",
    ),
    Variable(
        "voltage",
        _MOTOR_DIMS,
        units.VOLTAGE,
        "voltage of the motor",
        "resistance * current + torque_constant * gear_ratio * dtheta",
        "resistance",
    ),
    Variable(
        "copper_loss",
        _MOTOR_DIMS,
        units.POWER,
        "copper loss in the windings of the motor",
        "resistance * current^2",
        "resistance",
    ),
    Variable(
        "det_A",
        _JOINT_DIMS,
        units.DECOUPLING,
        "determinant of the decoupling block of the joint",
        "(67)",
        STIFFNESS.key,
    ),
    Variable(
        "stiffness_min",
        _JOINT_DIMS,
        units.STIFFNESS,
        "minimum attainable stiffness at this elastic torque on the joint's branch",
        "(14)",
        STIFFNESS.key,
    ),
    Variable(
        "stiffness_max",
        _JOINT_DIMS,
        units.STIFFNESS,
        "maximum attainable stiffness at this elastic torque on the joint's branch",
        "(14)",
        STIFFNESS.key,
    ),
    Variable(
        "flags",
        _JOINT_DIMS,
        units.DIMENSIONLESS,
        "flags of this sample of the joint; 0 if there is no finding",
        "margins of (14)",
    ),
    Variable(
        TIP_COMPLIANCE,
        ("tool", "displacement_axis", "wrench_axis"),
        units.COMPLIANCE,
        "compliance of each tool with the motors held, base axes",
        "J (K + dg/dq)^-1 J^T",
        TOOLS,
    ),
    Variable(
        TOOL_FLAGS,
        ("tool",),
        units.DIMENSIONLESS,
        "flags of this sample of the tool; 0 if there is no finding",
        TIP_COMPLIANCE,
        MIN_STIFFNESS,
    ),
)

ALL = "all"
"""Name that stands for all variables of a run in a list of names."""

ON_REQUEST = (TIP_COMPLIANCE,)
"""Variables that a run has only if they are asked for."""


UNCERTAIN = (
    *(name for signal in (POSITION, *COMMANDED.values(), WRENCH) for name in signal.names),
    *("tau_e", "dtau_e", "ddtau_e", "phi", "theta", "dtheta", "tau_motor"),
)
"""Variables that have a standard deviation if a signal was recorded."""


def deviation(name: str) -> str:
    """Return the name under which the standard deviation of a variable is stored."""
    return f"{name}_std"


def _deviation_variables(declared: Iterable[Variable]) -> Iterator[Variable]:
    for variable in declared:
        if variable.name in UNCERTAIN:
            long_name = variable.long_name.replace("commanded ", "")
            equation = "covariance of the fit" if variable.equation == "given" else "first order"
            yield variable._replace(
                name=deviation(variable.name),
                long_name=f"standard deviation of the {long_name}",
                equation=equation,
            )


VARIABLES: dict[str, Variable] = {
    variable.name: variable
    for variable in (
        *_given_variables(),
        *_COMPUTED_VARIABLES,
        *_deviation_variables((*_given_variables(), *_COMPUTED_VARIABLES)),
    )
}
"""All variables by name, `time` first."""


class Block:
    """Variables over consecutive samples, as attributes.

    Shapes are (samples, joints[, 2]); (samples, 6 tools) of the wrench, the six components of each tool in
    turn; (samples, tools, 6, 6) of `tip_compliance`; and (samples, tools) of `tool_flags`.

    A value that cannot be computed is NaN, and `flags` gives the reason; a variable that the joint's actuator
    does not have is NaN throughout. Missing variables are None: the wrench of a trajectory without one;
    `tip_compliance` if it is not requested, and `tool_flags` if no tool has a `min_stiffness` either;
    `motor_energy`, an integral over all earlier samples, and standard deviations until the block has its
    place in a run; standard deviations if no signal was recorded.

    Attributes:
        declared: variables that a block may have, by name.
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
        from vsacli.base.renamed import now_called  # loaded for error messages only

        hint = now_called(name, self.declared)
        raise AttributeError(f"{type(self).__name__!r} has no variable {name!r}{hint}")

    def of_joint(self, index: int) -> dict[str, AnyArray]:
        """Return the variables of one joint by name: (samples,), or (2, samples) for its motors."""
        joints = {name: array for name, array in vars(self).items() if "joint" in self.declared[name].dims}
        return of_joint(joints, index)

    def arrays(self) -> dict[str, AnyArray]:
        """Return the variables present, by name."""
        return {name: vars(self)[name] for name in self.declared if name in vars(self)}

    def taken(self, selection: int | slice | AnyArray) -> Self:
        """Return a block of the selected samples; a single number removes the axis of samples."""
        return type(self)(**{name: array[selection] for name, array in self.arrays().items()})

    def divided(self, parts: int) -> Iterator[Self]:
        """Yield blocks of equal numbers of consecutive samples."""
        count = len(self.time) // parts
        return (self.taken(slice(part * count, (part + 1) * count)) for part in range(parts))

    def replaced(self, **arrays: AnyArray) -> Self:
        """Return a copy of the block with variables replaced or added."""
        return type(self)(**{**self.arrays(), **arrays})


def select_variables(
    names: Iterable[str], declared: Mapping[str, Variable] = VARIABLES
) -> tuple[Variable, ...]:
    """Return the variables with these names in declared order, without `time`.

    Raises:
        InputError: names are unknown; each is reported with the nearest valid one.
    """
    wanted = set(names)
    unknown = sorted(wanted - set(declared))
    if unknown:
        raise InputError(
            Problem("", 0, f"no variable is called {name!r}{did_you_mean(name, _like(name, declared))}")
            for name in unknown
        )
    return tuple(variable for name, variable in declared.items() if name in wanted and variable.dims)


def _like(name: str, declared: Iterable[str]) -> list[str]:
    """Return the names of which one may be meant: standard deviations only if this is one."""
    ending = deviation("")
    return [each for each in declared if name.endswith(ending) or not each.endswith(ending)]


Labels: TypeAlias = Mapping[str, Sequence[Any]]
"""Labels along each dimension after `time`."""


def dimension_labels(joint_names: Sequence[str], tool_names: Sequence[str]) -> Labels:
    """Return the labels along the dimensions of the variables of a robot."""
    return {
        "joint": joint_names,
        "motor": MOTORS,
        "tool": tool_names,
        "displacement_axis": DISPLACEMENT_AXES,
        "wrench_axis": WRENCH_AXES,
    }


def variables_by_tool(declared: Mapping[str, Variable], tools: int) -> Mapping[str, Variable]:
    """Return the variables of a robot with some number of tools: several have wrenches along `tool`.

    In memory, blocks of samples have the components of several tools in turn along one axis.
    """
    if tools < 2:
        return declared
    return {
        name: _of_each_tool(variable) if variable.dims == _WRENCH_DIMS else variable
        for name, variable in declared.items()
    }


def _of_each_tool(variable: Variable) -> Variable:
    words = variable.long_name.replace("the end effector", "each tool")
    return variable._replace(dims=("tool", *variable.dims), long_name=words)


def row_shape(variable: Variable, labels: Labels) -> tuple[int, ...]:
    """Return the lengths of the axes after time."""
    return tuple(len(labels[dim]) for dim in variable.dims)


def split_axes(values: AnyArray, variable: Variable, labels: Labels) -> AnyArray:
    """Return samples of a variable with an axis for each dimension: tools may be in turn along one."""
    return values.reshape(len(values), *row_shape(variable, labels))


def column_names(variable: Variable, labels: Labels) -> list[str]:
    """Return the CSV headers of a variable in the order of its flat values.

    Examples: `elbow.tau_motor_1`, `fx`, and `left_hand.fx` for a robot with several tools.
    """
    owned = variable.dims[0] in ("joint", "tool")
    owners = [f"{owner}." for owner in labels[variable.dims[0]]] if owned else [""]
    if variable.dims[owned:] == _WRENCH_DIMS:
        columns = wrench_columns(variable.name)
    else:
        endings = product(*(labels[dim] for dim in variable.dims[owned:]))
        columns = ["_".join(map(str, (variable.name, *ending))) for ending in endings]
    return [owner + column for owner in owners for column in columns]
