"""Faults of the stamps of a recording: gaps, jitter, a unit other than seconds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.units import time_text
from vsacli.documents.time_column import UNITS, unit_of_steps
from vsacli.trajectory.recorded.even_stamps import stamp_resolution
from vsacli.trajectory.recorded.problems import SampleProblem
from vsacli.trajectory.recorded.thresholds import (
    ENOUGH_ROWS,
    GAP_STEPS,
    JITTER_SHARE,
    LONGEST_STEP,
    SHORTEST_STEP,
)


def stamp_faults(stamps: FloatArray) -> Iterator[SampleProblem]:
    """Yield the faults of ascending stamps, (samples,), s."""
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    if len(stamps) >= ENOUGH_ROWS and not SHORTEST_STEP <= usual <= LONGEST_STEP:
        yield SampleProblem("time", _suspect_unit(usual, float(stamps[-1] - stamps[0])))
        return
    long = np.flatnonzero(steps > GAP_STEPS * usual)
    if long.size:
        worst = long[np.argmax(steps[long])]
        gaps = "a gap" if len(long) == 1 else f"{len(long)} gaps, the longest"
        yield SampleProblem(
            "time",
            f"has {gaps} of {step_text(float(steps[worst]))} from t = {time_text(float(stamps[worst]))} on;"
            f" rows are usually {step_text(usual)} apart. Motion and torques meanwhile are a guess of the"
            " spline: cut the recording there, or record again",
            sample=int(worst) + 1,
        )
    jitter = _jitter(stamps, steps, usual)
    if jitter > JITTER_SHARE:
        rate = mean_rate(stamps)
        yield SampleProblem(
            "time",
            f"jitters: steps of about {step_text(1 / rate)} change by {100 * jitter:.2g} % from one to the"
            " next. Where stamps are late, not samples, this is noise of the motion. For torques at equal"
            f" steps, as drives need them, set rate: {rate:g} in a trajectory file",
        )


def mean_rate(stamps: FloatArray) -> float:
    """Return the mean rate of the rows, 1/s, without gaps, in the digits that it is known to."""
    steps = np.diff(stamps)
    return float(f"{1 / np.mean(steps[steps <= GAP_STEPS * np.median(steps)]):.3g}")


def step_text(step: float) -> str:
    """Return the text of a short time with a suitable unit."""
    size, unit = (step, "s") if step >= 1 else (1e3 * step, "ms") if step >= 9.9e-4 else (1e6 * step, "us")
    return f"{size:.3g} {unit}"


def _suspect_unit(usual: float, duration: float) -> str:
    rows = f"rows are {usual:.4g} s apart, and the recording lasts {float(f'{duration:.4g}'):g} s"
    unit = unit_of_steps(usual)
    if unit is None:
        return f"is hardly in seconds: {rows}; write its unit in the header, e.g. time[ms]"
    apart = step_text(usual * UNITS[unit])
    return f"looks like {unit}: {rows}; if rows are {apart} apart, write time[{unit}] in the header"


def _jitter(stamps: FloatArray, steps: FloatArray, usual: float) -> float:
    """Return the median change of successive intervals, in intervals, beyond that due to their resolution."""
    if len(steps) < 2:
        return 0.0
    change = float(np.median(np.abs(np.diff(steps))))
    return max(0.0, change - 2 * stamp_resolution(stamps)) / usual
