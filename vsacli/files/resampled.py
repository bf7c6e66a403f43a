"""A result at another rate: computed again, since samples are not interpolated.

A trajectory that is a function of time, rather than a list of steps, can be computed at any times. Its result
holds everything that this takes.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from vsacli.analysis.run import Run
from vsacli.base.errors import InputError
from vsacli.base.outputs import Staged
from vsacli.base.storage import temporary_folder
from vsacli.files.repetition import rebuilt
from vsacli.results.exports.sample_rate import check_rate, stride_of
from vsacli.results.store.reader import StoredResult
from vsacli.results.store.writer import ResultWriter
from vsacli.robot.model import Robot
from vsacli.trajectory.times import MAX_STEPS, RecordedTimes
from vsacli.trajectory.trajectory import Trajectory

ROUNDING = 1e-9
"""Share of a period by which the last one may be too short."""


@contextmanager
def at_rate(result: StoredResult, rate: float) -> Iterator[StoredResult]:
    """The result itself if every n-th of its steps makes the rate, or nothing does; else computed again.

    Args:
        result: an open result of `vsacli invdyn`.
        rate: samples per second, Hz.

    Raises:
        InputError: the rate is not positive or gives too many samples, the stored times are damaged, or the
            inputs that the result holds cannot be used.
    """
    check_rate(rate)
    samples = float(result.time[-1] - result.time[0]) * rate
    if samples > MAX_STEPS:
        message = f"the rate {rate:.9g} Hz gives {samples:.4g} samples; at most {MAX_STEPS:.0e} are possible"
        raise InputError.one(message, result.path)
    again = None if _takes_every_nth(result, rate) else _function_of_time(result)
    if again is None:
        yield result
        return
    robot, trajectory = again[0], _sampled(again[1], rate)
    options: dict[str, Any] = result.provenance()["options"]
    run = Run(robot, trajectory, **options)
    with temporary_folder() as place:
        staged = Staged.unnamed(place / "result.h5")
        with ResultWriter(staged, robot, trajectory) as writer:
            for block in run:
                writer.write(block)
            writer.finish(run.report().as_json())
        with StoredResult.open(staged.temporary) as resampled:
            yield resampled


def _takes_every_nth(result: StoredResult, rate: float) -> bool:
    try:
        stride_of(result, rate)
    except InputError:
        return False
    return True


def _function_of_time(result: StoredResult) -> tuple[Robot, Trajectory] | None:
    """Robot and trajectory of a result, if its steps are not all that is known of the motion."""
    if result.kind != StoredResult.kind:
        return None
    try:
        robot, trajectory = rebuilt(result)
    except InputError:
        return None  # the export says what is wrong with the rate
    return (robot, trajectory) if trajectory.known_between and not trajectory.estimates else None


def _sampled(trajectory: Trajectory, rate: float) -> Trajectory:
    """The trajectory at whole periods of a rate; if its end is none, up to the last one before."""
    periods = int(trajectory.duration * rate + ROUNDING)
    time = trajectory.start + np.arange(periods + 1) / rate
    return trajectory.sampled(RecordedTimes(np.minimum(time, trajectory.times.span[1])))
