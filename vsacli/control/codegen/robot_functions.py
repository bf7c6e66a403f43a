"""Generated functions without feedback: link torques (36)-(60) and inverse dynamics (36)-(74)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.reach import margin
from vsacli.base.errors import InputError
from vsacli.base.flags import finite, not_finite_flags
from vsacli.base.signals import POSITION
from vsacli.base.variables import VARIABLES
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES, Wrench, WrenchFrame, frames_by_tool
from vsacli.compute.vector import Scalar
from vsacli.control.codegen.interface import Arguments, Array, Function, Rows, Structure, rows_by_array
from vsacli.dynamics.deflection_rows import INTERNAL, InternalRows
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques
from vsacli.dynamics.inverse import InverseDynamics
from vsacli.robot.model import Robot

DRIVE_NAMES = (
    "tau_e",
    "phi",
    "theta",
    "dtheta",
    "ddtheta",
    "tau_motor",
    "stiffness_min",
    "stiffness_max",
)
"""Variables that the generated inverse dynamics returns, in addition to margins and flags."""


def motion_structure(robot: Robot) -> Structure:
    """Return the structure of position and derivatives, with damping between the links if there is any."""
    names = tuple(LinkTorques(robot).arguments.shapes)
    return Structure("motion", "Motion of the joints.", _variable_arrays(robot, names))


def command_structure(robot: Robot) -> Structure:
    """Return the structure of commanded motion and stiffness."""
    meaning = "Commanded motion and stiffness; only antagonistic and serial joints read a stiffness."
    names = (name for signal in (POSITION, *robot.signals) for name in signal.names)
    return Structure("command", meaning, _variable_arrays(robot, tuple(names)))


def state_structure(robot: Robot) -> Structure:
    """Return the structure of the full state of joints and motors."""
    motors = (len(robot.joints), SIDES)
    return Structure(
        "state",
        "Measured state.",
        (
            Array("q", motors[:1], "joint position, rad (m)"),
            Array("dq", motors[:1], "joint velocity, rad/s (m/s)"),
            Array("theta", motors, "motor position, joint side of the gear, rad (m)"),
            Array("dtheta", motors, "motor velocity, joint side of the gear, rad/s (m/s)"),
        ),
    )


def wrench_structure(robot: Robot, frame: WrenchFrame) -> Structure:
    """Return the structure of the wrench of the environment on each tool that has a frame.

    Raises:
        InputError: two tools have the same name in C.
    """
    axes, units = ", ".join(WRENCH_AXES), ("N and N m", "N and N m per s", "N and N m per s^2")
    verb = "the environment exerts on the"
    quantities = "force and moment about the origin of the tool frame"
    if isinstance(frame, str):
        axes_name = frame.replace("_", " ")
        meaning = f"Wrench that {verb} end effector: {quantities}, along the axes of the {axes_name} frame."
        names = {name: f"{axes}; {unit}" for name, unit in zip(WRENCH_NAMES, units, strict=True)}
    else:
        meaning = f"Wrenches that {verb} tools: {quantities}."
        frames = zip(robot.tool_names, frames_by_tool(frame), strict=True)
        frame_of_tool = {tool: axes_name for tool, axes_name in frames if axes_name is not None}
        names = {
            _c_name(name, tool): f"{axes} along the axes of the {axes_name.replace('_', ' ')} frame; {unit}"
            for tool, axes_name in frame_of_tool.items()
            for name, unit in zip(WRENCH_NAMES, units, strict=True)
        }
        if len(names) < len(frame_of_tool) * len(units):
            tools = ", ".join(frame_of_tool)
            raise InputError.one(f"two of the tools {tools} have the same name in C, where - becomes _")
    arrays = (Array(name, (len(WRENCH_AXES),), meaning_of_array) for name, meaning_of_array in names.items())
    return Structure("wrench", meaning, tuple(arrays))


def _c_name(name: str, tool: str) -> str:
    return f"{name}_{tool.replace('-', '_')}"


def wrench_by_tool(robot: Robot, arrays: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Return wrench and derivatives of each tool from the arrays of a `wrench_structure`, zero if idle."""
    idle = np.zeros(len(WRENCH_AXES))
    if WRENCH_NAMES[0] in arrays:
        return {name: [arrays[name]] for name in WRENCH_NAMES}
    return {
        name: [arrays.get(_c_name(name, tool), idle) for tool in robot.tool_names] for name in WRENCH_NAMES
    }


def wrench_on_tools(robot: Robot, frame: WrenchFrame, arrays: Mapping[str, Any]) -> Wrench:
    """Return the wrench on all tools from the arrays of a `wrench_structure`."""
    return Wrench(*map(np.concatenate, wrench_by_tool(robot, arrays).values()), frame=frame)


def _kernel_inputs(robot: Robot, arguments: Arguments, rows: Rows) -> dict[str, Any]:
    """Return the rows of all arguments by the names of the kernel's inputs."""
    values = dict(rows_by_array(arguments, rows))
    wrench_rows = wrench_by_tool(robot, values) if "wrench" in dict(arguments) else {}
    return values | {name: [row for tool in tools for row in tool] for name, tools in wrench_rows.items()}


def wrench_argument(robot: Robot, frame: WrenchFrame | None) -> tuple[tuple[str, Structure], ...]:
    """Return the wrench as an argument; empty if `frame` is None."""
    return () if frame is None else (("wrench", wrench_structure(robot, frame)),)


