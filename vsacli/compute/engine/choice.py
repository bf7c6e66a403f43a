"""The choice of the backend: `choose_engine` for a run, `settle_engine` for many runs that must agree.

"auto" compares the time that compiled code saves with that of compiling, by the estimates in `costs`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.progress import Tell, unheard
from vsacli.compute.engine.costs import LOOK_FROM, NUMPY_CALL_SAMPLES, TRACE_FROM
from vsacli.compute.engine.engines import (
    SAMPLES_PER_PASS,
    Engine,
    Kernel,
    NumPyEngine,
    TracedEngine,
    samples_per_pass,
)

if TYPE_CHECKING:
    from vsacli.compute.engine.libraries import Code

NAMES = ("numpy", "c", "auto")
"""Names of engines."""

NUMPY: Engine = NumPyEngine()


class ChosenEngine(NamedTuple):
    """The chosen engine and the reason.

    Attributes:
        engine: Engine.
        reason: Backend and reason, a clause.
        compiler: Compiler of the code; empty without one.
        threads: Number of threads of compiled code.
    """

    engine: Engine
    reason: str
    compiler: str = ""
    threads: int = 1

    @property
    def provenance(self) -> dict[str, str]:
        """Attributes of a result: `engine`, `compiler`, `threads`."""
        name = "c" if self.compiler else "numpy"
        return {"engine": name, "compiler": self.compiler, "threads": str(self.threads)}


def choose_engine(
    name: str,
    kernel: Kernel,
    samples: int,
    threads: int | None = None,
    tell: Tell = unheard,
    *,
    busy: int = 0,
) -> ChosenEngine:
    """Return the engine for a computation.

    Args:
        name: One of `NAMES`; "auto" chooses compiled code where that saves time.
        kernel: Kernel to compute.
        samples: Number of samples.
        threads: Number of threads of compiled code; by default the number of CPU cores.
        tell: Receives problems on the way, and announcements of long work.
        busy: Number of threads that are occupied otherwise; at least one is left.

    Raises:
        InputError: The engine is unknown; or it is "c", and there is no working C compiler, or the kernel
            cannot be compiled.
    """
    check_engine(name)
    usual_samples = usual_block_samples(samples, kernel.inputs)
    if name == "numpy":
        return ChosenEngine(_numpy_engine(usual_samples), "NumPy computes, as requested")
    if name == "auto" and usual_samples < LOOK_FROM:
        return ChosenEngine(NUMPY, f"NumPy computes: {samples} samples are few")
    from vsacli.compute.engine.compiled_engine import CompiledEngine
    from vsacli.compute.engine.compiler import CompilerError, system_compiler

    threads = threads or processor_count()
    required = name == "c"
    try:
        with compiled_as_asked() if required else nullcontext():
            compiler = system_compiler()
            engine = CompiledEngine(compiler, max(1, threads - busy), tell)
            loaded = engine.prepare(kernel, lambda code: required or _repays_compiling(code, usual_samples))
    except (CompilerError, NotImplementedError) as error:
        return ChosenEngine(_numpy_engine(usual_samples), f"NumPy computes: {error}")
    if loaded is None:
        return ChosenEngine(
            _numpy_engine(usual_samples), f"NumPy computes: {samples} samples would not repay compiling"
        )
    compile_time = "now" if loaded.compiled else "before"
    reason = f"C code computes, compiled {compile_time}, in {_threads_text(threads)}"
    return ChosenEngine(engine, reason, compiler.name, threads)


class Settled(NamedTuple):
    """An engine by its name, "numpy" or "c", and its compiler, empty for NumPy."""

    name: str
    compiler: str = ""


def settle_engine(name: str, kernel: Kernel, samples: int) -> Settled:
    """Return the engine for many computations that must agree, whichever process runs them, and when.

    So the choice does not depend on the cache of compiled code.

    Args:
        name: One of `NAMES`; "auto" chooses compiled code where that saves time.
        kernel: Kernel of most runs.
        samples: Number of samples of all runs together.

    Raises:
        InputError: The engine is unknown; or it is "c", and there is no working C compiler.
    """
    check_engine(name)
    usual_samples = usual_block_samples(samples, kernel.inputs)
    if name == "numpy" or (name == "auto" and usual_samples < LOOK_FROM):
        return Settled("numpy")
    from vsacli.compute.engine.compiled_engine import kernel_code
    from vsacli.compute.engine.compiler import CompilerError, system_compiler

    required = name == "c"
    try:
        with compiled_as_asked() if required else nullcontext():
            compiler = system_compiler()
            repays = required or _repays_compiling(kernel_code(kernel), usual_samples)
    except (CompilerError, NotImplementedError):
        return Settled("numpy")
    return Settled("c", compiler.name) if repays else Settled("numpy")


def check_engine(name: str) -> None:
    """Raise an error for the name of an unknown engine.

    Raises:
        InputError: The engine is unknown; the message suggests the nearest name.
    """
    if name not in NAMES:
        raise InputError.one(f"unknown engine {name!r}{did_you_mean(name, NAMES)}")


@contextmanager
def compiled_as_asked() -> Iterator[None]:
    """Convert errors of the compiler into input errors, for code that requires the engine "c".

    Raises:
        InputError: There is no working C compiler, or the code cannot be compiled.
    """
    from vsacli.compute.engine.compiler import CompilerError

    try:
        yield
    except CompilerError as error:
        raise InputError.one(f"{error}; the engine numpy needs none") from error
    except NotImplementedError as error:
        raise InputError.one(f"this cannot be compiled: {error}; take the engine numpy") from error


def usual_block_samples(samples: int, inputs: int) -> float:
    """Return the number of samples in blocks of the usual size that would take NumPy the same time."""
    call_share, usual_call_share = (
        NUMPY_CALL_SAMPLES / size for size in (samples_per_pass(inputs), SAMPLES_PER_PASS)
    )
    return samples * (1 + call_share) / (1 + usual_call_share)


def _repays_compiling(code: Code, samples: float) -> bool:
    """Return whether NumPy would take longer than the compiler, and the compiler not too long."""
    return samples * code.seconds_saved > code.compiling_seconds and not code.takes_too_long


def _numpy_engine(samples: float) -> Engine:
    return NUMPY if samples < TRACE_FROM else TracedEngine()


def _threads_text(threads: int) -> str:
    return f"{threads} threads" if threads > 1 else "1 thread"


def processor_count() -> int:
    """Return the number of CPU cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
