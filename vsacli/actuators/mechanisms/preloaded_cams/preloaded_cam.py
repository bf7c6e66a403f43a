"""Mechanisms whose motor 2 preloads the spring of a cam: U = k/2 (l(phi) + p)^2 with p = r theta_2."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vsacli.actuators.laws.pair import PairSolution
from vsacli.actuators.mechanisms.mechanism import Mechanism
from vsacli.actuators.mechanisms.preloaded_cams.branch_map import map_branch
from vsacli.actuators.mechanisms.preloaded_cams.lift import Lift
from vsacli.actuators.mechanisms.preloaded_cams.solver import CamSolver
from vsacli.actuators.mechanisms.state import Partials
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import NON_ZERO, POSITIVE, check_fields, interval, number


@dataclass(frozen=True)
class PreloadedCam(Mechanism):
    """A spring behind a cam whose lift l has one minimum, at rest.

    The branch is the one that reaches the largest pretension. On any other the stiffness rises while the
    pretension falls; all of them shrink to nothing as the torque goes to zero.
    """

    k: float = number(units.LINEAR_STIFFNESS, "stiffness of the spring", check=POSITIVE)
    r: float = number(units.LEAD, "pretension of the spring per theta_2, p = r theta_2", check=NON_ZERO)
    pretension: tuple[float, float] = interval(
        units.LENGTH, "smallest and largest compression of the spring at rest, zero or above"
    )

    def __post_init__(self) -> None:
        check_fields(self, *self._pretension_problems())

    def _pretension_problems(self) -> list[FieldProblem]:
        low, high = self.pretension
        if 0 <= low < high < math.inf:
            return []
        return [FieldProblem(("pretension",), "must have two ends, the smaller one first, zero or above")]

    @property
    def rest(self) -> float:
        """The deflection at which the lift has its minimum."""
        return 0.0

    @property
    @abstractmethod
    def deflection_range(self) -> tuple[float, float]:
        """The deflections for which the cam has a lift."""

    @abstractmethod
    def lift(self, from_rest: FloatArray) -> Lift:
        """The lift from its minimum over the deflection from there."""

    @property
    def setting_range(self) -> tuple[float, float]:
        """theta_2 at the ends of the pretension."""
        low, high = sorted(pretension / self.r for pretension in self.pretension)
        return low, high

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:  # noqa: ARG002
        """On the branch of the largest pretension; see `Mechanism.solve`."""
        found = _solver(self).solve(tau_e, stiffness)
        return found._replace(phi_1=self.rest + found.phi_1, phi_2=found.phi_2 / self.r)

    def partials(self, phi: FloatArray, s: FloatArray) -> Partials:
        """Those of k/2 (l + r s)^2."""
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
    """What solves a cam; equal ones have the same, with the map of the branch that is made once."""
    low, high = cam.deflection_range
    domain = low - cam.rest, high - cam.rest
    branch = map_branch(cam.lift, domain, cam.k, cam.pretension)
    return CamSolver(cam.lift, domain, cam.k, cam.pretension, branch)
