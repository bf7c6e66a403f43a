"""The code for single samples that recording leaves, beside what casadi leaves of its recursion."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import time
from importlib.metadata import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
from casadi_peer import FLAGS, CasadiPeer
from kernel import CASADI
from subjects import motion, seven_joints
from timing import medians

import vsacli.compute.tracing
from vsacli.control.codegen.robot_functions import link_torques_function
from vsacli.control.codegen.texts import header_text, source_text

OURS = "vsacli, recorded, C"
LOOP = """
#include <time.h>
#include "arm.h"
const unsigned long torques_size = sizeof(arm_torques);
double time_all(const arm_motion *motion, arm_torques *torques, long samples)
{
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (long k = 0; k < samples; k++)
        arm_link_torques(&motion[k], &torques[k]);
    clock_gettime(CLOCK_MONOTONIC, &end);
    return (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
}
"""


class Recorder(NamedTuple):
    """What a recorder leaves of tau_e, dtau_e, ddtau_e of the arm with seven joints.

    Attributes:
        name: of the recorder.
        operations: that are left.
        source: bytes of C.
        code: bytes of machine code, `gcc -O2`.
        compiling: seconds.
        seconds: of a sample, in a loop in C.
        installed: bytes on the disk.
    """

    name: str
    operations: int
    source: int
    code: int
    compiling: float
    seconds: float
    installed: int


def compare(samples: int, repeats: int) -> list[Recorder]:
    """Both, compiled and called alike."""
    robot, moving = seven_joints(), motion(7, samples)
    function = link_torques_function(robot)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        casadi = CasadiPeer(robot, folder)
        (folder / "arm.h").write_text(header_text("arm", robot, [function], "double", "Timed."))
        (folder / "arm.c").write_text(source_text("arm", [function], "double", "Timed."))
        (folder / "loop.c").write_text(LOOP)
        subprocess.run(["gcc", *FLAGS, "arm.c", "loop.c", "-o", "arm.so", "-lm"], cwd=folder, check=True)
        library = ctypes.CDLL(str(folder / "arm.so"))
        run = library.time_all
        run.restype = ctypes.c_double
        record = ctypes.c_ulong.in_dll(library, "torques_size").value
        rows, torques = np.concatenate(moving, axis=1), np.empty((samples, record), np.uint8)
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (rows, torques)]
        ways = {OURS: lambda: run(*pointers, ctypes.c_long(samples)), CASADI: lambda: casadi(moving)[0]}
        seconds = medians(ways, repeats)
        own = sum(path.stat().st_size for path in Path(vsacli.compute.tracing.__path__[0]).glob("*.py"))
        theirs = sum(Path(file.locate()).stat().st_size for file in files("casadi") or ())
        operations = {OURS: len(function.program.operations), CASADI: casadi.operations}
        sizes = {OURS: own, CASADI: theirs}
        sources = {OURS: folder / "arm.c", CASADI: folder / "peer.c"}
        return [
            Recorder(
                way,
                operations[way],
                sources[way].stat().st_size,
                *_compiled(sources[way]),
                seconds[way] / samples,
                sizes[way],
            )
            for way in ways
        ]


def _compiled(source: Path) -> tuple[int, float]:
    """Bytes of machine code, and seconds of the compiler."""
    target = source.with_suffix(".o")
    begin = time.perf_counter()
    subprocess.run(["gcc", "-D_POSIX_C_SOURCE=199309L", "-O2", "-c", source, "-o", target], check=True)
    elapsed = time.perf_counter() - begin
    listed = subprocess.run(["size", target], capture_output=True, text=True, check=True).stdout
    return int(listed.splitlines()[1].split()[0]), elapsed
