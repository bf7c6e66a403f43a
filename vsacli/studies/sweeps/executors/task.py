"""What a worker of a cluster does: the rows of several runs."""

from __future__ import annotations

import platform
import time
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

from vsacli.base.errors import InputError, Problem
from vsacli.studies.sweeps.executors.job import Job
from vsacli.studies.sweeps.rows import Computer, Row
from vsacli.studies.sweeps.study import Study


class Answer(NamedTuple):
    """What a worker made of a task: rows, or why it cannot compute any.

    Attributes:
        host: where.
        seconds: that the rows took.
        rows: of all runs of the task; none if there are problems.
        problems: why it cannot compute here.
    """

    host: str
    seconds: float
    rows: tuple[Row, ...] = ()
    problems: tuple[Problem, ...] = ()


def answer(job: Job, runs: Sequence[int]) -> Answer:
    """Compute the rows of runs here."""
    try:
        study = _study(job)
        begin = time.perf_counter()
        rows = tuple(map(Computer(study).row, runs))  # threads of a worker share no computer
    except InputError as error:
        return Answer(platform.node(), 0.0, problems=error.problems)
    return Answer(platform.node(), time.perf_counter() - begin, rows)


@lru_cache(maxsize=4)
def _study(job: Job) -> Study:
    """A study that this worker has read, for its next tasks."""
    return job.study()
