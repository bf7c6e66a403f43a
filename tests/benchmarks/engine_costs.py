"""Measure the times behind vsacli/compute/engine/costs.py: `python tests/benchmarks/engine_costs.py`.

For each robot: processor time of NumPy, of the traced program and of compiled code, in ns an operation as
`kernel_code` counts them, time of tracing, and time of the compiler compared with its estimate.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the samples of the tests

import numpy as np
from samples.shipped import shipped_run
from subjects import chain
from timing import cpu_seconds, medians

from vsacli import Robot
from vsacli.compute.engine.compiled_engine import CompiledEngine, kernel_code
from vsacli.compute.engine.compiler import system_compiler
from vsacli.compute.engine.engines import (
    SAMPLES_PER_PASS,
    Engine,
    Kernel,
    NumPyEngine,
    TracedEngine,
    kernel_program,
)
from vsacli.dynamics.balances import BalancedDynamics
from vsacli.dynamics.energy import IntervalEnergy
from vsacli.dynamics.inverse import InverseDynamics, block_of
from vsacli.trajectory.times import UniformTimes

RUNS = {
    "vsa_3r": "rest_to_rest",
    "qbmove_arm_manual": "qbmove_arm",
    "lwr_7r_vsa": "lwr_7r",
    **{
        name: name
        for name in (
            *("tendon_1r", "measured_1r", "shifted_cams_1r", "cam_1r", "maccepa_1r", "sliding_anchor_1r"),
            *("devices/vsa_ii", "devices/jack_spring"),
        )
    },
}
SAMPLES = 4 * SAMPLES_PER_PASS
REPEATS = 5
JOINTS = (20, 50, 100)


class Noted(NumPyEngine):
    """NumPy, with a note of the kernel and the rows that it was given."""

    def run(self, kernel: Kernel, rows: list[np.ndarray]) -> np.ndarray:
        self.kernel, self.rows = kernel, [row.copy() for row in rows]
        return super().run(kernel, rows)


def costs_of_run(robot: str, trajectory: str) -> str:
    """Return a row on the kernel of a run."""
    arm, motion = shipped_run(robot, trajectory)
    duration = motion.times.span[1]
    noted = Noted()
    motion = motion.sampled(UniformTimes(duration, (SAMPLES - 1) / duration))
    block_of(BalancedDynamics(InverseDynamics(arm)), motion.block(0, SAMPLES), noted)
    kernel, rows, code = noted.kernel, noted.rows, kernel_code(noted.kernel)
    compiled = CompiledEngine(system_compiler(), 1, lambda _text: None)
    engines: dict[str, Engine] = {"NumPy": NumPyEngine(), "traced": TracedEngine(), "C": compiled}
    ways: dict[str, Callable[[], object]] = {
        name: cpu_seconds(partial(engine.run, kernel, rows)) for name, engine in engines.items()
    }
    taken = medians({**ways, "tracing": cpu_seconds(partial(kernel_program, kernel))}, REPEATS)
    tracing = taken.pop("tracing")
    each = ", ".join(
        f"{name} {1e9 * seconds / SAMPLES / code.operations:.2f}" for name, seconds in taken.items()
    )
    straight = "straight" if code.straight else "loops or branches"
    return f"{robot}: {code.operations} operations, {straight}; ns: {each}; tracing {tracing:.3f} s"


def costs_of_compiling(kernel: Kernel) -> str:
    """Return a row on the compiler, which gets new code."""
    code = kernel_code(kernel)
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "program.c")
        source.write_text(code.text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        begin = time.perf_counter()
        system_compiler().build(source, Path(folder, "program.so"))
        by_clock = time.perf_counter() - begin
    used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    return f"{used:.2f} s, by the clock {by_clock:.2f}, estimated {code.compiling_seconds:.2f}"


def interval_energy(robot: Robot) -> IntervalEnergy:
    """Return the second kernel of a run, which has two branches for each joint."""
    actuators = [joint.actuator for joint in robot.joints]
    inertia = tuple(tuple(motor.inertia for motor in actuator.motors) for actuator in actuators)
    return IntervalEnergy(
        inertia, tuple(actuator.coupled_rotors for actuator in actuators), with_friction=False
    )


def rows() -> Iterator[str]:
    """Yield a row for each measurement."""
    for robot, trajectory in RUNS.items():
        yield costs_of_run(robot, trajectory)
        kernel = BalancedDynamics(InverseDynamics(shipped_run(robot, trajectory)[0]))
        yield f"    compiling {costs_of_compiling(kernel)}"
    for joints in JOINTS:
        arm = chain(joints)
        for each in (BalancedDynamics(InverseDynamics(arm)), interval_energy(arm)):
            yield f"{joints} joints, {type(each).__name__}: compiling {costs_of_compiling(each)}"


if __name__ == "__main__":
    for row in rows():
        sys.stdout.write(f"{row}\n")
        sys.stdout.flush()
