"""Parts of a study, each computed by itself, put together into its whole table."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.base.outputs import Staged
from vsacli.documents.source import Source
from vsacli.results.store.stored_study import StoredStudy
from vsacli.results.store.study_table import TEXTS, Column, Head, Parameter, Rows, StudyWriter
from vsacli.studies.sweeps.kept import KEPT
from vsacli.studies.sweeps.over_time import OVER_TIME
from vsacli.studies.sweeps.rows import FAILED

MOST_NAMED = 5
"""Runs that a message names."""


def merge(paths: Sequence[str | Path], file: Staged, **provenance: str) -> None:
    """Write the whole table of a study from parts that have all its runs between them.

    A run that failed in one part and not in another counts as computed.

    Args:
        paths: the parts.
        file: where the whole is staged.
        **provenance: root attributes in place of those of the parts.

    Raises:
        InputError: they are parts of different studies, or some runs are in none of them.
        StorageError: the disk is full or fails.
    """
    with ExitStack() as stack:
        parts = [stack.enter_context(StoredStudy(path)) for path in paths]
        _check_alike(parts)
        order = _order(parts)
        with StudyWriter(
            file, _head(parts[0], max(part.steps for part in parts), provenance), len(order)
        ) as writer:
            writer.write(Rows(range(len(order)), _arrays(parts, order)))
            writer.finish()


def _check_alike(parts: Sequence[StoredStudy]) -> None:
    first = parts[0]
    for part in parts[1:]:
        if part.fingerprint != first.fingerprint:
            raise InputError.one(
                f"is part of another study than {first.path}: of other files, or computed otherwise",
                part.path,
            )


def _order(parts: Sequence[StoredStudy]) -> IndexArray:
    """The place of each run among all rows of the parts, one part after the other."""
    runs = np.concatenate([part.read("run") for part in parts])
    lost = np.concatenate([np.array(part.texts("verdict")) == FAILED for part in parts])
    order = np.full(parts[0].runs, -1)
    for rows in (np.flatnonzero(lost), np.flatnonzero(~lost)):
        order[runs[rows]] = rows
    absent = np.flatnonzero(order < 0)
    if len(absent):
        shown = ", ".join(map(str, absent[:MOST_NAMED])) + (", ..." if len(absent) > MOST_NAMED else "")
        raise InputError.one(f"{len(absent):,} of {len(order):,} runs are in none of the files: {shown}")
    return order


def _arrays(parts: Sequence[StoredStudy], order: IndexArray) -> dict[str, Any]:
    """All columns in the order of the runs."""
    first, arrays = parts[0], dict[str, Any]()
    for name in (*TEXTS, *first.parameters, *first.columns):
        if name in TEXTS or first.parameter_is_text(name):
            texts = [text for part in parts for text in part.texts(name)]
            arrays[name] = [texts[row] for row in order]
        else:
            arrays[name] = np.concatenate(_alike([part.read(name) for part in parts]))[order]
    return arrays


def _alike(pieces: Sequence[FloatArray]) -> list[FloatArray]:
    """Pieces of a column with as many steps as the one that has most, NaN where others have ended."""
    if pieces[0].ndim == 1:
        return list(pieces)
    steps = max(piece.shape[1] for piece in pieces)
    rest = [(0, 0)] * (pieces[0].ndim - 2)
    ends = [[(0, 0), (0, steps - piece.shape[1]), *rest] for piece in pieces]
    return [np.pad(piece, end, constant_values=np.nan) for piece, end in zip(pieces, ends, strict=True)]


def _head(part: StoredStudy, steps: int, provenance: dict[str, str]) -> Head:
    sources: dict[str, tuple[Source, ...]] = {"study": (), "robot": (), "trajectory": ()}
    columns: dict[str, Column] = {**KEPT, **OVER_TIME}
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
            Parameter(
                path,
                "" if part.parameter_is_text(path) else part.unit(path),
                not part.parameter_is_text(path),
            )
            for path in part.parameters
        ),
        columns=tuple(columns[name] for name in part.columns),
        steps=steps,
        sources=sources,
        provenance=part.provenance() | provenance,
    )
