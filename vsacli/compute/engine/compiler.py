"""The C compiler of the system."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from vsacli.base.errors import VsacliError

NATIVE = "-march=native"

FLAGS = ("-std=gnu11", "-O2", NATIVE, "-fno-math-errno", "-ffp-contract=fast", "-fPIC", "-shared")
"""None of those that let the compiler assume away NaN, or that change the arithmetic of the whole process."""

TIMEOUT = 300.0
"""Seconds after which a compiler counts as hanging."""


class CompilerError(VsacliError):
    """There is no C compiler, or it does not do its work; the message says which."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler.

    Attributes:
        command: how it is called.
        identity: what decides on the code that it makes: version, processor, C library, flags.
    """

    command: tuple[str, ...]
    identity: str

    def build(self, source: Path, library: Path) -> None:
        """Compile a source file to a shared library.

        Raises:
            CompilerError: it could not be done.
        """
        _output([*self.command, *FLAGS, "-o", str(library), str(source), "-lm"])
        if not library.exists():
            raise CompilerError(f"the C compiler {self.command[0]!r} made no library")


def system_compiler() -> Compiler:
    """The compiler that the environment variable CC names, else `cc`.

    Raises:
        CompilerError: there is none, or it does not work.
    """
    return _examined(tuple(shlex.split(os.environ.get("CC") or "cc")), os.environ.get("PATH", ""))


@lru_cache(maxsize=4)
def _examined(command: tuple[str, ...], _path: str) -> Compiler:
    macros = _output([*command, NATIVE, "-dM", "-E", "-x", "c", os.devnull])
    return Compiler(command, "\n".join((macros, *platform.libc_ver(), *FLAGS)))


def _output(command: list[str]) -> str:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=TIMEOUT, check=False
        )
    except FileNotFoundError:
        raise CompilerError(f"there is no C compiler {command[0]!r}") from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CompilerError(f"the C compiler {command[0]!r} cannot be run: {error}") from None
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"it ended with {done.returncode} and no message"]
        raise CompilerError(f"the C compiler {command[0]!r} fails: {lines[0]}")
    return done.stdout
