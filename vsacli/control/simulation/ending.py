"""Why a run ends before its time, and how many evaluations of the equations of motion it may take."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag
from vsacli.base.units import time_text

DIVERGED = "diverged"
INCOMPLETE = "incomplete"


@dataclass(frozen=True)
class Ending:
    """Why a run ended early.

    Attributes:
        time: when, s.
        reason: of the end, as part of a sentence.
        flag: of the last sample of the joint to blame.
        joint: its index; None, like the flag, if there is none.
        verdict: on a run that ends so, unless a flag says it.
    """

    time: float
    reason: str
    flag: Flag | None = None
    joint: int | None = None
    verdict: str = DIVERGED

    def described(self, joint_names: Sequence[str], first: float) -> str:
        """Return the end as a sentence; `first` is the stamp of time zero, s."""
        place = "" if self.joint is None else f"{joint_names[self.joint]}: "
        return f"{place}{self.reason}; ended at t = {time_text(first + self.time)}"


LEAST_DEFAULT = 200_000
"""Evaluations: a second for an arm of three joints, half a minute without a program. Runs of the shipped
files take 20,000 at most."""

DEFAULT_PER_STEP = 100
"""Evaluations for each step of a trajectory, where that is more: sampled control takes 17."""

TRIAL = 0.05
"""Share of the budget after which the pace so far is taken for that of the whole run: a start with fast
transients takes less, 5000 evaluations with poles of -20/s."""

EXPLICIT_SHARE = 0.5
"""Share of the budget that a run may take explicitly. The implicit method, which takes ten thousands where
it is called for, gets the rest; half of 100 a step is enough for sampled control."""

Derivative = Callable[[float, FloatArray], FloatArray]
"""Time derivatives (..., entries) of state vectors (..., entries) at a time."""

Progress = Callable[[float], None]
"""Called with the time reached, s."""


class Budget:
    """Counts evaluations of the equations of motion.

    Args:
        limit: after how many a run ends; None for the default.
        times: of the steps of the trajectory, s.

    Attributes:
        limit: the same, or the default.
        used: evaluations so far.

    Raises:
        InputError: a limit below 1.
    """

    def __init__(self, limit: int | None, times: FloatArray) -> None:
        if limit is not None and limit < 1:
            raise InputError.one(f"the budget must be at least 1 evaluation, not {limit}")
        self.limit = max(LEAST_DEFAULT, DEFAULT_PER_STEP * len(times)) if limit is None else limit
        self.used = 0
        self._first, self._last = float(times[0]), float(times[-1])

    def spent(self, _time: float) -> bool:
        """Return whether nothing is left."""
        return self.used >= self.limit

    def too_slow(self, time: float) -> bool:
        """Return whether a run that goes on at this rate exceeds the limit of explicit steps."""
        projected = self.used * (self._last - self._first)  # times the part of it that is done
        share = EXPLICIT_SHARE * self.limit
        return self.used > TRIAL * self.limit and projected > share * (time - self._first)


class Deadline:
    """The event of `solve_ivp` at the end of the first step after which a run is to stop.

    It is called at each step, and passes the time on.

    Args:
        limit: the budget, to be named.
        is_due: whether to stop at a time, s.
        last: where the run ends anyway, s.
        progress: called with the time reached, s.

    Attributes:
        time: of that end, s; infinite until it has come.
    """

    terminal = True
    direction = -1.0

    def __init__(self, limit: int, is_due: Callable[[float], bool], last: float, progress: Progress) -> None:
        self._limit = limit
        self._is_due, self._last, self._progress = is_due, last, progress
        self.time = math.inf

    def __call__(self, time: float, _vector: FloatArray) -> float:
        """Time left, zero at the end of that step."""
        self._progress(time)
        if math.isinf(self.time) and time < self._last and self._is_due(time):
            self.time = time
        return min(self.time - time, 1.0)

    def ending(self, time: float, _vector: FloatArray) -> Ending:
        """Return the end of a run here."""
        reason = f"the budget of {self._limit} evaluations of the equations of motion is used up"
        return Ending(time, reason, verdict=INCOMPLETE)
