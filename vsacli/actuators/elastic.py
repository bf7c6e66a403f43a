"""One motor behind a spring of any law; with a linear one, EJ-NEA of Buondonno & De Luca (2015)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar, Self

import numpy as np

from vsacli.actuators.actuator import Actuator, PlaceholderConstants
from vsacli.actuators.elasticity import Components, Elasticity
from vsacli.actuators.laws import LAWS, SpringLaw
from vsacli.actuators.laws.law import PairSolution, SpringRows
from vsacli.actuators.motor import Motor
from vsacli.actuators.reach import LimitCheck, Reach
from vsacli.actuators.single_springs import LinearRows, SingleSpring, SingleSprings
from vsacli.actuators.spring_elements import SpringElement
from vsacli.actuators.transmission import Command, JointVariables, single_motor
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.flags import Flag, has_flag
from vsacli.documents.fields import POSITIVE, OneOf, RecordOf, number, value
from vsacli.documents.record_checks import construct_unchecked

EXAMPLE_STIFFNESSES = {"revolute": 1000, "prismatic": 10000}


@dataclass(frozen=True)
class Elastic(Actuator):
    """One motor that moves the link through a spring: a linear one, or one of any law."""

    motor: Motor = value(RecordOf(Motor), "motor")
    stiffness: float | None = number(
        units.STIFFNESS, "stiffness of a linear spring; either this or `spring`", check=POSITIVE, default=None
    )
    spring: SpringLaw | None = value(
        OneOf(LAWS), "spring of any law; either this or `stiffness`", default=None
    )

    uncommanded: ClassVar[Mapping[str, str]] = {
        "stiffness": "its actuator is elastic, with the spring that the robot file says"
    }

    def _problems(self) -> Iterator[FieldProblem]:
        if self.stiffness is None and self.spring is None:
            yield FieldProblem((), "missing key 'stiffness' (of a linear spring) or 'spring' (of any law)")
        elif self.stiffness is not None and self.spring is not None:
            reason = "the law of `spring` says already how stiff it is; leave out one of both"
            yield FieldProblem(("stiffness",), reason)

    @cached_property
    def law(self) -> SpringLaw:
        """Law of the spring, without its limit."""
        if self.stiffness is None:
            assert self.spring is not None, "see __post_init__"
            return self.spring.unlimited
        from vsacli.actuators.laws.polynomial import Polynomial

        return construct_unchecked(Polynomial, {"c1": self.stiffness})

    @classmethod
    def example(cls, joint_type: str, mechanism: str | None = None) -> dict[str, Any]:
        """Return a motor and a spring: a linear one, or one of the law."""
        motor = Motor.example(joint_type)
        if mechanism is None:
            return {"motor": motor, "stiffness": EXAMPLE_STIFFNESSES[joint_type]}
        return {"motor": motor, "spring": {"type": mechanism, **LAWS[mechanism].examples[joint_type]}}

    @classmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        """Return one motor, which drives the joint alone, behind a linear spring."""
        return cls(motor=constants.only_motor, stiffness=constants.stiffness)

    @property
    def max_deflections(self) -> tuple[float, ...]:
        """Largest deflection of the spring; none for a linear one."""
        return (math.inf if self.spring is None else self.spring.max_deflection,)

    @property
    def phi_ranges(self) -> tuple[tuple[float, float], ...]:
        """Domain of the spring."""
        return (self.law.domain,)

    @property
    def parts(self) -> tuple[SpringLaw, ...]:
        """The law of the spring."""
        return (self.law,)

    @property
    def spring_elements(self) -> tuple[SpringElement, ...]:
        """The spring."""
        return (SpringElement(self.law, -1.0, (1.0,)),)

    @cached_property
    def limits(self) -> tuple[LimitCheck, ...]:
        """The limits of every actuator, and the torques that the spring can carry."""
        return *super().limits, self._torque_limit

    @property
    def _torque_limit(self) -> LimitCheck:
        endless = (-math.inf, math.inf)
        torques = endless if self.spring is None else self.spring.torque_range
        return LimitCheck(Flag.INFEASIBLE, "tau_e", None, torques)

    def transmit(
        self, command: Command, _min_margin: float, _prescribed: FloatArray | None
    ) -> JointVariables:
        """Compute the deflection at which the spring carries tau_e, and its derivatives.

        NaN where tau_e cannot be carried; derivatives, which require 1/sigma, also where sigma is zero.
        """
        infeasible = has_flag(self._torque_limit.flags(command.arrays()), Flag.INFEASIBLE)
        solution = self.solve(command.tau_e, np.full_like(command.tau_e, np.nan), command.q)
        phi = np.where(infeasible, np.nan, solution.phi_1)
        spring = self.springs((phi,), command.q)
        rates = spring.rates(command.dtau_e, command.q, command.dq)
        still = np.zeros_like(command.q)
        (ddphi,) = spring.motor_accelerations(rates, still, command.ddtau_e, still)
        reach = Reach(
            infeasible=infeasible,
            slack=infeasible & self.law.pulls_only & (command.tau_e < 0),
            singular=spring.stiffness == 0,
            near_singular=np.zeros_like(phi, dtype=bool),
        )
        return single_motor(
            command,
            stiffness=spring.stiffness,
            dstiffness=spring.stiffness_rate(rates),
            ddstiffness=spring.stiffness_curvature(rates) + spring.stiffness_rate((ddphi,)),
            phi=phi,
            dphi=rates[0],
            theta=phi + command.q,
            dtheta=rates[0] + command.dq,
            ddtheta=ddphi + command.ddq,
            tau_transmission=spring.tau_transmission[0],
            elastic_energy=spring.energy,
            flags=reach.flags,
        )

    def springs(self, unknowns: Components, _q: FloatArray) -> SingleSpring:
        """Return the spring at its deflection."""
        return SingleSpring(self.law.state(unknowns[0]), partial(self.law.energy, unknowns[0]))

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, _q: FloatArray) -> PairSolution:
        """Return the deflection at which the spring carries the torque; the stiffness cannot be chosen."""
        nowhere = np.zeros_like(tau_e, dtype=bool)
        deflection = self.law.deflection(tau_e)
        return PairSolution(stiffness, stiffness, nowhere, nowhere, nowhere, deflection, stiffness)

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """Return the springs of several joints."""
        linear_stiffnesses = [actuator.stiffness for actuator in actuators if actuator.stiffness is not None]
        if len(linear_stiffnesses) == len(actuators):
            return SingleSprings(LinearRows(linear_stiffnesses))
        return SingleSprings(SpringRows([(actuator.law,) for actuator in actuators]))