def link_torques_function(robot: Robot, frame: WrenchFrame | None = None) -> Function:
    """Return the function of link torques (36)-(60), with a wrench if its frame is given."""
    kernel = LinkTorques(robot, frame)
    arguments = (("motion", motion_structure(robot)), *wrench_argument(robot, frame))

    def compute(rows: Rows) -> Rows:
        torques = kernel(kernel.arguments.pack(_kernel_inputs(robot, arguments, rows)))
        joint_torques = zip(*kernel.results.unpack(torques).values(), strict=True)
        return [
            *torques,
            *(not_finite_flags(~finite(torques_of_joint)) for torques_of_joint in joint_torques),
        ]

    return Function(
        name="link_torques",
        meaning=(
            "Torques that the links demand of the joints, and their first two derivatives; returns the flags "
            "of all joints, 0 if all numbers are finite."
        ),
        arguments=arguments,
        result=Structure("torques", "Torques of the joints.", _variable_arrays(robot, (*TORQUES, "flags"))),
        compute=compute,
    )


def inverse_dynamics_function(robot: Robot, frame: WrenchFrame | None = None) -> Function:
    """Return the function of inverse dynamics (36)-(74).

    Deflections inside damped transmissions are inputs, and outputs together with their rates.

    Args:
        robot: robot.
        frame: frame along whose axes a wrench is given, see `WrenchFrame`; None without one.
    """
    damped = tuple(index for index, joint in enumerate(robot.joints) if joint.damper_at("transmission"))
    kernel = InverseDynamics(robot, frame, prescribed=(InternalRows(damped, INTERNAL[:1]),))
    internal = internal_structure(robot) if damped else None
    arguments = (
        ("command", command_structure(robot)),
        *([] if internal is None else [("internal", internal)]),
        *wrench_argument(robot, frame),
    )

    def compute(rows: Rows) -> Rows:
        values = _kernel_inputs(robot, arguments, rows)
        deflections = values.get(INTERNAL[0], ())
        values[INTERNAL[0]] = [deflections[SIDES * index + side] for index in damped for side in range(SIDES)]
        computed = kernel.results.unpack(kernel(kernel.arguments.pack(values)))
        drive = drive_rows(values, computed)
        if internal is None:
            return drive
        return [*drive, *_internal_rows(robot, computed, "phi"), *_internal_rows(robot, computed, "dphi")]

    rates = _internal_array(robot, "dinternal_phi", "their rates")
    further_arrays = () if internal is None else (*internal.arrays, rates)
    return Function(
        name="inverse_dynamics",
        meaning=(
            "Motor torques that execute a command; returns the flags of all joints, 0 if all is well."
            + (" Between calls integrate internal_phi by dinternal_phi." if internal else "")
        ),
        arguments=arguments,
        result=drive_structure(robot, further_arrays),
        compute=compute,
    )


def drive_rows(values: Mapping[str, Any], computed: Mapping[str, Sequence[Scalar]]) -> list[Scalar]:
    """Return the rows of a `drive_structure` without further arrays, from inputs and results of a kernel."""
    stiffness_rows = (values["stiffness"], computed["stiffness_min"], computed["stiffness_max"])
    rows = [row for name in DRIVE_NAMES for row in computed[name]]
    return [*rows, *map(margin, *stiffness_rows), *computed["flags"]]


def drive_structure(robot: Robot, further: tuple[Array, ...] = ()) -> Structure:
    """Return the structure of motions and torques of the motors, with the attainable range."""
    gap = "relative distance of the stiffness to the nearer end of the attainable range, negative outside it"
    return Structure(
        "drive",
        "What the motors have to do; NaN where a flag says it cannot be.",
        (
            *_variable_arrays(robot, DRIVE_NAMES),
            Array("margin", (len(robot.joints),), gap),
            variable_array(robot, "flags"),
            *further,
        ),
    )


def internal_structure(robot: Robot) -> Structure:
    """Return the structure of deflections inside damped transmissions, a state that the caller integrates."""
    meaning = (
        "State inside transmissions with a damper, whose damping must be positive; other joints do not "
        "count. Start it where the springs carry the joint alone."
    )
    array = _internal_array(robot, "internal_phi", "deflections; theta of a motor that sets springs")
    return Structure("internal", meaning, (array,))


def _internal_array(robot: Robot, name: str, meaning: str) -> Array:
    return Array(name, (len(robot.joints), SIDES), meaning)


def _internal_rows(robot: Robot, computed: Mapping[str, Sequence[Scalar]], name: str) -> Iterator[Scalar]:
    """Yield deflections or their rates; for a motor that sets the springs, its own position or velocity."""
    motor_name = {"phi": "theta", "dphi": "dtheta"}[name]
    for index, joint in enumerate(robot.joints):
        for side, has_phi in enumerate(joint.actuator.has_columns(VARIABLES["phi"])):
            yield computed[name if has_phi else motor_name][SIDES * index + side]


def _variable_arrays(robot: Robot, names: tuple[str, ...]) -> tuple[Array, ...]:
    return tuple(variable_array(robot, name) for name in names)


def variable_array(robot: Robot, name: str) -> Array:
    """Return the array of a result variable."""
    variable = VARIABLES[name]
    motors = (2,) if "motor" in variable.dims else ()
    units = dict.fromkeys(variable.quantity.unit(joint_type) for joint_type in robot.joint_types)
    meaning = ", ".join([variable.long_name, *([] if name == "flags" else [" or ".join(units)])])
    return Array(name, (len(robot.joints), *motors), meaning, bits=name == "flags")
