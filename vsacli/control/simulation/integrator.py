"""Integration of the equations of motion by SciPy, to a boundary or the end of the budget.

A run begins with an explicit method, and changes to an implicit one if that needs too many evaluations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.json_records import Stored
from vsacli.control.simulation.compiled_loop import dop853_with_stages
from vsacli.control.simulation.ending import INCOMPLETE, Deadline, Ending, Progress, SpentError
from vsacli.control.simulation.loop_equations import Edge, LoopEquations
from vsacli.control.simulation.stepping import Event, Pieces, StateSamples, Stop, step_samples
from vsacli.control.simulation.stick_slip import StickSlip, Switch
from vsacli.control.simulation.stiff import difference_jacobian, resolved_tolerances

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


class _MethodEnd(NamedTuple):
    """The end of an integration with one method.

    Attributes:
        last: time of the last sample, s.
        early: early end of the run; None without one.
        sample: state at an early end, which is not among the samples yet; None without one.
    """

    last: float
    early: Ending | None = None
    sample: StateSamples | None = None


class Integrator:
    """Integration by SciPy's methods to a boundary or the end, explicit as long as the budget allows.

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
        equations: LoopEquations,
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
        budget, provenance = self._budget, self.equations.provenance
        return Effort(tuple(self._methods), budget.used, budget.limit, provenance)

    def integrate(self, times: FloatArray, start: FloatArray) -> Pieces:
        """Integrate over times, (samples,); yield those reached with the states there, in pieces.

        If the run ends early, the last time and state are those of its end.
        """
        if not self._methods:
            self._methods.append(Method(EXPLICIT, float(times[0])))
        explicit = self._methods[-1].name == EXPLICIT
        end = yield from (self._integrate_explicitly if explicit else self._integrate_implicitly)(
            times, start
        )
        ending, sample = end.early, end.sample
        if explicit and sample is not None and ending is not None and ending.verdict == INCOMPLETE:
            return (yield from self._continue_implicitly(times, sample))
        if sample is not None:
            yield sample
        return ending

    def _continue_implicitly(self, times: FloatArray, change: StateSamples) -> Pieces:
        """Continue with the implicit method at the end of the explicit one, which is not a sample of its own.

        Only if the budget is too small for the implicit method, the run ends there.
        """
        change_time = float(change.time[0])
        remaining_times = np.concatenate((change.time, times[times > change_time]))
        pieces = self._integrate_implicitly(remaining_times, change.states[0])
        first_samples = next(pieces)
        if len(first_samples.time) > 1:
            yield StateSamples(first_samples.time[1:], first_samples.states[1:])
        end = yield from pieces
        if end.sample is None and end.last == change_time:
            yield change
            return end.early
        self._methods.append(Method(IMPLICIT, change_time))
        if end.sample is not None:
            yield end.sample
        return end.early

    def _integrate_explicitly(
        self, times: FloatArray, start: FloatArray
    ) -> Generator[StateSamples, None, _MethodEnd]:
        method = dop853_with_stages()
        solver = partial(method, self.equations, stages=self.equations.stages, atol=self._tolerances.atol)
        return self._integrate_spans(times, start, self._budget.too_slow, solver, reserve=len(method.C_EXTRA))

    def _integrate_implicitly(
        self, times: FloatArray, start: FloatArray
    ) -> Generator[StateSamples, None, _MethodEnd]:
        jacobian = partial(difference_jacobian, self.equations)
        try:
            smallest_atol = resolved_tolerances(
                jacobian(float(times[0]), start), start, self._tolerances.rtol
            )
        except SpentError:
            yield StateSamples(times[:1], start[None])
            return _MethodEnd(float(times[0]), self._budget.ending(float(times[0])))
        atol = np.maximum(self._tolerances.atol, smallest_atol)
        options: dict[str, Any] = {"jac": jacobian, "atol": atol}  # SciPy's stubs know only scalar tolerances
        solver = partial(scipy.integrate.Radau, self.equations, **options)
        return (yield from self._integrate_spans(times, start, self._budget.is_spent, solver, reserve=0))

    def _integrate_spans(
        self,
        times: FloatArray,
        start: FloatArray,
        is_due: Callable[[float], bool],
        solver: Callable[..., Any],
        reserve: int,
    ) -> Generator[StateSamples, None, _MethodEnd]:
        """Integrate with a method of SciPy from switch to switch; yield at least one sample."""
        deadline = Deadline(self._budget, is_due, float(times[-1]), self._progress)
        events = [deadline, Edge(self.equations), *(self._sliding.switches if self._sliding else ())]
        if self._sliding:  # torques may have changed since the last call
            self._sliding.release_motors(float(times[0]), start)
        first_time, last_time, stop = times[0], math.nan, Stop(float(times[0]), start)
        while True:
            stop = yield from self._integrate_to_event(stop, times, events, solver, reserve)
            if stop.reached:
                last_time = float(times[stop.reached - 1])
            if not isinstance(stop.event, Switch):
                break
            times = times[times.searchsorted(stop.time, "right") :]
            stop = stop._replace(state=stop.event.state_after_switch(stop.time, stop.state), event=None)
            if not times.size:
                break
        if math.isnan(last_time):  # a span of zero length, or a failure of the first step
            last_time = float(first_time)
            yield StateSamples(first_time[None], start[None])
        if self._budget.exhausted:
            return _MethodEnd(last_time, self._budget.ending(last_time))
        if stop.failed:
            return _MethodEnd(last_time, Ending(last_time, "the motion became too fast to integrate"))
        if stop.event is None:
            return _MethodEnd(last_time)
        sample = StateSamples(np.array([stop.time]), stop.state[None])
        return _MethodEnd(last_time, stop.event.ending(stop.time, stop.state), sample)

    def _integrate_to_event(
        self,
        start: Stop,
        times: FloatArray,
        events: Sequence[Event],
        solver: Callable[..., Any],
        reserve: int,
    ) -> Generator[StateSamples, None, Stop]:
        """Integrate from a time and state on to the first event or the last time."""
        max_step = self._sliding.longest_step if self._sliding else math.inf
        tolerance = {"rtol": self._tolerances.rtol, "max_step": max_step}
        try:
            with np.errstate(all="ignore"):
                solver_instance = solver(t0=start.time, y0=start.state, t_bound=float(times[-1]), **tolerance)
        except SpentError:  # the budget is too small even for a first step
            return Stop(start.time, start.state, failed=True)
        return (yield from step_samples(solver_instance, times, events, self._budget, reserve))
