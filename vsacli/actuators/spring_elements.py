"""Springs as elements of multibody simulators: deflection and torque of each spring."""

from __future__ import annotations

from typing import NamedTuple

from vsacli.actuators.laws.law import SpringLaw


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
