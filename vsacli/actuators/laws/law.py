"""Spring laws: torque over deflection, three derivatives, energy, the inverse; pairs and rows of springs.

A `SpringState` is a spring at a deflection. A `Pair` says what solving (14) means for two springs on
one link, whatever the laws are. Springs of several joints that obey one law are evaluated at a time.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.units import POSITION
from vsacli.compute.control_flow import subroutine
from vsacli.documents.fields import POSITIVE_OR_INFINITE, check_fields, number
from vsacli.documents.source import Source


class SpringState(NamedTuple):
    """Torque, stiffness, slope and curvature of springs, (62)-(64), (66); arrays of one shape.

    Attributes:
        tau: torque, N m (N).
        sigma: stiffness, the first derivative of the torque over the deflection.
        zeta: slope of the stiffness, the second derivative.
        eta: curvature of the stiffness, the third derivative.
    """

    tau: FloatArray
    sigma: FloatArray
    zeta: FloatArray
    eta: FloatArray

    def take(self, members: IndexArray) -> SpringState:
        """Return the state of some of the springs, which are on the last axis."""
        return SpringState(*(values[..., members] for values in self))

    def after(self, step: FloatArray) -> SpringState:
        """Return the state after a short step of the deflection, by Taylor's formula."""
        return SpringState(
            self.tau + step * self.sigma + self.linearization_error(step),
            self.sigma + step * (self.zeta + step / 2 * self.eta),
            self.zeta + step * self.eta,
            self.eta,
        )

    def linearization_error(self, step: FloatArray) -> FloatArray:
        """Torque after a short step less what its tangent gives, to the third order of the step."""
        return step * step / 2 * (self.zeta + step / 3 * self.eta)


class PairSolution(NamedTuple):
    """Reachable stiffness on the branch, and the deflections for the demanded one; arrays (samples,).

    Attributes:
        lower: smallest reachable stiffness, N m/rad (N/m); NaN where the torque cannot be carried at all.
        upper: largest reachable stiffness; +inf where nothing bounds it.
        lower_critical: whether `lower` is a critical point, where A is singular (else the end of a domain).
        upper_critical: the same for `upper`.
        slack_below: whether a side that only pulls goes slack below `lower`.
        phi_1: deflection of side 1 for the stiffness clipped into [lower, upper], rad (m).
        phi_2: deflection of side 2.
    """

    lower: FloatArray
    upper: FloatArray
    lower_critical: BoolArray
    upper_critical: BoolArray
    slack_below: BoolArray
    phi_1: FloatArray
    phi_2: FloatArray

    @classmethod
    def unbounded(
        cls, lower: FloatArray, phi_1: FloatArray, phi_2: FloatArray, *, lower_critical: bool
    ) -> PairSolution:
        """Return a solution without upper end.

        The lower end is a critical point, or where a tendon goes slack.
        """
        return cls(
            lower=lower,
            upper=np.full_like(lower, np.inf),
            lower_critical=np.full_like(lower, lower_critical, dtype=bool),
            upper_critical=np.zeros_like(lower, dtype=bool),
            slack_below=np.full_like(lower, not lower_critical, dtype=bool),
            phi_1=phi_1,
            phi_2=phi_2,
        )

    @property
    def deflections(self) -> FloatArray:
        """phi_1 and phi_2, (2, samples)."""
        return np.stack((self.phi_1, self.phi_2))

    def exchanged(self) -> PairSolution:
        """Return the same with the two sides exchanged."""
        return self._replace(phi_1=self.phi_2, phi_2=self.phi_1)


class Pair(ABC):
    """Two springs on the branch of the largest preload: phi_1 up, phi_2 down.

    Along a given tau_e the joint stiffness G is a function of the preload; its critical points are the
    singularities of the decoupling matrix, its monotone pieces the branches of solutions. The branch used is
    the piece that reaches the largest preload; it needs no memory of the previous step.
    """

    @abstractmethod
    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample.

        Args:
            tau_e: elastic torque, (samples,), N m (N).
            stiffness: demanded joint stiffness, (samples,), N m/rad (N/m).
        """


def tendon_solution(lower: FloatArray, phi_1: FloatArray, phi_2: FloatArray) -> PairSolution:
    """Solution of two tendons, which is singular nowhere.

    Deflections that rounding has made those of a tendon that pushes are zero.
    """
    return PairSolution.unbounded(lower, np.maximum(phi_1, 0), np.minimum(phi_2, 0), lower_critical=False)


def same_number(number: float, other: float) -> bool:
    """Return whether two numbers of springs are one, also where it is a symbol, known when a program runs."""
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
        """Sentences on the distance of the law from the spring it describes."""
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
        """Coefficients of phi, phi^2, ... if the torque is a polynomial on the domain, else None."""
        return None

    def as_second(self) -> SpringLaw:
        """Return the law as it acts on side 2, where a tendon pulls the other way."""
        return self

    def closed_pair(self, other: SpringLaw) -> Pair | None:  # noqa: ARG002
        """Return the pair of this law (side 1) with another (side 2) if (14) has a closed solution."""
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


class SpringRows:
    """Equally many springs at each joint; deflections and their functions are (..., joints, springs)."""

    def __init__(self, laws: Sequence[Sequence[SpringLaw]]) -> None:
        self._alike = list(_alike([law for of_joint in laws for law in of_joint]))

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque of each spring."""
        return self._each(phi, lambda law, part: (law.torque(part),))[0]

    def energy(self, phi: FloatArray) -> FloatArray:
        """Energy of each spring."""
        return self._each(phi, lambda law, part: (law.energy(part),))[0]

    def state(self, phi: FloatArray) -> SpringState:
        """State of each spring."""
        return SpringState(*self._each(phi, lambda law, part: law.state(part)))

    def _each(
        self, phi: FloatArray, values: Callable[[SpringLaw, FloatArray], Sequence[FloatArray]]
    ) -> Sequence[FloatArray]:
        """Return the values of both springs' laws at their deflections."""
        if len(self._alike) == 1:
            return values(self._alike[0][0], phi)
        flat = phi.reshape(*phi.shape[:-2], -1)
        parts = [(members, values(law, flat[..., members])) for law, members in self._alike]
        merged = [np.empty_like(flat) for _ in parts[0][1]]
        for members, of_law in parts:
            for whole, part in zip(merged, of_law, strict=True):
                whole[..., members] = part
        return [whole.reshape(*phi.shape) for whole in merged]


def _alike(laws: list[SpringLaw]) -> Iterator[tuple[SpringLaw, list[int]]]:
    """Yield each distinct law, with the springs that obey it."""
    distinct: list[SpringLaw] = []
    for law in laws:
        if law not in distinct:
            distinct.append(law)
            yield law, [index for index, other in enumerate(laws) if other == law]
