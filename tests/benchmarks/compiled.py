"""Compiled code beside casadi: batches of samples, and what code of longer chains costs."""

from __future__ import annotations

import re
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from casadi_peer import CasadiPeer
from kernel import CASADI
from single_calls import SCALAR_FLAGS
from subjects import chain, motion, seven_joints
from timing import Seconds, cpu_seconds, medians

from vsacli import Robot
from vsacli.compute.engine.compiled_engine import CompiledEngine, kernel_code
from vsacli.compute.engine.compiler import FLAGS, system_compiler
from vsacli.compute.engine.engines import Engine, Kernel, passes
from vsacli.control.codegen.project import generate, prefix_of
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.inverse import InverseDynamics

LINKS, WHOLE = "link torques", "whole inverse dynamics"
JOINTS = (1, 2, 3, 5, 7, 10, 20, 50, 100, 200)


def batches(samples: int, repeats: int) -> Seconds:
    """Seconds a sample of the arm with seven joints: casadi, and both kernels in one and two threads.

    Of processor time, but for two threads.
    """
    robot = seven_joints()
    moving = motion(7, samples)
    rows = [row for array in moving for row in np.ascontiguousarray(array.T)]
    stiffness = [np.full(samples, 1000.0)] * 7 + [np.zeros(samples)] * 14
    with tempfile.TemporaryDirectory() as folder:
        casadi = CasadiPeer(robot, Path(folder))
        ways = {CASADI: lambda: casadi(moving)[0]}
        for threads in (1, 2):
            engine = CompiledEngine(system_compiler(), threads, print)
            for name, kernel, given in (
                (LINKS, LinkTorques(robot), rows),
                (WHOLE, InverseDynamics(robot), [*rows, *stiffness]),
            ):
                engine.prepare(kernel)
                way = _in_blocks(engine, kernel, given)
                ways[f"{name}, {threads}"] = way if threads > 1 else cpu_seconds(way)
        return {name: seconds / samples for name, seconds in medians(ways, repeats).items()}


def _in_blocks(engine: Engine, kernel: Kernel, rows: Sequence[np.ndarray]) -> Callable[[], object]:
    """As a run takes them."""

    def way() -> None:
        for part in passes(rows):
            engine.run(kernel, [row[part] for row in rows])

    return way


class Cost(NamedTuple):
    """What code of inverse dynamics costs: operations, bytes of machine code and of stack, seconds.

    `recording` and `compiling` are of the batch library, the rest of the generated function and of what
    it calls.
    """

    operations: int
    code: int
    stack: int
    recording: float
    compiling: float


def costs() -> dict[int, Cost]:
    """Over the number of joints."""
    return {joints: _cost(chain(joints)) for joints in JOINTS}


def _cost(robot: Robot) -> Cost:
    prefix = prefix_of(robot)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        begin = time.perf_counter()
        batch = kernel_code.__wrapped__(InverseDynamics(robot))
        (folder / "batch.c").write_text(batch.text, encoding="utf-8")
        recorded = time.perf_counter()
        subprocess.run(["cc", *FLAGS, "batch.c", "-o", "batch.so", "-lm"], cwd=folder, check=True)
        compiled = time.perf_counter()
        for file, text in generate(robot).files.items():
            (folder / file).write_text(text, encoding="utf-8")
        command = ["cc", *SCALAR_FLAGS, "-fstack-usage", "-c", f"{prefix}.c"]
        subprocess.run(command, cwd=folder, check=True)
        symbols = subprocess.run(
            ["nm", "-S", f"{prefix}.o"], cwd=folder, check=True, capture_output=True, text=True
        ).stdout.splitlines()
        stacks = (folder / f"{prefix}.su").read_text().splitlines()
    wanted = f"{prefix}_inverse_dynamics"
    functions = re.compile(rf"{wanted}|inverse_dynamics_\d+(\.\w+)*")
    sizes = {line.split()[-1]: int(line.split()[1], 16) for line in symbols if len(line.split()) == 4}
    code = sum(size for function, size in sizes.items() if functions.fullmatch(function))
    frames = {line.split()[0].split(":")[-1]: int(line.split()[-2]) for line in stacks}
    called = [
        size for function, size in frames.items() if functions.fullmatch(function) and function != wanted
    ]
    stack = frames[wanted] + max(called, default=0)
    return Cost(batch.operations, code, stack, recorded - begin, compiled - recorded)
