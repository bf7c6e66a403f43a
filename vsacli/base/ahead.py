"""What comes next is computed in a thread, while the caller is busy with what came before."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

_Item = TypeVar("_Item")


def ahead(items: Iterator[_Item]) -> Iterator[_Item]:
    """The items of an iterator, each of which a thread begins when the caller takes the one before.

    So there is one more of them at a time. What the iterator raises comes here, in its place. Signals never
    reach the thread: whoever is ended while it computes waits for the item that it is at.
    """

    def following() -> list[_Item]:
        return list(islice(items, 1))

    with ThreadPoolExecutor(1, "vsacli-ahead") as thread:
        coming = thread.submit(following)
        while found := coming.result():
            coming = thread.submit(following)
            yield found.pop()  # which is not kept here
