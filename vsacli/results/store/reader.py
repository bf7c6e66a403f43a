"""Reading of result files, and of simulation and sensitivity files, which have the same layout.

`StoredFile` opens any HDF5 file of this program, `StoredResult` reads samples, limits and geometry, and
`open_stored` opens a result or a simulation, depending on the file. Content is checked before it is used.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar, cast

import h5py
import numpy as np

from vsacli.base import file_formats
from vsacli.base.arrays import AnyArray, BoolArray, FlagArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.simulation_variables import SIMULATED_NAMES, SIMULATION_VARIABLES
from vsacli.base.texts import joined, one_line, shown
from vsacli.base.variables import (
    MOTOR_CONSTANTS,
    MOTORS,
    OF_ANY_ROBOT,
    VARIABLES,
    Labels,
    Variable,
    dimension_labels,
    row_shape,
    select_variables,
    split_axes,
    variables_by_tool,
)
from vsacli.results.store.damage import (
    SCALES,
    CheckedFile,
    DamageError,
    check_nbytes,
    check_present,
    check_times,
    local_dataset,
    read_texts,
    reporting_damage,
)
from vsacli.results.store.geometry import ARRAYS, CARRIER, PARENT, StoredGeometry
from vsacli.results.store.inputs import StoredInput, read_sources
from vsacli.results.store.schema import (
    DOUBLE,
    EXISTING,
    PRECISION,
    storage_type,
    variable_attributes,
)
from vsacli.robot.joint import existing_columns
from vsacli.robot.model import END_EFFECTOR

ROBOT_GROUP = "inputs/robot"
JOINT_DATASET = f"{ROBOT_GROUP}/joints/{{}}"
"""Dataset of a parameter of all joints: path in the robot file with underscores in place of dots."""

MIN_STIFFNESS_DATASET = f"{ROBOT_GROUP}/tools/min_stiffness"
"""Dataset of the limits of the tools."""

BLOCK_SAMPLES = 8192
"""Number of samples read at a time to check a file."""

FILE_ATTRIBUTES = ("created", "generated_by", "command_line", "versions", "Conventions")
"""Root attributes of every file."""

RUN_ATTRIBUTES = ("engine", "compiler", "threads")
"""Root attributes of files written by a run: all of them, or none."""


FORMAT_PREFIX = "vsacli-"
"""Beginning of the name of each format."""

RANGE_DATASETS = {
    "q": "limits_position",
    "dq": "limits_velocity",
    "stiffness": "limits_stiffness",
    "damping": "damper_range",
}
"""Datasets with the lower and upper bound of joint variables, by variable."""

MAGNITUDE_DATASETS = {
    "phi": "actuator_spring_max_deflection",
    "dtheta": "actuator_motor_max_velocity",
    "tau_motor": "actuator_motor_max_torque",
    "current": "actuator_motor_max_current",
    "voltage": "actuator_motor_max_voltage",
}
"""Datasets with the largest magnitude of motor variables, by variable."""


class StoredFile:
    """An open file; a context manager that closes it.

    Args:
        path: path of the file, as given.
        file: open file.

    Attributes:
        path: path as given.
    """

    def __init__(self, path: str | Path, file: CheckedFile) -> None:
        self.path = Path(path)
        self._file = file
        self._checked_datasets: dict[str, h5py.Dataset] = {}

    def _dataset(self, name: str) -> h5py.Dataset:
        """Return a dataset, checked at its first use."""
        if name not in self._checked_datasets:
            self._checked_datasets[name] = check_nbytes(local_dataset(self._file, name))
        return self._checked_datasets[name]

    def _read_labels(self, name: str, rows: slice = slice(None)) -> tuple[str, ...]:
        return tuple(map(one_line, self._dataset(name).asstr()[rows]))

    def inputs(self) -> list[StoredInput]:
        """Return the input files of the run, with their content if it was stored.

        Raises:
            InputError: the file is damaged.
        """
        with reporting_damage(self.path):
            return list(read_sources(self._file))

    def close(self) -> None:
        """Close the file."""
        self._checked_datasets.clear()
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class StoredResult(StoredFile):
    """An open result file; a context manager that closes it. Subclasses read other formats.

    Attributes:
        kind: name of such files in messages.
        command: command that writes such files.
        path: path as given.
        attributes: root attributes, e.g. `created`, `command_line`, `versions`.
        robot_name, trajectory_name, verdict: as in the report.
        complete: False if the run ended early at an infeasible sample.
        joint_names, joint_types: names and types ("revolute" or "prismatic"), in the order of
            the robot file.
        tool_names: names of the tools.
        actuators: kind of the actuator of each joint.
        gear_ratio: gear ratios of the motors, (joints, 2); NaN where the robot file gives none.
        variables: names of the stored variables, in declared order, without `time`.
        samples: number of stored samples.
        report_json: report of the run, as printed by `--json`.
        precision: precision of the stored values, "double" or "single"; they are read as double.
    """

    format = file_formats.RESULT
    kind = "result"
    command = "invdyn"
    declared: Mapping[str, Variable] = VARIABLES
    _run_attributes: tuple[str, ...] = ("options",)
    _how_to_store = "run invdyn again without --variables, or with {} among them"

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Open a file.

        Raises:
            InputError: the file does not exist, or is not a complete file of the format that this version
                reads.
            StorageError: the operating system refuses to read it, or another program is writing it.
        """
        return open_one_of(path, cls)

    def __init__(self, path: str | Path, file: CheckedFile) -> None:
        super().__init__(path, file)
        with reporting_damage(path):
            self.attributes: dict[str, Any] = dict(file.attrs)
            check_present(self.attributes, ("robot_name", "trajectory_name", "verdict", "complete"))
            self.robot_name, self.trajectory_name, self.verdict = (
                one_line(str(file.attrs[name])) for name in ("robot_name", "trajectory_name", "verdict")
            )
            self.complete = bool(file.attrs["complete"])
            self.precision = str(file.attrs.get(PRECISION, DOUBLE))
            self.joint_names = self._read_labels("joint")
            self.joint_types = self._read_labels("joint_type")
            self.tool_names = self._tool_names()
            self.declared = variables_by_tool(self.declared, len(self.tool_names))
            self.actuators = self._read_labels("inputs/robot/joints/actuator_type")
            self.gear_ratio = self._motor_values("actuator_motor_gear_ratio")
            self.variables = tuple(
                name for name, variable in self.declared.items() if variable.dims and name in file
            )
            self.samples = self._sample_count()
            self.report_json = self._read_report()
        self._checked_layouts: set[str] = set()

    @property
    def labels(self) -> Labels:
        """Labels along each dimension of the variables."""
        return dimension_labels(self.joint_names, self.tool_names)

    def _tool_names(self) -> tuple[str, ...]:
        """Return the names of the tools; chains that need none in their file have one."""
        if "tool" in self._file:
            return self._read_labels("tool")
        return (END_EFFECTOR,) if self.format == str(self.attributes["format"]) else ()

    def motor_constant(self, name: str) -> FloatArray:
        """Return a parameter of the motors on the joint side, (joints, 2); NaN where there is none.

        Raises:
            InputError: the file is damaged.
        """
        with reporting_damage(self.path):
            return self._motor_values(f"actuator_motor_{name}")

    def _motor_values(self, name: str) -> FloatArray:
        """Return values of motors, (joints, 2); stored without second axis if no joint has two motors."""
        constants = np.full((len(self.actuators), len(MOTORS)), np.nan)
        if JOINT_DATASET.format(name) in self._file:
            dataset = self._dataset(JOINT_DATASET.format(name))
            constants.T[: 1 if dataset.ndim == 1 else len(MOTORS)] = dataset[...].T
        return constants

    def limits(self, name: str) -> FloatArray:
        """Return lower and upper bound of a variable, (joints, 1 or 2, 2); not finite where there is none.

        Raises:
            InputError: the file is damaged.
        """
        name = SIMULATED_NAMES.get(name, name)
        with reporting_damage(self.path):
            if name in MAGNITUDE_DATASETS:
                magnitudes = self._motor_values(MAGNITUDE_DATASETS[name])
                return np.stack([-magnitudes, magnitudes], axis=-1)
            bounds = np.full((len(self.actuators), 1, 2), np.nan)
            if name in RANGE_DATASETS and JOINT_DATASET.format(RANGE_DATASETS[name]) in self._file:
                bounds[:, 0] = self._dataset(JOINT_DATASET.format(RANGE_DATASETS[name]))[...]
        return bounds

    def min_stiffness(self) -> FloatArray:
        """Return the smallest stiffness that each tool may have, (tools,), N/m; NaN without this limit.

        Raises:
            InputError: the file is damaged.
        """
        bounds = np.full(len(self.tool_names), np.nan)
        if MIN_STIFFNESS_DATASET in self._file:
            with reporting_damage(self.path):
                bounds[:] = self._dataset(MIN_STIFFNESS_DATASET)[...]
        return bounds

    def geometry(self) -> StoredGeometry:
        """Return the geometry of the robot.

        Raises:
            InputError: the file is damaged.
        """
        with reporting_damage(self.path):
            arrays = {
                name: np.array(self._read_labels(path))
                if name in (PARENT, CARRIER)
                else self._dataset(path)[...]
                for name in ARRAYS
                if (path := f"{ROBOT_GROUP}/{name}") in self._file
            }
            return StoredGeometry.of(self.joint_names, self.joint_types, arrays)

    def gravity(self) -> FloatArray:
        """Return the gravity acceleration in the base frame, (3,), m/s^2.

        Raises:
            InputError: the file is damaged.
        """
        with reporting_damage(self.path):
            return np.asarray(self._dataset(f"{ROBOT_GROUP}/gravity")[...], dtype=np.float64).reshape(3)

    def has_variable(self, variable: Variable) -> bool:
        """Return whether runs of this robot have a variable, as far as that depends on the robot file."""
        if variable.requires in MOTOR_CONSTANTS:
            return not np.isnan(self.motor_constant(variable.requires)).all()
        return variable.requires in OF_ANY_ROBOT or variable.name in self.variables

    def _read_report(self) -> dict[str, Any]:
        report = json.loads(local_dataset(self._file, "report/json").asstr()[()])
        if not isinstance(report, dict):
            raise DamageError("report/json is no JSON object")
        return cast("dict[str, Any]", shown(report))

    def _sample_count(self) -> int:
        """Return the number of samples; refuse a file whose joints and times do not match."""
        shape = self._dataset("time").shape
        if {len(self.joint_types), len(self.actuators)} != {len(self.joint_names)} or len(shape) != 1:
            raise DamageError("joints and times do not fit together")
        return int(shape[0])

    def whole_span(self) -> tuple[float, float]:
        """Return first and last time of the whole run, s, also for an excerpt of it."""
        return float(self.time[0]), float(self.time[-1])

    @cached_property
    def time(self) -> FloatArray:
        """Times, (samples,), s; finite and ascending.

        Raises:
            InputError: the times are invalid or damaged.
        """
        with reporting_damage(self.path, "time"):
            values: FloatArray = self._dataset("time")[...]
            check_times(values)
        return values

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray | FlagArray:
        """Read samples start..stop-1 of a variable, (samples, ...) with its dimensions, in its units.

        Raises:
            InputError: the variable is unknown, not stored, or damaged there.
        """
        select_variables([name], self.declared)
        if name == "time":
            return self.time[start:stop]
        if name not in self._file:
            raise InputError.one(f"holds no {name}; {self._how_to_store.format(name)}", self.path)
        with reporting_damage(self.path, name):
            self._check_layout(name)
            stored = self._file[name][start:stop]
        values: FloatArray | FlagArray = stored.astype(storage_type(self.declared[name]), copy=False)
        return values

    def rounded(self, name: str, values: AnyArray) -> FloatArray | FlagArray:
        """Return values of a variable, rounded as by storage in the precision of this file."""
        variable = self.declared[name]
        with np.errstate(over="ignore"):
            rounded_values = split_axes(values, variable, self.labels).astype(
                storage_type(variable, self.precision)
            )
        return rounded_values.astype(storage_type(variable))

    def _check_layout(self, name: str) -> None:
        """Refuse a variable whose shape or type does not fit the file, so that it can be read in parts."""
        if name in self._checked_layouts:
            return
        dataset, expected = local_dataset(self._file, name), storage_type(self.declared[name], self.precision)
        shape = (self.samples, *row_shape(self.declared[name], self.labels))
        if dataset.shape != shape or dataset.dtype != expected:
            raise DamageError(f"{name} is {dataset.dtype} {dataset.shape}, expected {expected} {shape}")
        self._checked_layouts.add(name)

    def check(self) -> None:
        """Read everything once, which is not done when a file is opened.

        Raises:
            InputError: any content is damaged.
        """
        for name in ("time", *self.variables):
            for start in range(0, self.samples, BLOCK_SAMPLES):
                self.read(name, start, start + BLOCK_SAMPLES)
        self.provenance()
        with reporting_damage(self.path):
            read_texts(self._file)
            for name in ("time", *self.variables):
                required = variable_attributes(self.declared[name], self.joint_types)
                check_present(self._file[name].attrs, required, name)
                if self.declared[name].dims:
                    check_present(self._file[name].attrs, [SCALES], name)

    def existing(self, variable: Variable) -> BoolArray:
        """Return a mask of the existing columns of a joint variable, (joints, 1 or 2)."""
        if variable.requires in OF_ANY_ROBOT or variable.name not in self.variables:
            return np.array(existing_columns(variable, self.actuators))
        with reporting_damage(self.path):
            exists = np.asarray(self._file[variable.name].attrs[EXISTING], dtype=bool)
            return exists.reshape(len(self.actuators), -1)

    def provenance(self) -> dict[str, Any]:
        """Return creation time, command, versions, and path and SHA-256 of each input.

        Raises:
            InputError: the file is damaged.
        """
        optional_attributes = (*RUN_ATTRIBUTES, PRECISION)
        with reporting_damage(self.path):
            has_run_attributes = any(
                name in self.attributes for name in (*RUN_ATTRIBUTES, *self._run_attributes)
            )
            check_present(
                self.attributes,
                (*FILE_ATTRIBUTES, *((*RUN_ATTRIBUTES, *self._run_attributes) if has_run_attributes else ())),
            )
            provenance = {
                **{name: str(self.attributes[name]) for name in ("created", "generated_by", "command_line")},
                **{
                    name: str(self.attributes[name])
                    for name in optional_attributes
                    if name in self.attributes
                },
                "versions": json.loads(self.attributes["versions"]),
                "options": json.loads(self.attributes.get("options", "{}")),
                "inputs": [
                    {"path": source.path, "sha256": source.sha256, **_changes_entry(source)}
                    for source in self.inputs()
                ],
            }
        return cast("dict[str, Any]", shown(provenance))


