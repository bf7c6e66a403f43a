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
    bounded,
    check_present,
    check_times,
    own_dataset,
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

OF_ROBOT = "inputs/robot"
OF_JOINTS = f"{OF_ROBOT}/joints/{{}}"
"""Dataset of a parameter of all joints: path in the robot file with underscores in place of dots."""

OF_MIN_STIFFNESS = f"{OF_ROBOT}/tools/min_stiffness"
"""Dataset of the limits of the tools."""

BLOCK_SAMPLES = 8192
"""Number of samples read at a time to check a file."""

MADE_BY = ("created", "generated_by", "command_line", "versions", "Conventions")
"""Root attributes of every file."""

COMPUTED_BY = ("engine", "compiler", "threads")
"""Root attributes of files written by a run: all of them, or none."""


OURS = "vsacli-"
"""Beginning of the name of each format."""

RANGES = {
    "q": "limits_position",
    "dq": "limits_velocity",
    "stiffness": "limits_stiffness",
    "damping": "damper_range",
}
"""Datasets with the lower and upper bound of joint variables, by variable."""

SIZES = {
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
        self._checked: dict[str, h5py.Dataset] = {}

    def _dataset(self, name: str) -> h5py.Dataset:
        """Return a dataset, checked at its first use."""
        if name not in self._checked:
            self._checked[name] = bounded(own_dataset(self._file, name))
        return self._checked[name]

    def _labels(self, name: str, rows: slice = slice(None)) -> tuple[str, ...]:
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
        self._checked.clear()
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
    _of_runs: tuple[str, ...] = ("options",)
    _to_get = "run invdyn again without --variables, or with {} among them"

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
            self.joint_names = self._labels("joint")
            self.joint_types = self._labels("joint_type")
            self.tool_names = self._tool_names()
            self.declared = variables_by_tool(self.declared, len(self.tool_names))
            self.actuators = self._labels("inputs/robot/joints/actuator_type")
            self.gear_ratio = self._of_motors("actuator_motor_gear_ratio")
            self.variables = tuple(
                name for name, variable in self.declared.items() if variable.dims and name in file
            )
            self.samples = self._samples()
            self.report_json = self._report()
        self._whole: set[str] = set()

    @property
    def labels(self) -> Labels:
        """Labels along each dimension of the variables."""
        return dimension_labels(self.joint_names, self.tool_names)

    def _tool_names(self) -> tuple[str, ...]:
        """Return the names of the tools; chains that need none in their file have one."""
        if "tool" in self._file:
            return self._labels("tool")
        return (END_EFFECTOR,) if self.format == str(self.attributes["format"]) else ()

    def motor_constant(self, name: str) -> FloatArray:
        """Return a parameter of the motors on the joint side, (joints, 2); NaN where there is none.

        Raises:
            InputError: the file is damaged.
        """
        with reporting_damage(self.path):
            return self._of_motors(f"actuator_motor_{name}")

    def _of_motors(self, name: str) -> FloatArray:
        """Return values of motors, (joints, 2); stored without second axis if no joint has two motors."""
        constants = np.full((len(self.actuators), len(MOTORS)), np.nan)
        if OF_JOINTS.format(name) in self._file:
            stored = self._dataset(OF_JOINTS.format(name))
            constants.T[: 1 if stored.ndim == 1 else len(MOTORS)] = stored[...].T
        return constants

    def limits(self, name: str) -> FloatArray:
        """Return lower and upper bound of a variable, (joints, 1 or 2, 2); not finite where there is none.

        Raises:
            InputError: the file is damaged.
        """
        name = SIMULATED_NAMES.get(name, name)
        with reporting_damage(self.path):
            if name in SIZES:
                largest = self._of_motors(SIZES[name])
                return np.stack([-largest, largest], axis=-1)
            bounds = np.full((len(self.actuators), 1, 2), np.nan)
            if name in RANGES and OF_JOINTS.format(RANGES[name]) in self._file:
                bounds[:, 0] = self._dataset(OF_JOINTS.format(RANGES[name]))[...]
        return bounds

    def min_stiffness(self) -> FloatArray:
        """Return the smallest stiffness that each tool may have, (tools,), N/m; NaN without this limit.

        Raises:
            InputError: the file is damaged.
        """
        bounds = np.full(len(self.tool_names), np.nan)
        if OF_MIN_STIFFNESS in self._file:
            with reporting_damage(self.path):
                bounds[:] = self._dataset(OF_MIN_STIFFNESS)[...]
        return bounds

    def geometry(self) -> StoredGeometry:
        """Return the geometry of the robot.

        Raises:
            InputError: the file is damaged.
        """
        with reporting_damage(self.path):
            arrays = {
                name: np.array(self._labels(path)) if name in (PARENT, CARRIER) else self._dataset(path)[...]
                for name in ARRAYS
                if (path := f"{OF_ROBOT}/{name}") in self._file
            }
            return StoredGeometry.of(self.joint_names, self.joint_types, arrays)

    def gravity(self) -> FloatArray:
        """Return the gravity acceleration in the base frame, (3,), m/s^2.

        Raises:
            InputError: the file is damaged.
        """
        with reporting_damage(self.path):
            return np.asarray(self._dataset(f"{OF_ROBOT}/gravity")[...], dtype=np.float64).reshape(3)

    def has_variable(self, variable: Variable) -> bool:
        """Return whether runs of this robot have a variable, as far as that depends on the robot file."""
        if variable.requires in MOTOR_CONSTANTS:
            return not np.isnan(self.motor_constant(variable.requires)).all()
        return variable.requires in OF_ANY_ROBOT or variable.name in self.variables

    def _report(self) -> dict[str, Any]:
        content = json.loads(own_dataset(self._file, "report/json").asstr()[()])
        if not isinstance(content, dict):
            raise DamageError("report/json is no JSON object")
        return cast("dict[str, Any]", shown(content))

    def _samples(self) -> int:
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
            raise InputError.one(f"holds no {name}; {self._to_get.format(name)}", self.path)
        with reporting_damage(self.path, name):
            self._check_layout(name)
            stored = self._file[name][start:stop]
        values: FloatArray | FlagArray = stored.astype(storage_type(self.declared[name]), copy=False)
        return values

    def rounded(self, name: str, values: AnyArray) -> FloatArray | FlagArray:
        """Return values of a variable, rounded as by storage in the precision of this file."""
        variable = self.declared[name]
        with np.errstate(over="ignore"):
            stored = split_axes(values, variable, self.labels).astype(storage_type(variable, self.precision))
        return stored.astype(storage_type(variable))

    def _check_layout(self, name: str) -> None:
        """Refuse a variable whose shape or type does not fit the file, so that it can be read in parts."""
        if name in self._whole:
            return
        dataset, expected = own_dataset(self._file, name), storage_type(self.declared[name], self.precision)
        shape = (self.samples, *row_shape(self.declared[name], self.labels))
        if dataset.shape != shape or dataset.dtype != expected:
            raise DamageError(f"{name} is {dataset.dtype} {dataset.shape}, expected {expected} {shape}")
        self._whole.add(name)

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
                needed = variable_attributes(self.declared[name], self.joint_types)
                check_present(self._file[name].attrs, needed, name)
                if self.declared[name].dims:
                    check_present(self._file[name].attrs, [SCALES], name)

    def existing(self, variable: Variable) -> BoolArray:
        """Return a mask of the existing columns of a joint variable, (joints, 1 or 2)."""
        if variable.requires in OF_ANY_ROBOT or variable.name not in self.variables:
            return np.array(existing_columns(variable, self.actuators))
        with reporting_damage(self.path):
            stored = np.asarray(self._file[variable.name].attrs[EXISTING], dtype=bool)
            return stored.reshape(len(self.actuators), -1)

    def provenance(self) -> dict[str, Any]:
        """Return creation time, command, versions, and path and SHA-256 of each input.

        Raises:
            InputError: the file is damaged.
        """
        known = (*COMPUTED_BY, PRECISION)
        with reporting_damage(self.path):
            ran = any(name in self.attributes for name in (*COMPUTED_BY, *self._of_runs))
            check_present(self.attributes, (*MADE_BY, *((*COMPUTED_BY, *self._of_runs) if ran else ())))
            provenance = {
                **{name: str(self.attributes[name]) for name in ("created", "generated_by", "command_line")},
                **{name: str(self.attributes[name]) for name in known if name in self.attributes},
                "versions": json.loads(self.attributes["versions"]),
                "options": json.loads(self.attributes.get("options", "{}")),
                "inputs": [
                    {"path": each.path, "sha256": each.sha256, **_changes(each)} for each in self.inputs()
                ],
            }
        return cast("dict[str, Any]", shown(provenance))


class StoredSimulation(StoredResult):
    """An open simulation file; a context manager that closes it."""

    format = file_formats.SIMULATION
    kind = "simulation"
    command = "simulate"
    declared = SIMULATION_VARIABLES
    _of_runs = ()
    _to_get = "run simulate again"


def _changes(file: StoredInput) -> dict[str, Any]:
    return {"changes": file.changes} if file.changes else {}


_Stored = TypeVar("_Stored", bound=StoredResult)


def open_one_of(path: str | Path, *kinds: type[_Stored]) -> _Stored:
    """Open a file of one of these kinds, determined by its format.

    Raises:
        InputError, StorageError: as `StoredResult.open`.
    """
    with contextlib.ExitStack() as stack:
        file = stack.enter_context(CheckedFile(path))
        found = _format(path, file)
        kind = next((kind for kind in kinds if kind.format == found), None)
        if kind is None:
            raise InputError.one(_foreign(found, kinds), path)
        stored = kind(path, file)
        stack.pop_all()
    return stored


def stored_format(path: str | Path) -> str | None:
    """Return the attribute `format` of an HDF5 file, for trees that of chains; None if it has none.

    Raises:
        InputError, StorageError: as `StoredResult.open`.
    """
    with CheckedFile(path) as file:
        return _format(path, file)


def stored_inputs(path: str | Path) -> list[StoredInput]:
    """Return the inputs that a result, a simulation or a study table holds, of any version of its format.

    Raises:
        InputError, StorageError: as `StoredResult.open`.
    """
    with CheckedFile(path) as file:
        found = _format(path, file)
        if found is None or not found.startswith(OURS):
            raise InputError.one(_foreign(found, (StoredResult, StoredSimulation)), path)
        return StoredFile(path, file).inputs()


def _format(path: str | Path, file: h5py.File) -> str | None:
    """Return the attribute `format`, for trees that of chains."""
    with reporting_damage(path):
        found = file.attrs.get("format")
    if not isinstance(found, str):
        return None
    return next((plain for plain, of_tree in file_formats.OF_TREES.items() if of_tree == found), found)


def _foreign(found: str | None, kinds: Sequence[type[StoredResult]]) -> str:
    for kind in kinds:
        if found is not None and found.startswith(f"{OURS}{kind.kind}/"):
            return other_version(found, kind.format, kind.command)
    return f"is {kind_of_format(found)}, expected {joined((f'a {kind.kind}' for kind in kinds), 'or')}"


def kind_of_format(found: str | None) -> str:
    """Return the kind of an HDF5 file in words, from its attribute `format`."""
    if found is None or not found.startswith(OURS):
        return "an HDF5 file that vsacli has not written"
    return f"a {found.partition('/')[0].removeprefix(OURS).replace('-', ' ')}"


def other_version(found: str, read: str, command: str) -> str:
    """Return that a file has another version of a format, and how to compute it again."""
    again = f"run {command} again, with its inputs (vsacli info FILE --extract FOLDER)"
    formats = joined((read, *(of_tree for plain, of_tree in file_formats.OF_TREES.items() if plain == read)))
    return f"has the format {found}, but this version reads {formats}; {again}"


def open_stored(path: str | Path) -> StoredResult:
    """Open a result or a simulation file, determined by its format; see `StoredResult.open`."""
    return open_one_of(path, StoredResult, StoredSimulation)
