"""On what the figures were taken."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import version
from pathlib import Path

from numpy._core._multiarray_umath import __cpu_features__

VECTORS = {"AVX512_SKX": "AVX-512", "AVX2": "AVX2"}
"""Names of vector extensions by those of NumPy, the widest first; the environment variable
`NPY_DISABLE_CPU_FEATURES` leaves them out, as a compiler in `CC` that adds `-mno-avx512f` does."""

PACKAGES = ("numpy", "scipy", "h5py", "casadi", "pin")


def description() -> str:
    """Processor, cores, compiler and versions, in one paragraph."""
    compiler = subprocess.run(["gcc", "--version"], capture_output=True, text=True, check=True).stdout
    packages = ", ".join(f"{package} {version(package)}" for package in PACKAGES)
    return (
        f"{processor()}, {os.cpu_count()} cores; {platform.system()}, Python {platform.python_version()}, "
        f"{packages}, {compiler.splitlines()[0]}"
    )


def processor() -> str:
    """Name of the processor, with the widest vectors that it and NumPy's settings allow."""
    names = [line.split(":", 1)[1].strip() for line in _lines() if line.startswith("model name")]
    widest = next((name for flag, name in VECTORS.items() if __cpu_features__.get(flag)), "no AVX2")
    return f"{names[0] if names else platform.processor()} with {widest}"


def _lines() -> list[str]:
    try:
        return Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return []
