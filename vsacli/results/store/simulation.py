"""The simulation file: the layout of a result file, with the variables of a simulation."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from vsacli.base.simulation_variables import SIMULATION_VARIABLES
from vsacli.base.variables import Variable, select_variables
from vsacli.results.store.reader import StoredResult, open_one_of
from vsacli.results.store.writer import ResultWriter, absent_at
from vsacli.robot.model import Robot
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

    @staticmethod
    def _selected(names: Iterable[str] | None, robot: Robot, _trajectory: Trajectory) -> tuple[Variable, ...]:
        absent = absent_at(robot, SIMULATION_VARIABLES)
        every = [name for name in SIMULATION_VARIABLES if name not in absent]
        return select_variables(every if names is None else names, SIMULATION_VARIABLES)


def open_stored(path: str | Path) -> StoredResult:
    """Open a result or a simulation file, whichever it is; see `StoredResult.open`."""
    return open_one_of(path, StoredResult, StoredSimulation)
