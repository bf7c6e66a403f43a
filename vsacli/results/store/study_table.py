"""The table of a study: a row for each run, as HDF5 that xarray can open; its writer and its reader."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from vsacli.base import file_formats
from vsacli.base.arrays import AnyArray
from vsacli.base.errors import InputError
from vsacli.base.outputs import Staged
from vsacli.base.texts import one_line
from vsacli.base.units import Quantity
from vsacli.base.variables import MOTORS
from vsacli.base.version import __version__
from vsacli.documents.source import Source
from vsacli.results.store.damage import (
    SCALES,
    CheckedFile,
    DamageError,
    check_present,
    read_texts,
    reporting_damage,
)
from vsacli.results.store.inputs import write_sources
from vsacli.results.store.layout import attach_scales, create_labels
from vsacli.results.store.new_file import NewFile
from vsacli.results.store.reader import StoredFile, kind_of_format
from vsacli.results.store.schema import TEXT, storable, unit_attributes

FIRST_LIMIT = "first_limit"
TEXTS = {
    "trajectory": "file of the trajectory",
    "verdict": "verdict of the run's report; failed if it cannot be computed, impossible without an optimum",
    FIRST_LIMIT: "joint and limit that the run exceeds first, else empty",
    "error": "why there are no numbers, else empty",
    "key": "digest of all that the row depends on",
}

RUN_TEXTS = tuple(name for name in TEXTS if name != "trajectory")
"""Texts that a run results in; the trajectory is one of its inputs."""

LATER_TEXTS = (FIRST_LIMIT,)
"""Texts that tables of earlier versions lack; there they are empty."""


ROWS_AT_ONCE = 8192
"""Number of rows written together, or of their samples over time."""


def rows_at_once(steps: int) -> int:
    """Return the number of rows written together if each has this many samples over time."""
    return 1 + ROWS_AT_ONCE // (1 + steps)


class StudyColumn(Protocol):
    """A column of a study: name, dimensions after `run`, unit, and short description."""

    @property
    def name(self) -> str:
        """Name in the table."""

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions after `run`: joint, or joint and motor; preceded by step if the column is over time."""

    @property
    def quantity(self) -> Quantity:
        """Quantity with its unit."""

    @property
    def long_name(self) -> str:
        """Short description."""


class VariedParameter(NamedTuple):
    """A parameter that varies: path, unit, and whether its values are numbers rather than texts."""

    path: str
    unit: str
    numeric: bool


class Head(NamedTuple):
    """Everything in a table except its rows.

    Attributes:
        study, robot: names of the study and of the robot.
        fingerprint: digest of the whole study, common to all its parts.
        runs: number of runs of the study; the table may contain a part of them.
        joint_names, joint_types: names and types of the joints, in the order of the robot file.
        parameters: varying parameters, with units.
        columns: columns stored for each run.
        steps: maximum number of samples of columns over time.
        sources: input files by the object that they describe.
        provenance: further root attributes: engine, method, command line.
    """

    study: str
    robot: str
    fingerprint: str
    runs: int
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    parameters: tuple[VariedParameter, ...]
    columns: Sequence[StudyColumn]
    steps: int
    sources: Mapping[str, tuple[Source, ...]]
    provenance: Mapping[str, str]


class StudyRows(NamedTuple):
    """Consecutive rows: numbers of the runs, and arrays or lists of texts by name."""

    run: Sequence[int]
    arrays: Mapping[str, Any]


