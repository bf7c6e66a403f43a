"""`vsacli export`: results or robots in the formats of other programs."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from vsacli.base.errors import InputError
from vsacli.base.outputs import Outputs
from vsacli.base.storage import STANDARD
from vsacli.base.texts import joined
from vsacli.cli.command_parts import (
    example,
    overwrite_option,
    result_line,
    variables_option,
)
from vsacli.cli.console import Exit, Talk, talk_options, tell
from vsacli.cli.file_names import FILE, KNOWN_ENDINGS, ending_of
from vsacli.cli.input_errors import in_words, naming_kind, naming_option
from vsacli.cli.option_types import RATE, Words
from vsacli.results.exports import FORMATS as RESULT_FORMATS
from vsacli.robot.models import FORMATS as ROBOT_FORMATS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from vsacli.base.outputs import Staged
    from vsacli.files.file_kinds import FileKind
    from vsacli.results.exports.result_format import ResultFormat
    from vsacli.results.store.reader import StoredResult
    from vsacli.robot.model import Robot
    from vsacli.robot.models.mjcf_drives import Start

ENDINGS = {
    "joint-trajectory": (".json", ".yaml", ".yml"),
    "urdf": (".urdf", ".xml"),
    "mjcf": (".mjcf", ".xml"),
}
"""File name endings of formats for which these are not the name of the format."""

RESULT_OPTIONS = ("variables", "rate", "side", "allow_nan")
"""Options that do not apply to robots."""

_ADVICE_BY_KIND = {
    "trajectory": "; compute it first: vsacli invdyn ROBOT {}",
    "table of a study": "; its columns are read with h5py or pandas",
}
"""Advice on a file of another kind, by the kind."""


@click.command(
    "export",
    epilog=example("vsacli export result.h5 --rate 250 -o torques.csv"),
)
@click.argument("file", type=FILE)
@click.option(
    "-o", "--output", type=FILE, help="File to write.", show_default="standard output, for text formats"
)
@click.option(
    "--format",
    "form",
    type=Words((*RESULT_FORMATS, *ROBOT_FORMATS)),
    help="Format. Results: CSV, MATLAB file, Parquet, or JointTrajectory of ROS 2. Robots: URDF, or "
    "MJCF, the XML format of MuJoCo.",
    show_default="extension of the output file, else csv",
)
@variables_option(
    "tau_motor; of a simulation q, stiffness, tau_motor; of a joint-trajectory q, dq, ddq, tau_e"
)
@click.option(
    "--rate",
    metavar="HZ",
    type=RATE,
    help="Sampling rate of the exported values; a motion known only at its samples requires an "
    "integer fraction of the stored rate.",
    show_default="all stored samples",
)
@click.option(
    "--side",
    type=Words(["joint", "motor"]),
    default="joint",
    show_default=True,
    help="Side of the gear at which motor motion and torque are given.",
)
@click.option(
    "--allow-nan",
    is_flag=True,
    help="Export missing and infinite values as well; missing ones are left empty.",
)
@click.option(
    "--start",
    type=FILE,
    help="Result whose first sample becomes the key frame `start` of an MJCF model.",
)
@overwrite_option
@talk_options
def export(
    file: str,
    output: str | None,
    form: str | None,
    start: str | None,
    overwrite: bool,
    talk: Talk,
    **of_results: Any,
) -> int:
    """Export variables of a result or a simulation, or a robot, for other programs.

    Without --variables, a result gives its motor torques, and a simulation its motion, stiffness and motor
    torques.

    Samples without a value (infeasible or singular ones) or with an infinite value are refused with exit code
    3, and nothing is written, unless --allow-nan is given.

    With --side motor, motion and torque of the motors are those of the motor shafts, in rad and N m at every
    joint; every motor needs a gear_ratio in the robot file. Other variables do not change.

    A URDF file holds links and joints. An MJCF file holds motors and springs as well; forces that MJCF cannot
    express are written to the Python file FILE_forces.py.
    """
    from vsacli.files.file_kinds import FileKind, recognize

    kind = recognize(file)
    output = None if output == STANDARD else output
    if kind is FileKind.ROBOT:
        _check_options(RESULT_OPTIONS, "results")
        name = _choose_format(form, ROBOT_FORMATS, output, file, kind)
        return _export_robot(file, output, name, start, overwrite, talk)
    if kind not in {FileKind.RESULT, FileKind.SIMULATION}:
        message = f"is {in_words(kind)}; export needs a result, a simulation or a robot"
        raise InputError.one(message + _ADVICE_BY_KIND.get(kind, "").format(file), file)
    _check_options(("start",), "MJCF of a robot")
    name = _choose_format(form, RESULT_FORMATS, output, file, kind)
    if RESULT_FORMATS[name].binary and output is None:
        raise click.UsageError(f"--format {name} needs -o FILE: the file is binary")
    options = {**of_results, "progress": talk.writing}
    return _export_result(file, output, RESULT_FORMATS[name], options, overwrite, talk)


def _endings(form: str) -> tuple[str, ...]:
    return ENDINGS.get(form, (f".{form}",))


def _choose_format(form: str | None, formats: Any, output: str | None, file: str, kind: FileKind) -> str:
    """Return the format named by --format or by the ending of the output; CSV without either."""
    words, name = joined(formats, "or"), output or ""
    if form is not None and form not in formats:
        other_files = "robots" if formats is RESULT_FORMATS else "results"
        raise InputError.one(f"--format {form} is for {other_files}; a {kind} is written as {words}", file)
    matching = [form_name for form_name in formats if ending_of(name) in _endings(form_name)]
    if ending_of(name) and not matching and (form is None or ending_of(name) in KNOWN_ENDINGS):
        allowed_endings = ", ".join(
            dict.fromkeys(ending for form_name in formats for ending in _endings(form_name))
        )
        advice = "" if ending_of(name) in KNOWN_ENDINGS else "; with --format the name may be any"
        message = f"export of a {kind} writes {allowed_endings}, not {ending_of(name)}{advice}"
        raise InputError.one(message, name)
    if form is not None:
        if matching and form not in matching:
            renaming_hint = f"name the file {_endings(form)[0]} or leave out --format"
            message = f"--format {form} does not match the ending {ending_of(name)}; {renaming_hint}"
            raise InputError.one(message, name)
        return form
    if len(matching) != 1 and formats is not RESULT_FORMATS:
        options = joined([f"--format {form_name}" for form_name in formats], "or")
        raise InputError.one(f"is a {kind}; choose its format: {options}", file)
    return matching[0] if matching else "csv"


def _check_options(names: Iterable[str], subject: str) -> None:
    """Refuse options, by the names of their parameters, that apply to another subject only."""
    context = click.get_current_context()
    for name in names:
        if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            option = f"--{name.replace('_', '-')}"
            raise click.UsageError(f"{option} is only for {subject}; leave it out")


def _export_robot(
    file: str, output: str | None, form: str, start: str | None, overwrite: bool, talk: Talk
) -> int:
    from vsacli.robot.file import load_robot

    robot = load_robot(file)
    if form != "mjcf":
        _check_options(("start",), "--format mjcf")
    model = ROBOT_FORMATS[form](robot, None if start is None else _read_start(start, robot))
    if output is None:
        if model.forces is not None:
            raise InputError.one("this model includes a Python file with forces; give -o FILE", file)
        click.echo(model.text.rstrip("\n"))
    else:
        with Outputs(overwrite=overwrite, inputs=_input_paths(robot, start)) as outputs:
            outputs.file(output).write_text(model.text)
            if model.forces is not None:
                path = Path(output)
                outputs.file(path.with_name(f"{path.stem}_forces.py")).write_text(model.forces)
        talk.wrote(outputs)
    for note in (*model.notes, *(f"warning: {warning}" for warning in robot.warnings)):
        talk.note(note)
    return Exit.OK


def _input_paths(robot: Robot, start: str | None) -> list[str]:
    sources = [source.path for source in robot.sources]
    return sources if start is None else [*sources, start]


def _read_start(path: str, robot: Robot) -> Start:
    """Return the first sample of a result of the robot."""
    from vsacli.results.store.reader import StoredResult
    from vsacli.robot.models.mjcf_drives import Start

    with naming_kind("--start", path, ("result",)), StoredResult.open(path) as result:
        if result.joint_names != robot.joint_names:
            joints = f"{', '.join(result.joint_names)}, not {', '.join(robot.joint_names)}"
            raise InputError.one(f"is of another robot, with the joints {joints}", path)
        return Start(*(result.read(name, 0, 1)[0] for name in Start._fields))


def _export_result(
    file: str, output: str | None, form: ResultFormat, options: dict[str, Any], overwrite: bool, talk: Talk
) -> int:
    from vsacli.base.variables import select_variables
    from vsacli.files.repetition import at_rate
    from vsacli.results.exports.result_format import UndefinedSamplesError, export_result
    from vsacli.results.exports.selection import stride_of
    from vsacli.results.store.reader import open_stored

    try:
        with ExitStack() as stack:
            stored = stack.enter_context(open_stored(file))
            talk.detail(result_line(stored))
            if options["variables"] is not None:
                with naming_option("--variables"):
                    select_variables(options["variables"], stored.declared)
            if options["rate"] is not None:
                with naming_option("--rate"):
                    stored = stack.enter_context(at_rate(stored, options["rate"]))
                    stride_of(stored, options["rate"])
            if output is None:
                export_result(stored, sys.stdout, form, **options)
                sys.stdout.flush()
            else:
                with Outputs(overwrite=overwrite, inputs=[file]) as outputs:
                    _write_result(stored, outputs.file(output), form, options)
                talk.wrote(outputs)
    except UndefinedSamplesError as error:
        tell(str(error))
        return Exit.VERDICT
    return Exit.OK


def _write_result(stored: StoredResult, file: Staged, form: ResultFormat, options: dict[str, Any]) -> None:
    from vsacli.results.exports.result_format import export_result

    with file.opened(binary=form.binary) as stream:
        export_result(stored, stream, form, **options)
