"""Files that say what the columns of recordings stand for: `vsacli-columns/1`."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.units import RATE
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping, MappedColumn
from vsacli.documents.column_source import columns_field, ignore_field
from vsacli.documents.expression import ExpressionError
from vsacli.documents.fields import LARGEST, POSITIVE, check_fields, number
from vsacli.documents.number import evaluate
from vsacli.documents.reading import read_document

FORMAT = "vsacli-columns/1"


@dataclass(frozen=True, kw_only=True)
class ColumnsFile:
    """The content of such a file: what a trajectory file says of its recordings, for recordings alone."""

    columns: Mapping[str, MappedColumn] | None = columns_field()
    ignore: str | tuple[str | int, ...] | None = ignore_field()
    rate: float | None = number(
        RATE, "rows per second of recordings without times", check=POSITIVE, default=None
    )

    def __post_init__(self) -> None:
        nothing = FieldProblem((), "says nothing: give columns, ignore or rate")
        check_fields(self, *([] if self.columns or self.ignore or self.rate else [nothing]))


def load_columns(path: str | os.PathLike[str] | None) -> ColumnMapping:
    """What a file says of the columns of recordings; without one, columns are what their names say.

    Raises:
        InputError: with every problem of the file, each with its line.
    """
    if path is None:
        return AS_NAMED
    document, _ = read_document(path, ColumnsFile, FORMAT)
    return ColumnMapping(document.columns or {}, document.ignore or (), document.rate)


def checked_rate(given: Any) -> float:
    """Rows per second, as a number or as a text that a file could hold.

    Raises:
        InputError: it is not positive, or no number at all.
    """
    try:
        rate = evaluate(given, "1/s") if isinstance(given, str) else float(given)
    except (ExpressionError, TypeError, ValueError):
        rate = math.nan
    if not 0 < rate <= LARGEST:
        raise InputError.one(f"rate must be a positive number of samples per second, not {given}")
    return rate
