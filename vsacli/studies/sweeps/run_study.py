"""Execution of a study: missing rows are computed and added to the journal, then all become a table."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from vsacli.base.errors import InputError, check_path
from vsacli.base.interrupts import Interrupted
from vsacli.base.outputs import Outputs
from vsacli.base.progress import Progress, unheard, unseen
from vsacli.results.store.study_table import StoredStudy
from vsacli.studies.sweeps.executors import executor
from vsacli.studies.sweeps.journal import Journal
from vsacli.studies.sweeps.rows import Row
from vsacli.studies.sweeps.study import Study, load_study
from vsacli.studies.sweeps.study_tables import write

MOST_LINES_NAMED = 5
"""Largest number of damaged lines of a journal that a message lists."""


def run_study(
    path: str | os.PathLike[str],
    table: str | os.PathLike[str] | None = None,
    *,
    shard: tuple[int, int] = (1, 1),
    processes: int | None = None,
    dask: str | None = None,
    engine: str = "numpy",
    overwrite: bool = False,
    command_line: str = "",
    progress: Progress = unseen,
    tell: Callable[[str], object] = unheard,
) -> StoredStudy:
    """Compute the runs of a study file, and write a table with one row per run.

    Finished rows are kept in a journal next to the table until the table is written. If the study is
    interrupted, the same call continues with the missing rows.

    Args:
        path: path of the study file.
        table: HDF5 file to write; by default it has the name of the study file, in the working folder.
        shard: part to compute and number of parts, such as (2, 8).
        processes: number of worker processes; default: number of CPU cores, or fewer for short studies. Rows
            do not depend on it. A script that uses more than one needs `if __name__ == "__main__":`; see
            the module `multiprocessing`.
        dask: address of the scheduler of a Dask cluster to use instead, or "local".
        engine: "numpy", compiled "c", or "auto", which chooses "c" for all runs if that saves time.
        overwrite: whether an existing table may be replaced.
        command_line: command line of the caller, for the provenance.
        progress: function that opens a progress bar over the missing runs.
        tell: function to call with messages about kept and lost rows, and with warnings about implausible
            values of robot and trajectories.

    Returns:
        Open table, a context manager that closes it.

    Raises:
        InputError: a file is wrong, or no worker can compute.
        StorageError: the table exists and must not be replaced, or the disk is full or fails.
        TypeError: `path` is of another type.
    """
    check_path(path, "run_study(path)")
    study = load_study(path, engine)
    for warning in study.warnings:  # once, not for each run
        tell(f"warning: {warning}")
    runs, suffix = _study_part(study, *shard)
    target = Path(f"{Path(path).stem}{suffix}.h5" if table is None else table)
    with Outputs(overwrite=overwrite, inputs=[source.path for source in study.sources]) as outputs:
        outputs.check(target)
        with Journal(target.with_name(f"{target.name}.journal")) as journal:
            _tell_damage(journal, tell)
            file = outputs.file(target)
            with _telling_what_is_kept(journal, study.runs_of_batch, tell):
                lost = _computed(study, runs, journal, (processes, dask), progress, tell)
                write(study, runs, lost, journal, file, command_line=command_line)
    if lost:
        tell(
            f"runs lost with their processes: {len(lost)}; all others are in {journal.path}, and the same "
            "command with --overwrite tries these again"
        )
    else:
        journal.remove()
    return StoredStudy(target)


def _study_part(study: Study, number: int, parts: int) -> tuple[range, str]:
    """Return the runs of a part of a study, and the suffix for the name of its table."""
    if not 1 <= number <= parts:
        raise InputError.one(
            f"shard must be the number of a part and how many there are, not {(number, parts)}"
        )
    return range(study.runs)[number - 1 :: parts], f"-{number}-of-{parts}" if parts > 1 else ""


def _tell_damage(journal: Journal, tell: Callable[[str], object]) -> None:
    if journal.damaged:
        numbers = ", ".join(map(str, journal.damaged[:MOST_LINES_NAMED]))
        more = len(journal.damaged) - MOST_LINES_NAMED
        words = (
            ("lines", "are", "their runs are") if len(journal.damaged) > 1 else ("line", "is", "its run is")
        )
        named = f"{words[0]} {numbers}{f' and {more} more' if more > 0 else ''}"
        tell(f"{journal.path}: {named} {words[1]} damaged; {words[2]} computed again")


def _computed(
    study: Study,
    runs: Sequence[int],
    journal: Journal,
    workers: tuple[int | None, str | None],
    progress: Progress,
    tell: Callable[[str], object],
) -> dict[int, Row]:
    """Compute rows missing in the journal; return the rows of runs that were lost with their processes."""
    missing = [run for run in runs if study.key(study.point(run)) not in journal]
    if len(missing) < len(runs):
        tell(f"{len(runs) - len(missing):,} of {len(runs):,} runs are in {journal.path} already")
    if not missing:
        return {}
    with progress(len(missing)) as bar, executor(study, len(missing), *workers, tell) as rows:
        return gather(rows(missing), journal, bar.update)


def gather(rows: Iterable[Row], journal: Journal, done: Callable[[int], object]) -> dict[int, Row]:
    """Add rows to the journal as they arrive.

    Args:
        rows: rows of further runs.
        journal: journal to extend.
        done: function to call with the number of further runs that are done.

    Returns:
        Rows of runs that were lost with their process, by run. They are not in the journal, since another
        attempt may succeed.

    Raises:
        InputError: a process cannot read the study as it was.
        StorageError: the disk is full or fails; previous rows are in the journal.
    """
    lost = {}
    for row in rows:
        if row.lost:
            lost[row.run] = row
        else:
            journal.add(row)
        done(1)
    return lost


@contextmanager
def _telling_what_is_kept(journal: Journal, together: int, tell: Callable[[str], object]) -> Iterator[None]:
    """Report the kept rows if the study ends early; up to `together` runs finish at a time."""
    try:
        yield
    except BaseException as error:
        if len(journal):
            tell(
                f"{len(journal):,} finished runs are kept in {journal.path}; the same command goes on from "
                "there"
            )
        elif isinstance(error, Interrupted | KeyboardInterrupt):
            tell(
                "no run had finished, so none is kept"
                + (f"; they are computed up to {together} at a time" if together > 1 else "")
            )
        raise
