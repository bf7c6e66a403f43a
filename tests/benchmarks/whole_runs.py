"""Whole runs, from the trajectory to the finished file, over peer 1, which computes link torques alone."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from casadi_peer import CasadiPeer
from stages import VARIABLES, trajectory_of
from subjects import motion, seven_joints
from timing import cpu_seconds, medians

from vsacli.analysis.run import Run
from vsacli.base.outputs import Outputs
from vsacli.results.store.writer import ResultWriter
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

SELECTIONS = {"all variables": None, f"`--variables {','.join(VARIABLES)}`": VARIABLES}


class WholeRun(NamedTuple):
    """A run of the arm with seven joints by compiled code.

    Attributes:
        stored: which variables.
        seconds: processor time a sample, with one thread.
        ratio: that over peer 1.
        longest: with two threads, that of the one that takes longest: it keeps the books and puts chunks
            together, while others compute and write.
    """

    stored: str
    seconds: float
    ratio: float
    longest: float


def compare(samples: int, repeats: int) -> list[WholeRun]:
    """Time runs and the peer in turns."""
    robot, trajectory = seven_joints(), trajectory_of(samples)
    moving = motion(len(robot.joints), samples)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        peer = CasadiPeer(robot, Path(folder))
        for stored, variables in SELECTIONS.items():
            one, two = (_run(robot, trajectory, variables, count, Path(folder)) for count in (1, 2))
            ways = {"peer": lambda: peer(moving)[0], "one": cpu_seconds(one), "two": _caller_seconds(two)}
            taken = medians(ways, repeats)
            ratio = taken["one"] / taken["peer"]
            found.append(WholeRun(stored, taken["one"] / samples, ratio, taken["two"] / samples))
    return found


def _caller_seconds(way: Callable[[], None]) -> Callable[[], float]:
    """A way that reports seconds of processor time of the thread that calls it."""

    def timed() -> float:
        begin = time.thread_time()
        way()
        return time.thread_time() - begin

    return timed


def _run(
    robot: Robot, trajectory: Trajectory, variables: Sequence[str] | None, threads: int, folder: Path
) -> Callable[[], None]:
    """A run with the compiled engine whose file replaces that of the one before."""

    def run() -> None:
        with Outputs(overwrite=True) as outputs:
            steps = Run(robot, trajectory, engine="c", threads=threads)
            file = outputs.file(folder / "result.h5")
            with ResultWriter(file, robot, trajectory, variables) as writer:
                for block in steps:
                    writer.write(block)
                writer.finish(steps.report().as_json())

    return run
