"""Confirmation of motions: a run of each, and a grid between its samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsacli.analysis.batch import Batch
from vsacli.analysis.joint_report import JointReport
from vsacli.analysis.report import Report
from vsacli.analysis.variant_groups import PreparedRun
from vsacli.base.arrays import FloatArray, evenly
from vsacli.dynamics.inverse import usual_block
from vsacli.dynamics.variants import Variants
from vsacli.studies.search.acceptance import Acceptance
from vsacli.studies.search.fix_report import Fix
from vsacli.studies.search.loads import TaskSamples

REFUSED = ("infeasible", "singular", "over_limit")
"""Verdicts that a fix must remove. Unreliable is not among them: no fix makes a recording less uncertain."""

FINER = 10
"""Subdivisions of each sampling interval when a motion is checked between its samples."""

MOST_INSTANTS = 300_000
"""Largest number of instants in this check: the intervals of longer motions get fewer subdivisions."""

MOST_REFUSED = 1000
"""Largest number of refused instants that this check returns."""


class Verification(NamedTuple):
    """The outcome of the run of a motion.

    Attributes:
        joints: findings of the run at each joint.
        refused: instants at which it misses the margin or a limit, as times since the start of the unchanged
            task, s: the worst ones of the run, also between samples, and those of a grid `FINER` times as
            fine; none if only the self-check fails. None if the motion is confirmed.
    """

    joints: Sequence[JointReport]
    refused: FloatArray | None


def verify(acceptance: Acceptance, run: PreparedRun, factor: float = 1.0) -> Verification:
    """Run a motion, and check it by a rule.

    Args:
        acceptance: acceptance rule.
        run: robot and motion.
        factor: factor by which the motion is stretched, compared with the unchanged task.
    """
    batch = Batch(Variants.of_one(run.robot), [run.trajectory], min_margin=acceptance.min_margin)
    for _ in batch:
        pass
    report = batch.findings()
    return Verification(report.joints, _refused_instants(acceptance, run, factor, report))


def _refused_instants(
    acceptance: Acceptance, run: PreparedRun, factor: float, report: Report
) -> FloatArray | None:
    """Return `Verification.refused` of a run with its report."""
    joints = [report.joints[index] for index in acceptance.counted]
    times = [worst.time for tool in report.tools for worst in tool.worst.values()]
    for joint in joints:
        if joint.margin < acceptance.min_margin or any(map(joint.shows, REFUSED)):
            findings = (*joint.worst.values(), *joint.between.values())
            times += [joint.margin_time, *(finding.time for finding in findings)]
    between = _refused_between(acceptance, run, factor)
    if report.self_check.passed and not times and not between.size:
        return None
    elapsed = (np.array(times) - run.trajectory.start) / factor
    return np.union1d(elapsed[np.isfinite(elapsed)], between)


def _refused_between(acceptance: Acceptance, run: PreparedRun, factor: float) -> FloatArray:
    """Return up to `MOST_REFUSED` refused instants between the samples of a motion, s.

    With the worst instants of the run alone, 7 of 44 fixes of random tasks miss the margin on this grid.
    """
    robot, trajectory = run
    # the allowance for the noise of a recording is known at samples only; the run checks between them
    if not trajectory.known_between or trajectory.estimates:
        return np.empty(0)
    acceptance = replace(acceptance, robot=robot, between=np.empty(0))
    steps = (trajectory.times.block(0, trajectory.samples) - trajectory.start) / factor
    parts = max(1, min(FINER, MOST_INSTANTS // len(steps)))
    elapsed = (steps[:-1, None] + np.diff(steps)[:, None] * np.arange(1, parts) / parts).ravel()
    refused = np.concatenate(
        [
            part[acceptance.refused(TaskSamples.between(trajectory, part, factor)).any(axis=1)]
            for part in np.array_split(elapsed, 1 + len(elapsed) // usual_block(trajectory.joints))
        ]
    )
    return refused[evenly(len(refused), MOST_REFUSED)]


def verify_fixes(acceptance: Acceptance, fixes: Sequence[Fix]) -> Iterator[tuple[Fix, FloatArray | None]]:
    """Yield fixes with the findings of their runs, and the instants that refuse them; see `Verification`."""
    for fix in fixes:
        joints, refused = verify(acceptance, PreparedRun(fix.robot, fix.trajectory), 1 + fix.longer)
        yield replace(fix, joints=joints), refused
