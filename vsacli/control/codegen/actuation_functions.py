"""Functions of the actuation of single joints, (61)-(74), which joints of equal structure share.

A kernel for a GPU calls them in a loop over the joints, after the recursion: inverse dynamics of an arm in
one text requires more registers than a thread has.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

from vsacli.base.wrench import WrenchFrame
from vsacli.compute.rows import RowLayout
from vsacli.compute.tracing import Program
from vsacli.compute.tracing.calls import share_bodies
from vsacli.compute.tracing.program import NESTED, SelectionTable
from vsacli.compute.vector import Scalar
from vsacli.control.codegen.interface import Array, Function, Rows, Structure, rows_by_array
from vsacli.control.codegen.parameters import with_parameters
from vsacli.control.codegen.robot_functions import (
    command_structure,
    drive_rows,
    drive_structure,
    variable_array,
)
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques
from vsacli.dynamics.inverse import InverseDynamics
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter

MOST_JOINTS = 16
"""Largest number of joints whose torques with two derivatives fit into 48 kB for the threads of a block."""

CONSTANTS = "constants"
"""Name of the argument with the numbers in which joints of one structure differ."""


@dataclass(frozen=True, kw_only=True)
class SharedFunction(Function):
    """A function of one joint, whose program other joints have with other constants.

    Attributes:
        body: its program.
    """

    body: Program

    @cached_property
    def program(self) -> Program:
        """See `Function.program`."""
        return self.body


class JointFunctions(NamedTuple):
    """The functions of all joints.

    Attributes:
        functions: Functions, each of at least one joint.
        of_joint: Index of the function of each joint.
        constants: Constants of each joint, the last argument of its function if there are any.
    """

    functions: list[SharedFunction]
    of_joint: list[int]
    constants: list[list[float]]


def actuation(robot: Robot, inverse: Function, free_parameters: Sequence[Parameter]) -> JointFunctions | None:
    """Return the functions of the actuation of the joints; None for one joint, or if the loop does not pay.

    It does not where springs are solved by iteration, which takes most of the time, where a damped
    transmission has a state, and where no joint has springs, which need derivatives of the recursion.

    Args:
        robot: Robot.
        inverse: Its inverse dynamics.
        free_parameters: Parameters that are an argument.
    """
    damped = any(joint.damper_at("transmission") for joint in robot.joints)
    sprung = any(joint.actuator.sprung for joint in robot.joints)
    fits_loop = 1 < len(robot.joints) <= MOST_JOINTS
    if not (fits_loop and sprung) or damped or not _is_straight(inverse.program):
        return None
    makers = (partial(_joint_function, index=index) for index in range(len(robot.joints)))
    functions = [with_parameters(make, robot, None, free_parameters) for make in makers]
    bodies = share_bodies([function.program for function in functions])
    shared_bodies = {id(body.program): body for body in bodies}
    function_indices = {identity: number for number, identity in enumerate(shared_bodies)}
    indices = [function_indices[id(body.program)] for body in bodies]
    shared = [
        _shared_function(number, functions[indices.index(number)], body.program, len(body.constants))
        for number, body in enumerate(shared_bodies.values())
    ]
    return JointFunctions(shared, indices, [body.constants for body in bodies])


def _is_straight(program: Program) -> bool:
    """Return whether a program has no loops, branches, calls, and tables."""
    return not any(
        symbol.operation in NESTED or any(isinstance(operand, SelectionTable) for operand in symbol.operands)
        for symbol in program.operations
    )


def _shared_function(index: int, function: Function, body: Program, constant_count: int) -> SharedFunction:
    values = Array("value", (constant_count,), "those of one joint")
    structure = Structure(f"{CONSTANTS}_{index}", "Numbers in which joints differ.", (values,))
    return SharedFunction(
        name=f"{function.name}_{index}",
        meaning=function.meaning,
        arguments=(*function.arguments, *([(CONSTANTS, structure)] if constant_count else [])),
        result=function.result,
        compute=function.compute,
        body=body,
    )


class _TorqueRows:
    """Link torques as inputs, in place of the recursion."""

    def __init__(self, robot: Robot) -> None:
        joint_shape = (len(robot.joints),)
        self.results = RowLayout(dict.fromkeys(TORQUES, joint_shape))
        self.arguments = RowLayout({**LinkTorques(robot).arguments.shapes, **self.results.shapes})

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        return self.results.pack(self.arguments.unpack(rows))


class _ActuationKernel(InverseDynamics):
    """Inverse dynamics with given link torques."""

    @cached_property
    def links(self) -> _TorqueRows:  # type: ignore[override]
        """See `InverseDynamics.links`."""
        return _TorqueRows(self.robot)


def _joint_function(robot: Robot, _frame: WrenchFrame | None, index: int) -> Function:
    """Return the function of the actuation of a joint, given its link torque."""
    joint = dataclasses.replace(robot.joints[index], parent=None, mount=None)
    kernel = _ActuationKernel(dataclasses.replace(robot, joints=(joint,), tools=()))
    torques = Structure("torques", "Link torques.", tuple(variable_array(robot, name) for name in TORQUES))
    arguments = (
        ("torques", _single_joint_structure(torques)),
        ("command", _single_joint_structure(command_structure(robot))),
    )

    def compute(rows: Rows) -> Rows:
        values = rows_by_array(arguments, rows)
        return drive_rows(values, kernel.results.unpack(kernel(kernel.arguments.pack(values))))

    return Function(
        name="actuation",
        meaning="Motion and torques of the motors of a joint; returns its flags.",
        arguments=arguments,
        result=_single_joint_structure(drive_structure(robot)),
        compute=compute,
    )


def _single_joint_structure(structure: Structure) -> Structure:
    """Return the structure of one joint from that of all."""
    arrays = tuple(dataclasses.replace(array, shape=(1, *array.shape[1:])) for array in structure.arrays)
    return dataclasses.replace(structure, name=f"joint_{structure.name}", arrays=arrays)
