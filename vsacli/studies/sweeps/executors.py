"""Executors of the rows of a study: this process, several of this machine, or the workers of a Dask cluster.

The latter two are executors of `concurrent.futures`, which `Executor.rows` gives tasks of a few runs. Whoever
computes a task reads the study again, by its `Job`, and returns an `Answer`; rows do not depend on who it is.
"""

from __future__ import annotations

import multiprocessing
import signal
import warnings
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.connection import Connection
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from vsacli.base.errors import InputError
from vsacli.base.interrupts import leave_interrupts_to_others
from vsacli.base.version import __version__
from vsacli.compute.engine import processors
from vsacli.studies.sweeps.rows import Answer, Computer, Job, Row, answer, lost
from vsacli.studies.sweeps.study import Study

if TYPE_CHECKING:
    from distributed import Client

RUNS_A_PROCESS = 25
"""A process takes as long to begin as some 25 short runs."""

LOCAL = "local"
"""Stands for an address: a cluster of processes of this machine."""

TASK_SECONDS = 0.5
"""Seconds of a task: about a hundred times the overhead of Dask, and the loss by a killed worker."""

TASKS_A_THREAD = 2
"""Given to the cluster at a time: one is computed, the next one waits at the worker."""

CONNECT_SECONDS = 10.0
"""After which a scheduler that does not answer counts as absent."""

CRITICAL = 50
"""The level of messages of Python's `logging` from which on Dask prints its own."""

Rows: TypeAlias = Callable[[Sequence[int]], Iterator[Row]]
"""The rows of runs, in the order in which they are finished; raises what `Job.study` raises."""


@contextmanager
def executor(
    study: Study, runs: int, processes: int | None, dask: str | None, tell: Callable[[str], object]
) -> Iterator[Rows]:
    """Return the executor of the rows of a study, for as long as the context lasts.

    Args:
        study: the study.
        runs: how many are to be computed.
        processes: how many compute on this machine; as many as pay if None.
        dask: address of the scheduler of a Dask cluster whose workers compute instead, or "local" for one
            of `processes` of this machine.
        tell: receives sentences on delays.

    Raises:
        InputError: there is no such cluster, or Dask is not installed.
    """
    short = dask is None and study.file.optimize is None
    paying = 1 + runs // RUNS_A_PROCESS if short else runs
    count = min(processors(), paying) if processes is None else min(processes, runs)
    if dask is not None:
        with Cluster(study, dask, count, tell) as cluster:
            yield cluster.rows
    elif count > 1:
        with Processes(study, count) as several:
            yield several.rows
    else:
        yield lambda runs: map(Computer(study).row, runs)


class Executor(ABC):
    """Context manager around workers that compute tasks, as executors of `concurrent.futures` do.

    Args:
        study: whose runs.
    """

    def __init__(self, study: Study) -> None:
        self._study, self._job = study, Job.of(study)
        self._open = ExitStack()
        self._seconds_a_run = TASK_SECONDS

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._open.close()

    @abstractmethod
    def next_task(self, waiting: deque[int], given: int) -> list[int]:
        """Take the next runs that go together; none while enough tasks are given."""

    @abstractmethod
    def submit(self, runs: Sequence[int]) -> Future[Answer]:
        """Give a task to a worker."""

    @abstractmethod
    def reason(self, task: Future[Answer], error: Exception) -> str:
        """Return the fate of the process whose task was lost.

        Raises:
            InputError: no other one would do better.
        """

    def rows(self, runs: Sequence[int]) -> Iterator[Row]:
        """See `Rows.rows`."""
        waiting, given = deque(runs), dict[Future[Answer], list[int]]()
        while waiting or given:
            while waiting and (task := self.next_task(waiting, len(given))):
                given[self.submit(task)] = task
            for future in wait(given, return_when=FIRST_COMPLETED).done:
                yield from self._rows_of(future, given.pop(future))

    def _rows_of(self, future: Future[Answer], runs: Sequence[int]) -> Sequence[Row]:
        """Return the rows of a task that has ended."""
        try:
            found = future.result()
        except Exception as error:
            how = self.reason(future, error)
            return [lost(self._study, run, how) for run in runs]
        if found.problems:
            raise InputError(found.problems)
        self._seconds_a_run = found.seconds / len(found.rows)
        return found.rows


class Worker:
    """A process and the thread that waits for it: if it is killed, no other task is lost.

    A `ProcessPoolExecutor` has named semaphores, which stay in the system if all is killed; a pipe does not.

    Args:
        job: which the process begins to read.
    """

    def __init__(self, job: Job) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, job), daemon=True)
        self.process.start()
        theirs.close()
        self._thread = ThreadPoolExecutor(1)
        self.begun = False
        self.task: Future[Answer] = Future()

    def compute(self, runs: Sequence[int]) -> Future[Answer]:
        """Give it a task."""
        self.task = self._thread.submit(self._answer, runs)
        return self.task

    def _answer(self, runs: Sequence[int]) -> Answer:
        if not self.begun:
            self.begun = self._connection.recv()
        self._connection.send(runs)
        found: Answer = self._connection.recv()
        return found

    def end(self) -> None:
        """End it at once."""
        self.process.kill()
        self.process.join()
        self._thread.shutdown()
        self._connection.close()


