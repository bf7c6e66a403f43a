"""Steps of SciPy's integrators, one at a time: the samples within each, and the event that ends a span.

`solve_ivp` keeps all samples until the end of a run, and its own work in a step exceeds that of compiled
equations of motion. The loop over the steps is therefore here; steps, errors and interpolants are SciPy's.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray
from vsacli.control.simulation.ending import Budget, Ending, SpentError

_ROOT_TOLERANCE = 4 * float(np.finfo(np.float64).eps)
"""Tolerance of the time of an event, absolute and relative: that of `solve_ivp`."""


class Event(Protocol):
    """A distance to a state at which a span ends: when the distance falls to zero."""

    def __call__(self, time: float, vector: FloatArray, /) -> float:
        """Return the distance at a time and state."""


class StateSamples(NamedTuple):
    """Consecutive samples of a run: times, (samples,), s, and states, (samples, entries)."""

    time: FloatArray
    states: FloatArray


class Stop(NamedTuple):
    """The end of a span.

    Attributes:
        time: time reached, s.
        state: state at this time.
        reached: number of samples of the span until then.
        event: event that occurred; None at the last time of the span, or after a failure.
        failed: whether a step failed, or exceeded the budget.
    """

    time: float
    state: FloatArray
    reached: int = 0
    event: Any = None
    failed: bool = False


Pieces = Generator[StateSamples, None, Ending | None]
"""A run in pieces, each of at least one sample; returns the early end of the run, None without one."""


def step_samples(
    solver: Any, times: FloatArray, events: Sequence[Event], budget: Budget, reserve: int
) -> Generator[StateSamples, None, Stop]:
    """Integrate to the first event or the end of the span; yield the samples within each step.

    Args:
        solver: instance of one of SciPy's integrators.
        times: ascending times of the samples within the span, s.
        events: events that end the span.
        budget: budget of evaluations.
        reserve: evaluations for the interpolant of a step, which the step must leave over.
    """
    sampled, distances_after = 0, [event(solver.t, solver.y) for event in events]
    while solver.status == "running":
        with np.errstate(all="ignore"):  # a trial step may leave the range of a law
            if not _take_step(solver, budget, reserve):
                return Stop(solver.t, solver.y, sampled, failed=True)
            distances_before, distances_after = (
                distances_after,
                [event(solver.t, solver.y) for event in events],
            )
            interpolant, stop = None, Stop(solver.t, solver.y)
            distances = zip(events, distances_before, distances_after, strict=True)
            if occurred := [event for event, before, after in distances if before >= 0 >= after]:
                interpolant = solver.dense_output()
                stop = _first_stop(occurred, interpolant, solver)
            first_sample, sampled = sampled, int(times.searchsorted(stop.time, "right"))
            states = (
                None
                if first_sample == sampled
                else (interpolant or solver.dense_output())(times[first_sample:sampled]).T
            )
        if states is not None:  # outside of errstate, which the receiver of the samples must not inherit
            yield StateSamples(times[first_sample:sampled], states)
        if stop.event is not None:
            return stop._replace(reached=sampled)
    return Stop(solver.t, solver.y, sampled)


def _take_step(solver: Any, budget: Budget, reserve: int) -> bool:
    """Take a step; return whether it succeeded within the budget."""
    budget.reserved = reserve
    try:
        solver.step()
    except SpentError:
        return False
    finally:
        budget.reserved = 0
    return bool(solver.status != "failed")


def _first_stop(occurred: Sequence[Event], interpolant: Any, solver: Any) -> Stop:
    """Return the stop at the first of the events that occur within the last step of a solver."""

    def time_of(event: Event) -> float:
        return scipy.optimize.brentq(
            lambda time: event(time, interpolant(time)),
            solver.t_old,
            solver.t,
            xtol=_ROOT_TOLERANCE,
            rtol=_ROOT_TOLERANCE,
        )

    times = [time_of(event) for event in occurred]
    first = times.index(min(times))
    return Stop(times[first], interpolant(times[first]), event=occurred[first])
