"""The simulation file: the layout of a result file, with the variables of a simulation."""

from __future__ import annotations

from pathlib import Path

from vsacli.base.simulation_variables import SIMULATION_VARIABLES
from vsacli.results.store.reader import StoredResult, open_one_of
from vsacli.results.store.writer import ResultWriter
from vsacli.trajectory.trajectory import Trajectory

FORMAT = "vsacli-simulation/1"


class StoredSimulation(StoredResult):
    """An open simulation file; a context manager that closes it."""

    format = FORMAT
    kind = "simulation"
    command = "simulate"
    declared = SIMULATION_VARIABLES
    _to_get = "run simulate again"


class SimulationWriter(ResultWriter):
    """Writes a simulation file; the trajectory's samples are the most it can have."""

    _format = FORMAT
    _declared = SIMULATION_VARIABLES

    @staticmethod
    def _absent(_trajectory: Trajectory) -> dict[str, str]:
        return {}


def open_stored(path: str | Path) -> StoredResult:
    """Open a result or a simulation file, whichever it is; see `StoredResult.open`."""
    return open_one_of(path, StoredResult, StoredSimulation)