class StudyWriter(NewFile):
    """Context manager that writes the table of a study, which is complete after `finish`.

    Args:
        file: staged file to write.
        head: head of the table.
        rows: number of rows.
    """

    def __init__(self, file: Staged, head: Head, rows: int) -> None:
        super().__init__(file)
        self._head, self._row_count, self._written_rows = head, rows, 0

    def write(self, rows: StudyRows) -> None:
        """Append rows.

        Raises:
            StorageError: the disk is full or fails.
        """
        row_slice = slice(self._written_rows, self._written_rows + len(rows.run))
        with self.reporting_disk_errors():
            self._file["run"][row_slice] = rows.run
            for name, values in rows.arrays.items():
                self._file[name][row_slice] = (
                    [storable(text) for text in values] if _are_texts(values) else values
                )
        self._written_rows = row_slice.stop

    def finish(self) -> None:
        """Complete the file.

        Raises:
            StorageError: the disk is full or fails.
        """
        with self.reporting_disk_errors():
            self._close()

    def _expected_bytes(self) -> int:
        columns = sum(int(np.prod(self._shape(column)[1:])) for column in self._head.columns)
        return self._row_count * 8 * (columns + len(self._head.parameters) + 16)

    def _shape(self, column: StudyColumn) -> tuple[int, ...]:
        dim_lengths = {"step": self._head.steps, "joint": len(self._head.joint_names), "motor": len(MOTORS)}
        return (self._row_count, *(dim_lengths[dim] for dim in column.dims))

    def _create_datasets(self) -> None:
        head, file = self._head, self._file
        file.attrs.update(self._attributes())
        scales = {
            "run": self._create_dataset(
                "run", (self._row_count,), "<i8", {"long_name": "number of the run, from 0"}
            ),
            "joint": create_labels(
                file, "joint", head.joint_names, "joint, from the base to the tip", track_order=False
            ),
            "motor": file.create_dataset("motor", data=np.array(MOTORS)),
        }
        scales["motor"].attrs["long_name"] = "motor of the joint"
        if any("step" in column.dims for column in head.columns):
            scales["step"] = file.create_dataset("step", data=np.arange(head.steps))
            scales["step"].attrs["long_name"] = "step that was kept, from 0"
        for name, scale in scales.items():
            scale.make_scale(name)
        joint_type = create_labels(
            file, "joint_type", head.joint_types, "type of the joint", track_order=False
        )
        attach_scales(joint_type, [scales["joint"]])
        for name, long_name in TEXTS.items():
            self._create_dataset(name, (self._row_count,), TEXT, {"long_name": long_name}, [scales["run"]])
        for parameter in head.parameters:
            unit_attribute = {"units": parameter.unit} if parameter.numeric and parameter.unit else {}
            attributes = {"long_name": f"value of {parameter.path}", **unit_attribute}
            dtype = "<f8" if parameter.numeric else TEXT
            self._create_dataset(parameter.path, (self._row_count,), dtype, attributes, [scales["run"]])
        coordinates = " ".join([*(varied.path for varied in head.parameters), "trajectory"])
        for column in head.columns:
            attributes = {
                **unit_attributes(column.quantity, head.joint_types),
                "long_name": column.long_name,
                "coordinates": f"{coordinates} joint_type",
            }
            column_scales = [scales[dim] for dim in ("run", *column.dims)]
            self._create_dataset(column.name, self._shape(column), "<f8", attributes, column_scales)
        for name in RUN_TEXTS:
            file[name].attrs["coordinates"] = coordinates
        write_sources(file.create_group("inputs", track_order=True), head.sources)

    def _attributes(self) -> dict[str, Any]:
        return {
            "format": file_formats.STUDY_TABLE,
            "generated_by": f"vsacli {__version__}",
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            **{name: storable(text) for name, text in self._head.provenance.items()},
            "study_name": storable(self._head.study),
            "robot_name": storable(self._head.robot),
            "fingerprint": self._head.fingerprint,
            "runs": self._head.runs,
            "parameters": json.dumps([each.path for each in self._head.parameters]),
            "columns": json.dumps([each.name for each in self._head.columns]),
            "Conventions": "CF-1.11",
        }

    def _create_dataset(
        self,
        name: str,
        shape: tuple[int, ...],
        dtype: Any,
        attributes: Mapping[str, str],
        scales: Sequence[Any] = (),
    ) -> Any:
        dataset = self._file.create_dataset(name, shape, dtype, track_order=True)
        dataset.attrs.update(attributes)
        attach_scales(dataset, scales)
        return dataset


def _are_texts(values: Any) -> bool:
    return not isinstance(values, np.ndarray) and bool(len(values)) and isinstance(values[0], str)


PROVENANCE = ("method", "seed", "engine", "compiler", "numpy", "command_line")
"""Root attributes on the computation of a table."""

COLUMN_ATTRIBUTES = ("units", "long_name", "coordinates", SCALES)


ALL_ROWS = slice(None)
"""Slice of all rows."""


class StoredColumn(NamedTuple):
    """A `StudyColumn` as read from a table."""

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str


