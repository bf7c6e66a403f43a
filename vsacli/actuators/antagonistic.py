"""Two motors, each behind a nonlinear spring: (14) solved, then (61)-(72) with the decoupling matrix A.

`transmit` is the path of a run: `solve` (14), `deflections_within_reach` (61), then `_moved` (62)-(72).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from vsacli.actuators.actuator import Actuator, Carried, PlaceholderConstants, SpringLoad
from vsacli.actuators.elasticity import Elasticity
from vsacli.actuators.laws import LAWS, SpringLaw
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.motor import JointMotor, Motor
from vsacli.actuators.pairs.joints import beta, determinant, solve_decoupling
from vsacli.actuators.pairs.pair_on_branch import BRANCHES, PairOnBranch
from vsacli.actuators.reach import OfJoint, Reach, deflections_within_reach
from vsacli.actuators.spring_elements import SpringElement
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import OneOf, Pair, Record, choice, value
from vsacli.documents.source import Source


@dataclass(frozen=True)
class Antagonistic(Actuator):
    """Two motors, each pulling the link through a nonlinear spring of its own."""

    motor: tuple[Motor, Motor] = value(Pair(Record(Motor)), "motors 1 and 2; one mapping applies to both")
    spring: tuple[SpringLaw, SpringLaw] = value(
        Pair(OneOf(LAWS)), "springs 1 and 2; one mapping applies to both"
    )
    coupling: SpringLaw | None = value(
        OneOf(LAWS),
        "spring between the motors, over theta_1 - theta_2; it exerts no torque on the link",
        default=None,
    )
    branch: str = choice(
        BRANCHES,
        "branch of the deflections: positive has phi_1 up and phi_2 down",
        default="positive",
    )

    motor_count = 2
    commanded = ("stiffness",)
    integrable = True

    def _problems(self) -> Iterator[FieldProblem]:
        yield from (*self.pair.problems(), *self._coupling_problems())

    def _coupling_problems(self) -> Iterator[FieldProblem]:
        """Yield a problem if the law or the limit of the coupling bounds its deflection."""
        if self.coupling is None:
            return
        # theta_1 - theta_2 is no result variable, so a limit on it could not be flagged.
        if self.coupling.domain != (-math.inf, math.inf):
            low, high = self.coupling.domain
            ends = f"holds from {low:.4g} to {high:.4g} only, but the motors may be any distance apart"
            yield FieldProblem(("coupling",), f"{ends}; take a law without an end, as polynomial or sinh")
        elif math.isfinite(self.coupling.max_deflection):
            reason = "is not known of a spring between motors; bound the springs of both sides"
            yield FieldProblem(("coupling", "max_deflection"), reason)

    @cached_property
    def pair(self) -> PairOnBranch:
        """Both springs, on the chosen branch."""
        return PairOnBranch(self.spring, self.branch)

    @property
    def laws(self) -> tuple[SpringLaw, SpringLaw]:
        """The springs as they act on sides 1 and 2."""
        return self.pair.laws

    @classmethod
    def example(cls, joint_type: str, mechanism: str | None = None) -> dict[str, Any]:
        """Return equal motors and springs on both sides, by default cubic springs."""
        law = mechanism or "cubic"
        spring = {"type": law, **LAWS[law].examples[joint_type]}
        return {"motor": Motor.example(joint_type), "spring": spring}

    @classmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        """Return two equal motors and cubic springs; the constants of a single motor do not apply."""
        from vsacli.actuators.laws.cubic import Cubic

        k, k_c = constants.spring
        motor, spring = Motor(inertia=constants.motor_inertia), Cubic(k=k, k_c=k_c)
        return cls(motor=(motor, motor), spring=(spring, spring))

    @property
    def motors(self) -> tuple[JointMotor, ...]:
        """Motors 1 and 2."""
        return tuple(motor.at_joint for motor in self.motor)

    @property
    def max_deflections(self) -> tuple[float, ...]:
        """Largest deflections of the springs."""
        return tuple(spring.max_deflection for spring in self.spring)

    @property
    def phi_ranges(self) -> tuple[tuple[float, float], ...]:
        """Domains of the springs."""
        return tuple(law.domain for law in self.laws)

    @property
    def co_contracts(self) -> bool:
        """See `Actuator.co_contracts`; False with a spring between the motors, which loads both of them."""
        return self.coupling is None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the springs, without repetition if one law serves both sides."""
        return tuple(warning for law in self._distinct_springs for warning in law.warnings)

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files that the springs were read from."""
        return tuple(source for law in self._distinct_springs for source in law.sources)

    @property
    def spring_elements(self) -> tuple[SpringElement, ...]:
        """The springs of both sides, and the coupling."""
        one, two = self.laws
        sides = (SpringElement(one, -1.0, (1.0, 0.0)), SpringElement(two, -1.0, (0.0, 1.0)))
        return sides if self.coupling is None else (*sides, SpringElement(self.coupling, 0.0, (1.0, -1.0)))

    @property
    def _distinct_springs(self) -> tuple[SpringLaw, ...]:
        return (*self.pair.distinct, *(() if self.coupling is None else (self.coupling,)))

    def transmit(self, command: Command, min_margin: float, integrated: FloatArray | None) -> OfJoint:
        """Compute deflections on the actuator's branch, their rates, and motor accelerations.

        See `Actuator.transmit`.
        """
        solution = self.solve(command.tau_e, command.commanded["stiffness"], command.q)
        stiffness = command.commanded["stiffness"]
        phi, reached = deflections_within_reach(stiffness, solution, min_margin, integrated)
        moved = self._moved(command, solution, reached, phi)
        if self.coupling is None:
            return moved
        return {
            **moved,
            "tau_transmission": moved["tau_transmission"] + _between(self.coupling, phi),
            "elastic_energy": moved["elastic_energy"] + self.coupling.energy(phi[0] - phi[1]),
        }

    def _moved(self, command: Command, solution: PairSolution, reached: Reach, phi: FloatArray) -> OfJoint:
        """Compute the motion of both motors and the torques of both springs at given deflections, (62)-(72).

        NaN at infeasible samples; rates and accelerations, which need A^-1, also at singular ones.
        """
        (energy_1, one), (energy_2, two) = (
            law.energy_and_state(side) for law, side in zip(self.laws, phi, strict=True)
        )
        det_a = determinant(one, two)  # (67)
        divisor = np.where(reached.singular, np.nan, det_a)
        dphi = solve_decoupling(one, two, divisor, command.dtau_e, command.commanded["dstiffness"])  # (68)
        # dphi and ddtheta solve the same system A x = b, (19) and (23).
        right = beta(one, two, dphi, command.ddtau_e, command.commanded["ddstiffness"], command.ddq)
        ddtheta = solve_decoupling(one, two, divisor, *right)  # (72)
        return {
            "stiffness": command.commanded["stiffness"],
            "dstiffness": command.commanded["dstiffness"],
            "ddstiffness": command.commanded["ddstiffness"],
            "phi": phi,
            "dphi": np.stack(dphi),
            "ddtheta": np.stack(ddtheta),
            "tau_transmission": np.stack((one.tau, two.tau)),
            "elastic_energy": energy_1 + energy_2,
            "det_A": det_a,
            "stiffness_min": solution.lower,
            "stiffness_max": solution.upper,
            "flags": reached.flags,
        }

    def spring_rates(self, of_joint: OfJoint) -> FloatArray:
        """Return sigma_k phi_k' of each side, with the rate +-U_3'' (phi_1' - phi_2') of a coupling."""
        sides = zip(self.laws, of_joint["phi"], of_joint["dphi"], strict=True)
        rates = np.stack([law.stiffness(phi) * dphi for law, phi, dphi in sides])
        if self.coupling is None:
            return rates
        apart, drifting = (of_joint[name][0] - of_joint[name][1] for name in ("phi", "dphi"))
        rate: FloatArray = self.coupling.stiffness(apart) * drifting
        return rates + np.stack((rate, -rate))

    def spring_loads(self, of_joint: OfJoint) -> tuple[SpringLoad, ...]:
        """Return the load of each spring, including a coupling."""
        phi = of_joint["phi"]
        sides = enumerate(zip(self.laws, phi, self.max_deflections, strict=True), 1)
        springs = [(f"spring {side}", *spring) for side, spring in sides]
        if self.coupling is not None:
            springs.append(("coupling", self.coupling, phi[0] - phi[1], math.inf))
        return tuple(
            SpringLoad(name, deflection, law.torque(deflection), law.energy(deflection), bound)
            for name, law, deflection, bound in springs
        )

    def carried(self, of_joint: OfJoint) -> Carried:
        """Return the sums over both springs, the right-hand sides of (14)."""
        sides = list(zip(self.laws, of_joint["phi"], strict=True))
        tau = np.stack([law.torque(deflection) for law, deflection in sides])
        sigma = np.stack([law.stiffness(deflection) for law, deflection in sides])
        against = tau if self.coupling is None else tau + _between(self.coupling, of_joint["phi"])
        stiffness = sigma.sum(axis=0)
        return Carried(tau.sum(axis=0), np.abs(tau).sum(axis=0), stiffness, stiffness, against)

    @property
    def spring_group(self) -> Hashable:
        """Key of joints that are computed together: those with equal couplings."""
        return type(self), self.coupling

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """Return the springs of several joints with equal couplings, as one object."""
        from vsacli.actuators.pairs.joints import CoupledPairs, PairElasticity

        pairs, coupling = [actuator.laws for actuator in actuators], actuators[0].coupling
        return PairElasticity(pairs) if coupling is None else CoupledPairs(pairs, coupling)

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, _q: FloatArray) -> PairSolution:
        """Solve (14) for the deflections (61) on the actuator's branch."""
        return self.pair.solve(tau_e, stiffness)

    @property
    def opposite_branch(self) -> str | None:
        """The other value of `branch`; None if the springs are tendons, which only pull."""
        return self.pair.opposite

    def other_branch(self, tau_e: FloatArray, stiffness: FloatArray, _q: FloatArray) -> BoolArray:
        """See `Actuator.other_branch`."""
        return self.pair.opposite_reaches(tau_e, stiffness)

    def deflection_rates(self, phi: FloatArray, command: Command) -> FloatArray:
        """Return A^-1 (tau_e', sigma'), (19)-(20)."""
        one, two = self.pair.states(*phi)
        right = command.dtau_e, command.commanded["dstiffness"]
        return np.stack(solve_decoupling(one, two, determinant(one, two), *right))

    def determinant(self, phi: FloatArray, _q: FloatArray) -> FloatArray:
        """Return det A (67)."""
        return determinant(*self.pair.states(*phi))


def _between(coupling: SpringLaw, phi: FloatArray) -> FloatArray:
    """Return the torque of a spring between the motors on each of them, (2, samples)."""
    torque = coupling.torque(phi[0] - phi[1])
    return np.stack((torque, -torque))
