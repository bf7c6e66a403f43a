"""What generated inverse dynamics takes on a Cortex-M7, memory and instructions, and its time here."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from samples.codegen import reachable
from samples.cortex_m7 import COMPILER, PROCESSOR
from samples.cortex_m7.instructions import taken
from samples.shipped import shipped_robot
from single_calls import single_calls

from vsacli import Robot
from vsacli.control.codegen.cost import worst_cost
from vsacli.control.codegen.project import generate, prefix_of
from vsacli.control.codegen.robot_functions import inverse_dynamics_function

NAMES = ("vsa_3r", "lwr_7r_vsa", "measured_1r")
PRECISIONS = ("double", "float")
FLAGS = ("-std=c99", "-O2")
CALLS = 100_000
COUNTED = 20
"""Commands whose instructions are counted, which takes no luck: they are the same each time."""


class Controller(NamedTuple):
    """What code of a robot takes.

    Attributes:
        robot: its name.
        precision: of the numbers.
        operations: of inverse dynamics, at most.
        flash: bytes of all functions and their tables on a Cortex-M7.
        stack: bytes that a call of inverse dynamics writes to there, math.h included, at most of some.
        instructions: there, median over commands.
        most: largest number of these.
        seconds: a call on this machine, median.
    """

    robot: str
    precision: str
    operations: int
    flash: int
    stack: int
    instructions: float
    most: float
    seconds: float


def measure() -> list[Controller]:
    """Each robot, in double and single precision."""
    return list(_measured())


def _measured() -> Iterator[Controller]:
    for name in NAMES:
        robot = shipped_robot(name)
        operations = worst_cost(inverse_dynamics_function(robot).program).operations
        command = reachable(robot)
        for precision in PRECISIONS:
            flash, stack, counts = _on_cortex_m7(robot, precision, command)
            calls = single_calls(robot, command, precision, CALLS)
            usual, most = float(np.median(counts)), float(counts.max())
            yield Controller(name, precision, operations, flash, stack, usual, most, calls.median * 1e-6)


def _on_cortex_m7(robot: Robot, precision: str, command: np.ndarray) -> tuple[int, int, np.ndarray]:
    """Bytes of code and of stack, and instructions of calls."""
    prefix = prefix_of(robot)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in generate(robot, precision).files.items():
            (folder / file).write_text(text, encoding="utf-8")
        compiler = [COMPILER, *PROCESSOR, *FLAGS, "-c", f"{prefix}.c"]
        subprocess.run(compiler, cwd=folder, check=True)
        size = ["arm-none-eabi-size", f"{prefix}.o"]
        listed = subprocess.run(size, cwd=folder, check=True, capture_output=True, text=True).stdout
        counts, stack = taken(folder, prefix, command[:COUNTED])
    return int(listed.splitlines()[1].split()[0]), int(stack.max()), counts
