"""Execution of a study: missing rows are computed and added to the journal, then all become a table.

The tables of the parts of a study are merged here, too.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.arrays import IndexArray
from vsacli.base.errors import InputError, check_path
from vsacli.base.interrupts import Interrupted
from vsacli.base.outputs import Outputs, Staged
from vsacli.base.progress import Progress, unheard, unseen
from vsacli.base.texts import counted, listed
from vsacli.documents.source import Source
from vsacli.results.store.study_table import (
    RUN_TEXTS,
    TEXTS,
    Head,
    StoredStudy,
    StudyRows,
    StudyWriter,
    VariedParameter,
    rows_at_once,
)
from vsacli.studies.sweeps.columns import arrays_of, pad_curves, row_length, steps_of
from vsacli.studies.sweeps.executors import executor
from vsacli.studies.sweeps.journal import Journal
from vsacli.studies.sweeps.rows import FAILED, Row
from vsacli.studies.sweeps.study import Study, load_study


def write(
    study: Study,
    runs: Sequence[int],
    lost_rows: Mapping[int, Row],
    journal: Journal,
    file: Staged,
    **provenance: str,
) -> None:
    """Write the table of runs.

    Args:
        study: study of the runs.
        runs: numbers of the runs, in order.
        lost_rows: rows that are not in the journal, by run.
        journal: journal with the other rows.
        file: staged file of the table.
        **provenance: further root attributes.

    Raises:
        StorageError: the disk is full or fails.
    """
    joints = len(study.robot.joints)

    def row(run: int) -> Row:
        return lost_rows[run] if run in lost_rows else journal.row(run, study.key(study.point(run)))

    steps = 0
    if study.over_time:  # the longest run determines the size, so all rows are read first
        steps = max((steps_of(row(run).curves, study.over_time, joints) for run in runs), default=0)
    batch_rows = rows_at_once(steps)
    with StudyWriter(file, _head_of_study(study, steps, provenance), len(runs)) as writer:
        for start in range(0, len(runs), batch_rows):
            writer.write(_table_rows(study, [row(run) for run in runs[start : start + batch_rows]], steps))
        writer.finish()


def _head_of_study(study: Study, steps: int, provenance: dict[str, str]) -> Head:
    parameters = [VariedParameter(each.path, each.unit, each.numeric) for each in study.dimensions]
    return Head(
        study=study.file.name,
        robot=study.robot.name,
        fingerprint=study.fingerprint,
        runs=study.runs,
        joint_names=study.robot.joint_names,
        joint_types=study.robot.joint_types,
        parameters=tuple(parameters),
        columns=(*study.costs, *study.kept, *study.over_time),
        steps=steps,
        sources={
            "study": (study.source,),
            "robot": study.robot.sources,
            "trajectory": tuple(dict.fromkeys(each for files in study.trajectory_sources for each in files)),
        },
        provenance={
            "method": study.file.method,
            "seed": str(study.file.seed),
            "engine": study.engine,
            "compiler": study.compiler,
            "numpy": np.__version__,
            **provenance,
        },
    )


def _table_rows(study: Study, rows: Sequence[Row], steps: int) -> StudyRows:
    points = [study.point(row.run) for row in rows]
    arrays: dict[str, Any] = {
        "trajectory": [study.trajectories[point.trajectory] for point in points],
        **{name: [getattr(row, name) for row in rows] for name in RUN_TEXTS},
    }
    for dimension in study.dimensions:
        values = [point.values[dimension.path] for point in points]
        if dimension.numeric:
            arrays[dimension.path] = np.array([dimension.number(value) for value in values], dtype=float)
        else:
            arrays[dimension.path] = [
                value if isinstance(value, str) else json.dumps(value) for value in values
            ]
    joints = len(study.robot.joints)
    columns = [*study.costs, *study.kept]
    table = np.full((len(rows), row_length(columns, joints)), np.nan)
    for row_index, row in enumerate(rows):
        if len(row.values):
            table[row_index] = row.values
    arrays |= arrays_of(columns, table, joints)
    if study.over_time:
        arrays |= pad_curves([row.curves for row in rows], study.over_time, steps, joints)
    return StudyRows([row.run for row in rows], arrays)


MAX_LISTED_RUNS = 5
"""Largest number of runs that a message lists."""


def merge(paths: Sequence[str | Path], file: Staged, **provenance: str) -> None:
    """Merge tables of parts, which together have all runs, into the whole table of a study.

    A run that failed in one part and not in another counts as computed.

    Args:
        paths: paths of the parts.
        file: staged file of the whole table.
        **provenance: root attributes that replace those of the parts.

    Raises:
        InputError: the parts belong to different studies, one is given twice, or some runs are in none.
        StorageError: the disk is full or fails.
    """
    _check_distinct_paths(paths)
    with ExitStack() as stack:
        parts = [stack.enter_context(StoredStudy(path)) for path in paths]
        _check_same_study(parts)
        order = _row_order(parts)
        steps = max(part.steps for part in parts)
        with StudyWriter(file, _head_of_parts(parts[0], steps, provenance), len(order)) as writer:
            for start in range(0, len(order), rows_at_once(steps)):
                row_indices = order[start : start + rows_at_once(steps)]
                writer.write(
                    StudyRows(
                        range(start, start + len(row_indices)),
                        _concatenated_columns(parts, row_indices, steps),
                    )
                )
            writer.finish()


def _check_distinct_paths(paths: Sequence[str | Path]) -> None:
    seen_paths: set[Path] = set()
    for path in paths:
        if (resolved_path := Path(path).resolve()) in seen_paths:
            raise InputError.one("is given twice; give each table once", path)
        seen_paths.add(resolved_path)


def _check_same_study(parts: Sequence[StoredStudy]) -> None:
    first = parts[0]
    for part in parts[1:]:
        if part.fingerprint != first.fingerprint:
            raise InputError.one(
                f"is part of another study than {first.path}: of other files, or computed otherwise",
                part.path,
            )


def _row_order(parts: Sequence[StoredStudy]) -> IndexArray:
    """Return the index of each run's row in the concatenated parts."""
    runs = np.concatenate([part.read("run") for part in parts])
    is_failed = np.concatenate([np.array(part.texts("verdict")) == FAILED for part in parts])
    order = np.full(parts[0].runs, -1)
    for rows in (np.flatnonzero(is_failed), np.flatnonzero(~is_failed)):
        order[runs[rows]] = rows
    missing_runs = np.flatnonzero(order < 0)
    if len(missing_runs):
        listed_runs = listed(list(map(str, missing_runs)), MAX_LISTED_RUNS)
        missing_text = (
            f"run {listed_runs} is missing" if len(missing_runs) == 1 else f"runs {listed_runs} are missing"
        )
        subject = f"{parts[0].path} holds" if len(parts) == 1 else "the tables hold"
        count_text = f"{subject} {len(order) - len(missing_runs)} of {counted(len(order), 'run')}"
        raise InputError.one(f"{count_text}; {missing_text}: give the tables of all shards (--shard K/N)")
    return order


