"""How the state of a closed loop goes on, with a controller that acts at every instant, or at samples."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.integrator import Effort, Integrator
from vsacli.control.simulation.sensors import Readings
from vsacli.control.simulation.state_vector import Phase

CUTOFF = 0.1
"""Cut-off frequency of the low-pass, in shares of the sampling rate: a delay of some two samples."""


class RateFilter:
    """Backward differences of joint and motor positions, smoothed by a low-pass of first order.

    Args:
        start: what is read of the first sample, whose velocities are known: the robot rests.
    """

    def __init__(self, start: Phase) -> None:
        self.phase = start

    def add(self, read: Phase, elapsed: float) -> None:
        """Take a sample of the positions, some seconds after the previous one."""
        keep = math.exp(-2 * math.pi * CUTOFF)
        dq, dtheta = (
            keep * rate + (1 - keep) * (new - old) / elapsed
            for rate, new, old in (
                (self.phase.dq, read.q, self.phase.q),
                (self.phase.dtheta, read.theta, self.phase.theta),
            )
        )
        self.phase = read._replace(dq=dq, dtheta=dtheta)


class StateTrajectory(NamedTuple):
    """How a run went: times (samples,), states (samples, entries), torques asked for (samples, motors).

    `held` says whether the torques stay the same from step to step.
    """

    time: FloatArray
    states: FloatArray
    demand: FloatArray
    ending: Ending | None
    effort: Effort
    held: bool = False


def continuous(
    loop: ClosedLoop, integrator: Integrator, times: FloatArray, start: FloatArray
) -> StateTrajectory:
    """The controller acts at every instant, on the true state."""
    time, states, ending = integrator.over(times, start)
    demand = loop.controller.torque(time, loop.packing.unpack(states))
    return StateTrajectory(time, states, demand, ending, integrator.effort)


def sampled(
    loop: ClosedLoop,
    integrator: Integrator,
    times: FloatArray,
    start: FloatArray,
    readings: Readings | None = None,
) -> StateTrajectory:
    """The controller acts at the times, on measured positions, and its torques are held in between.

    What is measured are the readings of sensors, or the true positions.
    """

    def read(state: FloatArray, sample: int) -> Phase:
        truth = loop.packing.unpack(state)
        return truth if readings is None else readings.phase(truth, sample)

    measurement = RateFilter(read(start, 0))
    reached, states, ending = [times[:1]], [start[None]], None
    demands = [loop.controller.torque(float(times[0]), measurement.phase)]
    loop.hold(demands[0])
    for sample, interval in enumerate(np.stack((times[:-1], times[1:]), axis=1), 1):
        time, after, ending = integrator.over(interval, states[-1][-1])
        reached.append(time[1:])
        states.append(after[1:])
        measurement.add(read(after[-1], sample), time[-1] - time[0])
        demands.append(integrator.equations.torques(float(time[-1]), loop.packing.joined(measurement.phase)))
        loop.hold(demands[-1])
        if ending is not None:
            break
    rows = (np.concatenate(reached), np.concatenate(states), np.array(demands)[: sum(map(len, reached))])
    return StateTrajectory(*rows, ending, integrator.effort, held=True)
