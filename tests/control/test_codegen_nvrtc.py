"""Generated kernels compiled by NVRTC, the compiler that CuPy calls; this needs no GPU."""

from __future__ import annotations

import ctypes
import importlib.metadata
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from samples.generated_code import write_files
from samples.host_gpu import host_cupy, load_gpu_module
from samples.marks import exhaustive
from samples.shipped import shipped_robot

from vsacli.control.codegen.project import generate, prefix_of

PACKAGES = ("nvidia-cuda-nvrtc-cu12", "nvidia-cuda-nvrtc")
"""Packages of CUDA 12 and 13."""

ARCHITECTURES = ("sm_80", "sm_90")


@cache
def nvrtc() -> Any:
    """The library of an installed package; without one the test is skipped."""
    for name in PACKAGES:
        try:
            files = importlib.metadata.files(name) or []
        except importlib.metadata.PackageNotFoundError:
            continue
        libraries = [Path(str(file.locate())) for file in files if file.name.startswith("libnvrtc.so")]
        return ctypes.CDLL(str(libraries[0]))
    pytest.skip(f"could not import '{PACKAGES[0]}'")


def compiled(code: str, options: tuple[str, ...], architecture: str) -> bytes:
    """The machine code of a text."""
    program, size = ctypes.c_void_p(), ctypes.c_size_t()
    assert nvrtc().nvrtcCreateProgram(ctypes.byref(program), code.encode(), b"kernels.cu", 0, None, None) == 0
    whole = [option.encode() for option in (*options, f"--gpu-architecture={architecture}")]
    failed = nvrtc().nvrtcCompileProgram(program, len(whole), (ctypes.c_char_p * len(whole))(*whole))
    part = "ProgramLog" if failed else "CUBIN"
    assert getattr(nvrtc(), f"nvrtcGet{part}Size")(program, ctypes.byref(size)) == 0
    text = ctypes.create_string_buffer(size.value)
    assert getattr(nvrtc(), f"nvrtcGet{part}")(program, text) == 0
    nvrtc().nvrtcDestroyProgram(ctypes.byref(program))
    assert not failed, text.value.decode()[:3000]
    return text.raw


class NvrtcModule:
    """A module whose kernels are compiled, and then do nothing."""

    names: list[str] = []  # noqa: RUF012

    def __init__(self, code: str, options: tuple[str, ...]) -> None:
        self._code = [compiled(code, options, architecture) for architecture in ARCHITECTURES]

    def get_function(self, name: str) -> Any:
        """Return a kernel of the module."""
        assert all(name.encode() in code for code in self._code)
        self.names.append(name)
        return lambda *_: None


@pytest.mark.slow
@pytest.mark.cases(3)
@pytest.mark.parametrize(
    ("name", "precision", "patterns"),
    [
        ("vsa_3r", "double", ()),
        exhaustive("measured_1r", "float", ()),
        ("tendon_1r", "double", ("joints.*.link.*",)),
        ("maccepa_vd_1r", "double", ()),
        exhaustive("lwr_7r_vsa", "double", ()),
        ("mixed_3r", "double", ()),
    ],
)
def test_every_kernel_is_compiled(
    name: str, precision: str, patterns: tuple[str, ...], tmp_path: Path
) -> None:
    nvrtc()
    robot = shipped_robot(name)
    write_files(generate(robot, precision, None, patterns), tmp_path)
    cupy: Any = host_cupy()
    cupy.RawModule = NvrtcModule
    module = load_gpu_module(tmp_path, prefix_of(robot), cupy)
    NvrtcModule.names.clear()
    for kernel in module._KERNELS:
        module._kernel(kernel, 2**20 - 1)  # with all results
    assert NvrtcModule.names == [f"{prefix_of(robot)}_gpu_{kernel}" for kernel in module._KERNELS]
