"""Writing of the result file, block by block."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from types import MappingProxyType, TracebackType
from typing import Any, Protocol

import numpy as np

from vsacli.base import file_formats
from vsacli.base.arrays import AnyArray, FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, StorageError
from vsacli.base.outputs import Staged
from vsacli.base.signals import COMMANDED
from vsacli.base.units import time_text
from vsacli.base.variables import (
    ALL,
    MIN_STIFFNESS,
    MOTOR_CONSTANTS,
    ON_REQUEST,
    TIP_COMPLIANCE,
    TOOL_FLAGS,
    UNCERTAIN,
    VARIABLES,
    Variable,
    deviation,
    select_variables,
    split_axes,
    variables_by_tool,
)
from vsacli.base.wrench import WRENCH_NAMES
from vsacli.results.store.layout import create_layout, row_bytes
from vsacli.results.store.new_file import ChunkFiller, NewFile
from vsacli.results.store.schema import DOUBLE, FLOATS, PRECISION, TEXT, storable
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


class Samples(Protocol):
    """Consecutive samples: times, and an array for each variable as an attribute."""

    @property
    def time(self) -> FloatArray:
        """Times, (samples,), s."""


class ResultWriter(NewFile):
    """Context manager that writes a result file, which is complete after `finish`.

    A subclass writes another format: other variables in the same layout.

    Args:
        file: staged file to write.
        robot: robot of the run, stored as resolved arrays.
        trajectory: source of the name, the number of samples, and the input files.
        variables: names of the variables to store, by default `ALL`, which leaves out those of `ON_REQUEST`;
            coordinates are always stored.
        provenance: attributes of the file on the computation, such as `command_line`.
        precision: precision of the stored values, "double" or "single"; times are always double.

    Raises:
        InputError: a name in `variables` is unknown, or the trajectory or the robot does not have the
            variable; or the precision is unknown.
    """

    _format = file_formats.RESULT
    _declared: Mapping[str, Variable] = VARIABLES

    def __init__(
        self,
        file: Staged,
        robot: Robot,
        trajectory: Trajectory,
        variables: Iterable[str] | None = None,
        *,
        provenance: Mapping[str, str] = MappingProxyType({}),
        precision: str = DOUBLE,
    ) -> None:
        if precision not in FLOATS:
            raise InputError.one(f"unknown precision {precision!r}{did_you_mean(precision, FLOATS)}")
        super().__init__(file)
        self._robot = robot
        self._labels = robot.labels
        self._declared = variables_by_tool(self._declared, len(robot.tool_names))
        self._trajectory = trajectory
        self._variables = self._variables_to_store(variables, robot, trajectory)
        self._precision = precision
        precision_attribute = {} if precision == DOUBLE else {PRECISION: precision}
        self._provenance = {"command_line": "", **provenance, **precision_attribute}
        self._fillers: dict[str, ChunkFiller] = {}

    def write(self, block: Samples) -> None:
        """Append a copy of a block of samples; in a long file it is written later, in a thread.

        Raises:
            StorageError: the disk is full or fails, perhaps for an earlier block; or a value overflows single
                precision.
        """
        with self.reporting_disk_errors():
            for name, filler in self._fillers.items():
                values = self._dataset_values(block, name)
                try:
                    filler.append(values)
                except FloatingPointError:
                    raise self._overflow_error(name, values, block.time) from None

    def finish(self, report: Mapping[str, Any], provenance: Mapping[str, str] = MappingProxyType({})) -> None:
        """Store the report; the file contains the samples written so far.

        Args:
            report: report as JSON values; `verdict` and `complete` also become root attributes.
            provenance: attributes on the computation that have changed since the file was created.

        Raises:
            StorageError: the disk is full or fails.
        """
        with self.reporting_disk_errors():
            for filler in self._fillers.values():
                filler.finish()
            self.wait()
            for name, value in provenance.items():
                self._file.attrs.modify(name, value)  # keeps its place among the attributes
            self._write_report(report)
            self._close()

    def __exit__(
        self,
        error_type: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        unfinished = error_type is None and bool(self._file)
        super().__exit__(error_type, error, traceback)
        if unfinished:
            raise RuntimeError("a result was left without `finish`")

    def _create_datasets(self) -> None:
        datasets = create_layout(
            self._file,
            self._format if self._robot.is_plain_chain else file_formats.TREE_FORMATS[self._format],
            self._robot,
            self._trajectory,
            self._variables,
            self._provenance,
            self._precision,
        )
        self._fillers = {
            name: ChunkFiller(dataset, self.schedule_write) for name, dataset in datasets.items()
        }

    def _dataset_values(self, block: Any, name: str) -> AnyArray:
        """Return the values of a block for a dataset."""
        return split_axes(getattr(block, name), self._declared[name], self._labels)

    def _overflow_error(self, name: str, values: AnyArray, time: FloatArray) -> StorageError:
        """Return the error for values that overflow single precision."""
        with np.errstate(over="ignore"):
            overflows = np.isfinite(values) & np.isinf(values.astype(np.float32))
        index = tuple(np.argwhere(overflows)[0])
        owner_dim = next((dim for dim in self._declared[name].dims if dim in ("joint", "tool")), None)
        owner_text = f" of {self._labels[owner_dim][index[1]]}" if owner_dim else ""
        value_text = f"{name}{owner_text} is {values[index]:.3g} at t = {time_text(time[index[0]])}"
        advice = f"beyond the {np.finfo(np.float32).max:.2g} of single precision; store in double precision"
        return StorageError(self._staged.path, f"cannot be written: {value_text}, {advice}")

    def _write_report(self, report: Mapping[str, Any]) -> None:
        report_json = storable(json.dumps(report, ensure_ascii=False, allow_nan=False))
        self._file.create_group("report").create_dataset("json", data=report_json, dtype=TEXT)
        self._file.attrs["verdict"] = report["verdict"]
        self._file.attrs["complete"] = int(report["complete"])

    def _expected_bytes(self) -> int:
        """Return the bytes of all samples, flags before compression."""
        stored_variables = (VARIABLES["time"], *self._variables)
        sample_bytes = sum(
            row_bytes(variable, self._labels, self._precision) for variable in stored_variables
        )
        return self._trajectory.samples * sample_bytes

    def _variables_to_store(
        self, names: Iterable[str] | None, robot: Robot, trajectory: Trajectory
    ) -> tuple[Variable, ...]:
        """Return the variables with these names, or all that a run of robot and trajectory has."""
        requested = {ALL} if names is None else set(names)
        reasons = {**self._absent_reasons(trajectory), **_missing_in_robot(robot, self._declared)}
        if TIP_COMPLIANCE in requested:
            reasons.pop(TOOL_FLAGS, None)
        for variable in select_variables(requested - {ALL}, self._declared):
            if variable.name in reasons:
                raise InputError.one(f"there is no {variable.name}: {reasons[variable.name]}")
        default_names = {name for name in self._declared if name not in reasons and name not in ON_REQUEST}
        return select_variables(
            requested - {ALL} | (default_names if ALL in requested else set()), self._declared
        )

    def _absent_reasons(self, trajectory: Trajectory) -> dict[str, str]:
        """Return the variables that a run along a trajectory does not have, each with the reason."""
        uncertain_names = trajectory.uncertain
        certain_names = [name for name in UNCERTAIN if name not in uncertain_names]
        reasons = {
            deviation(name): f"{name} does not come from a fit of recorded samples" for name in certain_names
        }
        if trajectory.wrench is not None:
            return reasons
        wrench_names = (*WRENCH_NAMES, *map(deviation, WRENCH_NAMES))
        return reasons | dict.fromkeys(wrench_names, "the trajectory has no wrench")


def _missing_in_robot(robot: Robot, declared: Mapping[str, Variable]) -> dict[str, str]:
    """Return the variables that the robot does not have, each with the missing key of its file."""
    return {
        name: f"no {variable.dims[0]} of {robot.name} has {_requirement_text(variable)}"
        for name, variable in declared.items()
        if not robot.has_variable(variable)
    }


def _requirement_text(variable: Variable) -> str:
    if variable.requires == MIN_STIFFNESS:
        return f"a {MIN_STIFFNESS}, and {TIP_COMPLIANCE} is not computed"
    if variable.requires in MOTOR_CONSTANTS:
        return f"a motor with a {variable.requires}"
    signal = COMMANDED.get(f"{variable.requires}")
    return f"{variable.requires}" if signal is None else f"a {signal.device or signal.key}"
