"""Numbers of less than full precision, below 2.2e-308: taken for zero while rows of samples are computed.

Some processors, those of Intel among them, take a hundred times longer for an operation on them, and motions
that decay are full of them. Compiled code does the same (engine/lanes.c).
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache

import numpy as np

_Environment = ctypes.c_uint32 * 8
"""The floating-point environment of glibc on x86-64, fenv_t; its last word is the register MXCSR."""

RESULTS_ARE_ZERO, OPERANDS_ARE_ZERO = 0x8000, 0x0040
"""Bits of that register: Intel's manual, volume 1, 10.2.3."""


@contextmanager
def subnormals_as_zero() -> Iterator[None]:
    """Treat subnormal operands and results as zero in this thread; Linux on x86-64 only."""
    library = _mathematics()
    if library is None:
        yield
        return
    before = _Environment()
    library.fegetenv(before)
    within = _Environment(*before)
    within[-1] |= RESULTS_ARE_ZERO | OPERANDS_ARE_ZERO
    library.fesetenv(within)
    try:
        yield
    finally:
        library.fesetenv(before)


@cache
def _mathematics() -> ctypes.CDLL | None:
    """Return the library with the functions of fenv.h, where their data are as above.

    NumPy finds the limits of numbers when it is first asked for them: here, before the smallest are zero.
    """
    for kind in (np.float16, np.float32, np.float64):
        np.finfo(kind)
    if sys.platform == "linux" and os.uname().machine == "x86_64" and sys.maxsize > 2**32:
        with suppress(OSError):  # another C library
            return ctypes.CDLL("libm.so.6")
    return None
