"""The torque of a spring that a lever stretches by its turn: it softens, and has a maximum."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsacli.actuators.laws.state import SpringState
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.documents.fields import POSITIVE, check_fields, number
from vsacli.documents.source import Source


@dataclass(frozen=True)
class Sine:
    """tau = (k/ratio) sin(ratio phi), up to its maximum at ratio phi = pi/2: it softens."""

    k: float = number(units.STIFFNESS, "stiffness at rest", check=POSITIVE)
    ratio: float = number(
        units.DIMENSIONLESS, "angle of the sine over the deflection", check=POSITIVE, default=2.0
    )

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def warnings(self) -> tuple[str, ...]:
        """None."""
        return ()

    @property
    def sources(self) -> tuple[Source, ...]:
        """None."""
        return ()

    @property
    def domain(self) -> tuple[float, float]:
        """Deflections up to the largest torque."""
        end = math.pi / 2 / self.ratio
        return (-end, end)

    @property
    def torque_range(self) -> tuple[float, float]:
        """The largest torque to either side."""
        return (-self.k / self.ratio, self.k / self.ratio)

    def deflection(self, torque: FloatArray) -> FloatArray:
        """The inverse, asin(ratio torque/k)/ratio."""
        return np.arcsin(torque * (self.ratio / self.k)) / self.ratio

    def deflection_at(self, quotient: FloatArray) -> FloatArray:
        """Where torque over stiffness, tan(ratio phi)/ratio, has a value."""
        return np.arctan(self.ratio * quotient) / self.ratio

    def state(self, phi: FloatArray) -> SpringState:
        """Torque and three derivatives."""
        return self.energy_and_state(phi)[1]

    def energy_and_state(self, phi: FloatArray) -> tuple[FloatArray, SpringState]:
        """Energy 2 k/ratio^2 sin^2(ratio phi/2), torque and three derivatives."""
        turn, squared = self.ratio * phi, self.ratio * self.ratio
        half = np.sin(turn / 2)
        tau, sigma = self.k / self.ratio * np.sin(turn), self.k * np.cos(turn)
        energy: FloatArray = 2 * self.k / squared * half * half
        return energy, SpringState(tau, sigma, -squared * tau, -squared * sigma)
