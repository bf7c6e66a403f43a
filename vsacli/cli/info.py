"""`vsacli info`: describe a file, or the cache of compiled code."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import click

from vsacli.base.errors import InputError
from vsacli.base.json_records import json_value
from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import example
from vsacli.cli.console import Talk, for_width, talk_options
from vsacli.cli.file_names import FILE, FOLDER
from vsacli.cli.input_errors import naming_kind, naming_option
from vsacli.cli.option_types import RATE


@click.command(
    "info",
    epilog=example("vsacli info robots/vsa_3r.yaml --field joints.elbow.static_load.torque"),
)
@click.argument("file", type=FILE, required=False)
@click.option("--robot", type=FILE, help="Robot of the trajectory or of the recording.")
@click.option(
    "--rate",
    metavar="HZ",
    type=RATE,
    help="Sampling rate of a recording without a time column.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the description as JSON.")
@click.option(
    "--field",
    metavar="PATH",
    help="Print one value of the JSON, e.g. reach.found; entries of lists by index from 0, by name, "
    "or all by *.",
)
@click.option(
    "--extract",
    "folder",
    type=FOLDER,
    help="Write the input files stored in a result to this folder.",
)
@click.option(
    "--cache", is_flag=True, help="Show the cache of compiled code and unfinished output files instead."
)
@click.option("--clear", is_flag=True, help="With --cache: empty the cache first.")
@talk_options
def info(
    file: str | None,
    robot: str | None,
    rate: float | None,
    as_json: bool,
    field: str | None,
    folder: str | None,
    cache: bool,
    clear: bool,
    talk: Talk,
) -> None:
    """Describe the content of FILE: a robot, a trajectory, a recording, a result, a simulation or a study.

    Robot: Denavit-Hartenberg rows, links, actuators, reach, static load and attainable stiffness. Trajectory:
    ranges and peaks. Recording (a CSV file with any columns): columns, sampling rate, faults of sensors and
    logging, and a trajectory file to begin with; --field trajectory prints this file alone, and --field
    mapping prints a file for --columns of other commands. Result or simulation: provenance, variables and
    report. Table of a study: findings, provenance and varied parameters.

    With --cache, show location and size of the cache of compiled code. Also list unfinished output files of
    interrupted or running commands, in the folder for temporary files and in the folder FILE (default: the
    current folder).
    """
    if clear and not cache:
        raise click.UsageError("--clear empties the cache; give --cache, too")
    if cache:
        _show(_cache(file or ".", clear), as_json, field)
    elif file is None:
        raise click.UsageError("Missing argument 'FILE'.")
    elif folder is not None:
        _extract(file, folder, talk)
    else:
        from vsacli.files.info import describe_file

        with naming_kind("--robot", robot, ("robot",)), naming_option("--rate"):
            description = describe_file(file, robot, talk.looking, rate)
        _show(description, as_json, field)


def _show(description: dict[str, Any], as_json: bool, field: str | None) -> None:
    from vsacli.files.info import render

    if field is not None:
        click.echo(_found(description, field))
    elif as_json:
        click.echo(json.dumps(json_value(description), indent=1))
    else:
        click.echo(for_width(render(description)))


def _cache(folder: str, clear: bool) -> dict[str, Any]:
    from vsacli.files.info import clear_cache, describe_cache

    if not Path(folder).is_dir():
        raise InputError.one("is not a folder; name one in which to look for unfinished files", folder)
    if clear:
        clear_cache()
    return describe_cache(folder)


def _extract(file: str, folder: str, talk: Talk) -> None:
    from vsacli.documents.reading import format_changes
    from vsacli.files.repetition import extract

    with naming_kind("FILE", file, ("result", "simulation", "table of a study")):
        found = extract(file)
    with Outputs(inputs=[file]) as outputs:
        for place, content in found.files.items():
            target = Path(folder) / place
            outputs.folder(target.parent)
            outputs.file(target).write_bytes(content)
    talk.wrote(outputs)
    if found.changes:
        again = shlex.join(part for change in format_changes(found.changes) for part in ("--set", change))
        talk.note(f"the files are as they were read; {file} was computed from them with {again}")


def _found(description: dict[str, Any], field: str) -> str:
    """Return the value at a path for use in scripts: texts without quotes, everything else as JSON."""
    from vsacli.files.info import described_value

    try:
        value = described_value(description, field)
    except InputError as error:
        raise InputError.one(f"--field: {error}") from None
    return value if isinstance(value, str) else json.dumps(value)
