"""What is wrong with columns of a record: what stops a fit, and what makes it doubtful."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.units import time_text
from vsacli.robot.model import Robot
from vsacli.studies.identification.record_columns import TORQUE, Column
from vsacli.trajectory.recorded.faults import wraps
from vsacli.trajectory.recorded.grain import Grain
from vsacli.trajectory.recorded.health import column_faults
from vsacli.trajectory.recorded.stamps import stamp_faults, step_text
from vsacli.trajectory.recorded.thresholds import GAP_STEPS, LARGEST_ANGLE, LARGEST_TRAVEL

NOISY = 1e-7
"""Noise of a torque, over its range, from which on equal readings are no motion at rest."""

CUT_SAMPLES = 10
"""Readings at the very largest value from which on they are no accident."""

CUT_SHARE = 5.0
"""The same, over those at the next value below: 2.4 at the crest of a sine in steps, without noise."""


def stopping_faults(columns: Sequence[Column], robot: Robot) -> Iterator[str]:
    """Sentences on what nothing can be fitted with."""
    for column in columns:
        yield from _gap(column)
        if column.place[0] != TORQUE:
            yield from _position_faults(column, robot.joints[column.place[1]].is_revolute)
    for index, joint in enumerate(robot.joints):
        own = [column for column in columns if column.place[1] == index]
        still = [column for column in own if np.ptp(column.values) == 0]
        if len(still) < len(own):
            moving = next(column.name for column in own if column not in still)
            for column in still:
                yield (
                    f"column {column.name!r} is {column.values[0]:.6g} throughout, while {moving!r} changes: "
                    "a sensor that is not connected, or a column that was not filled in"
                )
        elif own:
            yield f"joint {joint.name} does not move, and tells nothing: leave its columns out"


def _gap(column: Column) -> Iterator[str]:
    steps = np.diff(column.time)
    usual, longest = float(np.median(steps)), int(np.argmax(steps))
    if steps[longest] > GAP_STEPS * usual:
        yield (
            f"column {column.name!r} has a gap of {step_text(float(steps[longest]))} from t = "
            f"{time_text(float(column.time[longest]))} on, where rows are {step_text(usual)} apart: cut the "
            "file there and give both parts as records"
        )


def _position_faults(column: Column, turns: bool) -> Iterator[str]:
    largest = float(np.max(np.abs(column.values)))
    jumps = wraps(column.values) if turns else None
    if jumps is not None:
        when = time_text(float(column.time[jumps.at]))
        yield f"column {column.name!r} jumps by 2 pi at t = {when}, a wrapped angle: unwrap it"
    elif not column.has_unit and largest > (LARGEST_ANGLE if turns else LARGEST_TRAVEL):
        wrong, right = ("deg", "rad") if turns else ("mm", "m")
        yield (
            f"column {column.name!r} goes to {largest:.4g} {right}; is it in {wrong}? Write [{wrong}] after "
            f"its name in the header, or [{right}] if it is right"
        )


def doubts(columns: Sequence[Column]) -> Iterator[str]:
    """Sentences on what makes a fit doubtful."""
    for fault in stamp_faults(columns[0].time):
        yield f"time {fault.message}"
    for column in columns:
        for _, sentence in column_faults(column.time, column.time, column.values):
            yield f"column {column.name!r} {sentence}"
        if column.place[0] == TORQUE:
            yield from _cut(column)


def _cut(column: Column) -> Iterator[str]:
    """Noisy readings that come to an end at the same largest, or smallest, value again and again."""
    grain = Grain.of(column.time, column.values)
    if not np.median(grain.noise) > NOISY * np.ptp(column.values):
        return
    for end, values in ((np.max, column.values), (np.min, column.values)):
        at = values == end(values)
        rest = values[~at]
        beside = int(np.count_nonzero(rest == end(rest))) if rest.size else 1
        if at.sum() >= max(CUT_SAMPLES, CUT_SHARE * beside):
            when = time_text(float(column.time[np.argmax(at)]))
            yield (
                f"column {column.name!r} is cut off at {end(values):.4g}, {at.sum()} times, first at {when}"
                ": the drive or the sensor goes no further; leave that part out, or move with less torque"
            )
