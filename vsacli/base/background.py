"""Background computation in a single thread, one result ahead of the caller.

Signals never reach that thread: an interrupted run waits for the computation in progress.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def ahead(function: Callable[[_Item], _Result], items: Iterable[_Item]) -> Iterator[_Result]:
    """Yield results of a function, each computed in a thread while the caller uses the previous one.

    The items are produced in the caller's thread: two threads that both execute Python code would wait for
    one another. An exception of the function is raised here, in place of its result. Without this, 10^6
    samples of a 3R in two threads take 1.2 times as long.
    """
    coming: deque[Future[_Result]] = deque()
    with ThreadPoolExecutor(1, "vsacli-ahead") as thread:
        for item in items:
            coming.append(thread.submit(function, item))
            if len(coming) > 1:
                yield coming.popleft().result()
        while coming:
            yield coming.popleft().result()
