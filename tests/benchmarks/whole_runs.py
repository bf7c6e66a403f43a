"""Whole runs, from the trajectory to the finished file, over peer 1, which computes link torques alone."""

from __future__ import annotations

import tempfile
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
        seconds: processor time a sample, in one thread.
        ratio: that over peer 1.
        faster: by how much two threads are faster than one, by the clock.
    """

    stored: str
    seconds: float
    ratio: float
    faster: float


def compare(samples: int, repeats: int) -> list[WholeRun]:
    """Time runs and the peer in turns."""
    robot, trajectory = seven_joints(), trajectory_of(samples)
    moving = motion(len(robot.joints), samples)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        peer = CasadiPeer(robot, Path(folder))
        for stored, variables in SELECTIONS.items():
            one, two = (_run(robot, trajectory, variables, count, Path(folder)) for count in (1, 2))
            ways = {"peer": lambda: peer(moving)[0], "processor": cpu_seconds(one), "one": one, "two": two}
            taken = medians(ways, repeats)
            ratio, faster = taken["processor"] / taken["peer"], taken["one"] / taken["two"]
            found.append(WholeRun(stored, taken["processor"] / samples, ratio, faster))
    return found


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
