"""`vsacli examples`: list or copy the bundled robots and trajectories."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import example, overwrite_option
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FOLDER

if TYPE_CHECKING:
    from vsacli.files.examples import Example


@click.command(
    "examples",
    epilog=example("vsacli examples puma_560 scara_4 --copy my-robots"),
)
@click.argument("names", metavar="[ROBOT]...", nargs=-1)
@click.option("--copy", "folder", type=FOLDER, help="Copy the files to this folder instead of listing them.")
@overwrite_option
@talk_options
def examples(names: tuple[str, ...], folder: str | None, overwrite: bool, talk: Talk) -> None:
    """List the bundled robots, all or those named, each with the trajectories made for it.

    With --copy, write them to robots/ and trajectories/ of a folder together with the tables that they need;
    without names, write all bundled files. Nothing is written if one of the files exists, unless --overwrite
    is given.
    """
    from vsacli.files.examples import copy_examples
    from vsacli.files.examples import examples as shipped

    if folder is None and overwrite:
        raise click.UsageError("--overwrite needs --copy FOLDER")
    if folder is None:
        click.echo("\n".join(line for each in shipped(names) for line in _lines(each)))
        talk.note("get them with vsacli examples --copy FOLDER, or vsacli examples ROBOT... --copy FOLDER")
        return
    with Outputs(overwrite=overwrite) as outputs:
        copy_examples(names, folder, outputs)
    talk.wrote(outputs)


def _lines(shown: Example) -> Iterator[str]:
    letters = "".join("R" if joint.is_revolute else "P" for joint in shown.robot.joints)
    yield f"{shown.name} ({letters}): {shown.robot.description}"
    for trajectory in shown.trajectories:
        yield f"    {trajectory.name}: {trajectory.description}"
