"""`vsacli codegen`: C code of a robot."""

from __future__ import annotations

import click

from vsacli.cli.command_parts import example, overwrite_option, robot_argument
from vsacli.cli.console import Exit, Talk, talk_options
from vsacli.cli.file_names import FOLDER


@click.command(
    "codegen",
    short_help="Generate C code of a robot for its controller.",
    epilog=example("vsacli codegen robots/vsa_3r.yaml -o controller"),
)
@robot_argument
@click.option("-o", "--output", type=FOLDER, required=True, help="Folder for the code.")
@click.option(
    "--precision",
    type=click.Choice(["double", "float"]),
    default="double",
    show_default=True,
    help="Type of all numbers; float is refused where it would spoil the results.",
)
@click.option(
    "--wrench",
    metavar="FRAME",
    type=click.Choice(["end_effector", "base"]),
    help="Take a wrench at the end effector as input, along the axes of this frame.",
)
@click.option(
    "--parameters",
    "patterns",
    metavar="GLOB",
    multiple=True,
    help="Take the numbers whose paths fit as inputs, e.g. 'joints.*.link.mass'; may be given several times.",
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
    """Write C code for link torques, inverse dynamics and feedback linearization of ROBOT.

    C99 that needs nothing but math.h: no allocation, nothing kept between calls, a bounded number of
    operations. A test program with reference values, a Makefile, CMake's file, a Python module that calls
    the code, and a README come along.
    """
    from vsacli.base.outputs import Outputs
    from vsacli.control.codegen.project import generate, write
    from vsacli.robot.file import load_robot

    arm = load_robot(robot)
    project = generate(arm, precision, wrench, patterns, loops=not no_loops)
    with Outputs(overwrite=overwrite, inputs=[source.path for source in arm.sources]) as outputs:
        write(project, output, outputs)
    talk.wrote(outputs)
    for reason in project.omitted:
        talk.note(reason)
    for warning in project.warnings:
        talk.note(f"warning: {warning}")
    return Exit.OK
