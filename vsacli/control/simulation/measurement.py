"""Velocities from sampled positions, as a controller with encoders alone has them (III-C)."""

from __future__ import annotations

import math

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
