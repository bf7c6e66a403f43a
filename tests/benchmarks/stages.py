"""A whole run taken apart: sampling the trajectory, computing, bookkeeping, writing."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from subjects import SEVEN_JOINTS, seven_joints
from timing import cpu_seconds, medians

from vsacli import Robot, Trajectory, link_torques, load_trajectory
from vsacli.analysis.run import Run
from vsacli.base.outputs import Outputs
from vsacli.base.variables import Block
from vsacli.compute.engine import choose_engine
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.inverse import InverseDynamics, compute_block, usual_block
from vsacli.results.store.writer import ResultWriter
from vsacli.trajectory.times import UniformTimes

VARIABLES = ("tau_motor", "flags")


class Stages(NamedTuple):
    """Processor time a sample of the arm with seven joints, s."""

    sampling: float
    recursion: float
    actuation: float
    bookkeeping: float
    writing: float
    writing_all_variables: float


def trajectory_of(samples: int) -> Trajectory:
    """The motion of the arm at so many samples."""
    shipped = load_trajectory(SEVEN_JOINTS[1], seven_joints())
    times = UniformTimes(shipped.duration, (samples - 1) / shipped.duration)
    return Trajectory(times, shipped.position, shipped.commanded, name=shipped.name)


def split(samples: int, repeats: int, engine: str) -> Stages:
    """Time what ends with each stage over the blocks of one run, in a single thread."""
    robot, trajectory = seven_joints(), trajectory_of(samples)
    of_block = usual_block(len(robot.joints))
    starts = range(0, trajectory.samples, of_block)
    motions = [trajectory.block(start, start + of_block) for start in starts]
    blocks = list(Run(robot, trajectory))
    links = choose_engine(engine, LinkTorques(robot), samples, threads=1).engine
    whole = choose_engine(engine, InverseDynamics(robot), samples, threads=1).engine

    ways = {
        "sample": lambda: _each(trajectory.block(start, start + of_block) for start in starts),
        "recur": lambda: _each(
            link_torques(robot, m.q, m.dq, m.ddq, m.d3q, m.d4q, engine=links) for m in motions
        ),
        "compute": lambda: _each(compute_block(robot, m, engine=whole) for m in motions),
        "run": lambda: _run(Run(robot, trajectory, engine=engine, threads=1)),
        "write": lambda: _write(blocks, robot, trajectory, VARIABLES),
        "write all": lambda: _write(blocks, robot, trajectory),
    }
    taken = medians({name: cpu_seconds(way) for name, way in ways.items()}, repeats)
    each = {name: seconds / samples for name, seconds in taken.items()}
    return Stages(
        sampling=each["sample"],
        recursion=each["recur"],
        actuation=each["compute"] - each["recur"],
        bookkeeping=each["run"] - each["compute"] - each["sample"],
        writing=each["write"],
        writing_all_variables=each["write all"],
    )


def _each(blocks: Iterable[object]) -> None:
    """Have them computed, one after the other, as a run does that keeps none."""
    for _ in blocks:
        pass


def _run(run: Run) -> None:
    _each(run)
    run.report()


def _write(
    blocks: Sequence[Block], robot: Robot, trajectory: Trajectory, variables: Sequence[str] | None = None
) -> None:
    with (
        tempfile.TemporaryDirectory() as folder,
        Outputs() as outputs,
        ResultWriter(outputs.file(Path(folder, "result.h5")), robot, trajectory, variables) as writer,
    ):
        for block in blocks:
            writer.write(block)
        writer.finish({"verdict": "ok", "complete": True})
