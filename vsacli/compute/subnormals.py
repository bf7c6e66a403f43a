"""Subnormal numbers, below 2.2e-308, treated as zero while rows of samples are computed.

On some processors, such as Intel's, an operation on them takes a hundred times longer, and decaying motions
are full of them. Without this, link torques of a 7R with derivatives of 1e-160 take 7.4 times as long.
Compiled code does the same (engine/lanes.c).
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache

import numpy as np

_FloatEnvironment = ctypes.c_uint32 * 8
"""The floating-point environment of glibc on x86-64, fenv_t; its last word is the register MXCSR."""

RESULTS_ARE_ZERO, OPERANDS_ARE_ZERO = 0x8000, 0x0040
"""Bits of MXCSR: Intel's manual, volume 1, 10.2.3."""


@contextmanager
def subnormals_as_zero() -> Iterator[None]:
    """Treat subnormal operands and results as zero in this thread; Linux on x86-64 only."""
    library = _math_library()
    if library is None:
        yield
        return
    saved = _FloatEnvironment()
    library.fegetenv(saved)
    changed = _FloatEnvironment(*saved)
    changed[-1] |= RESULTS_ARE_ZERO | OPERANDS_ARE_ZERO
    library.fesetenv(changed)
    try:
        yield
    finally:
        library.fesetenv(saved)


@cache
def _math_library() -> ctypes.CDLL | None:
    """Return the library with the functions of fenv.h if its data are as above, else None."""
    # NumPy computes the limits of each type at first use: here, before subnormals are zero.
    for dtype in (np.float16, np.float32, np.float64):
        np.finfo(dtype)
    if sys.platform == "linux" and os.uname().machine == "x86_64" and sys.maxsize > 2**32:
        with suppress(OSError):  # another C library
            return ctypes.CDLL("libm.so.6")
    return None