def _concatenated_columns(parts: Sequence[StoredStudy], rows: IndexArray, steps: int) -> dict[str, Any]:
    """Return all columns of some runs; `rows` are indices into the concatenated parts."""
    first = parts[0]
    text_columns = {
        name for name in (*TEXTS, *first.parameters) if name in TEXTS or first.parameter_is_text(name)
    }
    arrays: dict[str, Any] = {name: np.empty(len(rows), dtype=object) for name in text_columns}
    for name in {*first.parameters, *first.columns} - text_columns:
        arrays[name] = np.full((len(rows), *first.shape(name, steps)), np.nan)
    start = 0
    for part in parts:
        row_indices = np.flatnonzero((start <= rows) & (rows < start + part.rows))
        if len(row_indices):
            _copy_rows(arrays, text_columns, row_indices, part, rows[row_indices] - start)
        start += part.rows
    return arrays | {name: arrays[name].tolist() for name in text_columns}


def _copy_rows(
    arrays: dict[str, Any],
    texts: Collection[str],
    row_indices: IndexArray,
    part: StoredStudy,
    rows: IndexArray,
) -> None:
    """Copy rows of a part to their places; runs with fewer samples than others end with NaN."""
    span = slice(int(rows.min()), int(rows.max()) + 1)
    for name, array in arrays.items():
        part_values = (
            np.array(part.texts(name, span), dtype=object) if name in texts else part.read(name, span)
        )
        array[(row_indices, *map(slice, part_values.shape[1:]))] = part_values[rows - span.start]


