"""The state of a simulated robot as one vector."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.base.arrays import AnyArray, FloatArray
from vsacli.control.gains import Integral


class Phase(NamedTuple):
    """Full state, ([samples,] joints) and ([samples,] springs), and the integrals of the errors."""

    q: FloatArray
    dq: FloatArray
    theta: FloatArray
    dtheta: FloatArray
    integral: Integral


class Packing:
    """How a `Phase` lies in a vector.

    Attributes:
        entries: of the vector.
        motor_velocities: places of the velocities of all motors, (motors,).
    """

    def __init__(self, drivetrain: Drivetrain) -> None:
        joints, springs = len(drivetrain.present), int(drivetrain.sprung.sum())
        ends = np.cumsum([joints, joints, springs, springs, joints, joints]).tolist()
        self._parts = [slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True)]
        self.entries: int = ends[-1]
        places: AnyArray = np.arange(self.entries)
        dq, dtheta = places[self._parts[1]], places[self._parts[3]]
        self.motor_velocities = drivetrain.of_all(dq, dtheta)

    def pack(self, q: FloatArray, dq: FloatArray, theta: FloatArray, dtheta: FloatArray) -> FloatArray:
        """The vector of a state at which nothing is integrated yet."""
        nothing = np.zeros_like(q)
        return self.joined(Phase(q, dq, theta, dtheta, Integral(nothing, nothing)))

    def joined(self, phase: Phase) -> FloatArray:
        """The vector of a state."""
        return np.concatenate((*phase[:4], *phase.integral))

    def unpack(self, vector: FloatArray) -> Phase:
        """The parts of vectors (..., entries), as views."""
        q, dq, theta, dtheta, *integral = (vector[..., part] for part in self._parts)
        return Phase(q, dq, theta, dtheta, Integral(*integral))
