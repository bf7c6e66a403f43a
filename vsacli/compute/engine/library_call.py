"""A call of a function in a shared library, in a process of its own: `trial` executes this file alone.

It needs only Python's own modules, so that the process starts in a few hundredths of a second.
"""

from __future__ import annotations

import ctypes
import marshal
import sys
from contextlib import suppress
from typing import Any

ALIGNMENT = 64
"""Bytes of the longest vector register: results begin at multiples, as those of a `Library`."""


def call(path: str, name: str, arguments: list[Any]) -> bytes:
    """Call a function and return its results, one array after the other; see `Trial` for the arguments.

    Raises:
        OSError, AttributeError: The library or the function cannot be loaded.
    """
    with suppress(OSError):
        ctypes.CDLL("libmvec.so.1", mode=ctypes.RTLD_GLOBAL)
    function = getattr(ctypes.CDLL(path), name)
    kept: list[Any] = []
    results: list[tuple[int, int]] = []

    def word(part: Any) -> int:
        if isinstance(part, int):
            return part
        if isinstance(part, tuple):
            kept.append(ctypes.create_string_buffer(part[0] + ALIGNMENT))
            first = ctypes.addressof(kept[-1])
            results.append((first - first % -ALIGNMENT, *part))
            return results[-1][0]
        kept.append(
            (ctypes.c_int64 * len(part))(*map(word, part))
            if isinstance(part, list)
            else ctypes.create_string_buffer(part)
        )
        return ctypes.addressof(kept[-1])

    function(
        *(
            ctypes.c_double(each) if isinstance(each, float) else ctypes.c_int64(word(each))
            for each in arguments
        )
    )
    return b"".join(ctypes.string_at(*each) for each in results)


if __name__ == "__main__":
    with open(1, "wb") as output:
        output.write(call(*marshal.load(sys.stdin.buffer)))