def _head_of_parts(part: StoredStudy, steps: int, provenance: dict[str, str]) -> Head:
    sources: dict[str, tuple[Source, ...]] = {"study": (), "robot": (), "trajectory": ()}
    role = "study"
    for each in part.inputs():
        role = each.role or role
        text = None if each.content is None else each.content.decode()
        sources[role] += (Source(each.path, each.sha256, text),)
    return Head(
        study=part.study_name,
        robot=part.robot_name,
        fingerprint=part.fingerprint,
        runs=part.runs,
        joint_names=part.joint_names,
        joint_types=part.joint_types,
        parameters=tuple(
            VariedParameter(
                path,
                "" if part.parameter_is_text(path) else part.unit(path),
                not part.parameter_is_text(path),
            )
            for path in part.parameters
        ),
        columns=tuple(map(part.column, part.columns)),
        steps=steps,
        sources=sources,
        provenance=part.provenance() | provenance,
    )


MAX_LISTED_LINES = 5
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
            with _reporting_kept_rows(journal, study.runs_of_batch, tell):
                lost_rows = _compute_missing_rows(study, runs, journal, (processes, dask), progress, tell)
                write(study, runs, lost_rows, journal, file, command_line=command_line)
    if lost_rows:
        tell(
            f"runs lost with their processes: {len(lost_rows)}; all others are in {journal.path}, "
            "and the same command with --overwrite tries these again"
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
        numbers = ", ".join(map(str, journal.damaged[:MAX_LISTED_LINES]))
        other_count = len(journal.damaged) - MAX_LISTED_LINES
        words = (
            ("lines", "are", "their runs are") if len(journal.damaged) > 1 else ("line", "is", "its run is")
        )
        line_text = f"{words[0]} {numbers}{f' and {other_count} more' if other_count > 0 else ''}"
        tell(f"{journal.path}: {line_text} {words[1]} damaged; {words[2]} computed again")


def _compute_missing_rows(
    study: Study,
    runs: Sequence[int],
    journal: Journal,
    workers: tuple[int | None, str | None],
    progress: Progress,
    tell: Callable[[str], object],
) -> dict[int, Row]:
    """Compute rows missing in the journal; return the rows of runs that were lost with their processes."""
    missing_runs = [run for run in runs if study.key(study.point(run)) not in journal]
    if len(missing_runs) < len(runs):
        tell(f"{len(runs) - len(missing_runs):,} of {len(runs):,} runs are in {journal.path} already")
    if not missing_runs:
        return {}
    with progress(len(missing_runs)) as bar, executor(study, len(missing_runs), *workers, tell) as rows:
        return gather(rows(missing_runs), journal, bar.update)


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
    lost_rows = {}
    for row in rows:
        if row.lost:
            lost_rows[row.run] = row
        else:
            journal.add(row)
        done(1)
    return lost_rows


@contextmanager
def _reporting_kept_rows(journal: Journal, together: int, tell: Callable[[str], object]) -> Iterator[None]:
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
