"""Interface of spring laws, and the records and bases that all laws share.

`SpringLaw` has torque over deflection, three derivatives, energy and the inverse; `SpringState` is a spring
at a deflection. `Pair` and `PairSolution` define the solution of (14) for two springs on one link, whatever
their laws. `SpringRows` evaluates the springs of several joints, one evaluation per distinct law.
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from vsacli.actuators.elasticity import indices_of_equals
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.units import POSITION
from vsacli.compute.control_flow import subroutine
from vsacli.documents.fields import POSITIVE_OR_INFINITE, number
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.source import Source


class SpringState(NamedTuple):
    """Torque, stiffness, slope and curvature of springs, (62)-(64), (66); arrays of one shape.

    Attributes:
        tau: Torque, N m (N).
        sigma: Stiffness, the first derivative of the torque over the deflection.
        zeta: Slope of the stiffness, the second derivative.
        eta: Curvature of the stiffness, the third derivative.
    """

    tau: FloatArray
    sigma: FloatArray
    zeta: FloatArray
    eta: FloatArray

    def take(self, members: IndexArray) -> SpringState:
        """Return the state of a selection of the springs, which are on the last axis."""
        return SpringState(*(values[..., members] for values in self))

    def after(self, step: FloatArray) -> SpringState:
        """Return the state after a short step of the deflection, by Taylor expansion."""
        return SpringState(
            self.tau + step * self.sigma + self.linearization_error(step),
            self.sigma + step * (self.zeta + step / 2 * self.eta),
            self.zeta + step * self.eta,
            self.eta,
        )

    def linearization_error(self, step: FloatArray) -> FloatArray:
        """Return the torque after a short step minus its linear prediction, to third order."""
        return step * step / 2 * (self.zeta + step / 3 * self.eta)


class PairSolution(NamedTuple):
    """Attainable range of the stiffness on the branch, and deflections for the demanded one; (samples,).

    Attributes:
        lower: Minimum stiffness, N m/rad (N/m); NaN where the torque cannot be carried at all.
        upper: Maximum stiffness; +inf where nothing bounds it.
        lower_critical: Whether `lower` is a critical point, where A is singular (else the end of a domain).
        upper_critical: Whether `upper` is a critical point.
        slack_below: Whether a tendon goes slack below `lower`.
        phi_1: Deflection of side 1 for the stiffness clipped to [lower, upper], rad (m).
        phi_2: Deflection of side 2.
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
        """Return a solution without maximum stiffness.

        Its minimum is a critical point if `lower_critical`, else the stiffness at which a tendon goes slack.
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
        """Return the solution with sides 1 and 2 exchanged."""
        return self._replace(phi_1=self.phi_2, phi_2=self.phi_1)


class Pair(ABC):
    """Two springs on the branch of the largest preload: phi_1 up, phi_2 down.

    At a given tau_e the joint stiffness G is a function of the preload. Its critical points are the
    singularities of the decoupling matrix, its monotone pieces the branches of solutions. The branch used is
    the piece that extends to the largest preload, so that no sample depends on the previous one.
    """

    @abstractmethod
    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample.

        Args:
            tau_e: Elastic torque, (samples,), N m (N).
            stiffness: Demanded joint stiffness, (samples,), N m/rad (N/m).
        """


def tendon_solution(lower: FloatArray, phi_1: FloatArray, phi_2: FloatArray) -> PairSolution:
    """Return the solution of a pair of tendons, which is never singular.

    Deflections at which a tendon would push, by rounding, are set to zero.
    """
    return PairSolution.unbounded(lower, np.maximum(phi_1, 0), np.minimum(phi_2, 0), lower_critical=False)


def same_number(number: float, other: float) -> bool:
    """Return whether two parameters are equal; symbols of a traced program, if they are the same object."""
    return number is other or number == other


class SpringRecord(DeclaredRecord):
    """A record about springs, which may come from tables."""

    @property
    def parts(self) -> tuple[SpringRecord, ...]:
        """Records about springs of which this one consists, each once; none if it is about one spring."""
        return ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings to the user, as sentences, that the record deviates from the springs it describes."""
        return tuple(warning for part in self.parts for warning in part.warnings)

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files that the springs were read from."""
        return tuple(source for part in self.parts for source in part.sources)


