"""`vsacli export`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, TextIO

import click

from vsacli.cli.console import Talk, talk_options, tell
from vsacli.cli.exit_codes import Exit
from vsacli.cli.options import example, overwrite_option, variables_option
from vsacli.cli.running import described, refuse_input_as_output
from vsacli.errors import StorageError


@click.command(
    "export",
    short_help="Write motor torques, or other variables, as CSV.",
    epilog=example("vsacli export result.h5 --rate 250 -o torques.csv"),
)
@click.argument("result")
@click.option("-o", "--output", metavar="FILE", help="CSV file; by default standard output.")
@variables_option("tau_motor")
@click.option(
    "--rate", metavar="HZ", type=float, help="Samples per second, a whole fraction of the stored rate."
)
@click.option(
    "--side",
    type=click.Choice(["joint", "motor"]),
    default="joint",
    show_default=True,
    help="Of the gear, on which motion and torque of the motors are given.",
)
@click.option("--allow-nan", is_flag=True, help="Leave cells without a value empty.")
@overwrite_option
@talk_options
def export(
    result: str,
    output: str | None,
    variables: tuple[str, ...] | None,
    rate: float | None,
    side: str,
    allow_nan: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Write variables of a RESULT as CSV: the motor torques to send, by default.

    Refuses samples that have no value (infeasible or singular steps) with exit code 3 and writes nothing,
    unless --allow-nan.

    With --side motor, motion and torque of the motors are those of their shafts, in rad and N m at any joint;
    every motor needs a gear_ratio in the robot file. What is not of a motor stays as it is.
    """
    from vsacli.export import DEFAULT_VARIABLES, UndefinedSamplesError, export_csv, export_csv_file
    from vsacli.store.reader import open_result

    options: dict[str, Any] = {"rate": rate, "allow_nan": allow_nan, "side": side}
    try:
        with open_result(result) as stored:
            talk.detail(described(stored))
            if output is None:
                export_csv(stored, _stdout(), variables or DEFAULT_VARIABLES, **options)
                sys.stdout.flush()
            else:
                refuse_input_as_output(Path(output), [result])
                export_csv_file(
                    stored, output, variables or DEFAULT_VARIABLES, overwrite=overwrite, **options
                )
                talk.note(f"wrote {output}")
    except UndefinedSamplesError as error:
        tell(str(error))
        return Exit.VERDICT
    return Exit.OK


def _stdout() -> TextIO:
    if sys.stdout is None:
        raise StorageError("standard output", "is closed; name a file with -o")
    return sys.stdout
