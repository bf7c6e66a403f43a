"""`vsacli codegen`: C code of a robot."""

from __future__ import annotations

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import example, overwrite_option, read_robot, robot_argument
from vsacli.cli.console import Exit, Talk, talk_options
from vsacli.cli.file_names import FOLDER
from vsacli.cli.input_errors import naming_option
from vsacli.cli.option_types import Words


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
    metavar="FRAME",
    type=Words(["end_effector", "base"]),
    help="Add a wrench at the end effector as an input, in the axes of this frame.",
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
    wrench: str | None,
    patterns: tuple[str, ...],
    no_loops: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Generate C code for link torques, inverse dynamics and feedback linearization of ROBOT.

    The code is C99 and requires only math.h: no memory allocation, no state between calls, a bounded number
    of operations. The folder also contains a test program with reference values, a Makefile, a CMake file, a
    Python module that calls the code, and a README.
    """
    from vsacli.control.codegen.project import generate, write
    from vsacli.robot.parameters import parameters

    arm = read_robot(robot)
    with naming_option("--parameters"):
        parameters(arm, patterns)
    project = generate(arm, precision, wrench, patterns, loops=not no_loops)
    with Outputs(overwrite=overwrite, inputs=[source.path for source in arm.sources]) as outputs:
        write(project, output, outputs)
    talk.wrote(outputs)
    for reason in project.omitted:
        talk.note(reason)
    for warning in project.warnings:
        talk.note(f"warning: {warning}")
    return Exit.OK
