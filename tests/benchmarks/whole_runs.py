"""Whole runs, from the trajectory to the finished file, over peer 1, which computes link torques alone."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from casadi_peer import CasadiPeer
from stages import VARIABLES, trajectory_of
from subjects import motion, seven_joints
from timing import medians

from vsacli import Robot, Trajectory
from vsacli.analysis.run import Run
from vsacli.base.outputs import Outputs
from vsacli.results.store.writer import ResultWriter

SELECTIONS = {"all variables": None, f"`--variables {','.join(VARIABLES)}`": VARIABLES}


class WholeRun(NamedTuple):
    """A run of the arm with seven joints by compiled code.

    Attributes:
        stored: which variables.
        seconds: processor time a sample, with one thread.
        ratio: that over peer 1.
        by_clock: time a sample, by the clock, of one processor and of two with as many threads.
    """

    stored: str
    seconds: float
    ratio: float
    by_clock: tuple[float, float]


def compare(samples: int, repeats: int) -> list[WholeRun]:
    """Time runs and the peer in turns."""
    robot, trajectory = seven_joints(), trajectory_of(samples)
    moving = motion(len(robot.joints), samples)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        peer = CasadiPeer(robot, Path(folder))
        for stored, variables in SELECTIONS.items():
            one, two = (_run(robot, trajectory, variables, threads) for threads in (1, 2))
            ways = {
                "peer": lambda: peer(moving)[0],
                "processor": _timed(one, time.process_time),
                "one": _timed(one, time.perf_counter, processors=1),
                "two": _timed(two, time.perf_counter, processors=2),
            }
            taken = medians(ways, repeats)
            by_clock = taken["one"] / samples, taken["two"] / samples
            ratio = taken["processor"] / taken["peer"]
            found.append(WholeRun(stored, taken["processor"] / samples, ratio, by_clock))
    return found


def _timed(
    run: Callable[[Path], None], clock: Callable[[], float], processors: int | None = None
) -> Callable[[], float]:
    """A run to a file that is new, on so many processors; it reports what the clock says."""
    every = os.sched_getaffinity(0)

    def timed() -> float:
        os.sched_setaffinity(0, sorted(every)[:processors])
        try:
            with tempfile.TemporaryDirectory() as folder:
                begin = clock()
                run(Path(folder) / "result.h5")
                return clock() - begin
        finally:
            os.sched_setaffinity(0, every)

    return timed


def _run(
    robot: Robot, trajectory: Trajectory, variables: Sequence[str] | None, threads: int
) -> Callable[[Path], None]:
    """A run with the compiled engine."""

    def run(path: Path) -> None:
        with Outputs(overwrite=False) as outputs:
            steps = Run(robot, trajectory, engine="c", threads=threads)
            with ResultWriter(outputs.file(path), robot, trajectory, variables) as writer:
                for block in steps:
                    writer.write(block)
                writer.finish(steps.report().as_json())

    return run
