"""The workers of a Dask cluster, which read the same files and compute several runs a task."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from vsacli.base.errors import InputError, Problem
from vsacli.base.version import __version__
from vsacli.studies.sweeps.executors.job import Job
from vsacli.studies.sweeps.rows import Row, lost
from vsacli.studies.sweeps.study import Study

if TYPE_CHECKING:
    from distributed import Client, Future

    from vsacli.studies.sweeps.executors.task import Answer

LOCAL = "local"
"""In place of an address: a cluster of processes of this machine."""

TASK_SECONDS = 0.5
"""What a task shall take: about a hundred times what Dask takes for it, and what a killed worker costs."""

TASKS_A_THREAD = 2
"""Given to the cluster at a time: one is computed, the next one waits at the worker."""

CONNECT_SECONDS = 10.0
"""After which a scheduler that does not answer is none."""

CRITICAL = 50
"""The level of messages of Python's `logging` from which on Dask prints its own."""


class Cluster:
    """Context manager around a connection to a Dask cluster; one that is local lasts as long.

    Args:
        study: whose runs.
        address: of the scheduler, or `LOCAL`.
        processes: workers of a local cluster.
        tell: learns what is waited for.
    """

    def __init__(self, study: Study, address: str, processes: int, tell: Callable[[str], object]) -> None:
        self._study, self._job = study, Job.of(study)
        self._address, self._processes, self._tell = address, processes, tell
        self._open = ExitStack()
        self._seconds_a_run = TASK_SECONDS

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
            self._open = opened.pop_all()
        if not self._client.nthreads():
            self._tell(f"{self._address} has no worker yet; waiting for one")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._open.close()

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

    def rows(self, runs: Sequence[int]) -> Iterator[Row]:
        """As of `Rows`."""
        try:
            yield from self._rows(runs)
        except InputError:
            raise
        except Exception as error:  # which one it is depends on what was asked when the scheduler went
            if self._client.status == "running" and not isinstance(error, OSError):
                raise
            raise InputError.one(f"the connection to the scheduler {self._address} was lost") from error

    def _rows(self, runs: Sequence[int]) -> Iterator[Row]:
        from distributed import as_completed

        waiting, given = deque(runs), dict[str, list[int]]()
        done = as_completed()
        while waiting or given:
            threads = max(1, sum(self._client.nthreads().values()))
            while waiting and len(given) < TASKS_A_THREAD * threads:
                task = self._task(waiting, threads)
                future = self._client.submit(_compute(), tuple(self._job), task, pure=False)
                given[future.key] = task
                done.add(future)
            future = next(done)
            yield from self._rows_of(future, given.pop(future.key))

    def _task(self, waiting: deque[int], threads: int) -> list[int]:
        """The next runs that go together: of some time, but so few that the last tasks end together."""
        most = 1 + len(waiting) // (TASKS_A_THREAD * threads)
        count = min(most, max(1, int(TASK_SECONDS / self._seconds_a_run)))
        return [waiting.popleft() for _ in range(count)]

    def _rows_of(self, future: Future, runs: Sequence[int]) -> Sequence[Row]:
        """The rows of a task that has ended.

        Raises:
            InputError: no worker can compute.
            FutureCancelledError: the connection was lost.
        """
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        try:
            found: Answer = future.result()
        except KilledWorker:
            return [lost(self._study, run, "was killed") for run in runs]
        except FutureCancelledError:
            raise
        except Exception as error:
            raise InputError.one(_unable(error)) from error
        if found.problems:
            raise InputError(_named(found.host, problem) for problem in found.problems)
        self._seconds_a_run = found.seconds / len(found.rows)
        return found.rows


def _compute() -> Callable[[Sequence[Any], Sequence[int]], Answer]:
    """What a task does: a function within a function, since Dask sends such a one as code.

    One that is sent by its name ends workers that do not have the module, before they could say so.
    """

    def compute(job: Sequence[Any], runs: Sequence[int]) -> Answer:
        from vsacli.studies.sweeps.executors.job import Job
        from vsacli.studies.sweeps.executors.task import answer

        return answer(Job(*job), runs)

    return compute


def _unable(error: Any) -> str:
    """Why the cluster could not do a task at all."""
    cause = error.__cause__ or error
    return (
        "the Dask cluster cannot compute studies: all its workers need "
        f"vsacli {__version__}, as here ({type(cause).__name__}: {cause})"
    )


def _named(host: str, problem: Problem) -> Problem:
    return problem._replace(message=f"on the worker {host}: {problem.message}")
