"""The C compiler of the system or of a package, and the shared libraries that it builds."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import VsacliError

NATIVE = "-march=native"

FLAGS = ("-std=gnu11", "-O2", NATIVE, "-fno-math-errno", "-ffp-contract=fast", "-fPIC", "-shared")
"""Options, without those that ignore NaN (-ffast-math) or change the arithmetic of the whole process."""

ZIG_COMPILER = (sys.executable, "-m", "ziglang", "cc")
"""Clang with headers and linker, from the package ziglang."""

TIMEOUT = 120.0
"""Largest time of the compiler, s."""

FORBIDDEN_MACROS = (
    "__FINITE_MATH_ONLY__ 1",
    "__FAST_MATH__ 1",
    "__ASSOCIATIVE_MATH__ 1",
    "__RECIPROCAL_MATH__ 1",
)
"""Macros set by options that ignore NaN or reorder arithmetic; a compiler with one of them is refused."""

SAMPLES_PER_THREAD = 2048
"""Smallest number of samples per thread; fewer are not worth a thread."""

LINE = 64
"""Bytes of the longest vector register, and of a cache line."""

DOUBLES_PER_VECTOR = LINE // np.dtype(np.float64).itemsize
"""Samples in the longest vector."""


class CompilerError(VsacliError):
    """There is no C compiler, or it fails; the message says which."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler.

    Attributes:
        command: Command that calls it.
        identity: Everything that its code depends on: command, version, processor, C library, flags.
    """

    command: tuple[str, ...]
    identity: str

    @property
    def name(self) -> str:
        """Command and version, for the provenance of results."""
        version = re.search(r'^#define __VERSION__ "(.*)"$', self.identity, re.MULTILINE)
        return " ".join([_command_text(self.command), *([version[1]] if version else [])])

    def build(self, source: Path, library: Path) -> None:
        """Compile a source file to a shared library.

        Raises:
            CompilerError: The compiler fails.
        """
        _compiler_output(
            self.command, *FLAGS, "-o", str(library), str(source), "-lm", cache_folder=library.parent
        )
        if not library.exists():
            raise CompilerError(f"the C compiler {_command_text(self.command)!r} made no library")


def system_compiler() -> Compiler:
    """Return the compiler that CC names; else `cc`, else that of the package ziglang.

    Raises:
        CompilerError: There is no compiler, or it does not work.
    """
    path = os.environ.get("PATH", "")
    if command_line := os.environ.get("CC"):
        return _checked_compiler(_split_command(command_line), path)
    try:
        return _checked_compiler(("cc",), path)
    except CompilerError as error:
        if find_spec("ziglang") is None:
            raise CompilerError(f"{error} (pip install 'vsacli[compiler]' gets one)") from None
    return _checked_compiler(ZIG_COMPILER, path)


def _split_command(command_line: str) -> tuple[str, ...]:
    try:
        return tuple(shlex.split(command_line)) or ("cc",)
    except ValueError as error:
        raise CompilerError(
            f"the environment variable CC is not a command: {command_line!r} ({error})"
        ) from None


@lru_cache(maxsize=4)
def _checked_compiler(command: tuple[str, ...], _path: str) -> Compiler:
    """Return a compiler; asked anew, five runs of a 3R with 20,000 samples take 1.6 times as long."""
    macros = _compiler_output(command, NATIVE, "-dM", "-E", "-x", "c", os.devnull)
    if any(f"#define {macro}\n" in f"{macros}\n" for macro in FORBIDDEN_MACROS):
        raise CompilerError(
            f"{_command_text(command)!r} enables -ffast-math or a similar option, under which NaN goes "
            "unnoticed"
        )
    programs = map(_file_identity, filter(None, map(shutil.which, command)))
    return Compiler(command, "\n".join((macros, *platform.libc_ver(), *FLAGS, *command, *programs)))


def _file_identity(program: str) -> str:
    """Return place, size and time of a program: a script has the version of the compiler that it calls."""
    status = os.stat(program)
    return f"{os.path.realpath(program)} {status.st_size} {status.st_mtime_ns}"


def _command_text(command: tuple[str, ...]) -> str:
    """Return a command for messages and provenance, without the folder of Python."""
    return shlex.join("python" if part == sys.executable else part for part in command)


def _compiler_output(compiler: tuple[str, ...], *arguments: str, cache_folder: Path | None = None) -> str:
    """Return the output of a compiler; its own cache, such as zig's, is placed in `cache_folder`."""
    environment = None if cache_folder is None else {**os.environ, "ZIG_LOCAL_CACHE_DIR": str(cache_folder)}
    name = f"C compiler {_command_text(compiler)!r}"
    try:
        process = subprocess.run(
            [*compiler, *arguments],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIMEOUT,
            check=False,
            env=environment,
        )
    except FileNotFoundError:
        raise CompilerError(f"there is no {name}") from None
    except OSError as error:
        raise CompilerError(f"the {name} cannot be run: {error}") from None
    except subprocess.TimeoutExpired:
        raise CompilerError(f"the {name} took more than {TIMEOUT:g} s") from None
    if process.returncode:
        lines = process.stderr.strip().splitlines() or [f"it ended with {process.returncode} and no message"]
        raise CompilerError(f"the {name} fails: {lines[0]}")
    return process.stdout


