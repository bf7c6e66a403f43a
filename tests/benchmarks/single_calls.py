"""Single calls of generated inverse dynamics, as a control loop makes them: how long each takes."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from subjects import motion, seven_joints

from vsacli import Robot
from vsacli.control.codegen.project import generate, prefix_of

CALLS = 1_000_000
SCALAR_FLAGS = ("-std=c99", "-O2", "-march=native")

CALLER = """
#include <time.h>
#include "{prefix}.h"
/* Nanoseconds of each of many calls, which step through the commands. */
void time_calls(const {prefix}_command *commands, int count, int calls, int *nanoseconds)
{{
    {prefix}_drive drive;
    for (int n = 0; n < calls; n++) {{
        struct timespec begin, end;
        clock_gettime(CLOCK_MONOTONIC, &begin);
        {prefix}_inverse_dynamics(&commands[n % count], &drive);
        clock_gettime(CLOCK_MONOTONIC, &end);
        nanoseconds[n] = (int)(1000000000L * (end.tv_sec - begin.tv_sec) + end.tv_nsec - begin.tv_nsec);
    }}
}}
"""


class Calls(NamedTuple):
    """Microseconds of single calls; `most` is what 99.9 % of them stay below."""

    median: float
    most: float
    worst: float


def calls_of_seven_joints() -> Calls:
    """Those of the arm with seven joints along a motion."""
    count = 1000
    commands = np.zeros((count, 8, 7))
    commands[:, :5] = np.stack(motion(7, count), axis=1)
    commands[:, 5] = 1000
    return single_calls(seven_joints(), commands, "double", CALLS)


def single_calls(robot: Robot, commands: np.ndarray, precision: str, calls: int) -> Calls:
    """Time each of many calls.

    Args:
        robot: the robot.
        commands: through which the calls step, (commands, signals, joints).
        precision: of the numbers.
        calls: how many.
    """
    prefix = prefix_of(robot)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in generate(robot, precision).files.items():
            (folder / file).write_text(text, encoding="utf-8")
        (folder / "caller.c").write_text(CALLER.format(prefix=prefix), encoding="utf-8")
        command = ["cc", *SCALAR_FLAGS, "-D_POSIX_C_SOURCE=199309L", "-fPIC", "-shared", f"{prefix}.c"]
        subprocess.run([*command, "caller.c", "-o", "caller.so", "-lm"], cwd=folder, check=True)
        library = ctypes.CDLL(str(folder / "caller.so"))
    given = np.ascontiguousarray(commands, dtype={"double": np.float64, "float": np.float32}[precision])
    taken = np.empty(calls, dtype=np.int32)
    library.time_calls(
        given.ctypes.data_as(ctypes.c_void_p), len(given), calls, taken.ctypes.data_as(ctypes.c_void_p)
    )
    return Calls(
        *(float(value) / 1e3 for value in (np.median(taken), np.quantile(taken, 0.999), taken.max()))
    )
