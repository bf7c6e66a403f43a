"""What every spring law offers: torque over deflection, three derivatives, and the inverse."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from vsacli.arrays import FloatArray
from vsacli.spec.fields import POSITIVE_OR_INFINITE, check_fields, number
from vsacli.springs.pair import Pair
from vsacli.units import POSITION


@dataclass(frozen=True)
class SpringLaw(ABC):
    """Torque tau(phi) of a transmission, strictly increasing in the deflection phi on its domain.

    The methods take and return arrays of any one shape; phi in rad (m), torque in N m (N).
    """

    max_deflection: float = number(
        POSITION,
        "largest admissible |deflection|; a limit that is flagged, not the end of the law",
        check=POSITIVE_OR_INFINITE,
        default=math.inf,
        compare=False,
    )

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def domain(self) -> tuple[float, float]:
        """Deflections for which the law holds."""
        return (-math.inf, math.inf)

    @property
    def torque_range(self) -> tuple[float, float]:
        """Torques at the ends of the domain."""
        return (-math.inf, math.inf)

    @property
    def hardening_peak(self) -> tuple[float, float]:
        """Torques between which the relative hardening zeta/sigma still increases with the torque."""
        return (-math.inf, math.inf)

    def closed_pair(self, other: SpringLaw) -> Pair | None:  # noqa: ARG002
        """The pair of this law (side 1) with another (side 2), if (14) has a closed solution for them."""
        return None

    def hardening(self, phi: FloatArray) -> FloatArray:
        """Relative hardening rho = zeta/sigma."""
        return self.slope(phi) / self.stiffness(phi)

    @abstractmethod
    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque tau(phi), (62)."""

    @abstractmethod
    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Stiffness sigma = dtau/dphi, (63)."""

    @abstractmethod
    def slope(self, phi: FloatArray) -> FloatArray:
        """Slope zeta = dsigma/dphi, (64)."""

    @abstractmethod
    def curvature(self, phi: FloatArray) -> FloatArray:
        """Curvature eta = dzeta/dphi, (66)."""

    @abstractmethod
    def deflection(self, torque: FloatArray) -> FloatArray:
        """Deflection phi with tau(phi) = torque: the inverse of `torque`."""
