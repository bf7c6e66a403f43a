"""`vsacli study`."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.base.streams import STANDARD
from vsacli.cli.command_parts import example, hdf5_name, json_option, overwrite_option
from vsacli.cli.console import Exit, Talk, say, talk_options

if TYPE_CHECKING:
    from vsacli.base.outputs import Staged
    from vsacli.studies.sweeps import Journal, Shard, Study

RUNS_A_PROCESS = 25
"""A process takes as long to begin as some 25 short runs."""

_SHARD = re.compile(r"(\d{1,6})/(\d{1,6})")


def _shard(_context: click.Context, _parameter: click.Parameter, text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    found = _SHARD.fullmatch(text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise click.BadParameter(f"expected K/N with K from 1 to N, e.g. 2/8, found {text!r}")
    return int(found[1]), int(found[2])


@click.command(
    "study",
    short_help="Compute many runs: other numbers, other motions.",
    epilog=example("vsacli study yield.yaml -o yield.h5"),
)
@click.argument("files", metavar="STUDY", nargs=-1, required=True)
@click.option(
    "-o", "--output", metavar="FILE", callback=hdf5_name, help="Table; by default STUDY.h5 in this folder."
)
@click.option(
    "--processes",
    metavar="COUNT",
    type=click.IntRange(min=1),
    help="How many compute; by default one a processor. The table is the same for any number.",
)
@click.option(
    "--shard",
    metavar="K/N",
    callback=_shard,
    help="Compute part K of N, e.g. as one job of N; by default into STUDY-K-of-N.h5.",
)
@click.option("--merge", is_flag=True, help="Put tables of all parts together, given in place of STUDY.")
@click.option(
    "--engine",
    type=click.Choice(["numpy", "c"]),
    default="numpy",
    show_default=True,
    help="What computes; C code is compiled for each robot anew, and so for motions of one robot.",
)
@json_option
@overwrite_option
@talk_options
def study(
    files: tuple[str, ...],
    output: str | None,
    processes: int | None,
    shard: tuple[int, int] | None,
    merge: bool,
    engine: str,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Compute the runs of a STUDY file, and write a table with a row for each.

    Rows that are finished are kept in FILE.journal until the table is written: after an interruption of any
    kind, the same command goes on with what is missing. Exit code 0 if every run was computed, whatever its
    verdict, 3 if one failed; its row says why.
    """
    if merge:
        return _merge(files, output, overwrite, as_json, talk)
    if len(files) > 1:
        raise click.UsageError(f"expected one study, found {len(files)} files; --merge puts tables together")
    from vsacli.base.outputs import Outputs
    from vsacli.studies.sweeps import Journal, Shard, load_study

    if files[0] == STANDARD:
        raise click.UsageError("a study is read by several processes and again when it goes on; give a file")
    found = load_study(files[0], engine)
    part = Shard() if shard is None else Shard(*shard)
    stem = Path(files[0]).stem + (f"-{part.number}-of-{part.parts}" if shard else "")
    path = Path(f"{stem}.h5" if output is None else output)
    with Outputs(overwrite=overwrite, inputs=[source.path for source in found.sources]) as outputs:
        outputs.check(path)
        with Journal(path.with_name(f"{path.name}.journal")) as journal:
            file = outputs.file(path)
            lost = _computed(found, part, journal, file, processes, talk)
            summary, failed = _shown(file, as_json)
    say(summary)
    talk.wrote(outputs)
    if lost:
        talk.note(
            f"runs lost with their processes: {lost}; all others are in {journal.path}, and the same command "
            "with --overwrite tries these again"
        )
    else:
        journal.remove()
    return Exit.VERDICT if failed else Exit.OK


def _computed(
    found: Study, part: Shard, journal: Journal, file: Staged, processes: int | None, talk: Talk
) -> int:
    """Compute what is missing and write the table; how many runs were lost with their processes."""
    from vsacli.studies.sweeps import compute, missing, write

    runs = part.runs(found)
    todo = missing(found, runs, journal)
    if len(todo) < len(runs):
        talk.note(f"{len(runs) - len(todo):,} of {len(runs):,} runs are in {journal.path} already")
    count = min(_processors(), 1 + len(todo) // RUNS_A_PROCESS) if processes is None else processes
    try:
        with talk.progress(len(todo), shown_from=0, label="runs") as progress:
            lost = compute(found, todo, journal, count, progress.update)
        write(found, runs, lost, journal, file, command_line=shlex.join(["vsacli", *sys.argv[1:]]))
    except BaseException:
        kept = f"{len(journal):,} finished runs are kept in {journal.path}"
        talk.note(f"{kept}; the same command goes on from there")
        raise
    return len(lost)


def _merge(files: tuple[str, ...], output: str | None, overwrite: bool, as_json: bool, talk: Talk) -> int:
    from vsacli.base.outputs import Outputs
    from vsacli.studies.sweeps import merge

    if output is None:
        raise click.UsageError("--merge needs a name for the whole table: give -o FILE")
    with Outputs(overwrite=overwrite, inputs=files) as outputs:
        file = outputs.file(output)
        merge(files, file, command_line=shlex.join(["vsacli", *sys.argv[1:]]))
        summary, failed = _shown(file, as_json)
    say(summary)
    talk.wrote(outputs)
    return Exit.VERDICT if failed else Exit.OK


def _shown(file: Staged, as_json: bool) -> tuple[str, bool]:
    """What a table that was written says, and whether a run in it failed."""
    from vsacli.results.store.stored_study import StoredStudy
    from vsacli.studies.sweeps import StudySummary

    with StoredStudy(file.temporary) as table:
        summary = StudySummary.of(table)
    return json.dumps(summary.as_json(), indent=1) if as_json else str(summary), bool(summary.failures)


def _processors() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
