"""A cache for objects that compare equal although results of them differ.

Springs compare equal whatever their limits, so that joints share compiled code. Functions whose results
depend on everything in a robot must therefore not be cached by equality.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from typing import TypeVar

_Result = TypeVar("_Result")


def cached_by_identity(
    most: int,
) -> Callable[[Callable[..., _Result]], Callable[..., _Result]]:
    """Return a decorator that keeps the latest results of a function by the identity of its first argument.

    Args:
        most: Number of results that are kept. Each keeps its first argument alive, so that no other object
            gets its identity.
    """

    def cached(function: Callable[..., _Result]) -> Callable[..., _Result]:
        kept: OrderedDict[Hashable, tuple[object, _Result]] = OrderedDict()

        @wraps(function)
        def calling(first: object, *others: Hashable) -> _Result:
            key = (id(first), *others)
            if key in kept:
                kept.move_to_end(key)
            else:
                kept[key] = first, function(first, *others)
                if len(kept) > most:
                    kept.popitem(last=False)
            return kept[key][1]

        return calling

    return cached
