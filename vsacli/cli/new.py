"""`vsacli new`: commented robot and trajectory files as a starting point."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from vsacli.actuators.kinds import ACTUATORS
from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.base.storage import STANDARD
from vsacli.cli.command_parts import example, overwrite_option, read_robot
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FILE, YAML_FILE
from vsacli.cli.input_errors import naming_option
from vsacli.cli.option_types import Words

_output_option = click.option(
    "-o", "--output", type=YAML_FILE, help="File to write.", show_default="standard output"
)


@click.group(
    "new",
    short_help="Create a commented robot or trajectory file.",
    epilog=example("vsacli new robot --joints RR"),
)
def new() -> None:
    """Create a commented robot or trajectory file as a starting point."""


@new.command(
    "robot",
    short_help="Write a robot file with given joints.",
    epilog=example("vsacli new robot --joints RRP -o arm.yaml"),
)
@click.option(
    "--joints",
    metavar="LETTERS",
    required=True,
    help="Type of each joint from the base to the tip: R (revolute) or P (prismatic), e.g. RRP.",
)
@click.option(
    "--actuator",
    type=Words((*ACTUATORS, *MECHANISMS)),
    default="antagonistic",
    show_default=True,
    help="Kind of actuator of every joint, or mechanism of serial actuators.",
)
@_output_option
@overwrite_option
@talk_options
def robot(joints: str, actuator: str, output: str | None, overwrite: bool, talk: Talk) -> None:
    """Write a robot file with these joints, to be edited.

    The file is complete and can be used as it is; a profile that it refers to is written next to it. Each key
    has a comment, and optional keys are commented out. Reports mark its springs and motors as placeholders
    until the key `placeholder` is removed.
    """
    from vsacli.files.examples import example_tables
    from vsacli.files.templates import robot_template

    with naming_option("--joints"):
        text = robot_template(joints, actuator)
    _write(text, output, overwrite, talk, tables=[path for path in example_tables() if path.name in text])


@new.command(
    "trajectory",
    short_help="Write a trajectory file for a robot.",
    epilog=example("vsacli new trajectory --robot robots/rp_2.yaml -o move.yaml"),
)
@click.option(
    "--robot",
    "robot_path",
    type=FILE,
    help="Robot that will execute the trajectory.",
    show_default="a new robot with revolute joints",
)
@_output_option
@overwrite_option
@talk_options
def trajectory(robot_path: str | None, output: str | None, overwrite: bool, talk: Talk) -> None:
    """Write a trajectory file, to be edited: a motion from rest to rest with continuous motor torques.

    Its values suit the joints, limits and springs of the robot; without --robot, those of a new robot with
    revolute joints.
    """
    from vsacli.files.templates import trajectory_template

    robot = None if robot_path is None else read_robot(robot_path, argument="--robot")
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