class StoredSimulation(StoredResult):
    """An open simulation file; a context manager that closes it."""

    format = file_formats.SIMULATION
    kind = "simulation"
    command = "simulate"
    declared = SIMULATION_VARIABLES
    _run_attributes = ()
    _how_to_store = "run simulate again"


def _changes_entry(stored_input: StoredInput) -> dict[str, Any]:
    return {"changes": stored_input.changes} if stored_input.changes else {}


_Stored = TypeVar("_Stored", bound=StoredResult)


def open_one_of(path: str | Path, *kinds: type[_Stored]) -> _Stored:
    """Open a file of one of these kinds, determined by its format.

    Raises:
        InputError, StorageError: as `StoredResult.open`.
    """
    with contextlib.ExitStack() as stack:
        file = stack.enter_context(CheckedFile(path))
        format_name = _read_format(path, file)
        kind = next((kind for kind in kinds if kind.format == format_name), None)
        if kind is None:
            raise InputError.one(_wrong_format_message(format_name, kinds), path)
        stored = kind(path, file)
        stack.pop_all()
    return stored


def stored_format(path: str | Path) -> str | None:
    """Return the attribute `format` of an HDF5 file, for trees that of chains; None if it has none.

    Raises:
        InputError, StorageError: as `StoredResult.open`.
    """
    with CheckedFile(path) as file:
        return _read_format(path, file)


