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

_COMPUTED_VARIABLES = ("q", "dq", "ddq", "tau_e", "theta", "tau_motor", "motor_power", "flags")
"""Variables stored in addition to the derivatives."""

_SLOPE_SUFFIX = "_slope"
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
        self._has_sensors = sensed
        super().__init__(file, robot, trajectory, provenance=provenance)

    def _absent_reasons(self, trajectory: Trajectory) -> dict[str, str]:  # noqa: ARG002
        return {} if self._has_sensors else dict.fromkeys(map(measured, MEASURED), "the run had no sensors")


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
        parameters: Sequence[ParameterValue],
        differentiated: Mapping[str, bool],
        *,
        provenance: Mapping[str, str],
    ) -> None:
        super().__init__(file, robot, trajectory, _COMPUTED_VARIABLES, provenance=provenance)
        self._parameters, self._differentiated = parameters, differentiated

    def _create_datasets(self) -> None:
        super()._create_datasets()
        file, (paths, values, units) = self._file, zip(*self._parameters, strict=True)
        parameter_scale = create_labels(
            file, "parameter", paths, "number of the robot file", track_order=False
        )
        parameter_scale.make_scale("parameter")
        values_dataset = file.create_dataset("parameter_value", data=list(values))
        long_name = "SI unit of the number"
        for dataset in (
            values_dataset,
            create_labels(file, "parameter_unit", units, long_name, track_order=False),
        ):
            attach_scales(dataset, [parameter_scale])
        for name, of_motors in self._differentiated.items():
            slope_dataset = self._create_slope(name, of_motors, parameter_scale)
            self._fillers[f"{name}{_SLOPE_SUFFIX}"] = ChunkFiller(slope_dataset, self.schedule_write)

    def _create_slope(self, name: str, of_motors: bool, scale: h5py.Dataset) -> h5py.Dataset:
        row_shape = (len(self._parameters), len(self._robot.joints), *((len(MOTORS),) if of_motors else ()))
        samples = self._trajectory.samples
        dataset = self._file.create_dataset(
            f"{name}{_SLOPE_SUFFIX}",
            shape=(samples, *row_shape),
            maxshape=(samples, *row_shape),
            dtype="<f8",
            chunks=(chunk_rows(samples, 8 * int(np.prod(row_shape))), *row_shape),
        )
        dataset.attrs["units"] = f"units of {name}, per parameter_unit"
        dataset.attrs["long_name"] = f"derivative of {name} by each number of the robot file"
        scales = [self._file["time"], scale, self._file["joint"], self._file["motor"]]
        attach_scales(dataset, scales[: dataset.ndim])
        return dataset

    def _dataset_values(self, block: Any, name: str) -> AnyArray:
        """Return the values of a block, or of its derivatives, for a dataset."""
        variable = name.removesuffix(_SLOPE_SUFFIX)
        return super()._dataset_values(block.block, name) if variable == name else block.over_time(variable)

    def _expected_bytes(self) -> int:
        column_count = sum(len(MOTORS) if of_motors else 1 for of_motors in self._differentiated.values())
        slope_bytes = 8 * column_count * len(self._parameters) * len(self._robot.joints)
        return super()._expected_bytes() + self._trajectory.samples * slope_bytes
