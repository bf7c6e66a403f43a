"""Reading a simulation file, or whichever file a simulation or the inverse dynamics have left."""

from __future__ import annotations

from pathlib import Path

from vsacli.base.simulation_variables import SIMULATION_VARIABLES
from vsacli.results.store.reader import StoredResult, open_one_of

FORMAT = "vsacli-simulation/1"


class StoredSimulation(StoredResult):
    """An open simulation file; a context manager that closes it."""

    format = FORMAT
    kind = "simulation"
    command = "simulate"
    declared = SIMULATION_VARIABLES
    _to_get = "run simulate again"


def open_stored(path: str | Path) -> StoredResult:
    """Open a result or a simulation file, whichever it is; see `StoredResult.open`."""
    return open_one_of(path, StoredResult, StoredSimulation)
