"""Robot parameters as an argument of generated functions, instead of constants in their code."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from vsacli.base.errors import InputError, Problem
from vsacli.base.wrench import WrenchFrame
from vsacli.compute.tracing import Program, Symbol
from vsacli.control.codegen.interface import Array, Function, Rows, Structure
from vsacli.control.codegen.robot_functions import inverse_dynamics_function
from vsacli.documents.record_values import with_numbers
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter

Maker = Callable[[Robot, WrenchFrame | None], Function]
"""Factory of a generated function, called with a robot and the frame of a wrench (None without one)."""

PARAMETERS = "parameters"


def parameters_structure(free_parameters: Sequence[Parameter]) -> Structure:
    """Return the structure of the argument, with a member for each parameter, named by its path."""
    meaning = "Parameters of the robot, by their paths in its file; the functions do not check them."
    arrays = (
        Array("_".join(parameter.by_index), (), _parameter_meaning(parameter))
        for parameter in free_parameters
    )
    return Structure(
        PARAMETERS, meaning, tuple(arrays), tuple(parameter.value for parameter in free_parameters)
    )


def _parameter_meaning(parameter: Parameter) -> str:
    unit = parameter.unit if parameter.unit != "1" else "no unit"
    return ", ".join(filter(None, (str(parameter), unit, parameter.requirement)))


def with_parameters(
    make: Maker, robot: Robot, frame: WrenchFrame | None, free_parameters: Sequence[Parameter]
) -> Function:
    """Return the function with chosen parameters as an argument, or without if it depends on none of them.

    `make` is called again with symbols for the parameters, so that one implementation serves both cases.

    Raises:
        NotImplementedError: a condition in the code depends on one of the parameters.
    """
    constant_function = make(robot, frame)
    if not free_parameters:
        return constant_function

    def compute(rows: Rows) -> Rows:
        inputs, values = rows[: -len(free_parameters)], rows[-len(free_parameters) :]
        varied_robot = with_numbers(robot, free_parameters, [row[0] for row in values])
        try:
            return make(varied_robot, frame).compute(inputs)
        except InputError:
            raise
        except (AttributeError, TypeError, ValueError) as error:  # arrays of numbers hold no symbols
            raise NotImplementedError(f"a parameter goes into a table of numbers: {error}") from error

    arguments_with_parameters = (
        *constant_function.arguments,
        (PARAMETERS, parameters_structure(free_parameters)),
    )
    function = dataclasses.replace(constant_function, arguments=arguments_with_parameters, compute=compute)
    return function if _reads_last_inputs(function.program, len(free_parameters)) else constant_function


def _reads_last_inputs(program: Program, count: int) -> bool:
    """Return whether a program reads any of its last inputs."""
    operands = {operand for symbol in program.operations for operand in symbol.operands} | {*program.outputs}
    return any(isinstance(symbol, Symbol) and symbol in operands for symbol in program.inputs[-count:])


def check_parameters(robot: Robot, frame: WrenchFrame | None, free_parameters: Sequence[Parameter]) -> None:
    """Raise an error for parameters whose values select code or enter precomputed tables.

    Raises:
        InputError: such parameters are chosen; names each.
        NotImplementedError: no code can be generated for the robot, even without parameters.
    """
    _ = inverse_dynamics_function(robot, frame).program
    invalid = [parameter for parameter in free_parameters if not _may_vary(robot, frame, parameter)]
    reason = (
        "cannot be a parameter: its value decides which operations there are, or goes into tables that are "
        "computed when the code is written; choose other --parameters, and generate the code anew when it "
        "changes"
    )
    if invalid:
        raise InputError(Problem("", 0, f"{parameter} of {robot.name} {reason}") for parameter in invalid)


def _may_vary(robot: Robot, frame: WrenchFrame | None, parameter: Parameter) -> bool:
    try:
        with_parameters(inverse_dynamics_function, robot, frame, [parameter])
    except NotImplementedError:
        return False
    return True
