"""The table of a study: a row for each run, in HDF5 that opens in xarray."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from types import TracebackType
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from vsacli.base.interrupts import interrupts_deferred
from vsacli.base.outputs import Staged
from vsacli.base.storage import check_free_space
from vsacli.base.units import Quantity
from vsacli.base.variables import MOTORS
from vsacli.base.version import __version__
from vsacli.documents.source import Source
from vsacli.results.store.inputs import write_sources
from vsacli.results.store.new_file import NewFile
from vsacli.results.store.schema import TEXT, storable, unit_attributes

FORMAT = "vsacli-study-table/1"
TEXTS = {
    "trajectory": "file of the trajectory",
    "verdict": "verdict of the run's report; failed if it cannot be computed, impossible without an optimum",
    "error": "why there are no numbers, else empty",
    "key": "digest of all that the row depends on",
}


ROWS_AT_ONCE = 8192
"""That are written together, or as many as have so many steps over time."""


def rows_at_once(steps: int) -> int:
    """How many rows are written together, if each has so many steps over time."""
    return 1 + ROWS_AT_ONCE // (1 + steps)


class Column(Protocol):
    """What is kept of each run: its name, dimensions after `run`, unit, and a few words."""

    @property
    def name(self) -> str:
        """In the table."""

    @property
    def dims(self) -> tuple[str, ...]:
        """After `run`: joint, or joint and motor, after step if it is over time."""

    @property
    def quantity(self) -> Quantity:
        """Its unit."""

    @property
    def long_name(self) -> str:
        """A few words."""


class Parameter(NamedTuple):
    """What varies: the path to it, its unit, and whether its values are numbers rather than texts."""

    path: str
    unit: str
    numeric: bool


class Head(NamedTuple):
    """What a table says beside its rows.

    Attributes:
        study, robot: names.
        fingerprint: of the whole study, which its parts have in common.
        runs: how many the study has; the table may have some of them.
        joint_names, joint_types: base to tip.
        parameters: what varies.
        columns: what is kept.
        steps: how many steps columns over time have, at most.
        sources: files that were read, by what they describe.
        provenance: further root attributes: what computed it, and how.
    """

    study: str
    robot: str
    fingerprint: str
    runs: int
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    columns: Sequence[Column]
    steps: int
    sources: Mapping[str, tuple[Source, ...]]
    provenance: Mapping[str, str]


class Rows(NamedTuple):
    """Consecutive rows: numbers of the runs, and arrays or lists of texts by name."""

    run: Sequence[int]
    arrays: Mapping[str, Any]


class StudyWriter:
    """Context manager that writes the table of a study, which is complete after `finish`.

    Args:
        file: where it is staged.
        head: what it says beside its rows.
        rows: how many it will have.
    """

    def __init__(self, file: Staged, head: Head, rows: int) -> None:
        self._staged, self._hdf5, self._head, self._rows = file, NewFile(file), head, rows
        self._written = 0

    def __enter__(self) -> Self:
        """Create the file, with everything but the rows.

        Raises:
            StorageError: it cannot be written, or does not fit its disk.
        """
        columns = sum(int(np.prod(self._shape(each)[1:])) for each in self._head.columns)
        check_free_space(self._staged.path, self._rows * 8 * (columns + len(self._head.parameters) + 16))
        try:
            with interrupts_deferred(), self._hdf5.used():
                self._file = self._hdf5.open()
                self._create()
        except BaseException:
            self._hdf5.discard()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._hdf5.discard()

    def write(self, rows: Rows) -> None:
        """Append rows.

        Raises:
            StorageError: the disk is full or fails.
        """
        place = slice(self._written, self._written + len(rows.run))
        with self._hdf5.used():
            self._file["run"][place] = rows.run
            for name, values in rows.arrays.items():
                self._file[name][place] = [storable(each) for each in values] if _texts(values) else values
        self._written = place.stop

    def finish(self) -> None:
        """Complete the file.

        Raises:
            StorageError: the disk is full or fails.
        """
        with self._hdf5.used():
            self._hdf5.close()

    def _shape(self, column: Column) -> tuple[int, ...]:
        lengths = {"step": self._head.steps, "joint": len(self._head.joint_names), "motor": len(MOTORS)}
        return (self._rows, *(lengths[dim] for dim in column.dims))

    def _create(self) -> None:
        head, file = self._head, self._file
        file.attrs.update(self._attributes())
        scales = {
            "run": self._dataset("run", (self._rows,), "<i8", {"long_name": "number of the run, from 0"}),
            "joint": self._labels("joint", head.joint_names, "joint, from the base to the tip"),
            "motor": file.create_dataset("motor", data=np.array(MOTORS)),
        }
        scales["motor"].attrs["long_name"] = "motor of the joint"
        if any("step" in column.dims for column in head.columns):
            scales["step"] = file.create_dataset("step", data=np.arange(head.steps))
            scales["step"].attrs["long_name"] = "step that was kept, from 0"
        for name, scale in scales.items():
            scale.make_scale(name)
        self._labels("joint_type", head.joint_types, "type of the joint").dims[0].attach_scale(
            scales["joint"]
        )
        for name, long_name in TEXTS.items():
            self._dataset(name, (self._rows,), TEXT, {"long_name": long_name}, [scales["run"]])
        for parameter in head.parameters:
            unit = {"units": parameter.unit} if parameter.numeric and parameter.unit else {}
            attributes = {"long_name": f"value of {parameter.path}", **unit}
            dtype = "<f8" if parameter.numeric else TEXT
            self._dataset(parameter.path, (self._rows,), dtype, attributes, [scales["run"]])
        coordinates = " ".join([*(each.path for each in head.parameters), "trajectory"])
        for column in head.columns:
            attributes = {
                **unit_attributes(column.quantity, head.joint_types),
                "long_name": column.long_name,
                "coordinates": f"{coordinates} joint_type",
            }
            along = [scales[dim] for dim in ("run", *column.dims)]
            self._dataset(column.name, self._shape(column), "<f8", attributes, along)
        for name in ("verdict", "error", "key"):
            file[name].attrs["coordinates"] = coordinates
        write_sources(file.create_group("inputs", track_order=True), head.sources)

    def _attributes(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
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

    def _dataset(
        self,
        name: str,
        shape: tuple[int, ...],
        dtype: Any,
        attributes: Mapping[str, str],
        scales: Sequence[Any] = (),
    ) -> Any:
        dataset = self._file.create_dataset(name, shape, dtype, track_order=True)
        dataset.attrs.update(attributes)
        for axis, scale in enumerate(scales):
            dataset.dims[axis].attach_scale(scale)
        return dataset

    def _labels(self, name: str, labels: Sequence[str], long_name: str) -> Any:
        data = np.array([storable(label) for label in labels], dtype=TEXT)
        dataset = self._file.create_dataset(name, data=data, dtype=TEXT)
        dataset.attrs["long_name"] = long_name
        return dataset


def _texts(values: Any) -> bool:
    return not isinstance(values, np.ndarray) and bool(len(values)) and isinstance(values[0], str)
