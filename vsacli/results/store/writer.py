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
    MOTOR_CONSTANTS,
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
        variables: names of the variables to store, by default all; coordinates are always stored.
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
        self._variables = self._selected(variables, robot, trajectory)
        self._precision = precision
        rounded = {} if precision == DOUBLE else {PRECISION: precision}
        self._provenance = {"command_line": "", **provenance, **rounded}
        self._fillers: dict[str, ChunkFiller] = {}

    def write(self, block: Samples) -> None:
        """Append a copy of a block of samples; in a long file it is written later, in a thread.

        Raises:
            StorageError: the disk is full or fails, perhaps for an earlier block; or a value overflows single
                precision.
        """
        with self.used():
            for name, filler in self._fillers.items():
                values = self._values(block, name)
                try:
                    filler.append(values)
                except FloatingPointError:
                    raise self._too_large(name, values, block.time) from None

    def finish(self, report: Mapping[str, Any], provenance: Mapping[str, str] = MappingProxyType({})) -> None:
        """Store the report; the file contains the samples written so far.

        Args:
            report: report as JSON values; `verdict` and `complete` also become root attributes.
            provenance: attributes on the computation that have changed since the file was created.

        Raises:
            StorageError: the disk is full or fails.
        """
        with self.used():
            for filler in self._fillers.values():
                filler.finish()
            self.wait()
            for name, value in provenance.items():
                self._file.attrs.modify(name, value)  # keeps its place among the attributes
            self._complete(report)
            self._close()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        unfinished = kind is None and bool(self._file)
        super().__exit__(kind, error, traceback)
        if unfinished:
            raise RuntimeError("a result was left without `finish`")

    def _create(self) -> None:
        stored = create_layout(
            self._file,
            self._format if self._robot.is_plain_chain else file_formats.OF_TREES[self._format],
            self._robot,
            self._trajectory,
            self._variables,
            self._provenance,
            self._precision,
        )
        self._fillers = {name: ChunkFiller(dataset, self.do) for name, dataset in stored.items()}

    def _values(self, block: Any, name: str) -> AnyArray:
        """Return the values of a block for a dataset."""
        return split_axes(getattr(block, name), self._declared[name], self._labels)

    def _too_large(self, name: str, values: AnyArray, time: FloatArray) -> StorageError:
        """Return the error for values that overflow single precision."""
        with np.errstate(over="ignore"):
            lost = np.isfinite(values) & np.isinf(values.astype(np.float32))
        at = tuple(np.argwhere(lost)[0])
        owner = next((dim for dim in self._declared[name].dims if dim in ("joint", "tool")), None)
        of_owner = f" of {self._labels[owner][at[1]]}" if owner else ""
        what = f"{name}{of_owner} is {values[at]:.3g} at t = {time_text(time[at[0]])}"
        advice = f"beyond the {np.finfo(np.float32).max:.2g} of single precision; store in double precision"
        return StorageError(self._staged.path, f"cannot be written: {what}, {advice}")

    def _complete(self, report: Mapping[str, Any]) -> None:
        text = storable(json.dumps(report, ensure_ascii=False, allow_nan=False))
        self._file.create_group("report").create_dataset("json", data=text, dtype=TEXT)
        self._file.attrs["verdict"] = report["verdict"]
        self._file.attrs["complete"] = int(report["complete"])

    def _size(self) -> int:
        """Return the bytes of all samples, flags before compression."""
        stored = (VARIABLES["time"], *self._variables)
        row = sum(row_bytes(variable, self._labels, self._precision) for variable in stored)
        return self._trajectory.samples * row

    def _selected(
        self, names: Iterable[str] | None, robot: Robot, trajectory: Trajectory
    ) -> tuple[Variable, ...]:
        """Return the variables with these names, or all that a run of robot and trajectory has."""
        absent = {**self._absent(trajectory), **_not_given(robot, self._declared)}
        if names is None:
            return select_variables((name for name in self._declared if name not in absent), self._declared)
        selected = select_variables(names, self._declared)
        for variable in selected:
            if variable.name in absent:
                raise InputError.one(f"there is no {variable.name}: {absent[variable.name]}")
        return selected

    def _absent(self, trajectory: Trajectory) -> dict[str, str]:
        """Return the variables that a run along a trajectory does not have, each with the reason."""
        uncertain = trajectory.uncertain
        certain = [name for name in UNCERTAIN if name not in uncertain]
        reasons = {
            deviation(name): f"{name} does not come from a fit of recorded samples" for name in certain
        }
        if trajectory.wrench is not None:
            return reasons
        wrench = (*WRENCH_NAMES, *map(deviation, WRENCH_NAMES))
        return reasons | dict.fromkeys(wrench, "the trajectory has no wrench")


def _not_given(robot: Robot, declared: Mapping[str, Variable]) -> dict[str, str]:
    """Return the variables that the robot does not have, each with the missing key of its file."""
    return {
        name: f"no joint of {robot.name} has {_requirement(variable)}"
        for name, variable in declared.items()
        if not robot.has_variable(variable)
    }


def _requirement(variable: Variable) -> str:
    if variable.requires in MOTOR_CONSTANTS:
        return f"a motor with a {variable.requires}"
    signal = COMMANDED.get(f"{variable.requires}")
    return f"{variable.requires}" if signal is None else f"a {signal.device or signal.key}"
