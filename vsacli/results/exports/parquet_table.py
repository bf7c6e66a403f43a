"""Results as Parquet, column by column, for pandas, Polars, DuckDB and other tools of data analysis."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from vsacli.base.errors import InputError
from vsacli.results.exports.result_format import ResultFormat
from vsacli.results.exports.selection import Selection
from vsacli.results.store.schema import storage_type

if TYPE_CHECKING:
    import pyarrow

OF_RESULT = ("robot_name", "trajectory_name", "verdict")
"""What the metadata of a table say of the result, by attributes of it."""


def write_parquet(selection: Selection, stream: IO[bytes], done: Callable[[int], object]) -> None:
    """Write the columns of the CSV, in groups of rows of which one at a time is in memory."""
    from pyarrow import Table, array, parquet

    schema = _schema(selection)
    with parquet.ParquetWriter(stream, schema) as writer:
        for block in selection.blocks():
            columns = [block.time]
            for each in selection.chosen:
                columns += list(each.of_columns(block.values[each.name]))
            arrays = [array(column, mask=np.isnan(column)) for column in columns]
            writer.write_table(Table.from_arrays(arrays, schema=schema))
            done(len(block.time) * len(selection.chosen))


def check_installed(_selection: Selection) -> None:
    """Refuse if there is nothing that could write it."""
    try:
        import pyarrow  # noqa: F401
    except ModuleNotFoundError:
        reason = "Parquet needs the package pyarrow, which is not installed; pip install pyarrow gets it"
        raise InputError.one(reason) from None


def _schema(selection: Selection) -> pyarrow.Schema:
    import pyarrow

    of_result: dict[Any, Any] = {name: getattr(selection.result, name) for name in OF_RESULT}
    return pyarrow.schema(
        [
            pyarrow.field(name, pyarrow.from_numpy_dtype(kind), metadata={"unit": unit})
            for name, kind, unit in _fields(selection)
        ],
        metadata=of_result,
    )


def _fields(selection: Selection) -> Iterator[tuple[str, np.dtype[Any], str]]:
    """Name, type and unit of each column."""
    result = selection.result
    yield "time", np.dtype(np.float64), "s"
    for each in selection.chosen:
        units = np.repeat(each.units(result.joint_types), each.there.sum(axis=1)).tolist()
        for name, unit in zip(each.columns(result.joint_names), units, strict=True):
            yield name, storage_type(each.variable), unit


PARQUET = ResultFormat(write_parquet, binary=True, missing="nulls", check=check_installed)
