"""`vsacli info`."""

from __future__ import annotations

import json

import click

from vsacli.cli.options import example


@click.command(
    "info",
    short_help="Show what a robot, trajectory or result holds.",
    epilog=example("vsacli info robots/vsa_3r.yaml --field joints.elbow.static_load.torque"),
)
@click.argument("file")
@click.option("--robot", metavar="ROBOT", help="The robot that a trajectory is for.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@click.option(
    "--field",
    metavar="PATH",
    help="Print one value of the JSON, e.g. reach.found; entries of lists by number, from 0, or by name.",
)
def info(file: str, robot: str | None, as_json: bool, field: str | None) -> None:
    """Show what a FILE holds: a robot, a trajectory, a result or a simulation.

    Of a robot, Denavit-Hartenberg rows, links, actuators, reach, static load and reachable stiffness; of a
    trajectory, ranges and peaks; of a result or a simulation, provenance, variables and report.
    """
    from vsacli.base.json_values import finite
    from vsacli.files.info import bare, describe_file, render, select

    description = describe_file(file, robot)
    if field is not None:
        click.echo(bare(select(finite(description), field)))
    else:
        click.echo(json.dumps(finite(description), indent=1) if as_json else render(description))
