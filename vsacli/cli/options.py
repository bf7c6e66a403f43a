"""Arguments and options that several commands share, each defined once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click


def _split(_context: click.Context, _parameter: click.Parameter, text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise click.BadParameter("expected names separated by commas, e.g. tau_motor,flags")
    return names


def hdf5_name(_context: click.Context, _parameter: click.Parameter, name: str | None) -> str | None:
    """A callback for the name of an HDF5 file to write: not one that promises CSV."""
    if name is not None and name.lower().endswith(".csv"):
        raise click.BadParameter(f"{name!r}: the file is HDF5; `vsacli export` makes CSV of it")
    return name


def variables_option(default: str) -> Callable[[Any], Any]:
    """`--variables`, of a command that otherwise takes those that `default` says."""
    return click.option(
        "--variables",
        metavar="NAMES",
        callback=_split,
        help=f"Only these variables, e.g. tau_motor,flags; by default {default}.",
    )


def example(command: str) -> str:
    """The end of a help text: a command line that works."""
    return f"\b\nExample:\n  {command}"


robot_argument = click.argument("robot")
trajectory_argument = click.argument("trajectory")
json_option = click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
overwrite_option = click.option("--overwrite", is_flag=True, help="Replace files that exist.")
deflections_option = click.option(
    "--deflections",
    type=click.Choice(["root", "integrate"]),
    default="root",
    show_default=True,
    help="Solve for the deflections at each step, or follow those of the first by integration, which drifts.",
)
stop_option = click.option("--stop-on-infeasible", is_flag=True, help="End with the first infeasible step.")


def engine_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """`--engine` and `--threads`."""
    engine = click.option(
        "--engine",
        type=click.Choice(["numpy", "c", "auto"]),
        default="auto",
        show_default=True,
        help="What computes: NumPy, or code from the system's C compiler; auto takes what is faster.",
    )
    threads = click.option(
        "--threads",
        type=click.IntRange(min=1),
        metavar="COUNT",
        help="Threads of compiled code; by default one a processor.",
    )
    return engine(threads(command))
