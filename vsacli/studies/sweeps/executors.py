"""Executors for the rows of a study: this process, several processes, or the workers of a Dask cluster.

`Executor.rows` submits tasks of a few runs to processes or a cluster and waits for their futures. A worker
reads the study again from its `Job` and returns an `Answer`; rows do not depend on the worker.
"""

from __future__ import annotations

import multiprocessing
import platform
import signal
import warnings
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from vsacli.base.errors import InputError
from vsacli.base.interrupts import leave_interrupts_to_others, starting_worker
from vsacli.base.version import __version__
from vsacli.compute.engine import processor_count
from vsacli.studies.sweeps.rows import Answer, Computer, Job, Row, answer, lost
from vsacli.studies.sweeps.study import Study

if TYPE_CHECKING:
    from distributed import Client

SINGLE_RUNS_A_PROCESS, BATCHED_RUNS_A_PROCESS = 25, 350
"""Smallest numbers of short runs per process, computed one by one and in batches: starting a process takes as
long as about so many of them."""

TASKS_A_PROCESS = 4
"""Number of tasks into which the waiting runs are divided for each process, so that all end together."""

LOCAL = "local"
"""Address that stands for a cluster of processes on this machine."""

TASK_SECONDS = 0.5
"""Duration of a task, s: about a hundred times the overhead of Dask; it is lost if a worker is killed."""

TASKS_A_THREAD = 2
"""Submitted tasks per thread of the cluster: one is computed while the next waits at the worker."""

CONNECT_SECONDS = 10.0
"""Time after which a scheduler that does not answer is considered absent, s."""

CRITICAL = 50
"""Logging level from which on Dask prints messages."""

Rows: TypeAlias = Callable[[Sequence[int]], Iterator[Row]]
"""Function that yields the rows of runs in the order in which they finish; it raises as `Job.study`."""


@contextmanager
def executor(
    study: Study, runs: int, processes: int | None, dask: str | None, tell: Callable[[str], object]
) -> Iterator[Rows]:
    """Yield a function that computes the rows of a study, valid within the context.

    Args:
        study: study to compute.
        runs: number of runs to compute.
        processes: number of worker processes on this machine; chosen by the number of runs and CPU cores if
            None.
        dask: address of the scheduler of a Dask cluster to use instead, or "local" for a cluster of
            `processes` on this machine.
        tell: function to call with messages about delays.

    Raises:
        InputError: the cluster does not answer, or Dask is not installed.
    """
    is_short = dask is None and study.file.optimize is None
    min_runs = BATCHED_RUNS_A_PROCESS if study.runs_of_batch > 1 else SINGLE_RUNS_A_PROCESS
    useful_processes = 1 + runs // min_runs if is_short else runs
    process_count = min(processor_count(), useful_processes) if processes is None else min(processes, runs)
    if dask is not None:
        with Cluster(study, dask, process_count, tell) as cluster:
            yield cluster.rows
    elif process_count > 1:
        with Processes(study, process_count) as worker_processes:
            yield worker_processes.rows
    else:
        yield Computer(study).rows


class Executor(ExitStack, ABC):
    """A context manager around workers that compute tasks, like the executors of `concurrent.futures`.

    Args:
        study: study to compute.
    """

    def __init__(self, study: Study) -> None:
        super().__init__()
        self._study, self._job = study, Job.of(study)
        self._seconds_a_run = TASK_SECONDS
        self._isolated_runs: set[int] = set()  # runs of lost tasks, of which one may end its process again

    @abstractmethod
    def next_task(self, waiting: deque[int], given: int) -> list[int]:
        """Take the runs of the next task from those waiting; none while enough tasks are submitted."""

    def take(self, waiting: deque[int], count: int) -> list[int]:
        """Take the next runs from those waiting; one that was lost with others is a task of its own."""
        count = 1 if waiting[0] in self._isolated_runs else min(count, len(waiting))
        return [waiting.popleft() for _ in range(count)]

    @abstractmethod
    def submit(self, runs: Sequence[int]) -> Future[Answer]:
        """Submit a task to a worker."""

    @abstractmethod
    def reason(self, task: Future[Answer], error: Exception) -> str:
        """Return, as a clause, how the process of a lost task ended.

        Raises:
            InputError: another process would fail as well.
        """

    def rows(self, runs: Sequence[int]) -> Iterator[Row]:
        """Yield the rows of runs in the order in which they finish; see `Rows`."""
        pending_runs, runs_by_task = deque(runs), dict[Future[Answer], list[int]]()
        while pending_runs or runs_by_task:
            while pending_runs and (task := self.next_task(pending_runs, len(runs_by_task))):
                runs_by_task[self.submit(task)] = task
            for future in wait(runs_by_task, return_when=FIRST_COMPLETED).done:
                yield from self._rows_of_task(future, runs_by_task.pop(future), pending_runs)

    def _rows_of_task(
        self, future: Future[Answer], runs: Sequence[int], pending_runs: deque[int]
    ) -> Sequence[Row]:
        """Return the rows of a task that has ended; several runs of a lost task wait again, each apart."""
        try:
            task_answer = future.result()
        except Exception as error:
            end_clause = self.reason(future, error)
            if len(runs) == 1:
                return [lost(self._study, runs[0], end_clause)]
            self._isolated_runs.update(runs)
            pending_runs.extendleft(reversed(runs))
            return []
        if task_answer.problems:
            raise InputError(task_answer.problems)
        self._seconds_a_run = task_answer.seconds / len(task_answer.rows)
        return task_answer.rows


