"""Writing in a thread of its own, while the caller computes what comes next."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class WriteBehind:
    """Carries out tasks in a thread, in their order.

    Signals never reach that thread, and what it raises comes from the next call here.

    Args:
        most: bytes that may wait to be written; who hands over more waits instead.
    """

    def __init__(self, most: int) -> None:
        self._most, self._bytes = most, 0
        self._thread = ThreadPoolExecutor(1, "vsacli-writing")
        self._waiting: deque[tuple[Future[None], int]] = deque()

    def put(self, task: Callable[[], None], size: int) -> None:
        """Have a task carried out that keeps so many bytes till then."""
        self._waiting.append((self._thread.submit(task), size))
        self._bytes += size
        while self._bytes > self._most:
            self._await_oldest()

    def wait(self) -> None:
        """Wait until all is done."""
        while self._waiting:
            self._await_oldest()

    def discard(self) -> None:
        """End the thread; what waits is dropped."""
        self._thread.shutdown(cancel_futures=True)

    def _await_oldest(self) -> None:
        done, size = self._waiting.popleft()
        self._bytes -= size
        done.result()
