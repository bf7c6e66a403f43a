"""Files that say what the columns of recordings stand for: `vsacli-columns/1`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

from vsacli.base.errors import FieldProblem
from vsacli.documents.column_mapping import AS_NAMED, ColumnMapping, MappedColumn
from vsacli.documents.column_source import columns_field, ignore_field
from vsacli.documents.fields import check_fields
from vsacli.documents.reading import read_document

FORMAT = "vsacli-columns/1"


@dataclass(frozen=True, kw_only=True)
class ColumnsFile:
    """The content of such a file: what a trajectory file says of its recordings, for recordings alone."""

    columns: Mapping[str, MappedColumn] | None = columns_field()
    ignore: str | tuple[str | int, ...] | None = ignore_field()

    def __post_init__(self) -> None:
        nothing = FieldProblem((), "says nothing: give columns or ignore")
        check_fields(self, *([] if self.columns or self.ignore else [nothing]))


def load_columns(path: str | os.PathLike[str] | None) -> ColumnMapping:
    """What a file says of the columns of recordings; without one, columns are what their names say.

    Raises:
        InputError: with every problem of the file, each with its line.
    """
    if path is None:
        return AS_NAMED
    document, _ = read_document(path, ColumnsFile, FORMAT)
    return ColumnMapping(document.columns or {}, document.ignore or ())
