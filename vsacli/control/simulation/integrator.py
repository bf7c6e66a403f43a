"""Integration of a closed loop over the steps of a trajectory; what a controller with encoders measures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.control.simulation.boundaries import Boundary
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.state_vector import Phase

CUTOFF = 0.1
"""Cut-off frequency of the low-pass, in shares of the sampling rate: a delay of some two samples."""


class RateFilter:
    """Backward differences of joint and motor positions, smoothed by a low-pass of first order.

    Args:
        start: the state at the first sample, whose velocities are known: the robot rests.
    """

    def __init__(self, start: Phase) -> None:
        self.phase = start

    def add(self, truth: Phase, elapsed: float) -> None:
        """Take a sample of the positions, some seconds after the previous one."""
        keep = math.exp(-2 * math.pi * CUTOFF)
        dq, dtheta = (
            keep * rate + (1 - keep) * (new - old) / elapsed
            for rate, new, old in (
                (self.phase.dq, truth.q, self.phase.q),
                (self.phase.dtheta, truth.theta, self.phase.theta),
            )
        )
        self.phase = truth._replace(dq=dq, dtheta=dtheta)


METHOD: Literal["DOP853"] = "DOP853"
"""Explicit, of order 8: motors and links oscillate on their springs, but nothing is stiff."""

Derivative = Callable[[float, FloatArray], FloatArray]
Progress = Callable[[float], None]
"""Called with the time reached, s."""


SMALLEST_RTOL = 1e-13
"""Below, rounding alone exceeds the bound."""


@dataclass(frozen=True)
class Tolerances:
    """Bounds on the local error of a step: relative, and absolute in the units of the state."""

    rtol: float = 1e-9
    atol: float = 1e-10

    def __post_init__(self) -> None:
        if not (SMALLEST_RTOL <= self.rtol < 1 and 0 < self.atol < 1):
            raise InputError.one(
                f"the tolerances must be positive and below 1, the relative one at least {SMALLEST_RTOL:g}, "
                f"not {self.rtol:g} (relative) and {self.atol:g} (absolute)"
            )


class StateTrajectory(NamedTuple):
    """How a run went: times (samples,), states (samples, entries), torques asked for (samples, motors).

    `held` says whether the torques stay the same from step to step.
    """

    time: FloatArray
    states: FloatArray
    demand: FloatArray
    ending: Ending | None
    evaluations: int
    held: bool = False


class Integrator:
    """`solve_ivp` with boundaries at which a run ends.

    Attributes:
        evaluations: of the equations of motion, so far.
    """

    def __init__(self, boundaries: Sequence[Boundary], tolerances: Tolerances, progress: Progress) -> None:
        self._boundaries = boundaries
        self._tolerances = tolerances
        self._progress = progress
        self.evaluations = 0

    def over(
        self, derivative: Derivative, times: FloatArray, start: FloatArray
    ) -> tuple[FloatArray, FloatArray, Ending | None]:
        """States at the times (samples,) reached, and one more where the run ended early."""
        from scipy.integrate import solve_ivp

        events: list[Any] = [self._noted, *self._boundaries]
        with np.errstate(all="ignore"):  # a trial step may leave the range of a law
            solution: Any = solve_ivp(
                derivative,
                (float(times[0]), float(times[-1])),
                start,
                method=METHOD,
                t_eval=times,
                events=events,
                rtol=self._tolerances.rtol,
                atol=self._tolerances.atol,
            )
        self.evaluations += solution.nfev
        # Over no time at all, and where the first step fails, `solve_ivp` returns no states.
        reached, states = (solution.t, solution.y.T) if len(solution.t) else (times[:1], start[None])
        if solution.status < 0:
            reason = "the motion became too fast to integrate"
            return reached, states, Ending(float(reached[-1]), reason)
        for boundary, hits, where in zip(
            self._boundaries, solution.t_events[1:], solution.y_events[1:], strict=True
        ):
            if len(hits):
                ending = boundary.ending(float(hits[-1]), where[-1])
                return np.append(reached, hits[-1:]), np.concatenate((states, where[-1:])), ending
        return reached, states, None

    def _noted(self, time: float, _vector: FloatArray) -> float:
        """No event: called at each step, it passes the time on."""
        self._progress(time)
        return 1.0


def continuous(
    loop: ClosedLoop, integrator: Integrator, times: FloatArray, start: FloatArray
) -> StateTrajectory:
    """The controller acts at every instant, on the true state."""
    time, states, ending = integrator.over(loop.derivative, times, start)
    demand = loop.controller.torque(time, loop.packing.unpack(states))
    return StateTrajectory(time, states, demand, ending, integrator.evaluations)


def sampled(
    loop: ClosedLoop, integrator: Integrator, times: FloatArray, start: FloatArray
) -> StateTrajectory:
    """The controller acts at the times, on measured positions, and its torques are held in between."""
    measurement = RateFilter(loop.packing.unpack(start))
    reached, states, ending = [times[:1]], [start[None]], None
    demands = [loop.controller.torque(float(times[0]), measurement.phase)]
    for interval in np.stack((times[:-1], times[1:]), axis=1):
        held = partial(loop.derivative_under, demands[-1])
        time, after, ending = integrator.over(held, interval, states[-1][-1])
        reached.append(time[1:])
        states.append(after[1:])
        measurement.add(loop.packing.unpack(after[-1]), time[-1] - time[0])
        demands.append(loop.controller.torque(float(time[-1]), measurement.phase))
        if ending is not None:
            break
    rows = (np.concatenate(reached), np.concatenate(states), np.array(demands)[: sum(map(len, reached))])
    return StateTrajectory(*rows, ending, integrator.evaluations, held=True)
