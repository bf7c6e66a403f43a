"""The row of a run: what is kept of it, or why it could not be computed."""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np

from vsacli.analysis.run import Run
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.texts import one_line
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.model import Robot
from vsacli.studies.sweeps.kept import columns
from vsacli.studies.sweeps.over_time import Recorder
from vsacli.studies.sweeps.study import ChangedError, Point, Study
from vsacli.trajectory.changes import Divided
from vsacli.trajectory.devices import with_devices
from vsacli.trajectory.file import declared_trajectory
from vsacli.trajectory.trajectory import Trajectory

FAILED = "failed"
"""In place of the verdict of a run that could not be computed."""

IMPOSSIBLE = "impossible"
"""In place of the verdict of a run for which no feasible optimum was found."""

LOST = "the process that computed it"
"""How the error of a run begins that was lost with its process."""


class Row(NamedTuple):
    """What is known of a run.

    Attributes:
        run: its number.
        key: of all that it depends on.
        verdict: of its report, or `FAILED`, or `IMPOSSIBLE`.
        error: the reason of the latter two, else empty.
        values: costs of the optimum, if one was looked for, and what is kept, (columns,); empty if there is
            nothing of which they could be.
        curves: what is kept over time, flat; see `Recorder`.
    """

    run: int
    key: str
    verdict: str
    error: str
    values: FloatArray
    curves: FloatArray

    @property
    def lost(self) -> bool:
        """Whether it went with the process that computed it, so that another trial may do."""
        return self.error.startswith(LOST)


def failed(run: int, key: str, reason: str) -> Row:
    """The row of a run that could not be computed."""
    return _without_values(run, key, FAILED, reason)


def _without_values(run: int, key: str, verdict: str, reason: str) -> Row:
    return Row(run, key, verdict, one_line(reason), np.empty(0), np.empty(0))


def lost(study: Study, run: int, how: str) -> Row:
    """The row of a run whose process has ended."""
    return failed(run, study.key(study.point(run)), f"{LOST} {how}")


class Computer:
    """Computes runs of a study, one after the other.

    What is the same in consecutive runs is read once: the trajectory, as long as neither it nor who it is
    for changes.
    """

    def __init__(self, study: Study) -> None:
        self._study = study
        self._read: tuple[tuple[int, str], CommandedJoints, Trajectory] | None = None

    def row(self, run: int) -> Row:
        """The row of a run; no error of the run is raised.

        Raises:
            ChangedError: a file is not what it was.
        """
        point = self._study.point(run)
        key = self._study.key(point)
        try:
            return self._computed(run, key, point)
        except ChangedError:
            raise
        except InputError as error:
            self._study.check_files()
            return failed(run, key, str(self._study.as_named(error)))
        except Exception as error:  # one run must not cost the others
            return failed(run, key, f"a bug, please report it: {type(error).__name__}: {error}")

    def _computed(self, run: int, key: str, point: Point) -> Row:
        changes = point.changes
        robot = self._study.read.robot(changes.robot)
        if robot.joint_names != self._study.robot.joint_names:
            raise InputError.one(
                "joints have other names than in the robot file, so that rows would not compare"
            )
        trajectory = with_devices(self._trajectory(robot, point.trajectory, changes), robot)
        self._study.check_read([*robot.sources, *trajectory.sources])
        costs, optimise = list[FloatArray](), self._study.file.optimize
        if optimise is not None:
            optimum = optimise.optimum(robot, trajectory)
            if optimum.trajectory is None:
                return _without_values(run, key, IMPOSSIBLE, "; ".join(optimum.reasons))
            trajectory, costs = optimum.trajectory, [cost.values(optimum) for cost in self._study.costs]
        computed = Run(robot, trajectory, engine=self._study.engine, threads=1)
        recorder = Recorder(self._study.over_time, self._study.file.every)
        for block in computed:
            recorder.add(block)
        report = computed.report()
        values = np.concatenate([*costs, columns(self._study.kept, report)])
        return Row(run, key, report.verdict, "", values, recorder.curves)

    def _trajectory(self, robot: Robot, index: int, changes: Divided) -> Trajectory:
        place, joints = (index, json.dumps(changes.trajectory)), CommandedJoints.of(robot)
        if self._read is None or self._read[:2] != (place, joints):
            declared = declared_trajectory(self._study.trajectories[index], robot, changes.trajectory)
            self._read = (place, joints, declared)
        return self._read[2]