class Worker:
    """A process and the thread that waits for it; if it is killed, no other task is lost.

    A `ProcessPoolExecutor` has named semaphores, which remain in the system if everything is killed; a pipe
    does not.

    Args:
        job: job that the process reads at its start.
    """

    def __init__(self, job: Job) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, job), daemon=True)
        with starting_worker():
            self.process.start()
        theirs.close()
        self._thread = ThreadPoolExecutor(1)
        self.begun = False
        self.task: Future[Answer] = Future()

    def compute(self, runs: Sequence[int]) -> Future[Answer]:
        """Submit runs to the process."""
        self.task = self._thread.submit(self._answer, runs)
        return self.task

    def _answer(self, runs: Sequence[int]) -> Answer:
        if not self.begun:
            self.begun = self._connection.recv()
        self._connection.send(runs)
        task_answer: Answer = self._connection.recv()
        return task_answer

    def end(self) -> None:
        """Kill the process and close the connection."""
        self.process.kill()
        self.process.join()
        self._thread.shutdown()
        self._connection.close()


class Processes(Executor):
    """Processes on this machine, each with one run or batch at a time.

    Args:
        study: study to compute.
        count: number of processes.
    """

    def __init__(self, study: Study, count: int) -> None:
        super().__init__(study)
        self._count = count
        self.workers: list[Worker] = []

    def next_task(self, waiting: deque[int], given: int) -> list[int]:
        """See `Executor.next_task`."""
        runs_share = len(waiting) // (TASKS_A_PROCESS * self._count)
        return (
            self.take(waiting, min(self._study.runs_of_batch, 1 + runs_share)) if given < self._count else []
        )

    def submit(self, runs: Sequence[int]) -> Future[Answer]:
        """See `Executor.submit`; processes start when there are tasks for them."""
        free_worker = next((worker for worker in self.workers if worker.task.done()), None)
        if free_worker is None or len(self.workers) < self._count:
            free_worker = Worker(self._job)
            self.callback(free_worker.end)
            self.workers.append(free_worker)
        return free_worker.compute(runs)

    def reason(self, task: Future[Answer], _error: Exception) -> str:
        """See `Executor.reason`; the process is removed, and another starts for the next task."""
        worker = next(each for each in self.workers if each.task is task)
        worker.end()
        self.workers.remove(worker)
        code = worker.process.exitcode or 0
        end_clause = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        if not worker.begun:
            message = f"a process that was to compute {end_clause} before it had begun"
            raise InputError.one(message, self._study.source.path)
        return end_clause


def _work(connection: Connection, job: Job) -> None:
    """Read the study, then compute requested runs until the connection ends."""
    leave_interrupts_to_others()
    with suppress(EOFError, OSError):  # the parent process has ended
        answer(job, ())  # reads the study; the answer to the first task reports problems
        connection.send(True)
        while True:
            connection.send(answer(job, connection.recv()))


class Cluster(Executor):
    """The workers of a Dask cluster, which must see the same files; a local cluster ends with the context.

    Args:
        study: study to compute.
        address: address of the scheduler, or `LOCAL`.
        processes: number of workers of a local cluster.
        tell: function to call with messages about delays.
    """

    def __init__(self, study: Study, address: str, processes: int, tell: Callable[[str], object]) -> None:
        super().__init__(study)
        self._address, self._processes, self._tell = address, processes, tell

    def __enter__(self) -> Self:
        """Connect to the cluster.

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
            self._client = opened.enter_context(self._connect(opened))
            self._executor = self._client.get_executor(pure=False)
            self.callback(opened.pop_all().close)
        if not self._client.nthreads():
            self._tell(f"{self._address} has no worker yet; waiting for one")
        return self

    def _connect(self, opened: ExitStack) -> Client:
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
        except ValueError:
            expected = "expected the address of a scheduler such as tcp://host:8786, or local"
            raise InputError.one(f"{expected}, found {self._address!r}") from None
        except OSError:
            reason = f"no Dask scheduler answers at {self._address} within {CONNECT_SECONDS:g} s"
            raise InputError.one(f"{reason}; check the address and that it runs") from None

    def next_task(self, waiting: deque[int], given: int) -> list[int]:
        """See `Executor.next_task`; about `TASK_SECONDS` of runs, fewer at the end to end together."""
        tasks = TASKS_A_THREAD * max(1, sum(self._client.nthreads().values()))
        max_task_runs = max(self._study.runs_of_batch, int(TASK_SECONDS / self._seconds_a_run))
        return self.take(waiting, min(1 + len(waiting) // tasks, max_task_runs)) if given < tasks else []

    def submit(self, runs: Sequence[int]) -> Future[Answer]:
        """See `Executor.submit`."""
        task: Future[Answer] = self._executor.submit(_task_function(), tuple(self._job), runs)
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
        """See `Executor.rows`.

        Raises:
            InputError: the connection to the scheduler was lost.
        """
        try:
            yield from super().rows(runs)
        except InputError:
            raise
        except Exception as error:  # its type depends on the request during which the scheduler was lost
            if self._client.status == "running" and not isinstance(error, OSError | CancelledError):
                raise
            raise InputError.one(f"the connection to the scheduler {self._address} was lost") from error


def _task_function() -> Callable[[Sequence[Any], Sequence[int]], Answer]:
    """Return the function of a task, nested so that Dask sends it as code.

    A function sent by name would end workers without this module before they could report it.
    """

    def compute(job: Sequence[Any], runs: Sequence[int]) -> Answer:
        from vsacli.studies.sweeps.rows import Job, answer

        found = answer(Job(*job), runs)
        host = f"on the worker {platform.node()}: "
        named = (problem._replace(message=host + problem.message) for problem in found.problems)
        return found._replace(problems=tuple(named))

    return compute
