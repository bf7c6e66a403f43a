"""The parts of CuPy that generated projects use, on the host: arrays of NumPy, kernels compiled as C++."""

from __future__ import annotations

import ctypes
import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samples.generated_code import Compiled, write_files
from samples.shipped import shipped_robot
from vsacli.base.wrench import WrenchFrame
from vsacli.control.codegen.project import Project, generate, prefix_of
from vsacli.control.codegen.self_test import Arrays

PRELUDE = """
#include <math.h>
#undef NAN
#undef INFINITY
#undef HUGE_VAL
#define __global__
#define __launch_bounds__(...)
#define __constant__ static
#define __noinline__
#define __shared__ static
static struct { unsigned x; } blockIdx, threadIdx, blockDim;
static unsigned long long stored_results;
#define RESULTS stored_results
extern "C" void choose_thread(unsigned block, unsigned thread, unsigned threads, unsigned long long results)
{ blockIdx.x = block; threadIdx.x = thread; blockDim.x = threads; stored_results = results; }
"""

CPP = (
    *("g++", "-std=c++20", "-O0", "-ffp-contract=off", "-shared", "-fPIC"),
    *("-Wall", "-Werror", "-Wno-unused", "-Wno-narrowing", "-Wno-unknown-pragmas"),
)
"""A compiler that neither reorders nor contracts operations, as for C99 of the projects on this processor.
Tables of single precision contain NaN of double precision, which is an error to g++, not to NVRTC."""


class HostArray(np.ndarray):
    """An array "on the device"."""

    @property
    def data(self) -> Any:
        """Its address, as CuPy has it."""
        return SimpleNamespace(ptr=self.ctypes.data)


class Foreign:
    """An array on the device that belongs to another library."""

    def __init__(self, values: Any) -> None:
        self.values = np.asarray(values)

    def __dlpack_device__(self) -> tuple[int, int]:
        return 2, 0


class HostEvent:
    """An event that has always happened."""

    done = True

    def __init__(self, disable_timing: bool) -> None:
        assert disable_timing

    def record(self) -> None:
        pass


class CUDARuntimeError(RuntimeError):
    """The error of CuPy without a device."""


class _PlaceStructure(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int64) for name in ("first", "sample", "row", "column", "step")]


