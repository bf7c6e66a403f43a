"""Early ends of a run, and the budget of evaluations of the equations of motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag
from vsacli.base.texts import counted
from vsacli.base.units import time_text

DIVERGED = "diverged"
INCOMPLETE = "incomplete"


@dataclass(frozen=True)
class Ending:
    """The early end of a run.

    Attributes:
        time: time of the end, s.
        reason: reason of the end, as part of a sentence.
        flag: flag set at the last sample of the joint that caused the end; None without such a joint.
        joint: index of this joint; None without one.
        verdict: verdict on the run, unless a flag implies one.
    """

    time: float
    reason: str
    flag: Flag | None = None
    joint: int | None = None
    verdict: str = DIVERGED

    def as_sentence(self, joint_names: Sequence[str], start: float) -> str:
        """Return a sentence on the end; `start` is the stamp of time zero, s."""
        joint_prefix = "" if self.joint is None else f"{joint_names[self.joint]}: "
        suffix = "" if self.time > 0 else ", before the first step"
        return f"{joint_prefix}{self.reason}; ended at t = {time_text(start + self.time)}{suffix}"


LEAST_DEFAULT = 200_000
"""Smallest default budget, in evaluations: a second for an arm of three joints, half a minute without a
recorded program. Runs of the bundled examples take 20,000 at most."""

DEFAULT_PER_STEP = 100
"""Default evaluations per sample of a trajectory, if that is more: sampled control takes 17."""

TRIAL = 0.05
"""Share of the budget after which the pace so far is extrapolated to the whole run: fast transients at the
start take less, 5000 evaluations with poles of -20/s."""

EXPLICIT_SHARE = 0.5
"""Share of the budget for the explicit method. The rest is for the implicit method, which takes tens of
thousands of evaluations where it is needed; half of 100 per sample is enough for sampled control."""

Derivative = Callable[[float, FloatArray], FloatArray]
"""Function that returns time derivatives, (..., entries), of state vectors, (..., entries), at a time."""

Progress = Callable[[float], None]
"""Function called with the time reached, s."""


class SpentError(Exception):
    """The budget does not allow an evaluation; raised inside the integration, which then ends the run."""


class Budget:
    """A budget of evaluations of the equations of motion.

    Args:
        limit: number of evaluations after which a run ends; None for the default.
        times: sample times of the trajectory, s.

    Attributes:
        limit: number of evaluations after which a run ends.
        used: evaluations so far, at most `limit`.
        reserved: evaluations that a step must leave over for its interpolant.
        exhausted: whether an evaluation was refused.

    Raises:
        InputError: the limit is below 1.
    """

    def __init__(self, limit: int | None, times: FloatArray) -> None:
        if limit is not None and limit < 1:
            raise InputError.one(f"the budget must be at least 1, not {limit}")
        self.limit = max(LEAST_DEFAULT, DEFAULT_PER_STEP * len(times)) if limit is None else limit
        self.used, self.reserved, self.exhausted = 0, 0, False
        self._first, self._last = float(times[0]), float(times[-1])

    def check(self, evaluations: int) -> None:
        """Raise an error if so many further evaluations would exceed the limit.

        Raises:
            SpentError: they would.
        """
        if self.used + evaluations > self.limit - self.reserved:
            self.exhausted = True
            raise SpentError

    def ending(self, time: float) -> Ending:
        """Return the end of a run at a time, s, at which the budget is used up."""
        reason = f"the budget of {counted(self.limit, 'evaluation')} of the equations of motion is used up"
        return Ending(time, reason, verdict=INCOMPLETE)

    def is_spent(self, _time: float) -> bool:
        """Return whether the budget is used up."""
        return self.used >= self.limit

    def too_slow(self, time: float) -> bool:
        """Return whether a run that continues at this rate exceeds the limit of the explicit method."""
        # Both sides are multiplied by the time elapsed, which may be zero.
        projected = self.used * (self._last - self._first)
        share = EXPLICIT_SHARE * self.limit
        return self.used > TRIAL * self.limit and projected > share * (time - self._first)


class Deadline:
    """An event at the end of the step in which the budget is used up.

    It is called at each step, and reports the progress.

    Args:
        budget: budget of the run.
        is_due: function that returns whether to stop at a time, s.
        last: time at which the run ends regularly, s.
        progress: function called with the time reached, s.

    Attributes:
        time: time of the event, s; infinite until it occurs.
    """

    def __init__(
        self, budget: Budget, is_due: Callable[[float], bool], last: float, progress: Progress
    ) -> None:
        self._budget = budget
        self._is_due, self._last, self._progress = is_due, last, progress
        self.time = math.inf

    def __call__(self, time: float, _vector: FloatArray) -> float:
        """Return the time left, s, at most 1; zero at the event."""
        self._progress(time)
        if math.isinf(self.time) and time < self._last and self._is_due(time):
            self.time = time
        return min(self.time - time, 1.0)

    def ending(self, time: float, _vector: FloatArray) -> Ending:
        """Return the end of a run at this time."""
        return self._budget.ending(time)
