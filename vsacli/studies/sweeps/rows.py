"""The row of a run: its kept values, or the reason why there are none; and tasks of several runs.

Another process, here or on another machine, computes a task; it reads the study again from its `Job`.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np

from vsacli.analysis.batch import Batch
from vsacli.analysis.variant_groups import PreparedRun, batches
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.texts import one_line
from vsacli.documents.reading import format_changes
from vsacli.dynamics.variants import Variants
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.model import Robot
from vsacli.studies.sweeps.columns import Recorder, first_limit, scalars
from vsacli.studies.sweeps.study import ChangedError, Point, Study, load_study
from vsacli.trajectory.changes import ChangesByFile
from vsacli.trajectory.devices import set_uncommanded_dampers
from vsacli.trajectory.file import declared_trajectory
from vsacli.trajectory.trajectory import Trajectory

FAILED = "failed"
"""Verdict of a run that could not be computed."""

IMPOSSIBLE = "impossible"
"""Verdict of a run without a feasible optimum."""

LOST = "the process that computed it"
"""Prefix of the error of a run that was lost with its process."""


class Row(NamedTuple):
    """The row of a run.

    Attributes:
        run: number of the run.
        key: digest of everything that the row depends on.
        verdict: verdict of the report, `FAILED` or `IMPOSSIBLE`.
        first_limit: joint and limit that the run exceeds first, see `first_limit`; empty if none.
        error: reason for `FAILED` or `IMPOSSIBLE`; otherwise empty.
        values: costs of the optimum, if there is one, and the kept columns, (columns,); empty without a
            report.
        curves: columns over time, flat; see `Recorder`.
    """

    run: int
    key: str
    verdict: str
    first_limit: str
    error: str
    values: FloatArray
    curves: FloatArray

    @property
    def lost(self) -> bool:
        """Whether the run was lost with its process, so that another attempt may succeed."""
        return self.error.startswith(LOST)


def failed(run: int, key: str, reason: str, verdict: str = FAILED) -> Row:
    """Return the row of a run that could not be computed, or has no feasible optimum."""
    return Row(run, key, verdict, "", one_line(reason), np.empty(0), np.empty(0))


def lost(study: Study, run: int, how: str) -> Row:
    """Return the row of a run whose process has ended."""
    return failed(run, study.key(study.point(run)), f"{LOST} {how}")


class _Prepared(NamedTuple):
    """A run that is ready to be computed.

    Attributes:
        run: number of the run.
        key: digest of everything that the row depends on.
        inputs: robot and trajectory.
        costs: costs of the optimum, if the trajectory is one.
    """

    run: int
    key: str
    inputs: PreparedRun
    costs: Sequence[FloatArray]


class Computer:
    """Computation of the runs of a study, those that differ in numbers alone together.

    A trajectory is read again only if it, or the robot's joints, differ from those of the previous run. Read
    for each run, 300 runs of a 3R take 3 times as long; computed one by one, 11 times.
    """

    def __init__(self, study: Study) -> None:
        self._study = study
        self._latest_trajectory: tuple[tuple[int, str], CommandedJoints, Trajectory] | None = None

    def rows(self, runs: Sequence[int]) -> Iterator[Row]:
        """Yield the rows of runs; errors of a run become part of its row.

        Raises:
            ChangedError: a file of the study has changed.
        """
        batch_size = self._study.runs_of_batch
        for first in range(0, len(runs), batch_size):
            prepared = list[_Prepared]()
            for run in runs[first : first + batch_size]:
                prepared_or_row = self._prepare(run)
                if isinstance(prepared_or_row, Row):
                    yield prepared_or_row
                else:
                    prepared.append(prepared_or_row)
            for variants, members in batches(
                [each.inputs for each in prepared], self._study.varied_parameters
            ):
                yield from self._batch_rows(variants, [prepared[index] for index in members])

    def _prepare(self, run: int) -> _Prepared | Row:
        point = self._study.point(run)
        key = self._study.key(point)
        try:
            return self._inputs(run, key, point)
        except Exception as error:  # one run must not cost the others
            return self._failed_row(run, key, error)

    def _failed_row(self, run: int, key: str, error: Exception) -> Row:
        """Return the row of a run that an error ended.

        Raises:
            ChangedError: a file of the study has changed.
        """
        if isinstance(error, ChangedError):
            raise error
        if isinstance(error, InputError):
            self._study.check_files()
            return failed(run, key, str(self._study.as_named(error)))
        values = "; ".join(format_changes(self._study.point(run).values))
        bug = f"a bug, please report it: {type(error).__name__}: {error}"
        return failed(run, key, f"{bug}{f' ({values})' if values else ''}")

    def _inputs(self, run: int, key: str, point: Point) -> _Prepared | Row:
        changes = point.changes
        robot = self._study.read.robot(changes.robot)
        if robot.joint_names != self._study.robot.joint_names:
            raise InputError.one(
                "joints have other names than in the robot file, so that rows would not compare"
            )
        trajectory = set_uncommanded_dampers(self._trajectory(robot, point.trajectory, changes), robot)
        self._study.check_read([*robot.sources, *trajectory.sources])
        costs, optimize = list[FloatArray](), self._study.file.optimize
        if optimize is not None:
            optimum = optimize.optimum(robot, trajectory)
            if optimum.trajectory is None:
                return failed(run, key, "; ".join(optimum.reasons), IMPOSSIBLE)
            trajectory, costs = optimum.trajectory, optimize.costs_of(optimum)
        return _Prepared(run, key, PreparedRun(robot, trajectory), costs)

    def _batch_rows(self, variants: Variants, prepared: Sequence[_Prepared]) -> list[Row]:
        """Return the rows of a batch; if it fails, each run is computed alone."""
        try:
            return self._compute_batch(variants, prepared)
        except Exception as error:
            if len(prepared) == 1:
                return [self._failed_row(prepared[0].run, prepared[0].key, error)]
        rows = list[Row]()
        for robot, run in zip(variants.robots, prepared, strict=True):
            rows += self._batch_rows(replace(variants, robots=(robot,)), [run])
        return rows

    def _compute_batch(self, variants: Variants, prepared: Sequence[_Prepared]) -> list[Row]:
        trajectories = [each.inputs.trajectory for each in prepared]
        study = self._study
        batch = Batch(
            variants,
            trajectories,
            engine=study.engine,
            threads=1,
            kernel_samples=study.samples_of_kernel if study.runs_of_batch > 1 else None,
        )
        recorders = [Recorder(study.over_time, study.file.every) for _ in prepared]
        for block in batch:
            for recorder, part in zip(recorders, block.divided(len(prepared)), strict=True):
                recorder.add(part)
        reports = map(batch.findings, range(len(prepared)))
        return [
            Row(
                run,
                key,
                report.verdict,
                first_limit(report),
                "",
                np.concatenate([*costs, scalars(study.kept, report)]),
                recorder.curves,
            )
            for (run, key, _, costs), report, recorder in zip(prepared, reports, recorders, strict=True)
        ]

    def _trajectory(self, robot: Robot, index: int, changes: ChangesByFile) -> Trajectory:
        trajectory_key, joints = (index, json.dumps(changes.trajectory)), CommandedJoints.of(robot)
        if self._latest_trajectory is None or self._latest_trajectory[:2] != (trajectory_key, joints):
            declared = declared_trajectory(self._study.trajectories[index], robot, changes.trajectory)
            self._latest_trajectory = (trajectory_key, joints, declared)
        return self._latest_trajectory[2]


class Job(NamedTuple):
    """A description of a study by which another process, perhaps on another machine, reads it again.

    Attributes:
        path: absolute path of the study file.
        engine: name of the engine.
        computed_by: names and versions of the software that rows depend on.
        fingerprint: fingerprint of the study.
    """

    path: str
    engine: str
    computed_by: tuple[tuple[str, str], ...]
    fingerprint: str

    @classmethod
    def of(cls, study: Study) -> Self:
        """Return the job of a study."""
        path = os.path.abspath(study.source.path)
        return cls(path, study.engine, tuple(study.computed_by.items()), study.fingerprint)

    def study(self) -> Study:
        """Read the study in this process.

        Raises:
            InputError: the study cannot be read here, versions differ, or a file has another content here.
        """
        study = load_study(self.path, self.engine)
        differences = [
            f"{name} is {local_version or 'missing'} instead of {job_version or 'none'}"
            for (name, job_version), local_version in zip(
                self.computed_by, study.computed_by.values(), strict=True
            )
            if local_version != job_version
        ]
        if differences:
            raise InputError.one(f"other rows would be computed here: {', '.join(differences)}")
        if study.fingerprint != self.fingerprint:
            raise InputError.one(
                "a file of the study is another one here, or was changed meanwhile; run it again", self.path
            )
        return study


class Answer(NamedTuple):
    """The result of a task: its duration, s, and the rows of its runs, or the problems that prevent them."""

    seconds: float
    rows: tuple[Row, ...] = ()
    problems: tuple[Problem, ...] = ()


def answer(job: Job, runs: Sequence[int]) -> Answer:
    """Compute the rows of runs in this process."""
    try:
        computer = _computer(job, threading.get_ident())
        begin = time.perf_counter()
        rows = tuple(computer.rows(runs))
    except InputError as error:
        return Answer(0.0, problems=error.problems)
    return Answer(time.perf_counter() - begin, rows)


@lru_cache(maxsize=4)
def _computer(job: Job, _thread: int) -> Computer:
    """Return the computer of a thread, cached for its next tasks; threads do not share one."""
    return Computer(job.study())
