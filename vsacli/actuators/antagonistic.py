"""Two motors, each behind a nonlinear spring.

`solve` finds the deflections (14), `springs` is the state of the springs there; `VariableStiffness.transmit`
calls both for a run.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Self

from vsacli.actuators.actuator import PlaceholderConstants
from vsacli.actuators.elasticity import Components, Elasticity
from vsacli.actuators.laws import LAWS, SpringLaw
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.motor import Motor
from vsacli.actuators.pairs.pair_on_branch import BRANCHES, PairOnBranch
from vsacli.actuators.pairs.pair_springs import PairElasticity, PairSprings
from vsacli.actuators.spring_elements import SpringElement
from vsacli.actuators.variable_stiffness import VariableStiffness
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import OneOf, PairOf, RecordOf, choice, value


@dataclass(frozen=True)
class Antagonistic(VariableStiffness):
    """Two motors, each pulling the link through a nonlinear spring of its own."""

    motor: tuple[Motor, Motor] = value(PairOf(RecordOf(Motor)), "motors 1 and 2; one mapping applies to both")
    spring: tuple[SpringLaw, SpringLaw] = value(
        PairOf(OneOf(LAWS)), "springs 1 and 2; one mapping applies to both"
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

    def _problems(self) -> Iterator[FieldProblem]:
        yield from (*self.pair.problems(), *self._coupling_problems())

    def _coupling_problems(self) -> Iterator[FieldProblem]:
        """Yield a problem if the law or the limit of the coupling bounds its deflection."""
        if self.coupling is None:
            return
        # theta_1 - theta_2 is no result variable, so a limit on it could not be flagged.
        if self.coupling.domain != (-math.inf, math.inf):
            low, high = self.coupling.domain
            range_text = f"holds from {low:.4g} to {high:.4g} only, but the motors may be any distance apart"
            yield FieldProblem(
                ("coupling",), f"{range_text}; take a law without an end, as polynomial or sinh"
            )
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
    def parts(self) -> tuple[SpringLaw, ...]:
        """The laws of the springs, once if one law serves both sides."""
        return (*self.pair.distinct, *(() if self.coupling is None else (self.coupling,)))

    @property
    def spring_elements(self) -> tuple[SpringElement, ...]:
        """The springs of both sides, and the coupling."""
        law_1, law_2 = self.laws
        sides = (SpringElement(law_1, -1.0, (1.0, 0.0)), SpringElement(law_2, -1.0, (0.0, 1.0)))
        return sides if self.coupling is None else (*sides, SpringElement(self.coupling, 0.0, (1.0, -1.0)))

    def springs(self, unknowns: Components, _q: FloatArray) -> PairSprings:
        """Return both springs at their deflections, with the coupling at the difference."""
        spring_1, spring_2 = (law.state(phi) for law, phi in zip(self.laws, unknowns, strict=True))
        law, coupling_deflection = self.coupling, unknowns[0] - unknowns[1]
        coupling = None if law is None else partial(law.derivatives, coupling_deflection)
        return PairSprings(spring_1, spring_2, partial(self._total_energy, unknowns), coupling)

    def _total_energy(self, unknowns: Components) -> FloatArray:
        first, second = self.laws
        energy = first.energy(unknowns[0]) + second.energy(unknowns[1])
        return energy if self.coupling is None else energy + self.coupling.energy(unknowns[0] - unknowns[1])

    @property
    def spring_group(self) -> Hashable:
        """Key of joints that are computed together: those with equal couplings."""
        return type(self), self.coupling

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """Return the springs of several joints with equal couplings, as one object."""
        return PairElasticity([actuator.laws for actuator in actuators], actuators[0].coupling)

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