class Library:
    """A compiled program.

    Args:
        path: Path of the shared library; it may be removed once loaded.
        outputs: Number of output rows.

    Raises:
        CompilerError: The library cannot be loaded.
    """

    def __init__(self, path: Path, outputs: int) -> None:
        self._outputs = outputs
        _load_vector_functions()
        try:
            self._run = ctypes.CDLL(str(path)).run
        except (OSError, AttributeError) as error:
            raise CompilerError(f"what the C compiler made cannot be loaded: {error}") from None
        self._run.argtypes = [ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p]
        self._run.restype = None

    def __call__(self, rows: Sequence[FloatArray], threads: int) -> FloatArray:
        """Run on contiguous rows (samples,) of doubles; return the outputs, (rows, samples)."""
        samples = len(rows[0])
        outputs = _aligned_rows(self._outputs, samples)
        sources = np.array([row.ctypes.data for row in rows], dtype=np.uintp)
        offsets = np.arange(self._outputs, dtype=np.uintp) * np.uintp(outputs.strides[0])
        targets = outputs.ctypes.data + offsets
        pointers = sources.ctypes.data, targets.ctypes.data
        thread_count = min(threads, max(1, samples // SAMPLES_PER_THREAD))
        own_part, *other_parts = _thread_slices(samples, thread_count)
        futures = [_thread_pool(thread_count - 1).submit(self._run, *part, *pointers) for part in other_parts]
        self._run(*own_part, *pointers)
        for future in futures:
            future.result()
        return outputs


def _aligned_rows(rows: int, samples: int) -> FloatArray:
    """Return uninitialized rows, (rows, samples), each of which begins at a multiple of `LINE` bytes.

    Rows are an odd number of lines apart: at a power of two, all would be in the same sets of a cache.
    """
    distance = DOUBLES_PER_VECTOR * (samples // DOUBLES_PER_VECTOR // 2 * 2 + 3)
    buffer = np.empty(rows * distance + DOUBLES_PER_VECTOR)
    first = -buffer.ctypes.data % LINE // buffer.itemsize
    return buffer[first : first + rows * distance].reshape(rows, distance)[:, :samples]


@cache
def _load_vector_functions() -> None:
    """Load the vector functions of glibc, to which compilers with their own C library do not link."""
    with suppress(OSError):
        ctypes.CDLL("libmvec.so.1", mode=ctypes.RTLD_GLOBAL)


@lru_cache(maxsize=1)
def _thread_pool(threads: int) -> ThreadPoolExecutor:
    """Return the threads in addition to the calling one; they last as long as the process."""
    return ThreadPoolExecutor(threads)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_thread_pool.cache_clear)  # a child process has none of the threads


def _thread_slices(samples: int, thread_count: int) -> list[tuple[int, int]]:
    """Return start and end of the samples of each thread; whole vectors, except for the last."""
    starts = [
        DOUBLES_PER_VECTOR * (samples * thread // thread_count // DOUBLES_PER_VECTOR)
        for thread in range(thread_count)
    ]
    return list(pairwise([*starts, samples]))