@cache
def library(code: str) -> ctypes.CDLL:
    """All kernels of a text, compiled once for all results that they may store."""
    folder = Path(tempfile.mkdtemp(prefix="vsacli-kernels-"))
    (folder / "kernels.cpp").write_text(PRELUDE + code, encoding="utf-8")
    command = [*CPP, "kernels.cpp", "-o", "kernels.so"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr[:3000]
    return ctypes.CDLL(str(folder / "kernels.so"))


class HostModule:
    """A module of kernels."""

    def __init__(self, code: str, options: tuple[str, ...]) -> None:
        (stored,) = (option for option in options if option.startswith("-DRESULTS="))
        self._stored = int(stored.removeprefix("-DRESULTS=").removesuffix("ull"))
        self._library = library(code)

    def get_function(self, name: str) -> Any:
        """Return a function that runs the threads of a kernel one after the other."""
        function, choose = getattr(self._library, name), self._library.choose_thread
        function.restype = None

        def launch(grid: tuple[int], block: tuple[int], arguments: tuple[Any, ...]) -> None:
            passed = [_as_ctypes(argument) for argument in arguments]
            for number in range(grid[0]):
                for thread in range(block[0]):
                    choose(number, thread, block[0], ctypes.c_ulonglong(self._stored))
                    function(*passed)

        return launch


def _as_ctypes(argument: Any) -> Any:
    """A kernel's argument: a scalar, or a record by value."""
    if isinstance(argument, np.ndarray):
        assert argument.size == 1
        return _PlaceStructure.from_buffer_copy(argument.tobytes())
    return np.ctypeslib.as_ctypes_type(argument.dtype)(argument.item())


def host_cupy() -> ModuleType:
    """A module in place of CuPy."""
    module: Any = ModuleType("cupy")
    module.ndarray = HostArray
    module.asarray = lambda values, dtype=None: np.array(values, dtype, subok=False).view(HostArray)
    module.asnumpy = lambda values: np.array(values, subok=False)
    module.from_dlpack = lambda foreign: foreign.values.view(HostArray)
    module.empty = lambda shape, dtype: np.full(shape, 77, dtype).view(HostArray)
    module.zeros = lambda shape, dtype: np.zeros(shape, dtype).view(HostArray)
    module.stack = lambda arrays: np.stack(arrays).view(HostArray)
    module.broadcast_arrays = np.broadcast_arrays
    module.moveaxis = np.moveaxis
    module.RawModule = HostModule
    runtime = SimpleNamespace(getDeviceCount=lambda: 1, CUDARuntimeError=CUDARuntimeError)
    module.cuda = SimpleNamespace(Event=HostEvent, runtime=runtime)
    return module


class HostProject:
    """A generated project with its functions in C, `cpu`, and for a GPU, `gpu`, computed on the host.

    Args:
        folder: where the files are written.
        project: the project.
        prefix: of its names.
    """

    def __init__(self, folder: Path, project: Project, prefix: str) -> None:
        folder.mkdir(exist_ok=True)
        write_files(project, folder)
        self.cpu: Any = Compiled(folder, prefix).module
        self.gpu: Any = load_gpu_module(folder, prefix, host_cupy())


def load_gpu_module(folder: Path, prefix: str, cupy: ModuleType | None) -> Any:
    """Import the module for a GPU, with a module in place of CuPy, or without one."""
    before = sys.modules.get("cupy")
    sys.modules["cupy"] = cupy  # type: ignore[assignment]
    try:
        spec = importlib.util.spec_from_file_location(f"{prefix}_gpu", folder / f"{prefix}_gpu.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        if before is None:
            del sys.modules["cupy"]
        else:
            sys.modules["cupy"] = before
    return module


@cache
def host_project(
    name: str, precision: str = "double", patterns: tuple[str, ...] = (), wrench: WrenchFrame | None = None
) -> HostProject:
    """A bundled robot's project, compiled once for all tests."""
    robot = shipped_robot(name)
    folder = Path(tempfile.mkdtemp(prefix="vsacli-gpu-"))
    return HostProject(folder, generate(robot, precision, wrench, patterns), prefix_of(robot))


def by_c(
    project: HostProject, name: str, arguments: Sequence[tuple[str, Arrays]]
) -> tuple[Arrays, np.ndarray]:
    """Results of a function in C for each sample, (samples, ...), and the flags."""
    records = [record_of(project, structure, arrays) for structure, arrays in arguments]
    results, flags = getattr(project.cpu, name)(*records)
    return {member: results[member] for member in results.dtype.names}, flags


def record_of(project: HostProject, structure: str, arrays: Arrays) -> Any:
    """Records of a structure from its arrays, (samples, ...)."""
    records = np.zeros(len(next(iter(arrays.values()))), getattr(project.cpu, structure.capitalize()))
    for name, values in arrays.items():
        records[name] = values
    return records


def assert_equal(found: Arrays, expected: Arrays) -> None:
    """Arrays (..., samples) are those (samples, ...), NaN at the same places."""
    for name, values in found.items():
        samples_first = np.moveaxis(np.asarray(values), -1, 0)
        assert samples_first.dtype == expected[name].dtype
        np.testing.assert_array_equal(samples_first, expected[name], err_msg=name)


def contiguous(arrays: Arrays) -> Arrays:
    """The fast layout, (..., samples), from (samples, ...)."""
    return {name: np.ascontiguousarray(np.moveaxis(array, 0, -1)) for name, array in arrays.items()}


@contextmanager
def double_precision(jax: Any) -> Iterator[None]:
    """Arrays of JAX in double precision."""
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", before)


def exported(library: str, array: Any) -> Any:
    """An array as one of another library, by DLPack."""
    if library == "jax":
        jax = pytest.importorskip("jax")
        with double_precision(jax):
            return jax.numpy.from_dlpack(array)
    return pytest.importorskip(library).from_dlpack(array)
