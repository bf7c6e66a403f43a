"""Two motors behind nonlinear springs: (14), and (61)-(72) with the decoupling matrix."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.actuators.laws import LAWS, SpringLaw
from vsacli.actuators.laws.pair import PairSolution
from vsacli.actuators.motor import Motor
from vsacli.actuators.pairs import make_pair
from vsacli.actuators.pairs.decoupling_matrix import Sides, beta, determinant, solve
from vsacli.actuators.reach import Reach, reach
from vsacli.actuators.transmission import Command, Transmission
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import OneOf, Pair, Record, check_fields, choice, value


@dataclass(frozen=True)
class Antagonistic:
    """Two motors, each pulling the link through a nonlinear spring of its own."""

    motor: tuple[Motor, Motor] = value(Pair(Record(Motor)), "motors 1 and 2; one mapping serves both")
    spring: tuple[SpringLaw, SpringLaw] = value(Pair(OneOf(LAWS)), "springs 1 and 2; one mapping serves both")
    preload: str = choice(
        ("positive", "negative"),
        "branch of the deflections: positive has phi_1 up and phi_2 down",
        default="positive",
    )

    commanded: ClassVar[tuple[str, ...]] = ("stiffness",)
    """Signals that the actuator takes, by their keys in `COMMANDED`."""

    def __post_init__(self) -> None:
        problems = []
        if all(spring.is_linear for spring in self.spring):
            reason = (
                "both are linear: no motion of the motors changes the stiffness (A is singular everywhere)"
            )
            problems.append(FieldProblem(("spring",), reason))
        if self.preload == "negative" and any(spring.pulls_only for spring in self.spring):
            problems.append(
                FieldProblem(("preload",), "must be positive: a spring that only pulls cannot push")
            )
        check_fields(self, *problems)

    @cached_property
    def laws(self) -> tuple[SpringLaw, SpringLaw]:
        """The springs as they act on sides 1 and 2."""
        first, second = self.spring
        return first, second.as_second()


class Motors(NamedTuple):
    """What the motors of a joint do; arrays (samples,), or any other kind of number."""

    phi: Sides
    dphi: Sides
    ddtheta: Sides
    tau_spring: Sides
    elastic_energy: FloatArray
    det_A: FloatArray  # noqa: N815  (the published name)


def transmit(
    actuator: Antagonistic, command: Command, near_singular: float, followed: FloatArray | None
) -> Transmission:
    """Deflections on the actuator's branch, their rates, and motor accelerations; arguments as of `drive`."""
    solution = solve_deflections(actuator, command.tau_e, command.commanded["stiffness"])
    reached = reach(command.commanded["stiffness"], solution, near_singular)
    phi = (solution.phi_1, solution.phi_2)  # (61)
    if followed is not None:
        phi = (followed[0], followed[1])
        reached = reached._replace(infeasible=reached.infeasible | np.isnan(followed[0]))
    motors = motor_motion(actuator, command, reached, phi)
    return Transmission(
        stiffness=command.commanded["stiffness"],
        dstiffness=command.commanded["dstiffness"],
        ddstiffness=command.commanded["ddstiffness"],
        phi=np.stack(motors.phi),
        dphi=np.stack(motors.dphi),
        ddtheta=np.stack(motors.ddtheta),
        tau_spring=np.stack(motors.tau_spring),
        elastic_energy=motors.elastic_energy,
        det_A=motors.det_A,
        stiffness_lower=solution.lower,
        stiffness_upper=solution.upper,
        flags=reached.flags,
    )


def motor_motion(actuator: Antagonistic, command: Command, reached: Reach, deflections: Sides) -> Motors:
    """Motion of both motors and torques of both springs at given deflections, (62)-(72).

    NaN where the step is infeasible; what needs the inverse of A also where it is singular.
    """
    phi_1, phi_2 = (np.where(reached.infeasible, np.nan, phi) for phi in deflections)
    first, second = actuator.laws
    (energy_1, one), (energy_2, two) = first.energy_and_state(phi_1), second.energy_and_state(phi_2)
    det_a = determinant(one, two)  # (67)
    divisor = np.where(reached.singular, np.nan, det_a)
    dphi = solve(one, two, divisor, command.dtau_e, command.commanded["dstiffness"])  # (68)
    accelerating = beta(one, two, dphi, command.ddtau_e, command.commanded["ddstiffness"], command.ddq)
    return Motors(
        phi=(phi_1, phi_2),
        dphi=dphi,
        ddtheta=solve(one, two, divisor, *accelerating),  # (72)
        tau_spring=(one.tau, two.tau),
        elastic_energy=energy_1 + energy_2,
        det_A=det_a,
    )


def solve_deflections(actuator: Antagonistic, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
    """Solve (14) on the branch that the actuator's preload names."""
    first, second = actuator.laws
    if actuator.preload == "negative":
        return make_pair(second, first).solve(tau_e, stiffness).exchanged()
    return make_pair(first, second).solve(tau_e, stiffness)


def deflection_rates(
    actuator: Antagonistic, phi: FloatArray, dtau_e: FloatArray, dstiffness: FloatArray
) -> FloatArray:
    """Rates of the deflections phi, both (2, samples), by (19)-(20)."""
    one, two = (law.state(deflection) for law, deflection in zip(actuator.laws, phi, strict=True))
    return np.stack(solve(one, two, determinant(one, two), dtau_e, dstiffness))


def decoupling_determinant(actuator: Antagonistic, phi: FloatArray) -> FloatArray:
    """Determinant of A at deflections (2, samples), (67)."""
    one, two = (law.state(deflection) for law, deflection in zip(actuator.laws, phi, strict=True))
    return determinant(one, two)


def other_preload_would_do(actuator: Antagonistic, tau_e: FloatArray, stiffness: FloatArray) -> BoolArray:
    """Where the branch with the opposite preload reaches the stiffness."""
    if any(law.pulls_only for law in actuator.laws):
        return np.zeros(tau_e.shape, dtype=bool)
    opposite = replace(actuator, preload="negative" if actuator.preload == "positive" else "positive")
    return ~reach(stiffness, solve_deflections(opposite, tau_e, stiffness)).infeasible
