"""Whoever is asked to compute rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeAlias

from vsacli.studies.sweeps.executors.processes import Processes
from vsacli.studies.sweeps.rows import Computer, Row
from vsacli.studies.sweeps.study import Study

Rows: TypeAlias = Callable[[Sequence[int]], Iterator[Row]]
"""The rows of runs, in the order in which they are finished; raises what `Job.study` raises."""


@contextmanager
def executor(study: Study, processes: int, dask: str | None, tell: Callable[[str], object]) -> Iterator[Rows]:
    """What computes rows of a study, for as long as the context lasts; rows do not depend on it.

    Args:
        study: the study.
        processes: how many compute on this machine.
        dask: address of the scheduler of a Dask cluster whose workers compute instead, or "local" for one
            of `processes` of this machine.
        tell: learns what is waited for.

    Raises:
        InputError: there is no such cluster, or Dask is not installed.
    """
    if dask is not None:
        from vsacli.studies.sweeps.executors.cluster import Cluster

        with Cluster(study, dask, processes, tell) as cluster:
            yield cluster.rows
    elif processes > 1:
        with Processes(study, processes) as several:
            yield several.rows
    else:
        yield lambda runs: map(Computer(study).row, runs)
