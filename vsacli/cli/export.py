"""`vsacli export`."""

from __future__ import annotations

import sys
from typing import Any, TextIO

import click

from vsacli.base.errors import StorageError
from vsacli.base.streams import STANDARD
from vsacli.cli.command_parts import (
    example,
    overwrite_option,
    result_line,
    variables_option,
)
from vsacli.cli.console import Exit, Talk, talk_options, tell


@click.command(
    "export",
    short_help="Write motor torques, or other variables, as CSV.",
    epilog=example("vsacli export result.h5 --rate 250 -o torques.csv"),
)
@click.argument("file")
@click.option("-o", "--output", metavar="FILE", help="CSV file; by default standard output.")
@variables_option("tau_motor, of a simulation q_actual, stiffness_actual, tau_motor_actual")
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
    file: str,
    output: str | None,
    variables: tuple[str, ...] | None,
    rate: float | None,
    side: str,
    allow_nan: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Write variables of a result or a simulation as CSV.

    By default these are the motor torques to send; of a simulation, motion, stiffness and motor torques as
    they were.

    Refuses samples that have no value (infeasible or singular steps) with exit code 3 and writes nothing,
    unless --allow-nan.

    With --side motor, motion and torque of the motors are those of their shafts, in rad and N m at any joint;
    every motor needs a gear_ratio in the robot file. What is not of a motor stays as it is.
    """
    from vsacli.base.outputs import Outputs
    from vsacli.results.csv_export import UndefinedSamplesError, export_csv
    from vsacli.results.store.simulation import open_stored

    options: dict[str, Any] = {"rate": rate, "allow_nan": allow_nan, "side": side}
    try:
        with open_stored(file) as stored:
            talk.detail(result_line(stored))
            if output is None or output == STANDARD:
                export_csv(stored, _stdout(), variables, **options)
                sys.stdout.flush()
            else:
                with (
                    Outputs(overwrite=overwrite, inputs=[file]) as outputs,
                    outputs.file(output).opened() as stream,
                ):
                    export_csv(stored, stream, variables, **options)
                talk.wrote(outputs)
    except UndefinedSamplesError as error:
        tell(str(error))
        return Exit.VERDICT
    return Exit.OK


def _stdout() -> TextIO:
    if sys.stdout is None:
        raise StorageError("standard output", "is closed; name a file with -o")
    return sys.stdout
