"""Reading the table of a study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from vsacli.base.arrays import AnyArray
from vsacli.base.errors import InputError
from vsacli.base.texts import one_line
from vsacli.base.units import Quantity
from vsacli.results.store.damage import SCALES, CheckedFile, check_present, read_attributes, reporting_damage
from vsacli.results.store.stored_file import StoredFile
from vsacli.results.store.study_table import FORMAT, TEXTS

PROVENANCE = ("method", "seed", "engine", "compiler", "numpy", "command_line")
"""Root attributes that say how a table was computed."""

OF_COLUMNS = ("units", "long_name", "coordinates", SCALES)


ALL = slice(None)
"""Every row."""


class StoredColumn(NamedTuple):
    """A column as of `study_table.Column`."""

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str


class StoredStudy(StoredFile):
    """An open table of a study; a context manager that closes it.

    Attributes:
        path: the file, as given.
        attributes: the root attributes.
        study_name, robot_name: as in the files.
        joint_names, joint_types: base to tip.
        parameters: paths of what varies.
        columns: names of what is kept.
        rows: how many runs it has.
        steps: how many steps columns over time have; 0 if there are none.
        runs: how many the study has.
        fingerprint: of the whole study.
    """

    def __init__(self, path: str | Path) -> None:
        """Open a table.

        Raises:
            InputError: there is no such file, or it is no complete table of a study.
            StorageError: the operating system refuses to read it.
        """
        super().__init__(path, CheckedFile(path))
        try:
            with reporting_damage(path):
                self.attributes: dict[str, Any] = dict(self._file.attrs)
                if self.attributes.get("format") != FORMAT:
                    raise InputError.one(
                        f"is no table of a study ({FORMAT}), as `vsacli study` writes it", path
                    )
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
                self._check()
        except BaseException:
            self._file.close()
            raise

    def _check(self) -> None:
        for name in (*TEXTS, *self.parameters, *self.columns):
            if self._dataset(name).shape[0] != self.rows:
                raise ValueError(f"{name} has not {self.rows} rows")

    def texts(self, name: str, rows: slice = ALL) -> tuple[str, ...]:
        """Texts of rows, or the labels of a dimension.

        Raises:
            InputError: they are damaged.
        """
        with reporting_damage(self.path, name):
            return self._labels(name, rows)

    def read(self, name: str, rows: slice = ALL) -> AnyArray:
        """A column of numbers, (rows, ...), or the numbers of the runs.

        Raises:
            InputError: it is damaged, or not there.
        """
        with reporting_damage(self.path, name):
            values: AnyArray = self._dataset(name)[rows]
        return values

    def column(self, name: str) -> StoredColumn:
        """What is known of a column.

        Raises:
            InputError: it is damaged, or not there.
        """
        with reporting_damage(self.path, name):
            dataset = self._dataset(name)
            unit = str(dataset.attrs["units"])
            per_type = (str(dataset.attrs.get(f"units_{each}", unit)) for each in ("revolute", "prismatic"))
            dims = tuple(dimension[0].name.removeprefix("/") for dimension in dataset.dims)
            return StoredColumn(name, dims[1:], Quantity(*per_type), str(dataset.attrs["long_name"]))

    def shape(self, name: str, steps: int) -> tuple[int, ...]:
        """Of a column's values in one row, if columns over time have so many steps."""
        with reporting_damage(self.path, name):
            shape = tuple(map(int, self._dataset(name).shape[1:]))
        return (steps, *shape[1:]) if name in self.columns and "step" in self.column(name).dims else shape

    def unit(self, name: str) -> str:
        """The unit of a column or parameter; that of revolute joints if they differ."""
        with reporting_damage(self.path, name):
            attributes = self._dataset(name).attrs
            return str(attributes.get("units_revolute", attributes.get("units", "")))

    def parameter_is_text(self, path: str) -> bool:
        """Whether the values of what varies are texts rather than numbers."""
        return bool(self._dataset(path).dtype.kind != "f")

    def provenance(self) -> dict[str, str]:
        """What is known of how it was computed: method, seed and engine, and what was typed.

        Raises:
            InputError: some of it is missing.
        """
        with reporting_damage(self.path):
            check_present(self.attributes, (*PROVENANCE, "created", "generated_by", "Conventions"))
        return {name: str(self.attributes[name]) for name in PROVENANCE}

    def check(self) -> None:
        """Read everything once.

        Raises:
            InputError: something is damaged.
        """
        for name in (*TEXTS, *filter(self.parameter_is_text, self.parameters)):
            self.texts(name)
        for name in ("run", *self.columns):
            self.read(name)
        self.inputs()
        self.provenance()
        with reporting_damage(self.path):
            read_attributes(self._file)
            for name in self.columns:
                check_present(self._file[name].attrs, OF_COLUMNS, name)
