"""Generated kernels on a GPU: nanoseconds a sample, and a step and robot, of the kernels alone.

`python tests/benchmarks/device.py` prints the table without the packages that other parts need.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the samples of the tests

from markdown import table
from samples.shipped import shipped_run

from vsacli import Gains, inverse_dynamics
from vsacli.control.codegen.project import generate, prefix_of

RUNS = {"3R": ("vsa_3r", "rest_to_rest"), "7R": ("lwr_7r_vsa", "lwr_7r")}
"""Robots and the trajectories along which they are measured."""

SAMPLES = 2**20
ROUNDS = 20
STEPS = 100
DURATIONS = {"3R": 1e-3, "7R": 2.5e-4}
"""Seconds of a step, short for the fastest vibration."""

FAST, ROWS = "(joints, samples)", "(samples, joints)"
"""Layouts of the arguments."""

TORQUES = ("tau_motor", "flags")


class DeviceTime(NamedTuple):
    """Time of a kernel.

    Attributes:
        robot: name in `RUNS`.
        what: what is computed, in which layout.
        nanoseconds: a sample, or a step and robot.
        first: seconds of the first call, which compiles.
        deviation: largest difference from NumPy, relative to the peak of the variable; None for rollouts.
    """

    robot: str
    what: str
    nanoseconds: float
    first: float
    deviation: float | None


def device_name() -> str:
    """Name of the GPU; empty without one, or without CuPy."""
    try:
        import cupy
    except ImportError:
        return ""
    try:
        return str(cupy.cuda.runtime.getDeviceProperties(0)["name"].decode())
    except cupy.cuda.runtime.CUDARuntimeError:
        return ""


def measure() -> Iterator[DeviceTime]:
    """Measure each robot."""
    with tempfile.TemporaryDirectory() as folder:
        sys.path.append(folder)
        for name in RUNS:
            yield from _Robot(name, Path(folder)).times()


class _Robot:
    """A robot's module for a GPU, with samples along its trajectory."""

    def __init__(self, name: str, folder: Path) -> None:
        self._name = name
        self._robot, self._trajectory = shipped_run(*RUNS[name])
        for file, text in generate(self._robot).files.items():
            (folder / file).write_text(text, encoding="utf-8")
        self._gpu: Any = importlib.import_module(f"{prefix_of(self._robot)}_gpu")
        self._cupy = self._gpu.cupy
        time = np.linspace(0, self._trajectory.duration, SAMPLES)
        self._motion = self._trajectory.at(time)
        members = self._gpu._STRUCTURES["command"]
        values = self._motion.variables()
        self._command = {
            FAST: {name: self._cupy.asarray(np.ascontiguousarray(values[name].T)) for name in members},
            ROWS: {name: self._cupy.asarray(values[name]) for name in members},
        }

    def times(self) -> Iterator[DeviceTime]:
        """Yield the times of all kernels."""
        motion = {
            layout: {name: arrays[name] for name in self._gpu._STRUCTURES["motion"]}
            for layout, arrays in self._command.items()
        }
        for layout in (FAST, ROWS):
            yield self._evaluation(
                "link_torques", f"link torques, {layout}", {"motion": motion[layout]}, layout
            )
            for results, what in ((TORQUES, "tau_motor and flags"), (None, "all of drive")):
                command = {"command": self._command[layout]}
                yield self._evaluation("inverse_dynamics", f"{what}, {layout}", command, layout, results)
        yield from self._rollouts()

    def _evaluation(
        self,
        name: str,
        what: str,
        arguments: dict[str, Any],
        layout: str,
        results: tuple[str, ...] | None = None,
    ) -> DeviceTime:
        gpu, axis = self._gpu, -1 if layout == FAST else 0
        begin = time.perf_counter()
        computed, flags = getattr(gpu, name)(*arguments.values(), results=results, sample_axis=axis)
        self._cupy.cuda.Device().synchronize()
        first = time.perf_counter() - begin
        batch = gpu._Batch({key: (key, values) for key, values in arguments.items()}, axis)
        places = batch.arguments(name)
        taken = self._timed(lambda: gpu._launch(name, batch, places, computed, flags))
        return DeviceTime(self._name, what, 1e9 * taken / SAMPLES, first, self._deviation(computed))

    def _rollouts(self) -> Iterator[DeviceTime]:
        result = inverse_dynamics(self._robot, self._trajectory)
        state = {name: getattr(result, name)[0][..., None].repeat(SAMPLES, -1) for name in ("q", "theta")}
        state |= {f"d{name}": np.zeros_like(values) for name, values in state.items()}
        state = {name: self._cupy.asarray(values) for name, values in state.items()}
        torques = self._cupy.asarray(result.tau_motor[0])
        gains = Gains.from_poles([-20] * 4, [-20] * 2)
        command = {name: values[0] for name, values in self._command[ROWS].items()}
        dt = DURATIONS[self._name]
        ways: dict[str, Callable[[], Any]] = {
            "rollout": lambda: self._gpu.rollout(state, torques, dt, STEPS),
            "rollout_law": lambda: self._gpu.rollout_law(state, command, gains, dt, STEPS),
        }
        for what, way in ways.items():
            begin = time.perf_counter()
            way()
            self._cupy.cuda.Device().synchronize()
            first = time.perf_counter() - begin
            yield DeviceTime(self._name, what, 1e9 * self._timed(way, 3) / SAMPLES / STEPS, first, None)

    def _timed(self, way: Callable[[], Any], rounds: int = ROUNDS) -> float:
        """Return the mean seconds on the device, after one call that does not count."""
        way()
        begin, end = self._cupy.cuda.Event(), self._cupy.cuda.Event()
        begin.record()
        for _ in range(rounds):
            way()
        end.record()
        end.synchronize()
        return float(self._cupy.cuda.get_elapsed_time(begin, end)) * 1e-3 / rounds

    def _deviation(self, computed: dict[str, Any]) -> float:
        """Return the largest difference of some samples from NumPy, relative to the peak."""
        from vsacli.dynamics.inverse import compute_block

        places = np.linspace(0, SAMPLES - 1, 1000).astype(int)
        block = compute_block(self._robot, self._trajectory.at(self._motion.time[places]))
        errors = [0.0]
        for name, values in computed.items():
            if hasattr(block, name):
                found = np.moveaxis(self._cupy.asnumpy(values), -1, 0)[places]
                expected = np.asarray(getattr(block, name))
                np.testing.assert_array_equal(np.isnan(found), np.isnan(expected), err_msg=name)
                there = np.isfinite(expected)
                if expected[there].any():
                    difference = np.abs(found[there] - expected[there]).max()
                    errors.append(float(difference / np.abs(expected[there]).max()))
        return max(errors)


def device_part(gpu: str, times: Iterable[DeviceTime]) -> str:
    """Kernels on a GPU."""
    rows = (
        [
            each.robot,
            each.what,
            f"{each.nanoseconds:.2g}",
            f"{each.first:.1f}",
            "" if each.deviation is None else f"{each.deviation:.0e}",
        ]
        for each in times
    )
    header = ("robot", "kernel", "ns a sample, or a step and robot", "first call, s", "deviation of the peak")
    return f"{gpu}, double precision, {SAMPLES:,} samples.\n\n{table(header, rows)}"


if __name__ == "__main__":
    name = device_name()
    sys.stdout.write(device_part(name, measure()) if name else "CuPy finds no device\n")
