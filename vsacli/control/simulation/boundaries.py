"""Boundaries in state space at which a run must end: singularities, and the ends of spring laws."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import reduce

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.flags import Flag
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.ending import Ending

NEARLY_SINGULAR = 1e-4
"""Share of its initial value to which det A of a joint may fall: near zero, the torques of a linearizing
controller are unbounded."""


class Boundary(ABC):
    """A boundary at which a run must end, with the distance of a state to it."""

    reason: str
    flag: Flag
    joints: IndexArray

    def __init__(self, loop: ClosedLoop) -> None:
        self._plant = loop.plant
        self._packing = loop.packing

    @abstractmethod
    def distances(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return a number for each of `joints` that is positive inside, at positions of joints and motors."""

    def distance(self, vector: FloatArray) -> FloatArray:
        """Return the smallest distance, at most 1; an undefined one counts as beyond the boundary."""
        distances = self._distances(vector)
        clipped = np.where(np.isnan(distances), -1.0, np.minimum(distances, 1.0))
        return reduce(np.minimum, np.moveaxis(clipped, -1, 0))

    def ending(self, time: float, vector: FloatArray) -> Ending:
        """Return the end of a run at this time and state."""
        return Ending(time, self.reason, self.flag, int(self.joints[np.argmin(self._distances(vector))]))

    def _distances(self, vector: FloatArray) -> FloatArray:
        phase = self._packing.unpack(vector)
        return self.distances(phase.q, phase.theta)


class Singularity(Boundary):
    """The boundary at which the decoupling matrix A of a joint becomes singular."""

    reason = "its decoupling matrix became singular"
    flag = Flag.SINGULAR

    def __init__(self, loop: ClosedLoop, start: FloatArray) -> None:
        super().__init__(loop)
        self.joints = loop.plant.drivetrain.chosen
        phase = loop.packing.unpack(start)
        self._initial_determinant = self._determinant(phase.q, phase.theta)

    def distances(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return det A as a share of its initial value, minus `NEARLY_SINGULAR`."""
        return self._determinant(q, theta) / self._initial_determinant - NEARLY_SINGULAR

    def _determinant(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        return self._plant.drivetrain.determinant(q, theta)[..., self.joints]


class SpringRange(Boundary):
    """The boundary at which a spring leaves the domain of its law: a tendon goes slack, a table ends."""

    reason = "a spring left the range of its law"
    flag = Flag.INFEASIBLE

    def __init__(self, loop: ClosedLoop) -> None:
        super().__init__(loop)
        self._lowest, self._highest = loop.plant.drivetrain.domain
        self.joints = loop.plant.drivetrain.spring_joint

    def distances(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the deflection that is left to the nearer end of the law."""
        phi = self._plant.drivetrain.ranged(q, theta)
        distances: FloatArray = np.minimum(phi - self._lowest, self._highest - phi)
        return distances


def boundaries(loop: ClosedLoop, start: FloatArray) -> Iterator[Boundary]:
    """Yield the boundaries that a robot can reach; `start` is the initial state vector."""
    drivetrain = loop.plant.drivetrain
    if drivetrain.chosen.size:
        yield Singularity(loop, start)
    if np.isfinite(drivetrain.domain).any():
        yield SpringRange(loop)
