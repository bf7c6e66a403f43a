"""What every spring law offers: torque over deflection, three derivatives, energy, and the inverse."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from vsacli.actuators.laws.pair import Pair
from vsacli.actuators.laws.state import SpringState
from vsacli.base.arrays import FloatArray
from vsacli.base.units import POSITION
from vsacli.compute.control_flow import subroutine
from vsacli.documents.fields import POSITIVE_OR_INFINITE, check_fields, number
from vsacli.documents.source import Source


def alike(number: float, other: float) -> bool:
    """Whether two numbers of springs are one, also where it is a symbol, known when a program runs."""
    return number is other or number == other


@dataclass(frozen=True)
class SpringLaw(ABC):
    """Torque tau(phi) of a transmission: zero at zero, strictly increasing, hardening away from zero.

    So sigma > 0 on the domain, and zeta has the sign of phi. The methods take and return arrays of any one
    shape; phi in rad (m), torque in N m (N).
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
    def pulls_only(self) -> bool:
        """Whether the spring is a tendon, which goes slack at zero deflection instead of pushing."""
        return False

    @property
    def warnings(self) -> tuple[str, ...]:
        """How far the law may be from the spring it describes, one sentence each."""
        return ()

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files that the law was read from."""
        return ()

    @property
    def is_linear(self) -> bool:
        """Whether the stiffness is the same at every deflection."""
        return False

    @property
    def polynomial(self) -> tuple[float, ...] | None:
        """Coefficients of phi, phi^2, ... if the torque is a polynomial on the domain; None if it is none."""
        return None

    def as_second(self) -> SpringLaw:
        """The law as it acts on side 2, where a tendon pulls the other way."""
        return self

    def closed_pair(self, other: SpringLaw) -> Pair | None:  # noqa: ARG002
        """The pair of this law (side 1) with another (side 2), if (14) has a closed solution for them."""
        return None

    def hardening(self, phi: FloatArray) -> FloatArray:
        """Relative hardening rho = zeta/sigma."""
        return self.slope(phi) / self.stiffness(phi)

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Torque and its derivatives up to an order, 3 at most; for laws in which they share work."""
        methods = (self.torque, self.stiffness, self.slope, self.curvature)
        return tuple(method(phi) for method in methods[: order + 1])

    def state(self, phi: FloatArray) -> SpringState:
        """State of the spring at deflections."""
        return SpringState(*self.derivatives(phi, 3))

    def deflection_and_state(self, torque: FloatArray) -> tuple[FloatArray, SpringState]:
        """Deflection under a torque and the state there; for laws whose iteration finds both."""
        phi = self.deflection(torque)
        return phi, self.state(phi)

    def energy_and_state(self, phi: FloatArray) -> tuple[FloatArray, SpringState]:
        """Energy and state at deflections; for laws in which they share work."""
        return self.energy(phi), self.state(phi)

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
    def energy(self, phi: FloatArray) -> FloatArray:
        """Elastic energy stored from zero deflection on, J."""

    @abstractmethod
    def deflection(self, torque: FloatArray) -> FloatArray:
        """Deflection phi with tau(phi) = torque: the inverse of `torque`."""


def state_of(law: SpringLaw, phi: FloatArray) -> SpringState:
    """State of a spring, which code that must be short has once."""
    return SpringState(*subroutine(law.state, (phi,)))
