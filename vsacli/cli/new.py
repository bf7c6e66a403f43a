"""`vsacli new`: commented robot and trajectory files as a starting point."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from vsacli.actuators.kinds import ACTUATORS
from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.base.storage import STANDARD
from vsacli.cli.command_parts import example, overwrite_option
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FILE, YAML_FILE

_output_option = click.option(
    "-o", "--output", type=YAML_FILE, help="File to write; by default standard output."
)


@click.group(
    "new",
    short_help="Create a robot or trajectory file to begin with.",
    epilog=example("vsacli new robot --joints RR"),
)
def new() -> None:
    """Write a commented robot or trajectory file to begin with."""


@new.command(
    "robot",
    short_help="A robot with these joints.",
    epilog=example("vsacli new robot --joints RRP -o arm.yaml"),
)
@click.option(
    "--joints",
    metavar="LETTERS",
    required=True,
    help="A letter for each joint from the base to the tip: R (revolute) or P (prismatic).",
)
@click.option(
    "--actuator",
    type=click.Choice((*ACTUATORS, *MECHANISMS)),
    default="antagonistic",
    show_default=True,
    help="What drives the joints: a kind of actuator, or a mechanism of serial ones.",
)
@_output_option
@overwrite_option
@talk_options
def robot(joints: str, actuator: str, output: str | None, overwrite: bool, talk: Talk) -> None:
    """Write a robot file with these joints, to be edited.

    It can be computed with as it is; a profile that it names is written beside it. Each key has a comment;
    what is optional stands commented out. Reports say that its springs and motors are made up until the key
    `placeholder` is removed.
    """
    from vsacli.files.examples import example_tables
    from vsacli.files.templates import robot_template

    text = robot_template(joints, actuator)
    _write(text, output, overwrite, talk, tables=[path for path in example_tables() if path.name in text])


@new.command(
    "trajectory",
    short_help="A trajectory, for a robot of yours or for a new one.",
    epilog=example("vsacli new trajectory --robot robots/rp_2.yaml -o move.yaml"),
)
@click.option("--robot", "robot_path", type=FILE, help="The robot that is to execute it.")
@_output_option
@overwrite_option
@talk_options
def trajectory(robot_path: str | None, output: str | None, overwrite: bool, talk: Talk) -> None:
    """Write a trajectory file, to be edited: a motion from rest to rest whose torques start without a step.

    Its numbers suit the joints, limits and springs of the robot; without one, those of a new robot with
    revolute joints.
    """
    from vsacli.files.templates import trajectory_template
    from vsacli.robot.file import load_robot

    robot = None if robot_path is None else load_robot(robot_path)
    inputs = () if robot is None else [source.path for source in robot.sources]
    _write(trajectory_template(robot), output, overwrite, talk, inputs)


def _write(
    text: str,
    output: str | None,
    overwrite: bool,
    talk: Talk,
    inputs: Iterable[str] = (),
    tables: Iterable[Path] = (),
) -> None:
    """Write the text, and copies of these tables next to the file; standard output gets the text alone."""
    if output is None or output == STANDARD:
        click.echo(text, nl=False)
        return
    from vsacli.base.outputs import Outputs

    with Outputs(overwrite=overwrite, inputs=inputs) as outputs:
        outputs.file(output).write_text(text)
        for table in tables:
            outputs.file(Path(output).parent / table.name).write_bytes(table.read_bytes())
    talk.wrote(outputs)
