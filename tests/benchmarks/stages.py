"""A whole run taken apart: sampling the trajectory, computing, writing."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

from subjects import SEVEN_JOINTS, seven_joints
from timing import medians

from vsacli import load_trajectory
from vsacli.actuation import Drive, drive
from vsacli.newton_euler import link_torques
from vsacli.pipeline import BLOCK_SAMPLES, Run
from vsacli.steps import command_of, elastic_torques
from vsacli.store.writer import ResultWriter
from vsacli.times import UniformTimes
from vsacli.trajectory import Trajectory

VARIABLES = ("tau_motor", "flags")


class Stages(NamedTuple):
    """Seconds a sample of the arm with seven joints."""

    sampling: float
    recursion: float
    actuation: float
    bookkeeping: float
    writing: float

    @property
    def computing(self) -> float:
        """From the motion to variables and report."""
        return self.recursion + self.actuation + self.bookkeeping


def trajectory_of(samples: int) -> Trajectory:
    """The motion of the arm at so many samples."""
    shipped = load_trajectory(SEVEN_JOINTS[1], seven_joints())
    times = UniformTimes(shipped.duration, (samples - 1) / shipped.duration)
    return Trajectory(times, shipped.position, shipped.stiffness, name=shipped.name)


def split(samples: int, repeats: int) -> Stages:
    """Time each stage by itself over the blocks of one run."""
    robot, trajectory = seven_joints(), trajectory_of(samples)
    starts = range(0, trajectory.samples, BLOCK_SAMPLES)
    motions = [trajectory.block(start, start + BLOCK_SAMPLES) for start in starts]
    commands = [{**motion.variables(), **elastic_torques(robot, motion)} for motion in motions]
    blocks = list(Run(robot, trajectory))

    def sample() -> None:
        for start in starts:
            trajectory.block(start, start + BLOCK_SAMPLES)

    def recur() -> None:
        for motion in motions:
            link_torques(robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q)

    def actuate() -> list[Drive]:
        return [
            drive(joint, command_of(index, command))
            for command in commands
            for index, joint in enumerate(robot.joints)
        ]

    def run() -> None:
        walk = Run(robot, trajectory)
        for _ in walk:
            pass
        walk.report()

    def write() -> None:
        with (
            tempfile.TemporaryDirectory() as folder,
            ResultWriter(Path(folder, "result.h5"), robot, trajectory, VARIABLES) as writer,
        ):
            for block in blocks:
                writer.write(block)
            writer.finish({"verdict": "ok", "complete": True})

    taken = medians(
        {"sampling": sample, "recursion": recur, "actuation": actuate, "run": run, "writing": write}, repeats
    )
    rest = taken["run"] - taken["sampling"] - taken["recursion"] - taken["actuation"]
    each = {name: seconds / samples for name, seconds in {**taken, "bookkeeping": rest}.items()}
    return Stages(**{name: each[name] for name in Stages._fields})