class Processes(Executor):
    """Processes of this machine, each with one run at a time.

    Args:
        study: whose runs.
        count: how many.
    """

    def __init__(self, study: Study, count: int) -> None:
        super().__init__(study)
        self._count = count
        self.workers: list[Worker] = []

    def next_task(self, waiting: deque[int], given: int) -> list[int]:
        """One run, which a process that is killed costs."""
        return [waiting.popleft()] if given < self._count else []

    def submit(self, runs: Sequence[int]) -> Future[Answer]:
        """See `Executor.submit`; a process begins when there is a task for it."""
        free = next((worker for worker in self.workers if worker.task.done()), None)
        if free is None or len(self.workers) < self._count:
            free = Worker(self._job)
            self._open.callback(free.end)
            self.workers.append(free)
        return free.compute(runs)

    def reason(self, task: Future[Answer], _error: Exception) -> str:
        """See `Executor.reason`; the process goes, and another begins for the next task."""
        worker = next(each for each in self.workers if each.task is task)
        worker.end()
        self.workers.remove(worker)
        code = worker.process.exitcode or 0
        how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        if not worker.begun:
            message = f"a process that was to compute {how} before it had begun"
            raise InputError.one(message, self._study.source.path)
        return how


def _work(connection: Connection, job: Job) -> None:
    """Read the study, then compute requested runs until there are none."""
    leave_interrupts_to_others()
    with suppress(EOFError, OSError):  # whoever asked has gone
        answer(job, ())  # what is wrong with it the first task says
        connection.send(True)
        while True:
            connection.send(answer(job, connection.recv()))


class Cluster(Executor):
    """The workers of a Dask cluster, which read the same files; one that is local lasts as long.

    Args:
        study: whose runs.
        address: of the scheduler, or `LOCAL`.
        processes: workers of a local cluster.
        tell: receives sentences on delays.
    """

    def __init__(self, study: Study, address: str, processes: int, tell: Callable[[str], object]) -> None:
        super().__init__(study)
        self._address, self._processes, self._tell = address, processes, tell

    def __enter__(self) -> Self:
        """Connect.

        Raises:
            InputError: Dask is not installed, or no scheduler answers.
        """
        try:
            import distributed
        except ImportError:
            reason = "a Dask cluster needs the package distributed, which is not installed"
            raise InputError.one(f"{reason}; pip install 'vsacli[dask]' gets it") from None
        with ExitStack() as opened, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # versions that matter are compared by each task
            opened.enter_context(distributed.utils.silence_logging_cmgr(CRITICAL))
            self._client = opened.enter_context(self._connected(opened))
            self._executor = self._client.get_executor(pure=False)
            self._open = opened.pop_all()
        if not self._client.nthreads():
            self._tell(f"{self._address} has no worker yet; waiting for one")
        return self

    def _connected(self, opened: ExitStack) -> Client:
        import distributed
        from distributed.comm import get_address_host_port

        if self._address == LOCAL:
            cluster = distributed.LocalCluster(
                n_workers=self._processes, threads_per_worker=1, dashboard_address=None, silence_logs=CRITICAL
            )
            return distributed.Client(opened.enter_context(cluster))
        try:
            get_address_host_port(self._address, strict=True)
            return distributed.Client(self._address, timeout=CONNECT_SECONDS)
        except (OSError, ValueError) as error:
            expected = "expected the address of a Dask scheduler such as tcp://host:8786, or local"
            raise InputError.one(f"--dask {self._address}: {error}; {expected}") from None

    def next_task(self, waiting: deque[int], given: int) -> list[int]:
        """Runs of some time, but so few that the last tasks end together."""
        tasks = TASKS_A_THREAD * max(1, sum(self._client.nthreads().values()))
        count = min(1 + len(waiting) // tasks, max(1, int(TASK_SECONDS / self._seconds_a_run)), len(waiting))
        return [waiting.popleft() for _ in range(count)] if given < tasks else []

    def submit(self, runs: Sequence[int]) -> Future[Answer]:
        """See `Executor.submit`."""
        task: Future[Answer] = self._executor.submit(_compute(), tuple(self._job), runs)
        return task

    def reason(self, _task: Future[Answer], error: Exception) -> str:
        """See `Executor.reason`."""
        from distributed import KilledWorker

        if isinstance(error, KilledWorker):
            return "was killed"
        if isinstance(error, CancelledError):
            raise error
        cause = error.__cause__ or error
        raise InputError.one(
            "the Dask cluster cannot compute studies: all its workers need "
            f"vsacli {__version__}, as here ({type(cause).__name__}: {cause})"
        ) from error

    def rows(self, runs: Sequence[int]) -> Iterator[Row]:
        """See `Rows.rows`."""
        try:
            yield from super().rows(runs)
        except InputError:
            raise
        except Exception as error:  # which one it is depends on what was asked when the scheduler went
            if self._client.status == "running" and not isinstance(error, OSError | CancelledError):
                raise
            raise InputError.one(f"the connection to the scheduler {self._address} was lost") from error


def _compute() -> Callable[[Sequence[Any], Sequence[int]], Answer]:
    """Return what a task does: a function within a function, since Dask sends such a one as code.

    One that is sent by its name ends workers that do not have the module, before they could say so.
    """

    def compute(job: Sequence[Any], runs: Sequence[int]) -> Answer:
        import platform

        from vsacli.studies.sweeps.rows import Job, answer

        found = answer(Job(*job), runs)
        host = f"on the worker {platform.node()}: "
        named = (problem._replace(message=host + problem.message) for problem in found.problems)
        return found._replace(problems=tuple(named))

    return compute
