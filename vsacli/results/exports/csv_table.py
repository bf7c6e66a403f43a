"""Results as CSV: a column for each joint and variable, whose floats read back bit for bit."""

from __future__ import annotations

import csv
from collections.abc import Callable
from typing import Any, TextIO

import numpy as np
import numpy.typing as npt

from vsacli.results.exports.result_format import ResultFormat
from vsacli.results.exports.selection import Selection


def write_csv(selection: Selection, stream: TextIO, done: Callable[[int], object]) -> None:
    """Write a header line and a line for each sample; a file should be open with newline=""."""
    names = selection.result.joint_names
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", *(column for each in selection.chosen for column in each.columns(names))])
    for block in selection.blocks():
        columns = [block.time.tolist()]
        for each in selection.chosen:
            columns += _cells(each.of_columns(block.values[each.name]))
        writer.writerows(zip(*columns, strict=True))
        done(len(block.time) * len(selection.chosen))


def _cells(columns: npt.NDArray[Any]) -> list[list[Any]]:
    """Columns as numbers; NaN becomes None, which csv leaves empty."""
    missing = np.isnan(columns)
    if missing.any():
        columns = columns.astype(object)
        columns[missing] = None
    cells: list[list[Any]] = columns.tolist()
    return cells


CSV = ResultFormat(write_csv, missing="empty cells")
