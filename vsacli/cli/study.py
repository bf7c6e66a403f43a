"""`vsacli study`: compute the runs of a study, or merge its partial tables."""

from __future__ import annotations

import re
import shlex
import sys
from functools import partial
from typing import TYPE_CHECKING

import click

from vsacli.base.outputs import Outputs
from vsacli.base.storage import STANDARD
from vsacli.cli.command_parts import example, json_option, overwrite_option
from vsacli.cli.console import Exit, Talk, say, talk_options
from vsacli.cli.file_names import FILE, HDF5_FILE
from vsacli.cli.input_errors import naming_kind
from vsacli.cli.option_types import Whole, Words

if TYPE_CHECKING:
    from vsacli.results.store.study_table import StoredStudy

_SHARD_PATTERN = re.compile(r"(\d{1,6})/(\d{1,6})")


def _shard(_context: click.Context, _parameter: click.Parameter, text: str) -> tuple[int, int]:
    match = _SHARD_PATTERN.fullmatch(text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise click.BadParameter(f"expected K/N with K from 1 to N, e.g. 2/8, found {text!r}")
    return int(match[1]), int(match[2])


@click.command(
    "study",
    epilog=example("vsacli study yield.yaml -o yield.h5"),
)
@click.argument("files", type=FILE, metavar="STUDY", nargs=-1, required=True)
@click.option(
    "-o", "--output", type=HDF5_FILE, help="Table to write.", show_default="STUDY.h5 in the current folder"
)
@click.option(
    "--processes",
    metavar="N",
    type=Whole("a number of processes, e.g. 4", least=1),
    help="Number of worker processes; the table does not depend on it.",
    show_default="number of CPU cores",
)
@click.option(
    "--shard",
    metavar="K/N",
    callback=_shard,
    default="1/1",
    help="Compute part K of N, e.g. as one of N jobs, and write STUDY-K-of-N.h5.",
    show_default="the whole study",
)
@click.option(
    "--dask",
    metavar="ADDRESS",
    help="Compute on the workers of a Dask cluster: address of its scheduler, or `local` for "
    "processes on this computer.",
)
@click.option("--merge", is_flag=True, help="Merge tables of all parts, given in place of STUDY.")
@click.option(
    "--engine",
    type=Words(["numpy", "c", "auto"]),
    default="numpy",
    show_default=True,
    help="Backend of the computation: NumPy, or C code compiled for each robot; auto chooses the "
    "faster one once for all runs.",
)
@json_option
@overwrite_option
@talk_options
def study(
    files: tuple[str, ...],
    output: str | None,
    processes: int | None,
    shard: tuple[int, int],
    dask: str | None,
    merge: bool,
    engine: str,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Compute all runs of the file STUDY, and write a table with one row for each.

    Finished rows are kept in FILE.journal until the table is written: after an interruption of any kind, the
    same command computes only the missing rows. Exit code 0 if every run was computed, whatever its verdict,
    3 if one failed; its row gives the error.
    """
    if merge:
        return _merge(files, output, overwrite, as_json, talk)
    if len(files) > 1:
        raise click.UsageError(
            f"expected one STUDY, found {len(files)}; to merge tables of shards give --merge"
        )
    if files[0] == STANDARD:
        raise click.UsageError("a study is read by several processes and again when it goes on; give a file")
    if dask not in (None, "local") and processes is not None:
        raise click.UsageError(
            "--processes cannot be used with --dask ADDRESS; a cluster has its own workers"
        )
    from vsacli.studies.sweeps import run_study

    with (
        naming_kind("STUDY", files[0], ("study",)),
        run_study(
            files[0],
            output,
            shard=shard,
            processes=processes,
            dask=dask,
            engine=engine,
            overwrite=overwrite,
            command_line=_command_line(),
            progress=partial(talk.progress, shown_from=0, label="runs"),
            tell=talk.note,
        ) as table,
    ):
        return _show_summary(table, as_json, talk)


def _merge(files: tuple[str, ...], output: str | None, overwrite: bool, as_json: bool, talk: Talk) -> int:
    from vsacli.results.store.study_table import StoredStudy
    from vsacli.studies.sweeps import merge

    if output is None:
        raise click.UsageError("--merge needs -o FILE, the table to write")
    kinds = naming_kind("STUDY", files, ("table of a study",))
    with kinds, Outputs(overwrite=overwrite, inputs=files) as outputs:
        merge(files, outputs.file(output), command_line=_command_line())
    with StoredStudy(output) as table:
        return _show_summary(table, as_json, talk)


def _show_summary(table: StoredStudy, as_json: bool, talk: Talk) -> int:
    """Print the summary of a written table; return exit code 3 if a run in it failed."""
    from vsacli.studies.sweeps import StudySummary

    summary = StudySummary.of(table)
    say(summary, as_json)
    talk.note(f"wrote {table.path}")
    return Exit.VERDICT if summary.failures else Exit.OK


def _command_line() -> str:
    return shlex.join(["vsacli", *sys.argv[1:]])
