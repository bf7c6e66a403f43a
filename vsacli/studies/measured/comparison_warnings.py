"""Warnings of a comparison: reasons why its figures may mean nothing.

A linear fit and a time offset are found for almost any two smooth motions, so that a recording of another
robot or of another motion is compared without an error. These checks say so at the top of the report.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FLAG_TYPE
from vsacli.base.flags import Flag, has_flag
from vsacli.base.texts import counted
from vsacli.results.store.reader import StoredResult
from vsacli.studies.measured.agreement import Agreement
from vsacli.studies.measured.likely_causes import mistaken

LARGE_ERROR = 0.5
"""Rms error relative to the rms computed value above which a signal does not fit. Feedback-controlled robots
with a poor friction model stay below it in positions, so that fewer than half of their signals exceed it."""

SHORT_OVERLAP = 0.1
"""Share of the duration of the result below which the overlap is short."""

INVALID = Flag.INFEASIBLE | Flag.SINGULAR | Flag.NOT_FINITE
"""Flags of samples without motor torques."""

WITHOUT_TORQUES = ("infeasible", "singular")
"""Verdicts on results that have such samples."""


class Overlap(NamedTuple):
    """The common part of a recording and a result.

    Attributes:
        duration: duration, s.
        rows: number of rows of the recording.
        whole: duration of the result, s.
    """

    duration: float
    rows: int
    whole: float


def comparison_warnings(
    result: StoredResult,
    stranger: str,
    signals: Sequence[Agreement],
    gear_ratios: Sequence[float],
    overlap: Overlap,
) -> Iterator[str]:
    """Yield the warnings of a comparison, the most serious first.

    Args:
        result: compared result.
        stranger: sentence on joints of the recording that the result does not have; otherwise empty.
        signals: agreement of each column.
        gear_ratios: gear ratio of the motor of each signal; NaN without a motor, or if unknown.
        overlap: common part of recording and result.
    """
    if stranger:
        yield stranger
    yield from _poor_fit(signals, gear_ratios)
    if overlap.duration < SHORT_OVERLAP * overlap.whole:
        rows = counted(overlap.rows, "row")
        yield f"only {overlap.duration:.3g} s ({rows}) of {overlap.whole:.4g} s overlap"
    if result.verdict in WITHOUT_TORQUES:
        yield f"{result.path} is {result.verdict}{_lost_torques(result)}; its motors are not compared there"


def _poor_fit(signals: Sequence[Agreement], gear_ratios: Sequence[float]) -> Iterator[str]:
    """Yield a warning if most signals differ much from the result, without a likely mistake as the cause."""
    known = [
        (signal, ratio)
        for signal, ratio in zip(signals, gear_ratios, strict=True)
        if math.isfinite(signal.share) and signal.still != "computed"
    ]
    off = [signal for signal, ratio in known if signal.share > LARGE_ERROR and not mistaken(signal, ratio)]
    if 2 * len(off) <= len(known):
        return
    worst = max(off, key=lambda signal: signal.share)
    columns = f"{len(off)} of {counted(len(known), 'column')} {'differs' if len(off) == 1 else 'differ'}"
    yield (
        f"the recording does not fit the result: {columns} by more than {100 * LARGE_ERROR:g} % "
        f"({worst.column} by {100 * worst.share:.4g} %); is it the recording of another robot or motion?"
    )


def _lost_torques(result: StoredResult) -> str:
    """Return at how many samples motor torques are missing, if the result has flags; otherwise ""."""
    if "flags" not in result.variables:
        return ""
    flags = np.asarray(result.read("flags"), dtype=FLAG_TYPE)
    missing = np.any(has_flag(flags, INVALID), axis=1)
    return f" at {np.count_nonzero(missing)} of {counted(len(missing), 'sample')}"
