"""Springs that only pull: slack at zero deflection, and pulling the other way on side 2."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.mirrored import Mirrored


@dataclass(frozen=True)
class Tendon(SpringLaw):
    """A law for phi >= 0; on side 2 it acts as tau_2(phi) = -tau(-phi) for phi <= 0."""

    @property
    def domain(self) -> tuple[float, float]:
        """From slack upward."""
        return (0.0, math.inf)

    @property
    def torque_range(self) -> tuple[float, float]:
        """From slack upward."""
        return (0.0, math.inf)

    @property
    def pulls_only(self) -> bool:
        """A tendon cannot push."""
        return True

    def as_second(self) -> SpringLaw:
        """The tendon pulling downward."""
        return Mirrored(law=self)
