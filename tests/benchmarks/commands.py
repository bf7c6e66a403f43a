"""The installed command as a user waits for it: start-up, the paper's job, and memory of a long run."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

from subjects import PAPER, SEVEN_JOINTS
from timing import Seconds, medians

VSACLI = str(Path(sysconfig.get_path("scripts"), "vsacli"))

PEAK_MEMORY = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * (1 if sys.platform == "darwin" else 1024))
"""


def startup(repeats: int) -> Seconds:
    """Seconds of commands, and of the imports that nobody can do without."""
    with tempfile.TemporaryDirectory() as folder:
        job = [VSACLI, "invdyn", *map(str, PAPER), "-q", "--overwrite", "-o", str(Path(folder, "paper.h5"))]
        commands = {
            "import click": [sys.executable, "-c", "import click"],
            "vsacli --help": [VSACLI, "--help"],
            "import numpy, h5py, yaml, click": [sys.executable, "-c", "import numpy, h5py, yaml, click"],
            "the paper's job": job,
        }
        return medians({name: lambda line=line: _run(line) for name, line in commands.items()}, repeats)


def peak_memory(samples: int) -> int:
    """Bytes resident at most while the 7R arm is computed with `--variables tau_motor,flags`."""
    robot, trajectory = SEVEN_JOINTS
    with tempfile.TemporaryDirectory() as folder:
        motion = Path(folder, "motion.yaml")
        motion.write_text(trajectory.read_text().replace("rate: 1000", f"rate: {(samples - 1) / 3}"))
        options = ["--variables", "tau_motor,flags", "-q", "-o", str(Path(folder, "result.h5"))]
        line = [VSACLI, "invdyn", str(robot), str(motion), *options]
        measured = [sys.executable, "-c", PEAK_MEMORY, *line]
        return int(subprocess.run(measured, check=True, capture_output=True, text=True).stdout)


def _run(line: list[str]) -> None:
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL)
