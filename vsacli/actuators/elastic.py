"""One motor behind a spring of any law; with a linear one, EJ-NEA of Buondonno & De Luca (2015)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from vsacli.actuators.actuator import Actuator, Carried, PlaceholderConstants
from vsacli.actuators.elasticity import Elasticity
from vsacli.actuators.laws import LAWS, SpringLaw
from vsacli.actuators.laws.law import PairSolution, SpringRows
from vsacli.actuators.motor import JointMotor, Motor
from vsacli.actuators.reach import LimitCheck, OfJoint, Reach
from vsacli.actuators.spring_elements import SpringElement
from vsacli.actuators.transmission import Command, single_motor
from vsacli.base import units
from vsacli.base.arrays import FLAG_TYPE, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.flags import Flag, has
from vsacli.documents.fields import POSITIVE, OneOf, Record, number, value
from vsacli.documents.source import Source

EXAMPLE_STIFFNESS = {"revolute": 1000, "prismatic": 10000}


@dataclass(frozen=True)
class Elastic(Actuator):
    """One motor that moves the link through a spring: a linear one, or one of any law."""

    motor: Motor = value(Record(Motor), "motor")
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
        """Law of the spring."""
        if self.stiffness is None:
            assert self.spring is not None, "see __post_init__"
            return self.spring
        from vsacli.actuators.laws.polynomial import Polynomial

        return Polynomial(c1=self.stiffness)

    @classmethod
    def example(cls, joint_type: str, mechanism: str | None = None) -> dict[str, Any]:
        """Return a motor and a spring: a linear one, or one of the law."""
        motor = Motor.example(joint_type)
        if mechanism is None:
            return {"motor": motor, "stiffness": EXAMPLE_STIFFNESS[joint_type]}
        return {"motor": motor, "spring": {"type": mechanism, **LAWS[mechanism].examples[joint_type]}}

    @classmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        """Return one motor, which drives the joint alone, behind a linear spring."""
        return cls(motor=constants.only_motor, stiffness=constants.stiffness)

    @property
    def motors(self) -> tuple[JointMotor, ...]:
        """The one motor."""
        return (self.motor.at_joint,)

    @property
    def max_deflections(self) -> tuple[float, ...]:
        """Largest deflection of the spring; none for a linear one."""
        return (math.inf if self.spring is None else self.spring.max_deflection,)

    @property
    def phi_ranges(self) -> tuple[tuple[float, float], ...]:
        """Domain of the spring."""
        return (self.law.domain,)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the spring."""
        return self.law.warnings

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files of the spring."""
        return self.law.sources

    @property
    def spring_elements(self) -> tuple[SpringElement, ...]:
        """The spring."""
        return (SpringElement(self.law, -1.0, (1.0,)),)

    def limits(self) -> Iterator[LimitCheck]:
        """Yield the limits of every actuator, and the torques that the spring can carry."""
        yield from super().limits()
        yield self._carriable

    @property
    def _carriable(self) -> LimitCheck:
        endless = (-math.inf, math.inf)
        torques = endless if self.spring is None else self.spring.torque_range
        return LimitCheck(Flag.INFEASIBLE, "tau_e", None, torques)

    def transmit(self, command: Command, _min_margin: float, _integrated: FloatArray | None) -> OfJoint:
        """Compute the deflection at which the spring carries tau_e, and its derivatives."""
        return self._nonlinear(command) if self.stiffness is None else self._linear(command, self.stiffness)

    def _linear(self, command: Command, stiffness: float) -> OfJoint:
        """Compute a linear spring: phi = tau_e/K, with constant stiffness."""
        phi, constant = command.tau_e / stiffness, np.zeros_like(command.q)
        return single_motor(
            stiffness=constant + stiffness,
            dstiffness=constant,
            ddstiffness=constant,
            phi=phi,
            dphi=command.dtau_e / stiffness,
            ddtheta=command.ddq + command.ddtau_e / stiffness,
            tau_transmission=command.tau_e,
            elastic_energy=phi * command.tau_e / 2,
            flags=np.zeros(command.q.shape, dtype=FLAG_TYPE),
        )

    def _nonlinear(self, command: Command) -> OfJoint:
        """Solve tau(phi) = tau_e, then tau_e' = sigma phi' and tau_e'' = zeta phi'^2 + sigma phi''.

        NaN where tau_e cannot be carried; derivatives, which require 1/sigma, also where sigma is zero.
        """
        law = self.law
        infeasible = has(self._carriable.flags(command.arrays()), Flag.INFEASIBLE)
        found = self.solve(command.tau_e, np.full_like(command.tau_e, np.nan), command.q)
        phi = np.where(infeasible, np.nan, found.phi_1)
        energy, spring = law.energy_and_state(phi)
        reached = Reach(
            infeasible=infeasible,
            slack=infeasible & law.pulls_only & (command.tau_e < 0),
            singular=spring.sigma == 0,
            near_singular=np.zeros_like(phi, dtype=bool),
        )
        divisor = np.where(reached.singular, np.nan, spring.sigma)
        dphi = command.dtau_e / divisor
        ddphi = (command.ddtau_e - spring.zeta * dphi * dphi) / divisor
        return single_motor(
            stiffness=spring.sigma,
            dstiffness=spring.zeta * dphi,
            ddstiffness=spring.eta * dphi * dphi + spring.zeta * ddphi,
            phi=phi,
            dphi=dphi,
            ddtheta=command.ddq + ddphi,
            tau_transmission=spring.tau,
            elastic_energy=energy,
            flags=reached.flags,
        )

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, _q: FloatArray) -> PairSolution:
        """Return the deflection at which the spring carries the torque; the stiffness cannot be chosen."""
        never = np.zeros_like(tau_e, dtype=bool)
        deflection = self.law.deflection(tau_e)
        return PairSolution(stiffness, stiffness, never, never, never, deflection, stiffness)

    def spring_rates(self, of_joint: OfJoint) -> FloatArray:
        """Return sigma phi'."""
        rates: FloatArray = self.law.stiffness(of_joint["phi"][:1]) * of_joint["dphi"][:1]
        return rates

    def carried(self, of_joint: OfJoint) -> Carried:
        """Return torque and stiffness by the law."""
        phi = of_joint["phi"][0]
        tau_e, stiffness = self.law.torque(phi), self.law.stiffness(phi)
        return Carried(tau_e, np.abs(tau_e), stiffness, stiffness, tau_e[None])

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """Return the springs of several joints."""
        from vsacli.actuators.single_springs import LinearRows, SingleSprings

        linear = [actuator.stiffness for actuator in actuators if actuator.stiffness is not None]
        if len(linear) == len(actuators):
            return SingleSprings(LinearRows(linear))
        return SingleSprings(SpringRows([(actuator.law,) for actuator in actuators]))
