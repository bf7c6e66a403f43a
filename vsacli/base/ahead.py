"""What comes next is computed in a thread, while the caller is busy with what came before."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def ahead(function: Callable[[_Item], _Result], items: Iterable[_Item]) -> Iterator[_Result]:
    """What a function makes of items, of each in a thread while the caller has that of the one before.

    The items themselves are taken in the caller's thread: two that are both busy in the interpreter would
    wait for one another. What the function raises comes here, in its place. Signals never reach the thread:
    whoever is ended while it computes waits for what it is at.
    """
    coming: deque[Future[_Result]] = deque()
    with ThreadPoolExecutor(1, "vsacli-ahead") as thread:
        for item in items:
            coming.append(thread.submit(function, item))
            if len(coming) > 1:
                yield coming.popleft().result()
        while coming:
            yield coming.popleft().result()
