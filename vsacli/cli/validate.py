"""`vsacli validate`: report every problem of files; recompute results."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from vsacli.cli.command_parts import example
from vsacli.cli.console import Exit, Talk, talk_options
from vsacli.cli.file_names import FILE
from vsacli.cli.input_errors import file_kind_or_none, in_words

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from vsacli.files.validation import CheckedInput


@click.command(
    "validate",
    epilog=example("vsacli validate robots/vsa_3r.yaml trajectories/rest_to_rest.yaml"),
)
@click.argument("files", type=FILE, metavar="FILE...", nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print the findings as a JSON list.")
@click.option(
    "--recompute",
    is_flag=True,
    help="Recompute results from their stored inputs as well; exit code 3 if one differs.",
)
@talk_options
def validate(files: tuple[str, ...], as_json: bool, recompute: bool, talk: Talk) -> int:
    """Report every problem of each FILE.

    The kind of a file (robot, trajectory, poles, CSV table, URDF, result) is recognized by its content. A
    trajectory or a file of poles must match one of the robots among the files; without a robot, joint names,
    units and limits are not checked. Warnings and notes do not count as problems; with --quiet, only problems
    are printed.
    """
    from vsacli.files.file_kinds import FileKind, recognize
    from vsacli.files.validation import check_files

    if recompute and as_json:
        raise click.UsageError("--recompute cannot be used with --json; leave one out")
    if recompute:
        _check_recomputable(files)
    checked = check_files(list(dict.fromkeys(files)))
    if as_json:
        messages = [message.as_json() for file in checked for message in file.messages]
        click.echo(json.dumps(messages, indent=1))
    else:
        for line in _finding_lines(checked, talk):
            click.echo(line)
    if not all(file.passed for file in checked):
        return Exit.USAGE
    result_kinds = (FileKind.RESULT, FileKind.SIMULATION)
    result_paths = [file.path for file in checked if recompute and recognize(file.path) in result_kinds]
    is_equal = [_recompute(path, talk) for path in result_paths]
    return Exit.OK if all(is_equal) else Exit.VERDICT


def _check_recomputable(files: Sequence[str]) -> None:
    """Refuse `--recompute` if no file may be a result; files that cannot be read are reported later.

    Raises:
        click.UsageError: with the kind of a file.
    """
    kinds = [file_kind_or_none(file) for file in files]
    if all(kind not in (None, "result", "simulation") for kind in kinds):
        file, kind = files[0], kinds[0] or ""
        raise click.UsageError(f"--recompute is for results; {file} is {in_words(kind)}")


def _recompute(path: str, talk: Talk) -> bool:
    """Recompute a result and print how it compares."""
    from vsacli.files.repetition import repeat

    differences, precision = repeat(path, talk.note)
    if not differences:
        precision_text = "" if precision == "double" else f", rounded to {precision} precision"
        click.echo(f"{path}: computed again, equal bit for bit{precision_text}")
    for difference in differences:
        click.echo(f"{path}: computed again, {difference}")
    return not differences


def _finding_lines(checked: Sequence[CheckedInput], talk: Talk) -> Iterator[str]:
    for file in checked:
        if file.passed and talk.quiet:
            continue
        if file.passed:
            yield f"{file.path}: ok, {file.summary}"
        yield from map(str, file.messages)
