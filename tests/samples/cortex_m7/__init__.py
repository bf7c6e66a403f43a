"""Code for a Cortex-M7, compiled as for a controller, and run by QEMU instruction by instruction."""

from __future__ import annotations

import subprocess
from pathlib import Path

COMPILER = "arm-none-eabi-gcc"
PROCESSOR = ("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard")
BOARD = (
    "-M",
    "mps2-an500",
    "-cpu",
    "cortex-m7",
    "-nographic",
    "-semihosting-config",
    "enable=on,target=native",
)

_FILES = Path(__file__).parent


def link(folder: Path, *arguments: str) -> Path:
    """A program of some sources, with newlib."""
    start = ("--specs=rdimon.specs", "-T", str(_FILES / "memory.ld"), str(_FILES / "startup.c"))
    command = [COMPILER, *PROCESSOR, *start, *arguments, "-lm", "-o", "program.elf"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "program.elf"


def run(program: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """What a program prints, and the value that its main returns, if that is 0."""
    command = ["qemu-system-arm", *BOARD, *options, "-kernel", str(program)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
