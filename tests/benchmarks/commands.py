"""The installed command as a user waits for it: start-up, the paper's job, and memory of a long run."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from subjects import PAPER, SEVEN_JOINTS
from timing import Seconds, medians

VSACLI = str(Path(sysconfig.get_path("scripts"), "vsacli"))

DONE = (0, 3)
"""Exit codes of commands that computed what was asked for, feasible or not."""

_MEASURE = """
import resource, subprocess, sys, time
begin = time.perf_counter()
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
elapsed = time.perf_counter() - begin
unit = 1 if sys.platform == "darwin" else 1024
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(elapsed, used.ru_utime + used.ru_stime, used.ru_maxrss * unit, code)
"""


class Taken(NamedTuple):
    """What a command took.

    Attributes:
        seconds: by the clock.
        processor: seconds of processor time, of all threads.
        memory: bytes resident at most.
    """

    seconds: float
    processor: float
    memory: int


def taken(line: Sequence[str], folder: Path | None = None) -> Taken:
    """Carry out a command line, in a process whose memory is not that of its parent.

    Raises:
        RuntimeError: it fails.
    """
    measured = [sys.executable, "-c", _MEASURE, *line]
    printed = subprocess.run(measured, check=True, capture_output=True, text=True, cwd=folder)
    seconds, processor, memory, code = printed.stdout.split()
    if int(code) not in DONE:
        raise RuntimeError(f"{' '.join(line)}: exit code {code}: {printed.stderr}")
    return Taken(float(seconds), float(processor), int(memory))


def startup(repeats: int) -> Seconds:
    """Processor seconds of commands, and of the imports that nobody can do without."""
    with tempfile.TemporaryDirectory() as folder:
        job = [VSACLI, "invdyn", *map(str, PAPER), "-q", "--overwrite", "-o", str(Path(folder, "paper.h5"))]
        commands = {
            "import click": [sys.executable, "-c", "import click"],
            "vsacli --help": [VSACLI, "--help"],
            "import numpy, h5py, yaml, click": [sys.executable, "-c", "import numpy, h5py, yaml, click"],
            "the paper's job": job,
        }
        return medians(
            {name: lambda line=line: taken(line).processor for name, line in commands.items()}, repeats
        )


def peak_memory(samples: int) -> int:
    """Bytes resident at most while the 7R arm is computed with `--variables tau_motor,flags`."""
    robot, trajectory = SEVEN_JOINTS
    with tempfile.TemporaryDirectory() as folder:
        motion = Path(folder, "motion.yaml")
        motion.write_text(trajectory.read_text().replace("rate: 1000", f"rate: {(samples - 1) / 3}"))
        options = ["--variables", "tau_motor,flags", "-q", "-o", str(Path(folder, "result.h5"))]
        line = [VSACLI, "invdyn", str(robot), str(motion), *options]
        return taken(line).memory
