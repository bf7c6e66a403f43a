"""The table of a study, from the rows in its journal."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsacli.base.outputs import Staged
from vsacli.results.store.study_table import Head, Parameter, Rows, StudyWriter, rows_at_once
from vsacli.studies.sweeps.journal import Journal
from vsacli.studies.sweeps.over_time import filled, steps_of
from vsacli.studies.sweeps.row_values import Values, arrays_of, width
from vsacli.studies.sweeps.rows import Row
from vsacli.studies.sweeps.study import Study


def write(
    study: Study,
    runs: Sequence[int],
    lost: Mapping[int, Row],
    journal: Journal,
    file: Staged,
    **provenance: str,
) -> None:
    """Write the table of runs.

    Args:
        study: the study.
        runs: in their order.
        lost: rows that are not in the journal.
        journal: has the others.
        file: where the table is staged.
        **provenance: further root attributes.

    Raises:
        StorageError: the disk is full or fails.
    """
    joints = len(study.robot.joints)

    def row(run: int) -> Row:
        return lost[run] if run in lost else journal.row(run, study.key(study.point(run)))

    steps = 0
    if study.over_time:  # known once all rows were read
        steps = max((steps_of(row(run).curves, study.over_time, joints) for run in runs), default=0)
    at_once = rows_at_once(steps)
    with StudyWriter(file, _head(study, steps, provenance), len(runs)) as writer:
        for start in range(0, len(runs), at_once):
            writer.write(_rows(study, [row(run) for run in runs[start : start + at_once]], steps))
        writer.finish()


def _head(study: Study, steps: int, provenance: dict[str, str]) -> Head:
    parameters = [Parameter(each.path, each.unit, each.numeric) for each in study.dimensions]
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


def _rows(study: Study, rows: Sequence[Row], steps: int) -> Rows:
    points = [study.point(row.run) for row in rows]
    arrays: dict[str, Any] = {
        "trajectory": [study.trajectories[point.trajectory] for point in points],
        **{name: [getattr(row, name) for row in rows] for name in ("verdict", "error", "key")},
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
    columns: list[Values] = [*study.costs, *study.kept]
    table = np.full((len(rows), width(columns, joints)), np.nan)
    for place, row in enumerate(rows):
        if len(row.values):
            table[place] = row.values
    arrays |= arrays_of(columns, table, joints)
    if study.over_time:
        arrays |= filled([row.curves for row in rows], study.over_time, steps, joints)
    return Rows([row.run for row in rows], arrays)
