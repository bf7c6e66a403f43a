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


def parameters_structure(chosen: Sequence[Parameter]) -> Structure:
    """Return the structure of the argument, with a member for each parameter, named by its path."""
    meaning = "Parameters of the robot, by their paths in its file; the functions do not check them."
    arrays = (Array("_".join(each.by_index), (), _meaning(each)) for each in chosen)
    return Structure(PARAMETERS, meaning, tuple(arrays), tuple(each.value for each in chosen))


def _meaning(parameter: Parameter) -> str:
    unit = parameter.unit if parameter.unit != "1" else "no unit"
    return ", ".join(filter(None, (str(parameter), unit, parameter.requirement)))


def with_parameters(
    make: Maker, robot: Robot, frame: WrenchFrame | None, chosen: Sequence[Parameter]
) -> Function:
    """Return the function with chosen parameters as an argument, or without if it depends on none of them.

    `make` is called again with symbols for the parameters, so that one implementation serves both cases.

    Raises:
        NotImplementedError: a condition in the code depends on one of the parameters.
    """
    plain = make(robot, frame)
    if not chosen:
        return plain

    def compute(rows: Rows) -> Rows:
        given, values = rows[: -len(chosen)], rows[-len(chosen) :]
        other = with_numbers(robot, chosen, [row[0] for row in values])
        try:
            return make(other, frame).compute(given)
        except InputError:
            raise
        except (AttributeError, TypeError, ValueError) as error:  # arrays of numbers hold no symbols
            raise NotImplementedError(f"a parameter goes into a table of numbers: {error}") from error

    taken = (*plain.arguments, (PARAMETERS, parameters_structure(chosen)))
    function = dataclasses.replace(plain, arguments=taken, compute=compute)
    return function if _reads(function.program, len(chosen)) else plain


def _reads(program: Program, last: int) -> bool:
    """Return whether a program reads any of its last inputs."""
    operands = {operand for each in program.operations for operand in each.operands} | {*program.outputs}
    return any(isinstance(each, Symbol) and each in operands for each in program.inputs[-last:])


def check_parameters(robot: Robot, frame: WrenchFrame | None, chosen: Sequence[Parameter]) -> None:
    """Raise an error for parameters whose values select code or enter precomputed tables.

    Raises:
        InputError: such parameters are chosen; names each.
        NotImplementedError: no code can be generated for the robot, even without parameters.
    """
    _ = inverse_dynamics_function(robot, frame).program
    refused = [each for each in chosen if not _may_vary(robot, frame, each)]
    reason = (
        "cannot be a parameter: its value decides which operations there are, or goes into tables that are "
        "computed when the code is written; choose other --parameters, and generate the code anew when it "
        "changes"
    )
    if refused:
        raise InputError(Problem("", 0, f"{each} of {robot.name} {reason}") for each in refused)


def _may_vary(robot: Robot, frame: WrenchFrame | None, parameter: Parameter) -> bool:
    try:
        with_parameters(inverse_dynamics_function, robot, frame, [parameter])
    except NotImplementedError:
        return False
    return True
