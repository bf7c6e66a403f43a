"""Writing a simulation file: the layout of a result file, with the variables of a simulation."""

from __future__ import annotations

from collections.abc import Iterable

from vsacli.base.simulation_variables import SIMULATION_VARIABLES
from vsacli.base.variables import Variable, select_variables
from vsacli.results.store.simulation import FORMAT
from vsacli.results.store.writer import ResultWriter
from vsacli.trajectory.trajectory import Trajectory


class SimulationWriter(ResultWriter):
    """Writes a simulation file; the trajectory's samples are the most it can have."""

    _format = FORMAT

    @staticmethod
    def _selected(names: Iterable[str] | None, _trajectory: Trajectory) -> tuple[Variable, ...]:
        return select_variables(SIMULATION_VARIABLES if names is None else names, SIMULATION_VARIABLES)
