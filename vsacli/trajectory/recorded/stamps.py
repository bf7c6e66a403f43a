"""What is wrong with the stamps of a recording: gaps, jitter, another unit than seconds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.units import time_text
from vsacli.trajectory.recorded.arrays import SampleProblem
from vsacli.trajectory.recorded.thresholds import (
    ENOUGH_ROWS,
    GAP_STEPS,
    JITTER_SHARE,
    LONGEST_STEP,
    SHORTEST_STEP,
    USUAL_STEPS,
)

UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}

MOST_DECIMALS = 9


def stamp_faults(stamps: FloatArray) -> Iterator[SampleProblem]:
    """What of stamps, (samples,) in s and ascending, is hardly meant, in sentences."""
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    if len(stamps) >= ENOUGH_ROWS and not SHORTEST_STEP <= usual <= LONGEST_STEP:
        yield SampleProblem("time", _of_another_unit(usual, float(stamps[-1] - stamps[0])))
        return
    long = np.flatnonzero(steps > GAP_STEPS * usual)
    if long.size:
        worst = long[np.argmax(steps[long])]
        message = (
            f"has {_count(len(long), 'gap')}, the longest of {step_text(float(steps[worst]))} from t ="
            f" {time_text(float(stamps[worst]))} on, where rows are usually {step_text(usual)} apart; what the"
            " motion and torques are meanwhile is a guess of the spline: cut the recording there, or record again"
        )
        yield SampleProblem("time", message, sample=int(worst) + 1)
    jitter = _jitter(stamps, steps, usual)
    if jitter > JITTER_SHARE:
        whole = float(f"{1 / usual:.3g}")
        yield SampleProblem(
            "time",
            f"jitters: steps change by {100 * jitter:.2g} % from one to the next, around {step_text(usual)}. If"
            " the sensor samples evenly and the stamps are late, this is noise of the motion; for equal steps"
            f" of torques, as drives need them, set rate: {whole:g} in a trajectory file",
        )


def step_text(step: float) -> str:
    """A short time in its unit."""
    size, unit = (step, "s") if step >= 1 else (1e3 * step, "ms") if step >= 1e-3 else (1e6 * step, "us")
    return f"{size:.4g} {unit}"


def _count(count: int, word: str) -> str:
    return f"1 {word}" if count == 1 else f"{count} {word}s"


def _of_another_unit(usual: float, duration: float) -> str:
    rows = f"rows are {usual:.4g} s apart, and the recording lasts {duration:.4g} s"
    low, high = USUAL_STEPS
    for unit, factor in UNITS.items():
        if low <= usual * factor <= high:
            return (
                f"looks like {unit}: {rows}; write time[{unit}] in the header if it is one of"
                f" {step_text(usual * factor)} steps"
            )
    return f"is hardly in seconds: {rows}; write its unit in the header, e.g. time[ms]"


def _jitter(stamps: FloatArray, steps: FloatArray, usual: float) -> float:
    """Median change from step to step, in steps, beyond what digits that were cut off explain."""
    if len(steps) < 2:
        return 0.0
    change = float(np.median(np.abs(np.diff(steps))))
    return max(0.0, change - 2 * _resolution(stamps)) / usual


def _resolution(stamps: FloatArray) -> float:
    """The last digit of stamps, s: of their decimals, or of their floating-point numbers."""
    few = stamps[:: max(1, len(stamps) // 1000)]
    rounding = float(np.spacing(np.abs(stamps).max()))
    for decimals in range(MOST_DECIMALS + 1):
        if np.abs(few - np.round(few, decimals)).max() <= 2 * rounding:
            return max(10.0**-decimals, rounding)
    return rounding
