"""`vsacli schema`: the JSON Schema of a YAML format."""

from __future__ import annotations

import json

import click

from vsacli.cli.command_parts import example


@click.command(
    "schema",
    short_help="Print the JSON Schema of a YAML format, for editors.",
    epilog=example("vsacli schema robot > robot.schema.json"),
)
@click.argument("kind", type=click.Choice(["robot", "trajectory", "poles", "study", "columns"]))
def schema(kind: str) -> None:
    """Print the JSON Schema of a YAML format, for editors that complete keys and mark errors."""
    from vsacli.files.file_kinds import DOCUMENTS

    click.echo(json.dumps(DOCUMENTS[kind].schema(), indent=1))