def stored_inputs(path: str | Path) -> list[StoredInput]:
    """Return the inputs that a result, a simulation or a study table holds, of any version of its format.

    Raises:
        InputError, StorageError: as `StoredResult.open`.
    """
    with CheckedFile(path) as file:
        format_name = _read_format(path, file)
        if format_name is None or not format_name.startswith(FORMAT_PREFIX):
            raise InputError.one(_wrong_format_message(format_name, (StoredResult, StoredSimulation)), path)
        return StoredFile(path, file).inputs()


def _read_format(path: str | Path, file: h5py.File) -> str | None:
    """Return the attribute `format`, for trees that of chains."""
    with reporting_damage(path):
        format_name = file.attrs.get("format")
    if not isinstance(format_name, str):
        return None
    return next(
        (
            chain_format
            for chain_format, tree_format in file_formats.TREE_FORMATS.items()
            if tree_format == format_name
        ),
        format_name,
    )


def _wrong_format_message(name: str | None, readers: Sequence[type[StoredResult]]) -> str:
    for reader in readers:
        if name is not None and name.startswith(f"{FORMAT_PREFIX}{reader.kind}/"):
            return other_version(name, reader.format, reader.command)
    return f"is {kind_of_format(name)}, expected {joined((f'a {reader.kind}' for reader in readers), 'or')}"


def kind_of_format(format_name: str | None) -> str:
    """Return the kind of an HDF5 file in words, from its attribute `format`."""
    if format_name is None or not format_name.startswith(FORMAT_PREFIX):
        return "an HDF5 file that vsacli has not written"
    return f"a {format_name.partition('/')[0].removeprefix(FORMAT_PREFIX).replace('-', ' ')}"


def other_version(format_name: str, expected_format: str, command: str) -> str:
    """Return that a file has another version of a format, and how to compute it again."""
    advice = f"run {command} again, with its inputs (vsacli info FILE --extract FOLDER)"
    formats = joined(
        (
            expected_format,
            *(
                tree_format
                for chain_format, tree_format in file_formats.TREE_FORMATS.items()
                if chain_format == expected_format
            ),
        )
    )
    return f"has the format {format_name}, but this version reads {formats}; {advice}"


def open_stored(path: str | Path) -> StoredResult:
    """Open a result or a simulation file, determined by its format; see `StoredResult.open`."""
    return open_one_of(path, StoredResult, StoredSimulation)
