"""`vsacli schema`: the JSON Schema of a YAML format."""

from __future__ import annotations

import json

import click

from vsacli.cli.command_parts import example
from vsacli.cli.option_types import Words


@click.command(
    "schema",
    epilog=example("vsacli schema robot > robot.schema.json"),
)
@click.argument(
    "kind", metavar="KIND", type=Words(["robot", "trajectory", "poles", "study", "columns"]), required=False
)
def schema(kind: str | None) -> None:
    """Print the JSON Schema of a YAML format, for editors that complete keys and mark errors.

    KIND is robot, trajectory, poles, study or columns.
    """
    if kind is None:
        raise click.UsageError("Missing argument KIND: robot, trajectory, poles, study or columns")
    from vsacli.files.file_kinds import DOCUMENTS

    click.echo(json.dumps(DOCUMENTS[kind].schema(), indent=1))
