"""Files in the layout of a result file: simulations, and results with derivatives by robot parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import h5py
import numpy as np

from vsacli.base import file_formats
from vsacli.base.arrays import AnyArray
from vsacli.base.outputs import Staged
from vsacli.base.simulation_variables import MEASURED, SIMULATION_VARIABLES, measured
from vsacli.base.variables import MOTORS
from vsacli.results.store.layout import attach_scales, create_labels
from vsacli.results.store.new_file import ChunkFiller, chunk_rows
from vsacli.results.store.writer import ResultWriter
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

_COMPUTED = ("q", "dq", "ddq", "tau_e", "theta", "tau_motor", "motor_power", "flags")
"""Variables stored in addition to the derivatives."""

_SLOPE = "_slope"
"""Suffix of the names of derivatives."""


class SimulationWriter(ResultWriter):
    """Writer of a simulation file, with at most as many samples as the trajectory.

    Args:
        file, robot, trajectory, provenance: as for `ResultWriter`.
        sensed: whether the run has sensor readings.
    """

    _format = file_formats.SIMULATION
    _declared = SIMULATION_VARIABLES

    def __init__(
        self,
        file: Staged,
        robot: Robot,
        trajectory: Trajectory,
        *,
        sensed: bool = False,
        provenance: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._sensed = sensed
        super().__init__(file, robot, trajectory, provenance=provenance)

    def _absent(self, trajectory: Trajectory) -> dict[str, str]:  # noqa: ARG002
        return {} if self._sensed else dict.fromkeys(map(measured, MEASURED), "the run had no sensors")


class ParameterValue(NamedTuple):
    """A parameter of the robot: its path, its value in SI units, and its unit."""

    path: str
    value: float
    unit: str


class SensitivityWriter(ResultWriter):
    """Writer of a sensitivity file.

    Args:
        numbers: parameters of the derivatives.
        slopes: names of the differentiated variables, each with whether it is a variable of motors.
    """

    _format = file_formats.SENSITIVITY

    def __init__(
        self,
        file: Staged,
        robot: Robot,
        trajectory: Trajectory,
        numbers: Sequence[ParameterValue],
        slopes: Mapping[str, bool],
        *,
        provenance: Mapping[str, str],
    ) -> None:
        super().__init__(file, robot, trajectory, _COMPUTED, provenance=provenance)
        self._numbers, self._wanted = numbers, slopes

    def _create(self) -> None:
        super()._create()
        file, (paths, values, units) = self._file, zip(*self._numbers, strict=True)
        scale = create_labels(file, "parameter", paths, "number of the robot file", track_order=False)
        scale.make_scale("parameter")
        stored = file.create_dataset("parameter_value", data=list(values))
        words = "SI unit of the number"
        for dataset in (stored, create_labels(file, "parameter_unit", units, words, track_order=False)):
            attach_scales(dataset, [scale])
        for name, of_motors in self._wanted.items():
            slope = self._slope(name, of_motors, scale)
            self._fillers[f"{name}{_SLOPE}"] = ChunkFiller(slope, self.do)

    def _slope(self, name: str, of_motors: bool, scale: h5py.Dataset) -> h5py.Dataset:
        row = (len(self._numbers), len(self._robot.joints), *((len(MOTORS),) if of_motors else ()))
        samples = self._trajectory.samples
        dataset = self._file.create_dataset(
            f"{name}{_SLOPE}",
            shape=(samples, *row),
            maxshape=(samples, *row),
            dtype="<f8",
            chunks=(chunk_rows(samples, 8 * int(np.prod(row))), *row),
        )
        dataset.attrs["units"] = f"units of {name}, per parameter_unit"
        dataset.attrs["long_name"] = f"derivative of {name} by each number of the robot file"
        scales = [self._file["time"], scale, self._file["joint"], self._file["motor"]]
        attach_scales(dataset, scales[: dataset.ndim])
        return dataset

    def _values(self, block: Any, name: str) -> AnyArray:
        """Return the values of a block, or of its derivatives, for a dataset."""
        variable = name.removesuffix(_SLOPE)
        return super()._values(block.block, name) if variable == name else block.over_time(variable)

    def _size(self) -> int:
        columns = sum(len(MOTORS) if of_motors else 1 for of_motors in self._wanted.values())
        slopes = 8 * columns * len(self._numbers) * len(self._robot.joints)
        return super()._size() + self._trajectory.samples * slopes