class StoredStudy(StoredFile):
    """An open study table; a context manager that closes it.

    Attributes:
        path: path as given.
        attributes: root attributes.
        study_name, robot_name: names as in the input files.
        joint_names, joint_types: names and types of the joints, in the order of the robot file.
        parameters: paths of the varying parameters.
        columns: names of the columns.
        rows: number of runs in the table.
        steps: number of samples of columns over time; 0 if there are none.
        runs: number of runs of the study.
        fingerprint: digest of the whole study.
    """

    def __init__(self, path: str | Path) -> None:
        """Open a table.

        Raises:
            InputError: the file does not exist, or is not a complete study table.
            StorageError: the operating system refuses to read it.
        """
        super().__init__(path, CheckedFile(path))
        try:
            with reporting_damage(path):
                self.attributes: dict[str, Any] = dict(self._file.attrs)
                if (format_name := self.attributes.get("format")) != file_formats.STUDY_TABLE:
                    format_kind = kind_of_format(format_name if isinstance(format_name, str) else None)
                    raise InputError.one(f"is {format_kind}, expected a table that vsacli study writes", path)
                check_present(self.attributes, ("study_name", "robot_name"))
                self.study_name, self.robot_name = (
                    one_line(str(self.attributes[name])) for name in ("study_name", "robot_name")
                )
                self.fingerprint, self.runs = (
                    str(self.attributes["fingerprint"]),
                    int(self.attributes["runs"]),
                )
                self.parameters, self.columns = (
                    tuple(map(str, json.loads(self.attributes[name]))) for name in ("parameters", "columns")
                )
                self.joint_names, self.joint_types = self.texts("joint"), self.texts("joint_type")
                self.rows = len(self._dataset("run"))
                self.steps = len(self._dataset("step")) if "step" in self._file else 0
                self._check_row_counts()
        except BaseException:
            self._file.close()
            raise

    def _check_row_counts(self) -> None:
        stored_texts = [name for name in TEXTS if not self._lacks_text(name)]
        for name in (*stored_texts, *self.parameters, *self.columns):
            if self._dataset(name).shape[0] != self.rows:
                raise DamageError(f"{name} has not {self.rows} rows")

    def _lacks_text(self, name: str) -> bool:
        return name in LATER_TEXTS and name not in self._file

    def texts(self, name: str, rows: slice = ALL_ROWS) -> tuple[str, ...]:
        """Return the texts of rows, or the labels of a dimension.

        Raises:
            InputError: the texts are damaged.
        """
        with reporting_damage(self.path, name):
            return (
                ("",) * len(range(self.rows)[rows])
                if self._lacks_text(name)
                else self._read_labels(name, rows)
            )

    def read(self, name: str, rows: slice = ALL_ROWS) -> AnyArray:
        """Return a numeric column, (rows, ...), or the numbers of the runs.

        Raises:
            InputError: the column is damaged or missing.
        """
        with reporting_damage(self.path, name):
            values: AnyArray = self._dataset(name)[rows]
        return values

    def column(self, name: str) -> StoredColumn:
        """Return the column with this name.

        Raises:
            InputError: the column is damaged or missing.
        """
        with reporting_damage(self.path, name):
            dataset = self._dataset(name)
            unit = str(dataset.attrs["units"])
            units_by_type = (
                str(dataset.attrs.get(f"units_{joint_type}", unit))
                for joint_type in ("revolute", "prismatic")
            )
            dims = tuple(dimension[0].name.removeprefix("/") for dimension in dataset.dims)
            return StoredColumn(name, dims[1:], Quantity(*units_by_type), str(dataset.attrs["long_name"]))

    def shape(self, name: str, steps: int) -> tuple[int, ...]:
        """Return the shape of a column's values in one row, with this many samples over time."""
        with reporting_damage(self.path, name):
            shape = tuple(map(int, self._dataset(name).shape[1:]))
        return (steps, *shape[1:]) if name in self.columns and "step" in self.column(name).dims else shape

    def unit(self, name: str) -> str:
        """Return the unit of a column or parameter; the unit at revolute joints if units differ."""
        with reporting_damage(self.path, name):
            attributes = self._dataset(name).attrs
            return str(attributes.get("units_revolute", attributes.get("units", "")))

    def parameter_is_text(self, path: str) -> bool:
        """Return whether the values of a parameter are texts rather than numbers."""
        return bool(self._dataset(path).dtype.kind != "f")

    def provenance(self) -> dict[str, str]:
        """Return the attributes on the computation: method, seed, engine and command line.

        Raises:
            InputError: an attribute is missing.
        """
        with reporting_damage(self.path):
            check_present(self.attributes, (*PROVENANCE, "created", "generated_by", "Conventions"))
        return {name: str(self.attributes[name]) for name in PROVENANCE}

    def check(self) -> None:
        """Read everything once.

        Raises:
            InputError: any content is damaged.
        """
        for name in (*TEXTS, *filter(self.parameter_is_text, self.parameters)):
            self.texts(name)
        for name in ("run", *self.columns):
            self.read(name)
        self.inputs()
        self.provenance()
        with reporting_damage(self.path):
            read_texts(self._file)
            for name in self.columns:
                check_present(self._file[name].attrs, COLUMN_ATTRIBUTES, name)
