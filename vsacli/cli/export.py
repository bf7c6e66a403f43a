"""`vsacli export`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, TextIO

import click

from vsacli.base.errors import InputError, StorageError
from vsacli.base.streams import STANDARD
from vsacli.cli.command_parts import (
    example,
    overwrite_option,
    result_line,
    variables_option,
)
from vsacli.cli.console import Exit, Talk, talk_options, tell
from vsacli.cli.file_names import FILE
from vsacli.results.exports import FORMATS as OF_RESULTS

if TYPE_CHECKING:
    from vsacli.base.outputs import Staged
    from vsacli.results.exports.result_format import ResultFormat
    from vsacli.results.store.reader import StoredResult


@click.command(
    "export",
    short_help="Write motor torques, or other variables, for other programs.",
    epilog=example("vsacli export result.h5 --rate 250 -o torques.csv"),
)
@click.argument("file", type=FILE)
@click.option(
    "-o", "--output", type=FILE, help="File to write; by default standard output, which takes texts."
)
@click.option(
    "--format",
    "form",
    type=click.Choice(tuple(OF_RESULTS)),
    default="csv",
    show_default=True,
    help="CSV, a MATLAB file, Parquet, or a message JointTrajectory of ROS 2.",
)
@variables_option(
    "tau_motor, of a simulation q_actual, stiffness_actual, tau_motor_actual; of a joint-trajectory what it "
    "has fields for: q, dq, ddq, tau_e"
)
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
@click.option("--allow-nan", is_flag=True, help="Leave values out where there are none.")
@overwrite_option
@talk_options
def export(
    file: str,
    output: str | None,
    form: str,
    variables: tuple[str, ...] | None,
    rate: float | None,
    side: str,
    allow_nan: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Write variables of a result or a simulation for other programs.

    By default these are the motor torques to send; of a simulation, motion, stiffness and motor torques as
    they were.

    Refuses samples that have no value (infeasible or singular steps) with exit code 3 and writes nothing,
    unless --allow-nan.

    With --side motor, motion and torque of the motors are those of their shafts, in rad and N m at any joint;
    every motor needs a gear_ratio in the robot file. What is not of a motor stays as it is.
    """
    from vsacli.base.outputs import Outputs
    from vsacli.results.exports.result_format import UndefinedSamplesError
    from vsacli.results.store.simulation import open_stored

    options: dict[str, Any] = {"variables": variables, "rate": rate, "allow_nan": allow_nan, "side": side}
    options["progress"] = talk.writing
    chosen: ResultFormat = OF_RESULTS[form]
    to_file = output is not None and output != STANDARD
    if chosen.binary and not to_file:
        raise InputError.one(f"a {form} file is no text; name it with -o")
    try:
        with open_stored(file) as stored:
            talk.detail(result_line(stored))
            if to_file:
                assert output is not None
                with Outputs(overwrite=overwrite, inputs=[file]) as outputs:
                    _write(stored, outputs.file(output), chosen, options)
                talk.wrote(outputs)
            else:
                _print(stored, chosen, options)
    except UndefinedSamplesError as error:
        tell(str(error))
        return Exit.VERDICT
    return Exit.OK


def _write(stored: StoredResult, file: Staged, form: ResultFormat, options: dict[str, Any]) -> None:
    from vsacli.results.exports.result_format import export_result

    with file.opened_for_bytes() if form.binary else file.opened() as stream:
        export_result(stored, stream, form, **options)


def _print(stored: StoredResult, form: ResultFormat, options: dict[str, Any]) -> None:
    from vsacli.results.exports.result_format import export_result

    export_result(stored, _stdout(), form, **options)
    sys.stdout.flush()


def _stdout() -> TextIO:
    if sys.stdout is None:
        raise StorageError("standard output", "is closed; name a file with -o")
    return sys.stdout
