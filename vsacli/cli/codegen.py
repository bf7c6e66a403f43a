"""`vsacli codegen`: C code of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from vsacli.base.errors import InputError
from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import example, overwrite_option, read_robot, robot_argument
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FOLDER
from vsacli.cli.input_errors import naming_option
from vsacli.cli.option_types import Words

if TYPE_CHECKING:
    from vsacli.base.wrench import WrenchFrame
    from vsacli.robot.model import Robot

FRAMES = ("end_effector", "base")
"""Frames of a wrench."""


class _ToolFrame(Words):
    """A frame, which the name of a tool may precede."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """See `click.Choice.convert`."""
        tool, colon, frame = value.rpartition(":")
        return f"{tool}{colon}{super().convert(frame, param, ctx)}"


def _wrench_frame(robot: Robot, wrenches: Sequence[str]) -> WrenchFrame | None:
    """Return the frame of the wrench on each tool from the option; None if nothing acts.

    Raises:
        InputError: there is no such tool, which one is not said, or one has two frames.
    """
    frames: list[str | None] = [None] * len(robot.tool_names)
    for tool, _, frame in (wrench.rpartition(":") for wrench in wrenches):
        index = robot.end_effector(tool or None)
        if frames[index] is not None:
            raise InputError.one(f"the tool {robot.tool_names[index]} has two frames; give one")
        frames[index] = frame
    if not wrenches:
        return None
    return tuple(frames) if len(frames) > 1 else frames[0]


@click.command(
    "codegen",
    epilog=example("vsacli codegen robots/vsa_3r.yaml -o controller"),
)
@robot_argument
@click.option("-o", "--output", type=FOLDER, required=True, help="Folder for the generated code.")
@click.option(
    "--precision",
    type=Words(["double", "float"], {"single": "float"}),
    default="double",
    show_default=True,
    help="Floating-point type of the code; float is refused if rounding would make results too inaccurate.",
)
@click.option(
    "--wrench",
    "wrenches",
    metavar="[TOOL:]FRAME",
    type=_ToolFrame(FRAMES),
    multiple=True,
    help="Add a wrench at the end effector as an input, in the axes of this frame: "
    f"{' or '.join(FRAMES)}; for a robot with several tools with the name of one, e.g. left_hand:base. May "
    "be repeated.",
)
@click.option(
    "--parameters",
    "patterns",
    metavar="GLOB",
    multiple=True,
    help="Make the robot parameters whose paths match this pattern inputs of the functions, e.g. "
    "'joints.*.link.mass'; may be repeated.",
)
@click.option("--no-loops", is_flag=True, help="Refuse joints whose springs are solved by iteration.")
@overwrite_option
@talk_options
def codegen(
    robot: str,
    output: str,
    precision: str,
    wrenches: tuple[str, ...],
    patterns: tuple[str, ...],
    no_loops: bool,
    overwrite: bool,
    talk: Talk,
) -> None:
    """Generate C code of ROBOT: link torques, inverse dynamics, feedback linearization, and the plant.

    The code is C99 and requires only math.h: no memory allocation, no state between calls, a bounded number
    of operations. The folder also contains a test program with reference values, a Makefile, a CMake file,
    Python modules that call the code on the processor and for batches on a GPU, and a README.
    """
    from vsacli.control.codegen.project import generate, write
    from vsacli.robot.parameters import parameters

    robot_model = read_robot(robot)
    with naming_option("--parameters"):
        parameters(robot_model, patterns)
    with naming_option("--wrench"):
        frame = _wrench_frame(robot_model, wrenches)
    project = generate(robot_model, precision, frame, patterns, loops=not no_loops)
    with Outputs(overwrite=overwrite, inputs=[source.path for source in robot_model.sources]) as outputs:
        write(project, output, outputs)
    talk.wrote(outputs)
    for reason in project.omitted:
        talk.note(reason)
    for warning in project.warnings:
        talk.note(f"warning: {warning}")
