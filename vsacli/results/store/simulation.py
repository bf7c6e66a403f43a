"""The simulation file: the layout of a result file, with the variables of a simulation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from vsacli.base.outputs import Staged
from vsacli.base.simulation_variables import MEASURED, SIMULATION_VARIABLES, measured
from vsacli.results.store.reader import StoredResult, open_one_of
from vsacli.results.store.writer import ResultWriter
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

FORMAT = "vsacli-simulation/1"


class StoredSimulation(StoredResult):
    """An open simulation file; a context manager that closes it."""

    format = FORMAT
    kind = "simulation"
    command = "simulate"
    declared = SIMULATION_VARIABLES
    _of_runs = ()
    _to_get = "run simulate again"


class SimulationWriter(ResultWriter):
    """Writes a simulation file; the trajectory's samples are the most it can have.

    Args:
        file, robot, trajectory, provenance: as of `ResultWriter`.
        sensed: whether the run has readings of sensors.
    """

    _format = FORMAT
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


def open_stored(path: str | Path) -> StoredResult:
    """Open a result or a simulation file, whichever it is; see `StoredResult.open`."""
    return open_one_of(path, StoredResult, StoredSimulation)
