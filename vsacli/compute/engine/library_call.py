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
    buffers: list[Any] = []
    results: list[tuple[int, int]] = []

    def word_of(content: Any) -> int:
        if isinstance(content, int):
            return content
        if isinstance(content, tuple):
            buffers.append(ctypes.create_string_buffer(content[0] + ALIGNMENT))
            first = ctypes.addressof(buffers[-1])
            results.append((first - first % -ALIGNMENT, *content))
            return results[-1][0]
        buffers.append(
            (ctypes.c_int64 * len(content))(*map(word_of, content))
            if isinstance(content, list)
            else ctypes.create_string_buffer(content)
        )
        return ctypes.addressof(buffers[-1])

    function(
        *(
            ctypes.c_double(argument) if isinstance(argument, float) else ctypes.c_int64(word_of(argument))
            for argument in arguments
        )
    )
    return b"".join(ctypes.string_at(*argument) for argument in results)


if __name__ == "__main__":
    with open(1, "wb") as output:
        output.write(call(*marshal.load(sys.stdin.buffer)))
