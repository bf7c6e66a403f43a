"""Processes of this machine, each with one run at a time; one that is killed costs that run alone."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import TYPE_CHECKING, Self

from vsacli.base.errors import InputError
from vsacli.base.interrupts import leave_interrupts_to_others
from vsacli.studies.sweeps.executors.job import Job
from vsacli.studies.sweeps.rows import Computer, Row, lost
from vsacli.studies.sweeps.study import Study

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

BEGIN = "begin"
"""What a process says when it has read the study, before any row."""


class Worker:
    """A process, and the run that it computes, if it computes one."""

    def __init__(self, job: Job) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(target=_work, args=(theirs, job), daemon=True)
        self.process.start()
        theirs.close()
        self.run: int | None = None

    def compute(self, run: int) -> None:
        """Have it compute a run, unless it has gone, which shows when it is waited for."""
        self.run = run
        with suppress(OSError):
            self.connection.send(run)

    def end(self) -> None:
        """End it at once."""
        self.connection.close()
        self.process.kill()
        self.process.join()


class Processes:
    """Context manager around processes that compute runs.

    Args:
        study: whose runs.
        count: how many.
    """

    def __init__(self, study: Study, count: int) -> None:
        self._study, self._job, self._count = study, Job.of(study), count
        self._workers: list[Worker] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for worker in self._workers:
            worker.end()

    def rows(self, runs: Iterable[int]) -> Iterator[Row]:
        """As of `Rows`."""
        waiting = iter(runs)
        self._workers = [Worker(self._job) for _ in range(self._count)]
        while self._workers:
            ready = wait([worker.connection for worker in self._workers])
            for worker in [worker for worker in self._workers if worker.connection in ready]:
                try:
                    message = worker.connection.recv()
                except (EOFError, OSError):
                    yield self._lost(worker)
                    self._replace(worker)
                    continue
                if isinstance(message, Row):
                    yield message
                elif message != BEGIN:
                    raise InputError(message)
                self._go_on(worker, next(waiting, None))

    def _lost(self, worker: Worker) -> Row:
        """The row of the run that a worker took with it."""
        worker.process.join()
        code = worker.process.exitcode or 0
        how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        if worker.run is None:
            raise InputError.one(
                f"a process that was to compute {how} before it had begun", self._study.source.path
            )
        return lost(self._study, worker.run, how)

    def _replace(self, worker: Worker) -> None:
        """Start another in the place of a worker that has gone; it asks for a run when it begins."""
        worker.end()
        self._workers[self._workers.index(worker)] = Worker(self._job)

    def _go_on(self, worker: Worker, run: int | None) -> None:
        """Give a worker the next run; if there is none, it ends."""
        if run is not None:
            worker.compute(run)
        else:
            self._workers.remove(worker)
            worker.end()


def _work(connection: Connection, job: Job) -> None:
    """What a worker does: read the study, then compute what it is told to until nobody tells it."""
    leave_interrupts_to_others()
    with suppress(EOFError, OSError):  # whoever asked has gone
        try:
            computer = Computer(job.study())
            connection.send(BEGIN)
            while True:
                connection.send(computer.row(connection.recv()))
        except InputError as error:
            connection.send(error.problems)