@dataclass(frozen=True)
class SpringLaw(SpringRecord, ABC):
    """A torque tau(phi) of a transmission: zero at zero, strictly increasing, hardening away from zero.

    So sigma > 0 on the domain, and zeta has the sign of phi. The methods take and return arrays of any one
    shape; phi in rad (m), torque in N m (N).

    Attributes:
        examples: Plausible values of the fields for a new robot file, by type of joint; without those of a
            type, `vsacli new` does not offer the law there.
    """

    examples: ClassVar[Mapping[str, Mapping[str, Any]]] = {}

    max_deflection: float = number(
        POSITION,
        "largest admissible |deflection|; larger ones are flagged, but the law does not end there",
        check=POSITIVE_OR_INFINITE,
        default=math.inf,
    )

    @property
    def unlimited(self) -> Self:
        """The law without `max_deflection`, for the mathematics: laws of equal torques are equal there."""
        if isinstance(self.max_deflection, float) and math.isinf(self.max_deflection):
            return self
        law = copy.copy(self)
        object.__setattr__(law, "max_deflection", math.inf)
        return law

    @property
    def domain(self) -> tuple[float, float]:
        """Smallest and largest deflection for which the law holds."""
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
    def is_linear(self) -> bool:
        """Whether the stiffness is the same at every deflection."""
        return False

    @property
    def polynomial(self) -> tuple[float, ...] | None:
        """Coefficients of phi, phi^2, ... if the torque is a polynomial on the domain; None otherwise."""
        return None

    def as_second(self) -> SpringLaw:
        """Return the law as it acts on side 2, where a tendon pulls the other way."""
        return self

    def closed_pair(self, other: SpringLaw) -> Pair | None:  # noqa: ARG002
        """Return the pair of this law (side 1) and another if (14) has a closed solution, else None."""
        return None

    def hardening(self, phi: FloatArray) -> FloatArray:
        """Return the relative hardening rho = zeta/sigma."""
        return self.slope(phi) / self.stiffness(phi)

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Return torque and derivatives up to an order, at most 3; laws override it to share work."""
        methods = (self.torque, self.stiffness, self.slope, self.curvature)
        return tuple(method(phi) for method in methods[: order + 1])

    def state(self, phi: FloatArray) -> SpringState:
        """Return the state of the spring at deflections."""
        return SpringState(*self.derivatives(phi, 3))

    def deflection_and_state(self, torque: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return the deflection at a torque and the state there; laws that iterate for both override it."""
        phi = self.deflection(torque)
        return phi, self.state(phi)

    def energy_and_state(self, phi: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return energy and state at deflections; laws override it to share work."""
        return self.energy(phi), self.state(phi)

    @abstractmethod
    def torque(self, phi: FloatArray) -> FloatArray:
        """Return the torque tau(phi), (62)."""

    @abstractmethod
    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Return the stiffness sigma = dtau/dphi, (63)."""

    @abstractmethod
    def slope(self, phi: FloatArray) -> FloatArray:
        """Return the slope of the stiffness zeta = dsigma/dphi, (64)."""

    @abstractmethod
    def curvature(self, phi: FloatArray) -> FloatArray:
        """Return the curvature of the stiffness eta = dzeta/dphi, (66)."""

    @abstractmethod
    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the elastic energy, J, zero at zero deflection."""

    @abstractmethod
    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the deflection phi with tau(phi) = torque, the inverse of `torque`."""


@dataclass(frozen=True)
class LawByDerivatives(SpringLaw):
    """A law whose torque, stiffness, slope and curvature share work, and are stated together."""

    @abstractmethod
    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """See `SpringLaw.derivatives`."""

    def torque(self, phi: FloatArray) -> FloatArray:
        """See `SpringLaw.torque`."""
        return self.derivatives(phi, 0)[0]

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """See `SpringLaw.stiffness`."""
        return self.derivatives(phi, 1)[1]

    def slope(self, phi: FloatArray) -> FloatArray:
        """See `SpringLaw.slope`."""
        return self.derivatives(phi, 2)[2]

    def curvature(self, phi: FloatArray) -> FloatArray:
        """See `SpringLaw.curvature`."""
        return self.derivatives(phi, 3)[3]


def spring_state(law: SpringLaw, phi: FloatArray) -> SpringState:
    """Return the state of a spring, as a subroutine of compiled code."""
    return SpringState(*subroutine(law.state, (phi,)))


class SpringRows:
    """Springs of several joints, the same number at each; deflections and results (..., joints, springs)."""

    def __init__(self, laws: Sequence[Sequence[SpringLaw]]) -> None:
        self._distinct_laws = list(indices_of_equals([law for joint_laws in laws for law in joint_laws]))

    def torque(self, phi: FloatArray) -> FloatArray:
        """Return the torque of each spring."""
        return self._evaluate_laws(phi, lambda law, phi_of_law: (law.torque(phi_of_law),))[0]

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy of each spring."""
        return self._evaluate_laws(phi, lambda law, phi_of_law: (law.energy(phi_of_law),))[0]

    def state(self, phi: FloatArray) -> SpringState:
        """Return the state of each spring."""
        return SpringState(*self._evaluate_laws(phi, lambda law, phi_of_law: law.state(phi_of_law)))

    def _evaluate_laws(
        self, phi: FloatArray, values: Callable[[SpringLaw, FloatArray], Sequence[FloatArray]]
    ) -> Sequence[FloatArray]:
        """Return arrays computed from each spring's law at its deflections; one call per distinct law."""
        if len(self._distinct_laws) == 1:
            return values(self._distinct_laws[0][0], phi)
        flat_phi = phi.reshape(*phi.shape[:-2], -1)
        members_and_results = [
            (members, values(law, flat_phi[..., members])) for law, members in self._distinct_laws
        ]
        results = [np.empty_like(flat_phi) for _ in members_and_results[0][1]]
        for members, law_results in members_and_results:
            for result, law_result in zip(results, law_results, strict=True):
                result[..., members] = law_result
        return [result.reshape(*phi.shape) for result in results]
