"""Mechanisms in which motor 2 preloads the spring of a cam, such as MACCEPA: U = k/2 (l(phi) + p)^2."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.mechanisms.mechanism import Mechanism, Partials
from vsacli.actuators.mechanisms.preloaded_cams.branch import map_branch
from vsacli.actuators.mechanisms.preloaded_cams.lift import Lift
from vsacli.actuators.mechanisms.preloaded_cams.solver import CamSolver
from vsacli.actuators.spring_elements import LeverSpring
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import NON_ZERO, POSITIVE, interval, number


@dataclass(frozen=True)
class PreloadedCam(Mechanism):
    """A spring behind a cam whose lift l has one minimum, at rest.

    The branch is the one that extends to the largest pretension. On others the stiffness rises while the
    pretension falls; all of them shrink to a point as the torque goes to zero.
    """

    k: float = number(units.LINEAR_STIFFNESS, "stiffness of the spring", check=POSITIVE)
    r: float = number(units.LEAD, "pretension of the spring per theta_2, p = r theta_2", check=NON_ZERO)
    pretension: tuple[float, float] = interval(
        units.LENGTH, "smallest and largest compression of the spring at rest, zero or above"
    )

    def _problems(self) -> list[FieldProblem]:
        low, high = self.pretension
        if 0 <= low < high < math.inf:
            return []
        return [FieldProblem(("pretension",), "must have two ends, the smaller one first, zero or above")]

    @property
    def rest(self) -> float:
        """Deflection at which the lift has its minimum."""
        return 0.0

    @property
    @abstractmethod
    def deflection_range(self) -> tuple[float, float]:
        """Range of deflections in which the cam has a lift."""

    @abstractmethod
    def lift(self, from_rest: FloatArray) -> Lift:
        """Return the lift from its minimum over the deflection from there."""

    @property
    def setting_range(self) -> tuple[float, float]:
        """theta_2 at the ends of the pretension."""
        low, high = sorted(pretension / self.r for pretension in self.pretension)
        return low, high

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:  # noqa: ARG002
        """See `Mechanism.solve`; on the branch of the largest pretension."""
        solution = _solver(self).solve(tau_e, stiffness)
        return solution._replace(phi_1=self.rest + solution.phi_1, phi_2=solution.phi_2 / self.r)

    def partials(self, phi: FloatArray, s: FloatArray) -> Partials:
        """Return the derivatives of k/2 (l + r s)^2."""
        k, r, lift = self.k, self.r, self.lift(phi - self.rest)
        compression = lift.l + r * s
        spring = lift.spring(k, r * s)
        return Partials(
            energy=k / 2 * compression * compression,
            setting_torque=k * r * compression,
            setting_stiffness=np.full_like(phi, k * r * r),
            T=spring.tau,
            T_p=spring.sigma,
            T_s=k * r * lift.l1,
            T_pp=spring.zeta,
            T_ps=k * r * lift.l2,
            T_ss=np.zeros_like(phi),
            T_ppp=spring.eta,
            T_pps=k * r * lift.l3,
            T_pss=np.zeros_like(phi),
        )


@lru_cache(maxsize=1024)
def _solver(cam: PreloadedCam) -> CamSolver:
    """Return the solver of a cam; equal cams share one, with the map of the branch.

    Otherwise the run of the bundled MACCEPA takes 3 times as long.
    """
    low, high = cam.deflection_range
    domain = low - cam.rest, high - cam.rest
    branch = map_branch(cam.lift, domain, cam.k, cam.pretension)
    return CamSolver(cam.lift, domain, cam.k, cam.pretension, branch)


@dataclass(frozen=True)
class Maccepa(PreloadedCam):
    """A spring from a lever b to a point at c: U = k/2 (a - |c - b| + p)^2, a^2 = b^2 + c^2 - 2 b c cos(phi).

    Van Ham, Vanderborght, Van Damme, Verrelst & Lefeber, Robotics and Autonomous Systems 55 (2007).
    """

    b: float = number(units.LENGTH, "length of the lever that motor 1 turns", check=POSITIVE)
    c: float = number(units.LENGTH, "distance from the axis to the point of the link", check=POSITIVE)

    joint_types = ("revolute",)

    def _problems(self) -> list[FieldProblem]:
        problems = super()._problems()
        if self.b == self.c:
            problems.append(FieldProblem(("c",), "must differ from b: equal levers have a kink at rest"))
        return problems

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:  # noqa: ARG003
        """Return levers of a hand's size, with the stiffness of an arm's joint."""
        return {"b": 0.04, "c": 0.12, "k": 40000, "r": 0.01, "pretension": [0.01, 0.05]}

    @property
    def deflection_range(self) -> tuple[float, float]:
        """Half a turn either way."""
        return (-math.pi, math.pi)

    @property
    def lever_spring(self) -> LeverSpring:
        """The spring."""
        return LeverSpring(self.b, self.c, self.k, self.r)

    def lift(self, from_rest: FloatArray) -> Lift:
        """Return the growth of the distance a; by half angles, so that nothing cancels at rest."""
        shortest, area = abs(self.c - self.b), self.b * self.c
        half_sine = np.sin(from_rest / 2)
        doubled = 2 * area * half_sine * half_sine
        growth = 2 * doubled  # a^2 - (c - b)^2
        a = np.sqrt(shortest * shortest + growth)
        sine, cosine = 2 * area * half_sine * np.cos(from_rest / 2), area - doubled
        l1 = sine / a
        l2 = (cosine - l1 * l1) / a
        l3 = -(sine + 3 * l1 * l2) / a
        l4 = -(cosine + 4 * l1 * l3 + 3 * l2 * l2) / a
        return Lift(growth / (a + shortest), l1, l2, l3, l4)
