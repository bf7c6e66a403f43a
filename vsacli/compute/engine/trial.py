"""The trial of a compiled library: a process of its own calls it once, before this one loads it.

The code of a faulty compiler may crash, or compute something else. A trial takes about 0.04 s, a tenth of the
shortest compilation; without it, such code would end this process, and later ones that find it in the cache.
"""

from __future__ import annotations

import marshal
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.compiler import TIMEOUT, CompilerError

AGREEMENT = 1e-6
"""Largest difference of results, relative to the peak of a row or to 1. Sound code differs by 1e-12 of the
peak, near a singularity by more; rows of residuals, which are rounding, are far below 1."""

MAX_DIFFERING_SHARE = 0.25
"""Share of the samples that may differ: at a threshold, rounding decides on which side a sample lies."""


class Trial(NamedTuple):
    """A call of a function in a library, with its results by NumPy.

    Attributes:
        function: Name of the function.
        arguments: Arguments in words of 8 bytes: integers and floats; `bytes` for the address of an array, a
            list for that of a row of words, `(size,)` for that of an array of results with so many bytes.
        expected: All results, (rows, samples); not compared where not finite. The function writes one row
            after the other, or one sample after the other if this array is in Fortran's order.
    """

    function: str
    arguments: list[Any]
    expected: FloatArray


TrialFactory: TypeAlias = Callable[[], Trial]
"""Function that returns a trial; called only if code is compiled."""


def check_library(path: Path, trial: Trial) -> None:
    """Call a library in a process of its own, and compare its results.

    Raises:
        CompilerError: The library cannot be loaded, crashes, or computes something else.
    """
    results = np.frombuffer(_library_results(path, trial)).reshape(
        trial.expected.shape, order="C" if trial.expected.flags.c_contiguous else "F"
    )
    finite = np.isfinite(trial.expected)
    peak = np.max(np.abs(trial.expected), axis=1, where=finite, initial=1.0, keepdims=True)
    with np.errstate(invalid="ignore"):
        agrees = ~finite | (np.abs(results - trial.expected) <= AGREEMENT * peak)
    if np.mean(~agrees.all(axis=0)) > MAX_DIFFERING_SHARE:
        raise CompilerError("what the C compiler made computes something else than NumPy does")


def _library_results(path: Path, trial: Trial) -> bytes:
    script = files("vsacli.compute.engine").joinpath("library_call.py").read_text(encoding="utf-8")
    message = marshal.dumps((str(path), trial.function, trial.arguments))
    try:
        process = subprocess.run(
            [sys.executable, "-I", "-S", "-c", script],
            input=message,
            capture_output=True,
            timeout=TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise CompilerError(f"what the C compiler made does not end within {TIMEOUT:g} s") from None
    except OSError as error:
        raise CompilerError(f"what the C compiler made cannot be tried: {error}") from None
    if process.returncode < 0:
        raise CompilerError(f"what the C compiler made crashes ({signal.Signals(-process.returncode).name})")
    if process.returncode or len(process.stdout) != trial.expected.nbytes:
        *_, last = process.stderr.decode(errors="replace").splitlines() or ["it returns nothing"]
        raise CompilerError(f"what the C compiler made cannot be loaded: {last.partition(': ')[2] or last}")
    return process.stdout
