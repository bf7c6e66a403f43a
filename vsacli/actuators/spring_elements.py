"""Springs of a joint as a whole, and as elements of multibody simulators."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringLaw, SpringRecord
from vsacli.base.arrays import BoolArray, FloatArray


class SpringElement(NamedTuple):
    """A spring whose deflection is a weighted sum of positions; its torques have the same weights.

    Attributes:
        law: Law of the spring.
        joint: Weight of the position of the joint.
        motors: Weight of the position of each motor.
    """

    law: SpringLaw
    joint: float
    motors: tuple[float, ...]


class LeverSpring(NamedTuple):
    """A linear spring from a lever that motor 1 rotates to a point of the link, tightened by motor 2.

    Its elongation is the distance of both ends minus its minimum, plus the pretension.

    Attributes:
        lever: Length of the lever, m.
        arm: Distance from the axis to the point of the link, m.
        stiffness: N/m.
        lead: Pretension per position of motor 2, m/rad.
    """

    lever: float
    arm: float
    stiffness: float
    lead: float


class SpringAssembly(SpringRecord):
    """The springs between the motors and the link of a joint: their elements, and branches of solutions."""

    @property
    def spring_elements(self) -> tuple[SpringElement, ...] | None:
        """Springs whose deflections are weighted sums of positions; None if there are others."""
        return None

    @property
    def lever_spring(self) -> LeverSpring | None:
        """Spring between a lever and a point of the link, if it is the only spring; else None."""
        return None

    @property
    def opposite_branch(self) -> str | None:
        """The other value of the branch field; None if there is no other branch."""
        return None

    def other_branch(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> BoolArray:  # noqa: ARG002
        """Return where the stiffness is attainable on another branch, (samples,)."""
        return np.zeros(tau_e.shape, dtype=bool)
