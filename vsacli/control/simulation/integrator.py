"""Integration of the equations of motion by SciPy, to a boundary or the end of the budget.

A run begins with an explicit method, and changes to an implicit one if that needs too many evaluations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.json_records import Stored
from vsacli.control.simulation.compiled_loop import dop853_with_stages
from vsacli.control.simulation.ending import INCOMPLETE, Deadline, Ending, Progress, SpentError, stopping
from vsacli.control.simulation.loop_equations import Edge, Equations
from vsacli.control.simulation.stick_slip import StickSlip, Switch
from vsacli.control.simulation.stiff import jacobian, resolved

EXPLICIT = "DOP853"
"""Method of order 8: motors and links oscillate on their springs, and most robots are not stiff."""

IMPLICIT = "Radau"
"""L-stable method of order 5: very stiff springs and fast poles do not shorten its steps.

With a joint of 1e9 N m/rad it was a hundred times as accurate as BDF and LSODA at the same tolerances, and
with one of 1e6 it took a tenth of their evaluations, since they are not stable for oscillations.
"""

SMALLEST_RTOL = 1e-13
"""Smallest relative tolerance; rounding alone exceeds a smaller one."""

LARGEST_TOLERANCE = 1e-3
"""Largest tolerance; with it, the example of the paper ends 4e-4 rad off, with 0.1 it deviated by 0.3 rad."""


@dataclass(frozen=True)
class Tolerances:
    """Bounds on the local error of a step: relative, and absolute in the units of the state."""

    rtol: float = 1e-9
    atol: float = 1e-10

    def __post_init__(self) -> None:
        if not SMALLEST_RTOL <= self.rtol <= LARGEST_TOLERANCE:
            bounds = f"from {SMALLEST_RTOL:g} to {LARGEST_TOLERANCE:g}"
            raise InputError.one(f"the relative tolerance must be {bounds}, not {self.rtol:g}")
        if not 0 < self.atol <= LARGEST_TOLERANCE:
            bounds = f"above 0 and at most {LARGEST_TOLERANCE:g}"
            raise InputError.one(f"the absolute tolerance must be {bounds}, not {self.atol:g}")


@dataclass(frozen=True)
class Method(Stored):
    """A method of integration: its name in SciPy, and the time from which on it was used, s."""

    name: str
    start: float

    shape: ClassVar = {"name": "name", "from": "start"}


class Effort(NamedTuple):
    """The effort of a run: methods, evaluations of the equations of motion, and their budget.

    The provenance names the backend: `engine`, `compiler` and `threads`.
    """

    methods: tuple[Method, ...]
    evaluations: int
    budget: int
    provenance: Mapping[str, str]


class Integrator:
    """Integration by `solve_ivp` with boundaries at which a run ends, explicit as long as the budget allows.

    Args:
        equations: equations of motion, with their boundaries.
        tolerances: bounds on the local error of a step.
        progress: function called with the time reached, s.
        sliding: stick and slip of motors with sharp friction, whose switches change the equations of motion.

    Attributes:
        equations: equations of motion, with their boundaries.
    """

    def __init__(
        self,
        equations: Equations,
        tolerances: Tolerances,
        progress: Progress,
        sliding: StickSlip | None = None,
    ) -> None:
        self.equations, self._sliding = equations, sliding
        self._tolerances = tolerances
        self._progress = progress
        self._budget = equations.budget
        self._methods: list[Method] = []

    @property
    def effort(self) -> Effort:
        """Effort of the run so far."""
        budget, by = self._budget, self.equations.provenance
        return Effort(tuple(self._methods), budget.used, budget.limit, by)

    def over(self, times: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray, Ending | None]:
        """Integrate over times, (samples,); return those reached, the states there, and an early end if any.

        If the run ends early, the last time and state are those of its end.
        """
        if not self._methods:
            self._methods.append(Method(EXPLICIT, float(times[0])))
        if self._methods[-1].name == IMPLICIT:
            return self._implicit(times, start)
        reached, states, ending = self._explicit(times, start)
        if ending is None or ending.verdict != INCOMPLETE or self._budget.exhausted:
            return reached, states, ending
        change = ending.time
        rest = np.concatenate((reached[-1:], times[times > change]))
        later, after, ending = self._implicit(rest, states[-1])
        if len(later) == 1:  # the budget is too small for the implicit method
            return reached, states, ending
        self._methods.append(Method(IMPLICIT, change))
        return np.append(reached[:-1], later[1:]), np.concatenate((states[:-1], after[1:])), ending

    def _explicit(self, times: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray, Ending | None]:
        method = dop853_with_stages()
        within = stopping(method, self._budget, reserve=len(method.C_EXTRA))
        steps: dict[str, Any] = {"method": within, "stages": self.equations.stages}
        return self._solve(times, start, self._budget.too_slow, atol=self._tolerances.atol, **steps)

    def _implicit(self, times: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray, Ending | None]:
        from scipy.integrate import Radau

        slope = partial(jacobian, self.equations)
        try:
            floor = resolved(slope(float(times[0]), start), start, self._tolerances.rtol)
        except SpentError:
            return times[:1], start[None], self._budget.ending(float(times[0]))
        atol = np.maximum(self._tolerances.atol, floor)
        within = stopping(Radau, self._budget, reserve=0)
        return self._solve(times, start, self._budget.spent, method=within, atol=atol, jac=slope)

    def _solve(
        self,
        times: FloatArray,
        start: FloatArray,
        is_due: Callable[[float], bool],
        **options: Any,
    ) -> tuple[FloatArray, FloatArray, Ending | None]:
        deadline = Deadline(self._budget, is_due, float(times[-1]), self._progress)
        events = [deadline, Edge(self.equations), *(self._sliding.switches if self._sliding else ())]
        if self._sliding:  # torques may have changed since the last call
            self._sliding.settle(float(times[0]), start)
        first, at, state, parts = times[:1], float(times[0]), start, []
        while True:
            solution = self._until_event((at, times), state, events, options)
            parts.append(_evaluated(solution, start))
            event, at, state = _terminal_event(events, solution)
            if not isinstance(event, Switch):
                break
            state, times = event.passed(at, state), times[times > at]
            if not times.size:
                event = None
                break
        reached, states = (np.concatenate(each) for each in zip(*parts, strict=True))
        if not len(reached):  # a span of zero length, or a failure of the first step
            reached, states = first, start[None]
        if self._budget.exhausted:
            return reached, states, self._budget.ending(float(reached[-1]))
        if solution.status < 0:
            reason = "the motion became too fast to integrate"
            return reached, states, Ending(float(reached[-1]), reason)
        if event is None:
            return reached, states, None
        return np.append(reached, at), np.concatenate((states, state[None])), event.ending(at, state)

    def _until_event(
        self,
        span: tuple[float, FloatArray],
        start: FloatArray,
        events: Sequence[Any],
        options: Mapping[str, Any],
    ) -> Any:
        """Return a solution from a time on, at further times, up to the first event or the last time.

        It is empty if the budget is too small even for a first step.
        """
        from scipy.integrate import solve_ivp

        time, times = span
        none: list[Any] = [()] * len(events)
        empty = SimpleNamespace(t=(), t_events=none, y_events=none, status=-1)
        with np.errstate(all="ignore"), suppress(SpentError):  # a trial step may leave the range of a law
            return solve_ivp(
                self.equations,
                (time, float(times[-1])),
                start,
                t_eval=times,
                events=events,
                rtol=self._tolerances.rtol,
                max_step=self._sliding.longest_step if self._sliding else math.inf,
                **options,
            )
        return empty


def _evaluated(solution: Any, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return times and states, (times, entries), of a solution, which may have none."""
    if not len(solution.t):
        return np.empty(0), np.empty((0, len(start)))
    return solution.t, solution.y.T


def _terminal_event(events: Sequence[Any], solution: Any) -> tuple[Any, float, FloatArray]:
    """Return the event that ended a solution, its time and state; the event is None if there was none."""
    for event, times, states in zip(events, solution.t_events, solution.y_events, strict=True):
        if len(times):
            return event, float(times[-1]), states[-1]
    return None, math.nan, np.empty(0)
