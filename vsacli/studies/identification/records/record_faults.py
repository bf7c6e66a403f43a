"""What is wrong with columns of a record: what stops a fit, and what makes it doubtful."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from vsacli.base.units import time_text
from vsacli.base.variables import VARIABLES
from vsacli.robot.model import Robot
from vsacli.studies.identification.records.record_columns import TORQUE, Column
from vsacli.trajectory.recorded.faults import wraps
from vsacli.trajectory.recorded.grain import Grain
from vsacli.trajectory.recorded.health import column_faults
from vsacli.trajectory.recorded.stamps import stamp_faults, step_text
from vsacli.trajectory.recorded.thresholds import (
    GAP_STEPS,
    LARGEST_ANGLE,
    LARGEST_TRAVEL,
    LONGEST_STEP,
    SHORTEST_STEP,
)

FEWEST_SAMPLES = 200
"""Numbers of a column that are worth a fit: some seconds at 50 Hz."""

NOISY = 1e-7
"""Noise of a torque, over its range, from which on equal readings are no motion at rest."""

CUT_SAMPLES = 10
"""Readings at the very largest value from which on they are no accident."""

CUT_SHARE = 5.0
"""The same, over those at the next value below: 2.4 at the crest of a sine in steps, without noise."""


def stopping_faults(columns: Sequence[Column], robot: Robot) -> Iterator[str]:
    """Sentences on what nothing can be fitted with."""
    yield from _together((column.name, clause) for column in columns for clause in _stamp_clauses(column))
    yield from _together(
        (column.name, clause)
        for column in columns
        if column.place[0] != TORQUE
        for clause in _position_clauses(column, robot)
    )
    for index, joint in enumerate(robot.joints):
        yield from _still([column for column in columns if column.place[1] == index], joint.name)


def doubts(columns: Sequence[Column]) -> Iterator[str]:
    """Sentences on what makes a fit doubtful."""
    yield from _together((column.name, clause) for column in columns for clause in _doubtful_clauses(column))


def _together(clauses: Iterable[tuple[str, str]]) -> Iterator[str]:
    """A sentence for each clause that columns share."""
    shared: dict[str, list[str]] = {}
    for name, clause in clauses:
        shared.setdefault(clause, []).append(name)
    for clause, (first, *others) in shared.items():
        beside = f", as {len(others)} more," if others else ""
        yield f"column {first!r}{beside} {clause}"


def _stamp_clauses(column: Column) -> Iterator[str]:
    if len(column.time) < FEWEST_SAMPLES:
        yield f"has {len(column.time)} numbers; a fit needs {FEWEST_SAMPLES} at least"
        return
    steps = np.diff(column.time)
    usual, longest = float(np.median(steps)), int(np.argmax(steps))
    if not SHORTEST_STEP <= usual <= LONGEST_STEP:
        yield from (f"has a time that {fault.message}" for fault in stamp_faults(column.time))
    elif steps[longest] > GAP_STEPS * usual:
        when = time_text(float(column.time[longest]))
        yield (
            f"has a gap of {step_text(float(steps[longest]))} from t = {when} on, where rows are "
            f"{step_text(usual)} apart: cut the file there and give both parts as records"
        )


def _position_clauses(column: Column, robot: Robot) -> Iterator[str]:
    _, index, motor = column.place
    turns = robot.joints[index].is_revolute
    follows = motor is None or robot.joints[index].actuator.has(VARIABLES["phi"])[motor - 1]
    largest = float(np.max(np.abs(column.values), initial=0.0))
    jumps = wraps(column.values) if turns else None
    if jumps is not None:
        when = time_text(float(column.time[jumps.at]))
        yield f"jumps by 2 pi at t = {when}, a wrapped angle: unwrap it"
    elif follows and not column.has_unit and largest > (LARGEST_ANGLE if turns else LARGEST_TRAVEL):
        wrong, right = ("deg", "rad") if turns else ("mm", "m")
        yield (
            f"goes to {largest:.4g} {right}; is it in {wrong}? Write [{wrong}] after its name in the header, "
            f"or [{right}] if it is right"
        )


def _still(columns: Sequence[Column], joint: str) -> Iterator[str]:
    """Columns of a joint that stand still: all of them, or while others move."""
    still = [column for column in columns if len(column.values) and np.ptp(column.values) == 0]
    moving = [column for column in columns if column not in still]
    if still and not moving:
        yield f"joint {joint} does not move, and tells nothing: leave its columns out"
        return
    for column in still:
        yield (
            f"column {column.name!r} is {column.values[0]:.6g} throughout, while {moving[0].name!r} changes: "
            "a sensor that is not connected, or a column that was not filled in"
        )


def _doubtful_clauses(column: Column) -> Iterator[str]:
    is_torque = column.place[0] == TORQUE
    inner = slice(1, -1) if is_torque else slice(None)  # dry friction jumps where a motion begins and ends
    time, values = column.time[inner], column.values[inner]
    yield from (clause for _, clause in column_faults(time, time, values))
    if is_torque:
        yield from _cut(column)


def _cut(column: Column) -> Iterator[str]:
    """Noisy readings that come to an end at the same largest, or smallest, value again and again."""
    grain = Grain.of(column.time, column.values)
    if not np.median(grain.noise) > NOISY * np.ptp(column.values):
        return
    for end in (np.max, np.min):
        last = end(column.values)
        at = column.values == last
        rest = column.values[~at]
        beside = int(np.count_nonzero(rest == end(rest)))
        if at.sum() >= max(CUT_SAMPLES, CUT_SHARE * beside):
            when = time_text(float(column.time[np.argmax(at)]))
            yield (
                f"is cut off at {last:.4g}, {at.sum()} times, first at t = {when}: the drive or the sensor "
                "goes no further; leave that part out, or move with less torque"
            )
